//! Finite elements: reference cells, quadrature, bases and spaces of degrees of freedom.

pub mod bernstein_hexahedron;
