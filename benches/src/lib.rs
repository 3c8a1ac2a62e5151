//! Shared by the programs that measure the solvers: kinds of scenes, errors against the truth, statistics.

pub mod cells;
pub mod errors;
pub mod kinds;
pub mod parallel;
pub mod peers;
pub mod statistics;

/// The seed of every run that does not name another.
pub const SEED: u64 = 2018;
