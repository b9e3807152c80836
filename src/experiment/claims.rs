//! What the papers behind the methods claim: an experiment file names the claims that it reproduces.

/// A claim of a paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Claim {
    /// `VM1`: the method's initials and a number.
    pub id: &'static str,
    pub method: &'static str,
    pub text: &'static str,
}

const fn claim(id: &'static str, method: &'static str, text: &'static str) -> Claim {
    Claim { id, method, text }
}

/// Every claim, by method.
pub const CLAIMS: &[Claim] = &[
    claim(
        "VF1",
        "volume-fit",
        "the Hencky energy is a barrier: a valid mesh stays valid while it is optimized",
    ),
    claim(
        "VF2",
        "volume-fit",
        "conformal energies change the volume around singularities, the rigid one does not",
    ),
    claim(
        "VF3",
        "volume-fit",
        "eleven mixed meshes of order 2 to 16 reach a mean scaled Jacobian of at least 0.955",
    ),
    claim(
        "VF4",
        "volume-fit",
        "raising the order only where needed stores about 6 % of the nodes at the same fit",
    ),
    claim(
        "VF5",
        "volume-fit",
        "the integrated Fourier basis gives a more uniform map than integrated Legendre",
    ),
    claim(
        "VF6",
        "volume-fit",
        "the energy falls monotonically in each stage and jumps only where the basis is refined",
    ),
    claim(
        "VF7",
        "volume-fit",
        "noisy targets, polygon soups, flipped and degenerate triangles are fitted",
    ),
    claim(
        "VF8",
        "volume-fit",
        "a point cloud is fitted with the inverse distance term alone",
    ),
    claim(
        "VF9",
        "volume-fit",
        "a mesh with inverted elements is repaired by fitting it over its own boundary",
    ),
    claim(
        "VF10",
        "volume-fit",
        "control meshes of subdivision volumes are fitted level by level and keep features",
    ),
    claim(
        "VF11",
        "volume-fit",
        "shell meshes are built on both sides of a surface at a prescribed distance",
    ),
    claim(
        "VF12",
        "volume-fit",
        "a schedule of two stages, its order raised step by step, beats one at full order",
    ),
    claim(
        "VF13",
        "volume-fit",
        "anisotropy along normals keeps features without tagging them",
    ),
    claim(
        "VF14",
        "volume-fit",
        "templates come from grids that are carved, extruded, pillowed and collapsed",
    ),
    claim(
        "VM1",
        "volume-map",
        "Dirichlet and ARAP fold tetrahedra over, stretch folds none",
    ),
    claim(
        "VM2",
        "volume-map",
        "stretch has by far the lowest maximum angle distortion; LPM beats LSCM in speed and distortion",
    ),
    claim(
        "VM3",
        "volume-map",
        "relaxation turns a stalled solve into a converged one",
    ),
    claim(
        "VM4",
        "volume-map",
        "locally injective mapping misses tight constraints that this solver meets better",
    ),
    claim(
        "VM5",
        "volume-map",
        "bounded-distortion projection lowers maximum angle distortion and raises volume distortion",
    ),
    claim(
        "VM6",
        "volume-map",
        "continuation in the constraint weight meets acute constraints",
    ),
    claim(
        "VM7",
        "volume-map",
        "starting from a similarity needs fewer iterations than starting from the rest pose",
    ),
    claim(
        "G1",
        "g1-surface",
        "the curve network is tangent-plane continuous and minimises linearised curvature",
    ),
    claim(
        "G2",
        "g1-surface",
        "the construction stays stable as the normals approach the straight case",
    ),
    claim(
        "G3",
        "g1-surface",
        "biquartic patches join with continuous tangent planes on irregular quad meshes",
    ),
    claim("G4", "g1-surface", "the free middle node is fixed by minimum energy"),
    claim(
        "G5",
        "g1-surface",
        "a head becomes a curved hexahedral mesh by transfinite interpolation",
    ),
    claim(
        "G6",
        "g1-surface",
        "the order of the geometry matters to the convergence of high-order simulation",
    ),
    claim(
        "SF1",
        "surface-fit",
        "spurious parts stay without the symmetric term and go with it",
    ),
    claim(
        "SF2",
        "surface-fit",
        "the error of the sampled energy falls as the square of the sample spacing",
    ),
    claim(
        "SF3",
        "surface-fit",
        "the weight of smoothness trades it against distance",
    ),
    claim("SF4", "surface-fit", "anisotropy along normals keeps sharp creases"),
    claim(
        "SF5",
        "surface-fit",
        "fits reach Hausdorff distances of 0.39 to 1.4 % of the diagonal within minutes",
    ),
    claim(
        "SF6",
        "surface-fit",
        "the distance falls fast with the size of the template, the time grows as n log n",
    ),
    claim(
        "SF7",
        "surface-fit",
        "control meshes of Catmull-Clark surfaces are fitted through their limit matrix",
    ),
    claim(
        "SF8",
        "surface-fit",
        "raw overlapping scans, soups and holes are fitted",
    ),
    claim(
        "SF9",
        "surface-fit",
        "a wrong genus or a bad template gives a poor result, never a crash",
    ),
    claim(
        "SF10",
        "surface-fit",
        "thin sheets fail without the orientation of normals and work with it",
    ),
    claim(
        "MF1",
        "mixed-fem",
        "biharmonic problems converge in L2 like h^(7/4), under region and curve conditions alike",
    ),
    claim(
        "MF2",
        "mixed-fem",
        "triharmonic problems converge more slowly with region than with curve conditions",
    ),
    claim(
        "MF3",
        "mixed-fem",
        "results depend little on the mesh for biharmonic and more for triharmonic problems",
    ),
    claim(
        "MF4",
        "mixed-fem",
        "hybrid Voronoi areas give smaller errors than barycentric ones at the same rate",
    ),
    claim(
        "MF5",
        "mixed-fem",
        "reduced and mixed systems agree for biharmonic problems at comparable cost",
    ),
    claim(
        "MF6",
        "mixed-fem",
        "fixed curve conditions can make the triharmonic system singular; the reduction works",
    ),
    claim(
        "MF7",
        "mixed-fem",
        "region, point and curve conditions edit, fill holes, blend, patch and deform",
    ),
];
