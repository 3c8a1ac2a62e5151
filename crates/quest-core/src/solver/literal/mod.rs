//! The paper's two algorithms as it prints them, on the matrices of faer: for reading beside the paper and for comparing with it.
//!
//! `quest` and `relinearization` find the same solutions faster, and those that these lose.

mod buffers;
mod candidates;
mod constraints;
mod null_vectors;
pub mod quest_literal;
pub mod relinearization_literal;
#[cfg(test)]
mod tests;
