//! Vector registers: pairs of numbers, lanes of any width, and the dispatch to the widest instructions of the processor.
#![expect(
    clippy::inline_always,
    reason = "a call would leave the instructions that a loop was dispatched to (`widest`, `instructions`)"
)]

pub(crate) mod abreast;
pub(crate) mod columns;
pub(crate) mod exponential;
pub(crate) mod geometry;
pub(crate) mod instructions;
pub(crate) mod lane;
pub(crate) mod portable;
#[cfg(target_arch = "x86_64")]
pub(crate) mod sse2;
pub(crate) mod twice;
pub(crate) mod two;
#[cfg(target_arch = "x86_64")]
pub(crate) mod vector;
pub(crate) mod widest;
