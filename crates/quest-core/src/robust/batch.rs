//! Many pairs at once.

use super::{Estimate, EstimateError, Options, estimate};
use crate::Correspondence;

/// One pair of a batch.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// The matches.
    pub matches: &'a [Correspondence],
    /// In place of those of the options: `fx, fy` of view 1 and of view 2.
    pub focal_lengths: [[f64; 2]; 2],
}

/// The estimate of every pair, in order: of the pair number `i` what [`estimate`] gives for it with the same seed and with
/// [`Options::index`] greater by `i`. A batch that begins with pair `k` of a larger one has an `index` greater by `k`, and the
/// same answers: nothing depends on how pairs are divided into batches or among threads.
///
/// With the feature `rayon` on `threads` threads, all of the machine's for zero; without it one after the other.
#[must_use]
pub fn estimate_batch(
    problems: &[Problem],
    options: &Options,
    threads: usize,
) -> Vec<Result<Estimate, EstimateError>> {
    let one = |(index, problem): (u64, &Problem)| {
        let index = options.index.wrapping_add(index);
        estimate(problem.matches, &Options { focal_lengths: problem.focal_lengths, index, ..options.clone() })
    };
    let problems: Vec<_> = (0..).zip(problems).collect();
    #[cfg(feature = "rayon")]
    if threads != 1
        && let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(threads).build()
    {
        use rayon::prelude::*;
        return pool.install(|| problems.into_par_iter().with_max_len(1).map(one).collect());
    }
    let _ = threads;
    problems.into_iter().map(one).collect()
}
