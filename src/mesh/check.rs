//! Validation of meshes before use, and repair of reversed tetrahedra.
//!
//! Guarantees: after [`tetrahedra`] without a [`Severity::Error`], every index is in range, every coordinate finite,
//! every vertex used, every tetrahedron positive, no two are equal, a face has at most two tetrahedra, and these lie
//! on its two sides. Does not guarantee: that distant parts of the mesh do not intersect each other.

use super::connectivity::{self, CROWDED, Facets, TETRAHEDRON_FACETS};
use super::quality::scaled_jacobian;
use super::{TetrahedralMesh, TriangleMesh, area_vector, determinant, length, subtract};

/// What a problem means for a computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The mesh cannot be used.
    Error,
    /// The mesh can be used; the reader should know.
    Warning,
    /// Was a problem and is repaired.
    Repaired,
}

/// What [`Problem::first`] counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// The mesh as a whole; `first` is 0.
    Mesh,
    Vertex,
    Cell,
}

/// One kind of problem of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Kebab-case, such as `degenerate-cell`.
    pub kind: &'static str,
    pub severity: Severity,
    /// How many vertices or cells have it.
    pub count: usize,
    pub element: Element,
    /// Index of the first offender, from 0.
    pub first: usize,
    /// What is wrong, where, and the mend.
    pub message: String,
}

/// The problems found so far.
#[derive(Default)]
pub(super) struct Problems(pub(super) Vec<Problem>);

impl Problems {
    /// Adds a problem when `offenders` has any; `describe` gets their number and the first.
    pub(super) fn add(
        &mut self,
        kind: &'static str,
        severity: Severity,
        element: Element,
        offenders: impl Iterator<Item = usize>,
        describe: impl FnOnce(usize, usize) -> String,
    ) -> bool {
        let mut offenders = offenders.peekable();
        let Some(&first) = offenders.peek() else { return false };
        let count = offenders.count();
        self.0.push(Problem {
            kind,
            severity,
            count,
            element,
            first,
            message: describe(count, first),
        });
        true
    }
}

/// `"1 tetrahedron"`, `"3 tetrahedra"`.
pub(super) fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// Names of a kind of cell: singular, plural.
pub(super) type Names = (&'static str, &'static str);

/// The checks that need no connectivity, in an order in which each may rely on those before. Returns whether cells and
/// coordinates can be used further.
pub(super) fn elementary<const N: usize>(
    points: &[[f64; 3]],
    all: &[[u32; N]],
    (one, many): Names,
    problems: &mut Problems,
) -> bool {
    let (vertices, cells) = (points.len(), all.len());
    if cells == 0 {
        problems.add("empty", Severity::Error, Element::Mesh, std::iter::once(0), |_, _| {
            format!("the mesh has {vertices} vertices but no {many}; check that the file holds {many}")
        });
        return false;
    }
    if vertices >= CROWDED as usize || cells > u32::MAX as usize / N {
        problems.add(
            "too-large",
            Severity::Error,
            Element::Mesh,
            std::iter::once(0),
            |_, _| format!("the mesh has {vertices} vertices and {cells} {many}; use one of fewer than a billion"),
        );
        return false;
    }
    let infinite = (0..vertices).filter(|&vertex| !points[vertex].iter().all(|c| c.is_finite()));
    let infinite = problems.add(
        "not-finite",
        Severity::Error,
        Element::Vertex,
        infinite,
        |count, first| {
            format!(
                "{} a coordinate that is not finite, the first is vertex {first}; repair or remove them",
                counted(count, "vertex has", "vertices have")
            )
        },
    );
    let beyond = (0..cells).filter(|&cell| all[cell].iter().any(|&vertex| vertex as usize >= vertices));
    let beyond = problems.add("index-out-of-range", Severity::Error, Element::Cell, beyond, |count, first| {
        format!(
            "{count} of {cells} {many} name a vertex that does not exist, the first is {one} {first} with vertices {:?} \
             of {vertices} (counted from 0); is the file truncated or its vertices counted from another number?",
            all[first]
        )
    });
    let repeats = |cell: &[u32; N]| (1..N).any(|i| cell[..i].contains(&cell[i]));
    let repeated = (0..cells).filter(|&cell| repeats(&all[cell]));
    let repeated = problems.add("repeated-vertex", Severity::Error, Element::Cell, repeated, |count, first| {
        format!(
            "{count} of {cells} {many} use a vertex twice, the first is {one} {first} with vertices {:?}; remove them",
            all[first]
        )
    });
    if infinite || beyond {
        return false;
    }
    let mut used = vec![false; vertices];
    for &vertex in all.iter().flatten() {
        used[vertex as usize] = true;
    }
    let unused = (0..vertices).filter(|&vertex| !used[vertex]);
    problems.add(
        "unreferenced-vertex",
        Severity::Error,
        Element::Vertex,
        unused,
        |count, first| {
            format!(
                "{} to no {one}, the first is vertex {first}; remove such vertices from the file",
                counted(count, "vertex belongs", "vertices belong")
            )
        },
    );
    let mut sorted: Vec<([u32; N], u32)> = all
        .iter()
        .zip(0..)
        .map(|(&cell, index)| {
            let mut cell = cell;
            cell.sort_unstable();
            (cell, index)
        })
        .collect();
    sorted.sort_unstable();
    let mut copies: Vec<usize> = sorted
        .windows(2)
        .filter(|pair| pair[0].0 == pair[1].0)
        .map(|pair| pair[1].1 as usize)
        .collect();
    copies.sort_unstable();
    let copied = problems.add(
        "duplicate-cell",
        Severity::Error,
        Element::Cell,
        copies.into_iter(),
        |count, first| {
            format!(
                "{} the vertices of an earlier one, the first is {one} {first} with vertices {:?}; remove the copies",
                counted(count, &format!("{one} has"), &format!("{many} have")),
                all[first]
            )
        },
    );
    drop(sorted);
    let mut order: Vec<u32> = (0..vertices as u32).collect();
    let key = |vertex: u32| points[vertex as usize].map(|coordinate| coordinate + 0.0);
    let compare = |a: [f64; 3], b: [f64; 3]| {
        (0..3)
            .map(|axis| a[axis].total_cmp(&b[axis]))
            .find(|order| order.is_ne())
            .unwrap_or(std::cmp::Ordering::Equal)
    };
    order.sort_unstable_by(|&a, &b| compare(key(a), key(b)).then(a.cmp(&b)));
    let mut twins: Vec<usize> = order
        .windows(2)
        .filter(|pair| key(pair[0]) == key(pair[1]))
        .map(|pair| pair[1] as usize)
        .collect();
    twins.sort_unstable();
    problems.add("coincident-vertices", Severity::Warning, Element::Vertex, twins.into_iter(), |count, first| {
        format!(
            "{} at the place of an earlier one, the first is vertex {first}; the mesh is cut apart there unless they are \
             merged",
            counted(count, "vertex lies", "vertices lie")
        )
    });
    !repeated && !copied
}

/// A volume below this multiple of the cube of the longest edge (an area below this multiple of its square) counts as
/// zero: the rounding of the coordinates alone produces as much.
pub(super) const FLAT: f64 = 1e-15;

/// The longest distance between two of the points.
fn longest<const N: usize>(corners: [[f64; 3]; N]) -> f64 {
    let mut longest = 0.0f64;
    for (index, &a) in corners.iter().enumerate() {
        for &b in &corners[..index] {
            longest = longest.max(length(subtract(a, b)));
        }
    }
    longest
}

/// Whether the neighbours across facet `local` of `cell` lie on its two sides, by the order of their vertices.
fn opposed(cells: &[[u32; 4]], cell: usize, local: usize, neighbour: usize) -> bool {
    let ours = TETRAHEDRON_FACETS[local].map(|corner| cells[cell][corner]);
    let other = &cells[neighbour];
    let Some(apex) = other.iter().position(|vertex| !ours.contains(vertex)) else {
        return false;
    };
    let theirs = TETRAHEDRON_FACETS[apex].map(|corner| other[corner]);
    // Seen from its own cell each face turns the same way; seen from one side they must turn opposite ways.
    let Some(start) = theirs.iter().position(|&vertex| vertex == ours[0]) else {
        return false;
    };
    theirs[(start + 1) % 3] == ours[2]
}

/// Cells that lie on the same side of a face as a neighbour, ascending.
fn folded(cells: &[[u32; 4]], facets: &Facets<4>) -> Vec<usize> {
    (0..cells.len())
        .filter(|&cell| {
            facets.neighbours[cell].iter().enumerate().any(|(local, &neighbour)| {
                neighbour < CROWDED && (neighbour as usize) < cell && !opposed(cells, cell, local, neighbour as usize)
            })
        })
        .collect()
}

/// Checks a tetrahedral mesh and turns reversed tetrahedra round by exchanging their last two vertices. Errors come
/// first in the list.
pub fn tetrahedra(mesh: &mut TetrahedralMesh) -> Vec<Problem> {
    let mut problems = Problems::default();
    if elementary(&mesh.points, &mesh.cells, ("tetrahedron", "tetrahedra"), &mut problems) {
        shape_and_orientation(mesh, &mut problems);
    }
    let mut problems = problems.0;
    problems.sort_by_key(|problem| problem.severity);
    problems
}

/// The checks of [`tetrahedra`] that rely on sound cells.
fn shape_and_orientation(mesh: &mut TetrahedralMesh, problems: &mut Problems) {
    let (vertices, total) = (mesh.points.len(), mesh.cells.len());
    let determinants: Vec<f64> = mesh.cells.iter().map(|&cell| determinant(mesh.corners(cell))).collect();
    let flat = |cell: usize| determinants[cell].abs() / 6.0 <= FLAT * longest(mesh.corners(mesh.cells[cell])).powi(3);
    let is_flat: Vec<bool> = (0..total).map(flat).collect();
    let flat = (0..total).filter(|&cell| is_flat[cell]);
    problems.add("degenerate-cell", Severity::Error, Element::Cell, flat, |count, first| {
        format!(
            "{count} of {total} tetrahedra have no volume, the first is tetrahedron {first} with vertices {:?}; remove \
             or remesh them",
            mesh.cells[first]
        )
    });
    let mut facets = connectivity::facets(&mesh.cells, vertices);
    if facets.crowded > 0 {
        let first = facets.first_crowded as usize;
        problems.0.push(Problem {
            kind: "non-manifold-face",
            severity: Severity::Error,
            count: facets.crowded,
            element: Element::Cell,
            first,
            message: format!(
                "{} more than two tetrahedra, the first at tetrahedron {first}; remove the surplus tetrahedra",
                counted(facets.crowded, "face has", "faces have")
            ),
        });
    }
    let signs = (0..total).filter(|&cell| !is_flat[cell]);
    let mostly_reversed = 2 * signs.clone().filter(|&cell| determinants[cell] < 0.0).count() > signs.count();
    // The sign of a flat tetrahedron is noise; it goes with the majority.
    let is_negative = |cell: usize| {
        if is_flat[cell] {
            mostly_reversed
        } else {
            determinants[cell] < 0.0
        }
    };
    let negative: Vec<usize> = (0..total).filter(|&cell| is_negative(cell)).collect();
    let turn = |mesh: &mut TetrahedralMesh, facets: &mut Facets<4>| {
        for &cell in &negative {
            mesh.cells[cell].swap(2, 3);
            facets.neighbours[cell].swap(2, 3);
        }
    };
    turn(mesh, &mut facets);
    let folded = folded(&mesh.cells, &facets);
    if folded.is_empty() {
        let reversed = negative.iter().copied();
        problems.add(
            "reversed",
            Severity::Repaired,
            Element::Cell,
            reversed,
            |count, first| {
                if count == total {
                    format!("all {total} tetrahedra were listed with reversed orientation; turned round")
                } else {
                    format!(
                        "{count} of {total} tetrahedra were listed with reversed orientation, the first is tetrahedron \
                     {first}; turned round"
                    )
                }
            },
        );
    } else {
        // The order of the vertices was sound and the positions are not: leave the cells as they are.
        let (count, first) = (folded.len(), folded[0]);
        turn(mesh, &mut facets);
        // A mesh that is reversed as a whole shows its few positive tetrahedra as the inverted ones.
        let mut odd = (0..total)
            .filter(|&cell| is_negative(cell) != mostly_reversed)
            .peekable();
        let first = odd.peek().copied().unwrap_or(first);
        let inverted = odd.count();
        let (kind, message) = if inverted == 0 {
            (
                "overlap",
                format!(
                    "{count} of {total} tetrahedra overlap a neighbour, the first is tetrahedron {first}; \
                                 remesh these places"
                ),
            )
        } else {
            (
                "inverted",
                format!(
                    "{inverted} of {total} tetrahedra are turned inside out by the positions of their vertices, the first is \
                 tetrahedron {first} with vertices {:?}; remesh or untangle these places",
                    mesh.cells[first]
                ),
            )
        };
        problems.add(kind, Severity::Error, Element::Cell, std::iter::once(first), |_, _| {
            message
        });
        if let Some(problem) = problems.0.last_mut() {
            problem.count = if inverted == 0 { count } else { inverted };
        }
    }
    let parts = connectivity::components(&mesh.cells, vertices).count;
    if parts > 1 {
        problems.add(
            "several-components",
            Severity::Warning,
            Element::Mesh,
            std::iter::once(0),
            |_, _| format!("the mesh has {parts} separate parts; a target shape needs a single one"),
        );
    }
    let pinched = connectivity::pinched_vertices(&mesh.cells, vertices, &facets);
    let pinched = pinched.iter().map(|&vertex| vertex as usize);
    problems.add("pinched-vertex", Severity::Warning, Element::Vertex, pinched, |count, first| {
        format!(
            "{} parts of the mesh that share no face there, the first is vertex {first}; the boundary is no manifold",
            counted(count, "vertex joins", "vertices join")
        )
    });
    let poor = (0..total).filter(|&cell| {
        let shape = scaled_jacobian(mesh.corners(mesh.cells[cell]));
        shape > 0.0 && shape < 1e-3
    });
    let poor: Vec<usize> = poor.collect();
    problems.add(
        "poor-cell",
        Severity::Warning,
        Element::Cell,
        poor.into_iter(),
        |count, first| {
            format!(
                "{count} of {total} tetrahedra are nearly flat (scaled Jacobian below 0.001), the first is tetrahedron \
             {first}; distortions and times suffer"
            )
        },
    );
}

/// Checks a triangle surface. Open boundaries and separate parts are no problems; they are in the summary. Errors come
/// first in the list.
pub fn triangles(mesh: &TriangleMesh) -> Vec<Problem> {
    let mut problems = Problems::default();
    if elementary(&mesh.points, &mesh.cells, ("triangle", "triangles"), &mut problems) {
        let total = mesh.cells.len();
        let flat = |&cell: &usize| {
            let corners = mesh.corners(mesh.cells[cell]);
            length(area_vector(corners)) / 2.0 <= FLAT * longest(corners).powi(2)
        };
        problems.add("degenerate-cell", Severity::Error, Element::Cell, (0..total).filter(flat), |count, first| {
            format!(
                "{count} of {total} triangles have no area, the first is triangle {first} with vertices {:?}; remove or \
                 remesh them",
                mesh.cells[first]
            )
        });
        let topology = connectivity::surface_topology(&mesh.cells, mesh.points.len());
        if topology.crowded_edges > 0 {
            problems.0.push(Problem {
                kind: "non-manifold-edge",
                severity: Severity::Warning,
                count: topology.crowded_edges,
                element: Element::Cell,
                first: topology.first_crowded as usize,
                message: format!(
                    "{} more than two triangles, the first at triangle {}; split or remove the surplus triangles",
                    counted(topology.crowded_edges, "edge has", "edges have"),
                    topology.first_crowded
                ),
            });
        }
        let pinched = topology.pinched.iter().map(|&vertex| vertex as usize);
        problems.add("pinched-vertex", Severity::Warning, Element::Vertex, pinched, |count, first| {
            format!(
                "{} parts of the surface that share no edge there, the first is vertex {first}; duplicate such vertices",
                counted(count, "vertex joins", "vertices join")
            )
        });
        let disoriented = topology.disoriented.iter().map(|&cell| cell as usize);
        problems.add(
            "inconsistent-orientation",
            Severity::Warning,
            Element::Cell,
            disoriented,
            |count, first| {
                format!(
                    "{} to a neighbour, the first is triangle {first}; turn one of each pair round",
                    counted(
                        count,
                        "triangle is oriented opposite",
                        "triangles are oriented opposite"
                    )
                )
            },
        );
    }
    let mut problems = problems.0;
    problems.sort_by_key(|problem| problem.severity);
    problems
}
