//! Finite elements: reference cells, quadrature, bases and spaces of degrees of freedom.

pub mod surface;
pub mod triangle_rule;
pub mod bernstein_hexahedron;
