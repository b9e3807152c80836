//! Modelling of a surface: handles or patches, conditions, solution, and the smoothness of the seam.

use super::domain::{self, Domain};
use super::handles::{self, Roles};
use super::hole;
use super::model::Model;
use super::scheme::{Data, Discretization, Scheme};
use super::seam::{Sides, jumps};
use super::settings::{Condition, DataKind, Fill, Settings};
use super::study::{Quiet, Report, compare, go_on, shrink, touching};
use super::surface_data::{Prescribed, prescribe};
use super::system::System;
use crate::fem::surface::SurfaceOperators;
use crate::mesh::format::{Cells, vtu};
use crate::mesh::{TriangleMesh, area_vector, diagonal, dot, length, subtract};
use crate::method::{Failure, Outcome};
use crate::optimize::{Iterate, Observer};

/// Runs a computation on a surface.
///
/// # Errors
/// For input that cannot be used, singular systems, and when the observer asks to stop.
pub(super) fn run(mut model: Model, settings: &Settings, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
    domain::manifold(&model.mesh)?;
    if settings.fill != Fill::None {
        hole::fill(&mut model, settings.fill == Fill::All)?;
    }
    let order = settings.order();
    let roles = roles(&model, settings)?;
    let mesh = &model.mesh;
    let mut inside = touching(mesh, &roles.free);
    if let Some(known) = &model.inside {
        // Triangles of a patch between fixed vertices belong to it as well.
        let whole = |cell: &[u32; 3]| cell.iter().all(|&vertex| !roles.free[vertex as usize]);
        for (index, cell) in mesh.cells.iter().enumerate() {
            inside[index] |= known[index] && whole(cell) && settings.handles.is_none();
        }
    }
    let domain = Domain::new(mesh, inside, &roles.free)?;
    let displacement = settings.data == DataKind::Displacement;
    let scheme = settings.scheme();
    let mut report = Report::new(&model, &domain);
    report.singular(&domain, settings)?;
    go_on(observer)?;

    observer.phase("assemble");
    let selected = if scheme.on_domain() {
        domain.inside.clone()
    } else {
        vec![true; mesh.cells.len()]
    };
    let operators = SurfaceOperators::on_graph(mesh, &domain.graph, &selected)
        .map_err(|error| Failure::invalid(format!("mesh: {error}")))?;
    let sides = Sides::new(&domain);
    let rest = model.targets.as_ref().unwrap_or(&mesh.points);
    let mut system: Option<System> = None;
    let mut places = rest.clone();
    let mut prescribed = Prescribed::default();
    for frame in 1..=settings.frames {
        go_on(observer)?;
        let share = frame as f64 / settings.frames as f64;
        let moved: Vec<[f64; 3]> = rest
            .iter()
            .zip(&roles.motion)
            .map(|(place, motion)| std::array::from_fn(|axis| place[axis] + share * motion[axis]))
            .collect();
        let values: Vec<f64> = if displacement {
            moved
                .iter()
                .zip(rest)
                .flat_map(|(moved, rest)| subtract(*moved, *rest))
                .collect()
        } else {
            moved.as_flattened().to_vec()
        };
        if settings.condition == Condition::Curve {
            prescribed = prescribe(&domain, &sides, &moved, model.targets.is_some(), displacement, settings);
        }
        let data = Data {
            components: 3,
            source: vec![0.0; values.len()],
            values,
            conormal: prescribed.conormal.clone(),
            laplacian: prescribed.laplacian.clone(),
            taylor: None,
        };
        let discretization = Discretization::new(
            &domain,
            &operators,
            scheme,
            order,
            settings.mass,
            settings.stabilisation(),
            &data,
        )?;
        let system = match &mut system {
            Some(system) => system,
            // The boundary values change from frame to frame, the matrix does not.
            none => none.insert(System::new(
                &discretization,
                settings.one_field(),
                settings.solver,
                observer,
            )?),
        };
        let solution = system.solve(&discretization, observer)?;
        report.count("solutions", 3);
        for (place, (value, rest)) in places.iter_mut().zip(solution.values.chunks_exact(3).zip(rest)) {
            *place = std::array::from_fn(|axis| value[axis] + if displacement { rest[axis] } else { 0.0 });
        }
        if frame == settings.frames {
            report.system(system, solution.accuracy);
            compare(
                &discretization,
                &solution.values,
                settings,
                &mut report,
                &mut Quiet(observer),
            )?;
        }
        observer.iterate(&Iterate {
            iteration: frame,
            energy: 0.0,
            gradient_norm: solution.accuracy.backward,
            step: share,
        });
    }
    observer.phase("measure");
    // Beyond a curve is what it prescribes, beyond a region the surface itself.
    let beyond = (scheme != Scheme::Region).then_some(&prescribed);
    measure(&domain, &sides, beyond, &roles, &places, rest, report)
}

/// What the generator, the patch, the handles, or the mesh's boundary say.
fn roles(model: &Model, settings: &Settings) -> Result<Roles, Failure> {
    let vertices = model.mesh.points.len();
    let none = Roles {
        free: model.free.clone().unwrap_or_else(|| vec![true; vertices]),
        motion: vec![[0.0; 3]; vertices],
    };
    if let Some(handles) = &settings.handles {
        return handles::resolve(model, handles, none.free);
    }
    if model.free.is_some() {
        return Ok(none);
    }
    let mut free = none.free;
    let loops = handles::boundary_loops(&model.mesh);
    if loops.is_empty() {
        return Err(Failure::invalid(
            "the surface has no boundary and no handles, so nothing is fixed; add handles to [settings]",
        ));
    }
    loops.iter().flatten().for_each(|&vertex| free[vertex as usize] = false);
    if settings.condition == Condition::Region {
        shrink(&model.mesh, &mut free, settings.order() - 1);
    }
    Ok(Roles { free, ..none })
}

/// Measures the seam and writes the surface.
fn measure(
    domain: &Domain<'_>,
    sides: &Sides<'_>,
    beyond: Option<&Prescribed>,
    roles: &Roles,
    places: &[[f64; 3]],
    rest: &[[f64; 3]],
    mut report: Report,
) -> Result<Outcome, Failure> {
    let mesh = domain.mesh;
    let found = jumps(sides, places, |vertex, across| {
        let Some(prescribed) = beyond else {
            let fit = sides.fit(places, vertex, false)?;
            return Some((fit.normal, fit.curvature(across)));
        };
        prescribed.beyond[vertex as usize]
    });
    let size = diagonal(places);
    if beyond.is_none() {
        let before = jumps(sides, rest, |vertex, across| {
            let fit = sides.fit(rest, vertex, false)?;
            Some((fit.normal, fit.curvature(across)))
        });
        report.set("tangent_jump_before", before.tangent_mean);
    }
    if found.vertices > 0 {
        report.set("tangent_jump_max", found.tangent_max);
        report.set("tangent_jump_mean", found.tangent_mean);
        report.set("curvature_jump_max", found.curvature_max * size);
        report.set("curvature_jump_mean", found.curvature_mean * size);
    }
    let moves: Vec<f64> = places.iter().zip(rest).map(|(a, b)| length(subtract(*a, *b))).collect();
    report.set("displacement_max", moves.iter().copied().fold(0.0, f64::max));
    let parts = parts(mesh, roles);
    let over: Vec<f64> = mesh
        .cells
        .iter()
        .map(|cell| cell.iter().map(|&vertex| moves[vertex as usize]).sum::<f64>() / 3.0)
        .collect();
    let normals = vertex_normals(mesh, places);
    let lines = isophotes(mesh, &normals);
    let picture = vtu::write(
        places,
        Cells {
            triangles: &mesh.cells,
            ..Cells::default()
        },
        &[
            ("rest", 3, rest.as_flattened()),
            ("normal", 3, normals.as_flattened()),
            ("displacement", 1, &moves),
        ],
        &[
            ("isophotes", 1, &lines),
            ("free_seam_held_moved", 1, &parts),
            ("displacement", 1, &over),
        ],
    );
    Ok(report.outcome(picture))
}

/// What a triangle belongs to: 0 the free part, 1 the seam between it and the rest, 2 what is held, 3 what is moved.
fn parts(mesh: &TriangleMesh, roles: &Roles) -> Vec<f64> {
    let part = |cell: &[u32; 3]| {
        let free = cell.iter().filter(|&&vertex| roles.free[vertex as usize]).count();
        let moved = |&vertex: &u32| roles.motion[vertex as usize] != [0.0; 3];
        match free {
            3 => 0.0,
            1 | 2 => 1.0,
            _ if cell.iter().any(moved) => 3.0,
            _ => 2.0,
        }
    };
    mesh.cells.iter().map(part).collect()
}

/// Means of the triangles' normals, weighted by area.
fn vertex_normals(mesh: &TriangleMesh, places: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut normals = vec![[0.0; 3]; places.len()];
    for cell in &mesh.cells {
        let part = area_vector(cell.map(|vertex| places[vertex as usize]));
        for &vertex in cell {
            (0..3).for_each(|axis| normals[vertex as usize][axis] += part[axis]);
        }
    }
    for normal in &mut normals {
        let size = length(*normal);
        if size > 0.0 {
            *normal = normal.map(|component| component / size);
        }
    }
    normals
}

/// Waves of brightness under a far light: their crests are isophotes, whose kinks show jumps of the curvature and whose
/// breaks show jumps of the tangent.
fn isophotes(mesh: &TriangleMesh, normals: &[[f64; 3]]) -> Vec<f64> {
    const LIGHT: [f64; 3] = [0.486_664, 0.324_443, 0.811_107];
    const WAVES: f64 = 8.0;
    mesh.cells
        .iter()
        .map(|cell| {
            let mean: [f64; 3] = std::array::from_fn(|axis| {
                cell.iter().map(|&vertex| normals[vertex as usize][axis]).sum::<f64>() / 3.0
            });
            let brightness = dot(mean, LIGHT) / length(mean).max(f64::MIN_POSITIVE);
            (std::f64::consts::PI * WAVES * brightness).cos()
        })
        .collect()
}
