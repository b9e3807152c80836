//! Geometry of points and surfaces: closest points, predicates, restricted Voronoi diagrams.

pub mod closest_point;
pub mod hilbert;
pub mod point_tree;
pub mod restricted_voronoi;
pub mod squared_distance;
pub mod centroidal_voronoi;
pub mod ray;
pub mod dual_contouring;
