//! Small dense linear algebra of fixed size, without heap; imports nothing of the crate.
//!
//! Each routine stands here because a library's, at these sizes, costs several times as much (ARCHITECTURE.md
//! has the measurements); the tests hold it against the library's.

pub(crate) mod eigenvalues;
pub(crate) mod elimination;
