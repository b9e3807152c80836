//! Pictures of result meshes: the poster of each job, drawn in software so that it needs no graphics card and comes
//! out the same everywhere.

pub mod colour;
pub mod cut;
pub mod image;
pub mod raster;
pub mod solid;

use solid::Solid;

/// Size of a poster in pixels.
pub const WIDTH: usize = 360;
pub const HEIGHT: usize = 300;

/// The direction from the mesh to the eye; the page's viewer begins with the same.
pub const EYE: [f64; 3] = [0.56, -0.70, 0.44];

/// A PNG of the mesh cut open through its middle, coloured by one field, inverted cells in red. The background is clear.
pub fn poster(solid: &Solid, field: Option<usize>, scale: colour::Scale) -> Result<Vec<u8>, String> {
    const FINER: usize = 3;
    let plane = solid.is_volume().then(|| cut::Plane::towards(EYE, &solid.points));
    let facets = cut::facets(solid, &solid.points, plane.as_ref());
    let pixels = raster::render(&facets, solid, field, scale, EYE, (WIDTH * FINER, HEIGHT * FINER));
    let shrunk = image::shrink_clear(&pixels, WIDTH * FINER, HEIGHT * FINER, FINER);
    image::palette_png(&shrunk, WIDTH, HEIGHT, 32)
}
