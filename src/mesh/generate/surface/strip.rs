//! One quadrilateral in the plane whose normals are tilted along one side: curves close to the straight case.

use super::{GeneratedSurface, Parameter, SurfaceGenerator};
use crate::mesh::generate::Arguments;
use crate::mesh::quadrilateral::QuadrilateralMesh;

pub(super) const GENERATOR: SurfaceGenerator = SurfaceGenerator {
    name: "strip",
    doc: "the unit square with normals (0, 0, 1) along y = 0 and (0, tilt, 1) along y = 1",
    parameters: &[Parameter {
        name: "tilt",
        whole: false,
        default: 1.0,
        min: -1e3,
        max: 1e3,
        doc: "the second component of the normals along y = 1",
    }],
    build,
};

fn build(arguments: &Arguments) -> Result<GeneratedSurface, String> {
    let tilt = arguments.number("tilt");
    let (level, tilted) = ([0.0, 0.0, 1.0], [0.0, tilt, 1.0]);
    Ok(GeneratedSurface {
        mesh: QuadrilateralMesh {
            points: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            quads: vec![[0, 1, 2, 3]],
            normals: Some(vec![level, level, tilted, tilted]),
        },
        exact: None,
        creased: None,
    })
}
