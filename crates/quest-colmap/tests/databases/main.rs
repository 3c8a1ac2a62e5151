//! Databases of every schema, made here, verified, and read again.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod planted;
mod rows;
mod trouble;
