//! The stages of the solver in the lanes, in the order in which a group of samples passes them.

pub(crate) mod cubics;
pub(crate) mod elimination;
pub(crate) mod frame;
pub(crate) mod isolation;
pub(crate) mod null_space;
pub(crate) mod resultant;
pub(crate) mod roots;
