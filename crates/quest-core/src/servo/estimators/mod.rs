//! Estimators: from the features of an image to a pose.

pub mod depth_filter;
pub(crate) mod estimate;
pub mod per_frame;
pub(crate) mod source;
pub mod tracker;
