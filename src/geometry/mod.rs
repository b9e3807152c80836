//! Geometry of points and surfaces: closest points, predicates, restricted Voronoi diagrams.

pub mod closest_point;
