//! Shared by the tests of the workspace: the paper's method written down literally and without regard to time,
//! independent of the library, and comparisons of solution sets.
#![expect(
    clippy::missing_panics_doc,
    clippy::expect_used,
    reason = "helpers of tests: what they expect failing is the test failing"
)]

pub mod hostile;
pub mod invariants;
pub mod literal_quest;
pub mod pairs;
pub mod polynomial;
pub mod quartics;
pub mod relinearization;
pub mod scenes;
pub mod solution_sets;

/// The example in Rust of the root's README.md, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
pub mod readme {}
