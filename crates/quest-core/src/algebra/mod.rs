//! Small dense linear algebra, descents and polynomials, without heap; imports nothing of the crate.
//!
//! Each routine stands here because a library's, at these sizes, costs several times as much (ARCHITECTURE.md
//! has the measurements); the tests hold it against the library's.

pub(crate) mod cholesky;
pub(crate) mod descent;
pub(crate) mod eigenvalues;
pub(crate) mod elimination;
pub(crate) mod monomials;
pub(crate) mod null_space;
pub(crate) mod number;
pub(crate) mod polynomial;
pub(crate) mod symmetric;
pub(crate) mod tridiagonal;
pub(crate) mod vectors;
