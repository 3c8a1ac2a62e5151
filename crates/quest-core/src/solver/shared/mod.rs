//! What every solver builds on: the frame without parallax, motions and their refinement, the ranked list of candidates.

pub(crate) mod descent_pair;
pub(crate) mod double_residual;
pub(crate) mod essential;
pub(crate) mod forms;
pub(crate) mod gram;
pub(crate) mod motion;
pub(crate) mod newton_lanes;
pub(crate) mod newton_pair;
pub(crate) mod parallax_frame;
pub(crate) mod resultant;
pub(crate) mod roots_abreast;
pub(crate) mod shortlist;
