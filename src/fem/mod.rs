//! Finite elements: reference cells, quadrature, bases and spaces of degrees of freedom.
//!
//! A high-order volume maps a canonical cell by `h(u) = sum_a n_a N_a(u)` with hierarchical functions N: those of the
//! vertices are linear, those of edges, faces and cells vanish on everything they do not belong to. Jin et al. 2013,
//! section 3.2; the functions on prisms and tetrahedra, which the paper leaves open, are described in [`functions`].
//!
//! Linear triangles on surfaces are apart, in [`surface`].

pub mod surface;
pub mod triangle_rule;
pub mod basis;
pub mod quadrature;
pub mod functions;
pub mod space;
mod contraction;
pub mod element;
pub mod batches;
pub mod volume_energy;
pub mod boundary;
pub mod certificate;
pub mod lagrange;
pub mod coefficient_file;
pub mod bernstein_hexahedron;
