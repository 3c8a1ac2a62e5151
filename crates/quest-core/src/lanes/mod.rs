//! Many minimal problems at once, one in each lane of a vector register.
//!
//! A robust estimator needs the essential matrices of thousands of samples of five matches, and the score of each over all matches.
//! Both are the same arithmetic on independent data. Vector instructions do it for two, four or eight samples or matches at once,
//! and in `f32` for up to sixteen:
//!
//! - [`BatchSolver`]: samples of five matches in, [`Essentials`] out, in structure of arrays.
//! - [`Scorer`]: an essential matrix and all matches in ([`ImageMatches`], [`BearingMatches`]), a [`Score`] or a mask of
//!   inliers out.
//!
//! [`Instructions`] says which vector instructions are used; the best that the processor has are found at run time.
//!
//! ```
//! use quest_core::lanes::{BatchSolver, Essentials, Tolerance};
//! # let x1 = [[0.1, 0.2], [-0.3, 0.1], [0.2, -0.2], [-0.1, -0.3], [0.3, 0.3], [0.2, 0.1]];
//! # let x2 = [[0.16, 0.2], [-0.22, 0.1], [0.25, -0.19], [-0.06, -0.28], [0.35, 0.31], [0.26, 0.11]];
//! # let matches = quest_core::correspondence::from_image_points(&x1, &x2)?;
//!
//! let samples = [[0, 1, 2, 3, 4], [1, 2, 3, 4, 5]];
//! let mut solver = BatchSolver::new(Tolerance::Tight);
//! let mut found = Essentials::new();
//! solver.solve(&matches, &samples, &mut found)?;
//! for sample in 0..found.samples() {
//!     for k in found.of(sample) {
//!         println!("{sample}: {:?}", found.matrices()[k]);
//!     }
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The stages of a solve
//! The formulation is that of [`quest`](crate::solver::quest), the scalar solver, which is also the oracle of the tests:
//!
//! | file | what |
//! |---|---|
//! | `frame.rs` | the best alignment of the bearings (Wahba's problem), the rows `[n/p, sym(b cᵀ)]` |
//! | `null_space.rs` | their null space, by Householder reflections |
//! | `cubics.rs` | ten cubics without the factor `p` |
//! | `elimination.rs` | reduced to six rows |
//! | `resultant.rs` | three equations linear in `x` and `y`, the polynomial of degree ten, the point of a root |
//! | `isolation.rs` | a cell for each of its real roots |
//! | `roots.rs` | the roots, and a second count of them by Sturm's theorem |
//! | `solver/shared/newton_lanes.rs` | rotation and translation, Newton's iteration |
//! | `batch.rs` | all of it, for groups of samples |
//!
//! What a scalar solver decides by branches is decided here by masks, or not at all: there is no pivoting and no second attempt. A
//! lane that needs one is flagged and left to the scalar solver; these are less than a hundredth of the samples. No lane looks at
//! another. So the result for a sample does not depend on its place, its neighbours or the size of the batch.
//!
//! A mask is a truth value for each lane. A group of samples is padded to whole registers by repeating its last sample. The roots
//! are taken slot by slot, in as many slots as the lane with the most roots needs; a lane without a root in a slot computes with
//! harmless numbers that are not kept. An iteration ends when no lane needs it any more, and a lane that has converged does not
//! move.
//!
//! The lanes are those of `algebra::vectors`: `vector.rs` (AVX2, AVX-512) and `sse2.rs` by pulp, `portable.rs` for other processors;
//! `twice.rs` takes two roots of every sample at once.
#![expect(
    clippy::inline_always,
    reason = "what is not inlined into a task is compiled without its instructions"
)]

mod batch;
mod essentials;
mod score;
mod stages;
#[cfg(test)]
mod test;

pub use crate::algebra::vectors::instructions::{Instructions, UnknownInstructions};
pub use batch::{BatchSolver, SampleError, Tolerance};
pub use essentials::Essentials;
pub(crate) use score::WithLoss;
pub use score::{
    BearingMatches, ImageMatches, MatchColumns, Real, Score, Scorer, SearchScore, Stop, UnknownLoss,
};

#[expect(deprecated, reason = "the old name stays for one version")]
pub use score::Loss;
