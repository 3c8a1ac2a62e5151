//! Refinement of motions, rotations and homographies over some of the matches, and the noise that the matches show.

pub(crate) mod epipolar;
pub(crate) mod loss;
pub(crate) mod noise;
pub(crate) mod point_transfer;
