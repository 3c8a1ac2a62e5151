//! Many pairs at once.

use super::{Estimate, EstimateError, KnownDirection, Options, Priors, estimate_until};
use crate::Correspondence;

/// A stack for threads that estimate, in bytes, with room in it: without optimisation an estimate takes almost two megabytes where the
/// processor has AVX-512, and two are what a thread of Rust's has.
pub const STACK_SIZE: usize = 4 << 20;

/// One pair of a batch.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// The matches.
    pub matches: &'a [Correspondence],
    /// In place of those of the options: `fx, fy` of view 1 and of view 2.
    pub focal_lengths: [[f64; 2]; 2],
}

/// How a batch is worked on, and what is known of its pairs beside their matches.
#[derive(Clone, Copy)]
pub struct Batch<'a> {
    /// The number of threads (feature `rayon`), all of the machine's for zero. It changes no answer.
    pub threads: usize,
    /// The key of each pair, in place of its place in the batch: its answer then does not depend on which other pairs
    /// are in the batch.
    pub indices: Option<&'a [u64]>,
    /// The scores of the matches of each pair, `None` for a pair without, as [`Priors::scores`].
    pub scores: Option<&'a [Option<&'a [f64]>]>,
    /// A direction that both cameras of every pair know.
    pub direction: Option<KnownDirection>,
    /// Asked by every thread, often: once it says yes, the pairs without an answer have [`EstimateError::Cancelled`].
    pub is_cancelled: &'a (dyn Fn() -> bool + Sync),
    /// Told by every thread of each pair that it has worked on.
    pub done: &'a (dyn Fn() + Sync),
}

impl Default for Batch<'_> {
    /// All threads of the machine, no keys, no scores, no direction; nothing ends it early.
    fn default() -> Self {
        Self {
            threads: 0,
            indices: None,
            scores: None,
            direction: None,
            is_cancelled: &|| false,
            done: &|| (),
        }
    }
}

impl std::fmt::Debug for Batch<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { threads, indices, scores, direction, .. } = self;
        f.debug_struct("Batch")
            .field("threads", threads)
            .field("indices", indices)
            .field("scores", scores)
            .field("direction", direction)
            .finish_non_exhaustive()
    }
}

/// The estimate of every pair, in order: of the pair number `i` what [`estimate`](super::estimate) gives for it with the same
/// seed and with [`Options::index`] greater by `i`. A batch that begins with pair `k` of a larger one has an `index` greater by
/// `k`, and the same answers: nothing depends on how pairs are divided into batches or among threads.
///
/// With the feature `rayon` on `threads` threads, all of the machine's for zero; without it one after the other.
#[must_use]
pub fn estimate_batch(
    problems: &[Problem],
    options: &Options,
    threads: usize,
) -> Vec<Result<Estimate, EstimateError>> {
    Batch { threads, ..Batch::default() }.estimate(problems, options)
}

impl Batch<'_> {
    /// The estimate of every pair, in order, as [`estimate_batch`] finds it, where the key of a pair is added to
    /// [`Options::index`].
    ///
    /// # Panics
    /// Where there are fewer keys or scores than pairs.
    #[must_use]
    pub fn estimate(&self, problems: &[Problem], options: &Options) -> Vec<Result<Estimate, EstimateError>> {
        let count = problems.len();
        assert!(self.indices.is_none_or(|keys| keys.len() >= count), "fewer keys than pairs");
        assert!(self.scores.is_none_or(|scores| scores.len() >= count), "fewer scores than pairs");
        let problems: Vec<_> = problems.iter().enumerate().collect();
        let one = |(place, problem): (usize, &Problem)| self.one(place, problem, options);
        #[cfg(feature = "rayon")]
        if self.threads != 1
            && let Ok(pool) =
                rayon::ThreadPoolBuilder::new().num_threads(self.threads).stack_size(STACK_SIZE).build()
        {
            use rayon::prelude::*;
            return pool.install(|| problems.into_par_iter().with_max_len(1).map(one).collect());
        }
        problems.into_iter().map(one).collect()
    }

    /// The estimate of the pair at this place.
    fn one(&self, place: usize, problem: &Problem, options: &Options) -> Result<Estimate, EstimateError> {
        if (self.is_cancelled)() {
            return Err(EstimateError::Cancelled);
        }
        let key = self.indices.map_or(place as u64, |keys| keys[place]);
        let index = options.index.wrapping_add(key);
        let options = Options { focal_lengths: problem.focal_lengths, index, ..options.clone() };
        let scores = self.scores.and_then(|scores| scores[place]);
        let priors = Priors { scores, direction: self.direction, ..Priors::default() };
        let found = estimate_until(problem.matches, &options, &priors, self.is_cancelled);
        (self.done)();
        found
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use crate::simulate::{FOCAL_LENGTH, Scene, SceneOptions};

    const SEED: u64 = 0xba7c_0001;

    fn scenes(count: u64) -> Vec<Scene> {
        let options = SceneOptions { points: 80, noise_px: 0.5, ..SceneOptions::realistic() };
        (0..count).map(|k| Scene::generate(&options, SEED, k).unwrap()).collect()
    }

    fn problems(scenes: &[Scene]) -> Vec<Problem<'_>> {
        let focal_lengths = [[FOCAL_LENGTH; 2]; 2];
        scenes.iter().map(|scene| Problem { matches: &scene.matches, focal_lengths }).collect()
    }

    fn options() -> Options {
        Options { threshold: 1.5, ..Options::default() }
    }

    #[test]
    fn a_key_makes_an_answer_independent_of_the_other_pairs() {
        let scenes = scenes(4);
        let all = problems(&scenes);
        let keys = [11, 12, 13, 14];
        let whole = Batch { indices: Some(&keys), ..Batch::default() }.estimate(&all, &options());
        let part =
            Batch { indices: Some(&[13]), threads: 1, ..Batch::default() }.estimate(&all[2..3], &options());
        assert_eq!(part[0], whole[2]);
        assert!(whole.iter().all(Result::is_ok));
    }

    #[test]
    fn scores_are_those_of_their_pair() {
        let scenes = scenes(2);
        let all = problems(&scenes);
        let scores: Vec<f64> = (0..80).map(f64::from).collect();
        let found =
            Batch { scores: Some(&[None, Some(&scores)]), ..Batch::default() }.estimate(&all, &options());
        let alone = super::super::estimate_with(
            &scenes[1].matches,
            &Options { index: 1, focal_lengths: all[1].focal_lengths, ..options() },
            &Priors { scores: Some(&scores), ..Priors::default() },
        );
        assert_eq!((&found[0], &found[1]), (&estimate_batch(&all, &options(), 1)[0], &alone));
        let short = Batch { scores: Some(&[None, Some(&scores[1..])]), ..Batch::default() };
        assert!(matches!(short.estimate(&all, &options())[1], Err(EstimateError::Option { .. })));
    }

    #[test]
    fn a_batch_that_is_ended_keeps_what_it_has() {
        let scenes = scenes(6);
        let all = problems(&scenes);
        for threads in [1, 2] {
            let done = AtomicUsize::new(0);
            let batch = Batch {
                threads,
                is_cancelled: &|| done.load(Ordering::Relaxed) >= 2,
                done: &|| {
                    done.fetch_add(1, Ordering::Relaxed);
                },
                ..Batch::default()
            };
            let found = batch.estimate(&all, &options());
            let whole = estimate_batch(&all, &options(), 1);
            let cancelled = found.iter().filter(|f| **f == Err(EstimateError::Cancelled)).count();
            assert!((1..=4).contains(&cancelled), "{cancelled}");
            for (some, all) in found.iter().zip(&whole).filter(|(f, _)| f.is_ok()) {
                assert_eq!(some, all);
            }
        }
    }

    #[test]
    fn a_long_search_ends_when_asked() {
        let scenes = scenes(1);
        let asked = AtomicUsize::new(0);
        let endless = Options { min_iterations: usize::MAX / 2, max_iterations: usize::MAX / 2, ..options() };
        let found = estimate_until(&scenes[0].matches, &endless, &Priors::default(), &|| {
            asked.fetch_add(1, Ordering::Relaxed) > 10
        });
        assert_eq!(found, Err(EstimateError::Cancelled));
    }
}
