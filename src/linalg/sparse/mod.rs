//! Symmetric positive definite systems over the vertices of a mesh: structure, order, factorization and solution.
//!
//! A matrix is made of `B x B` blocks, one for every vertex and every pair of vertices that share a cell: `B = 3` for
//! displacements, `B = 1` for weighted Laplacians. The structure is analysed once ([`BlockPattern`]) and serves every
//! matrix of that structure ([`BlockCholesky`]).
//!
//! The steps are those of a multifrontal Cholesky factorization (Duff and Reid 1983; Liu 1992): a nested-dissection
//! order of the vertices, the elimination tree with relaxed supernodes, one dense frontal matrix a supernode. The dense
//! kernels are faer's, in sequential mode, on blocks cut at fixed places; threads only share out these blocks and the
//! independent branches of the tree.
//!
//! Guaranteed: the same input gives the same bits with any number of threads. Not guaranteed: anything about matrices
//! that are not positive definite, except that the factorization says so.

mod cholesky;
mod dense;
mod elimination;
mod geometric_dissection;
mod graph;
mod minimum_degree;
mod nested_dissection;
mod pattern;
mod separator;

pub use cholesky::{BlockCholesky, NotPositive};
pub use elimination::Elimination;
pub use geometric_dissection::geometric_dissection;
pub use graph::Graph;
pub use nested_dissection::nested_dissection;
pub use pattern::{BlockPattern, FIXED, PatternError};
