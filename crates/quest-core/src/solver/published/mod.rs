//! The methods that the paper compares with, as published, and two linear methods for more matches.

pub mod eight_point;
pub(crate) mod five_point;
pub(crate) mod hidden_variable;
pub mod homography;
pub mod kneip;
pub mod kukelova;
pub(crate) mod least_squares;
pub mod li_hartley;
pub mod nister;
pub(crate) mod normalisation;
pub mod stewenius;
pub(crate) mod trace_cubics;
