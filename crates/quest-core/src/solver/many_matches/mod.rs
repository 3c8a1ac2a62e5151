//! From more than five matches to candidates: the driver that refining solvers share, and its last resorts.

pub(crate) mod collinear_view;
pub(crate) mod consensus;
pub(crate) mod driver;
