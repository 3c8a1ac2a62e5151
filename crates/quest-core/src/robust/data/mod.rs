//! The matches of one estimate, in the forms that the search and the refinement read.

pub(crate) mod columns;
pub(crate) mod image;
pub(crate) mod keypoints;
pub(crate) mod observations;
pub(crate) mod point_transfer;
