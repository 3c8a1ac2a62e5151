//! Section 7 of the paper: rotations as the solutions of quartics in a quaternion.

pub(crate) mod moments;
pub mod quest_eigen;
pub mod relinearization;
pub(crate) mod twenty_zeros;
