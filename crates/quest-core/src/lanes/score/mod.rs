//! The score of an essential matrix over many matches, and its inliers.
//!
//! With `r` the Sampson error of a match and `T` the threshold, a match is an inlier where `r < T`. What it then counts is its
//! [`SearchScore`]; elsewhere it counts nothing. On image planes, with the points `x1 = (u1, v1, 1)`, `x2 = (u2, v2, 1)`,
//!
//! ```text
//! r² = (x2ᵀ E x1)² / ((E x1)_1² + (E x1)_2² + (Eᵀ x2)_1² + (Eᵀ x2)_2²)
//! ```
//!
//! in the unit of the points. For pixels take the points relative to the principal points and in place of `E` the matrix
//! `F = diag(1/f2, 1/f2, 1) E diag(1/f1, 1/f1, 1)`: `r` is then in pixels, exactly. On unit bearings `b`, `c`
//!
//! ```text
//! r² = (bᵀ E c)² / (|E c|² + |Eᵀ b|² − 2 (bᵀ E c)²)
//! ```
//!
//! in radians. The scale and the sign of `E` do not matter.

mod columns;
mod kernel;
mod search_score;

pub use columns::{BearingMatches, ImageMatches, MatchColumns, Real};
#[expect(deprecated, reason = "the old name stays for one version")]
pub use search_score::Loss;
pub(crate) use search_score::WithLoss;
pub use search_score::{SearchScore, UnknownLoss};

use columns::BLOCK;
use kernel::{Inliers, Sum};

use crate::algebra::vectors::instructions::{Instructions, Token};

/// When to stop before the last match. It is asked after every 64 matches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Stop {
    /// Never.
    #[default]
    Never,
    /// When the score could not reach this even if every further match counted one.
    CannotReach(f64),
    /// When the score after `m` matches is below `m s − 3 √(m s (1 − s))`, with `s` this mean score of a match. A matrix as good as
    /// that is lost once in a few hundred times. The matches must be in random order.
    Unlikely(f64),
}

/// What [`Scorer::score`] finds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// The sum over the matches that were looked at. Each of them counts at most one.
    pub sum: f64,
    /// How many those were; all of them unless it stopped early.
    pub visited: usize,
}

/// Scores essential matrices over many matches.
#[derive(Clone, Copy, Debug)]
pub struct Scorer {
    token: Token,
}

impl Scorer {
    /// A scorer with the fastest instructions of this processor.
    #[must_use]
    pub fn new() -> Self {
        Self { token: Token::chosen() }
    }

    /// A scorer with these instructions; `None` where the processor does not have them.
    #[must_use]
    pub fn with_instructions(instructions: Instructions) -> Option<Self> {
        Token::new(instructions).map(|token| Self { token })
    }

    /// The instructions that are used.
    #[must_use]
    pub fn instructions(&self) -> Instructions {
        self.token.instructions()
    }

    /// The score of the matrix `e`, row by row, at a threshold in the unit of the points.
    ///
    /// It is exact to the rounding of `T`. With `f32` and AVX-512 the relative error of a residual is at most 5e-6.
    #[must_use]
    pub fn score<T: Real>(
        &self,
        matches: &impl MatchColumns<T>,
        e: &[f64; 9],
        threshold: f64,
        loss: SearchScore,
        stop: Stop,
    ) -> Score {
        T::run(self.token, Sum { matches, e: e.map(T::from_f64), threshold, loss, stop })
    }

    /// Sets bit `k % 64` of `mask[k / 64]` where match `k` is an inlier of the matrix `e`, and clears all other bits. `mask` is
    /// made as long as it has to be. Returns the number of inliers.
    pub fn inliers<T: Real>(
        &self,
        matches: &impl MatchColumns<T>,
        e: &[f64; 9],
        threshold: f64,
        mask: &mut Vec<u64>,
    ) -> usize {
        mask.clear();
        mask.resize(matches.len().div_ceil(BLOCK), 0);
        T::run(self.token, Inliers { matches, e: e.map(T::from_f64), threshold, mask })
    }
}

impl Default for Scorer {
    fn default() -> Self {
        Self::new()
    }
}

impl Stop {
    /// Whether to stop after `visited` of `all` matches with the score `sum`.
    fn is_reached(self, sum: f64, visited: usize, all: usize) -> bool {
        match self {
            Self::Never => false,
            Self::CannotReach(best) => sum + ((all - visited) as f64) < best,
            Self::Unlikely(mean) => {
                let m = visited as f64;
                sum < m * mean - 3.0 * (m * mean * (1.0 - mean)).sqrt()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::test::{available, scene};

    /// The score as the head of the module defines it.
    fn defined(errors: &[f64], threshold: f64, loss: SearchScore) -> f64 {
        let count = |r: &f64| 1.0 - loss.loss(r / threshold);
        errors.iter().filter(|r| **r < threshold).map(count).sum()
    }

    #[test]
    fn scores_and_masks_are_those_of_the_definition() {
        // 131 matches: two whole blocks and a part of one.
        let scene = scene(131, 0.75, 5);
        let e = scene.truth.essential();
        let rows: [f64; 9] = std::array::from_fn(|i| e[(i / 3, i % 3)]);
        let (mut image, mut image_f32) = (ImageMatches::<f64>::new(), ImageMatches::<f32>::new());
        let (mut bearings, mut bearings_f32) = (BearingMatches::<f64>::new(), BearingMatches::<f32>::new());
        let (mut on_plane, mut on_sphere) = (Vec::new(), Vec::new());
        for m in &scene.matches {
            let (a, b) = (m.bearing1(), m.bearing2());
            bearings.push((*a).into(), (*b).into());
            bearings_f32.push((*a).into(), (*b).into());
            on_sphere.push(scene.truth.sampson_error(m));
            let (a, b) = (a / a.z, b / b.z);
            image.push([a.x, a.y], [b.x, b.y]);
            image_f32.push([a.x, a.y], [b.x, b.y]);
            let (line2, line1) = (e * a, e.tr_mul(&b));
            let gradient = line2.xy().norm_squared() + line1.xy().norm_squared();
            on_plane.push(b.dot(&line2).abs() / gradient.sqrt());
        }
        let threshold = 1e-3;
        for instructions in available() {
            let scorer = Scorer::with_instructions(instructions).unwrap();
            for loss in SearchScore::CHOICES {
                let plane = defined(&on_plane, threshold, loss);
                let sphere = defined(&on_sphere, threshold, loss);
                assert!(plane > 20.0 && plane < 120.0, "the threshold has to part the matches");
                // Rounding of r is 1e-16, or 1e-7 · |x|, against the threshold.
                let close = |found: Score, expected: f64, tolerance: f64| {
                    assert!(
                        (found.sum - expected).abs() < tolerance,
                        "{instructions:?} {found:?} {expected}"
                    );
                    assert_eq!(found.visited, 131);
                };
                close(scorer.score(&image, &rows, threshold, loss, Stop::Never), plane, 1e-9);
                close(scorer.score(&bearings, &rows, threshold, loss, Stop::Never), sphere, 1e-9);
                close(scorer.score(&image_f32, &rows, threshold, loss, Stop::Never), plane, 0.2);
                close(scorer.score(&bearings_f32, &rows, threshold, loss, Stop::Never), sphere, 0.2);
            }
            let mut mask = vec![u64::MAX; 7];
            let count = scorer.inliers(&image, &rows, threshold, &mut mask);
            let inliers = |k: usize| mask[k / 64] >> (k % 64) & 1 == 1;
            assert_eq!(mask.len(), 3);
            assert!((0..131).all(|k| inliers(k) == (on_plane[k] < threshold)));
            assert_eq!(count, on_plane.iter().filter(|r| **r < threshold).count());
            assert_eq!(mask[2] >> 3, 0, "no bit beyond the last match");
            assert_eq!(scorer.inliers(&bearings, &rows, threshold, &mut mask), {
                on_sphere.iter().filter(|r| **r < threshold).count()
            });
        }
    }

    #[test]
    fn what_cannot_win_is_left_early() {
        let scene = scene(1000, 0.0, 6);
        let mut matches = ImageMatches::<f64>::new();
        for m in &scene.matches {
            let (a, b) = (m.bearing1() / m.bearing1().z, m.bearing2() / m.bearing2().z);
            matches.push([a.x, a.y], [b.x, b.y]);
        }
        let right = scene.truth.essential().transpose();
        let right: [f64; 9] = right.as_slice().try_into().unwrap();
        let wrong = [0.0, -0.3, 0.2, 0.3, 0.1, -0.9, -0.2, 0.9, 0.4];
        let scorer = Scorer::new();
        let visited = |e, stop| scorer.score(&matches, e, 1e-3, SearchScore::Truncated, stop).visited;
        for stop in [Stop::CannotReach(999.0), Stop::Unlikely(0.9)] {
            assert_eq!((visited(&right, stop), visited(&wrong, stop)), (1000, 64), "{stop:?}");
        }
        // Out of reach only when fewer are left than are missing.
        assert_eq!(visited(&wrong, Stop::CannotReach(500.0)), 512);
        assert_eq!(visited(&wrong, Stop::Unlikely(0.0)), 1000);
        assert_eq!(
            scorer.score(&ImageMatches::<f32>::new(), &right, 1.0, SearchScore::Truncated, Stop::Never),
            { Score { sum: 0.0, visited: 0 } }
        );
    }

    #[test]
    fn numbers_that_are_none_are_no_inliers() {
        for instructions in available() {
            let scorer = Scorer::with_instructions(instructions).unwrap();
            let mut matches = ImageMatches::<f32>::new();
            matches.push([f64::NAN, 0.0], [0.0, 0.0]);
            matches.push([0.1, 0.2], [f64::INFINITY, 0.0]);
            matches.push([0.1, 0.2], [0.3, 0.2]);
            // A shift along x: only the last match has the same y twice.
            let e = [0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0];
            let mut mask = Vec::new();
            assert_eq!((scorer.inliers(&matches, &e, 0.1, &mut mask), mask), (1, vec![4]));
            let score = scorer.score(&matches, &e, 0.1, SearchScore::Marginalised, Stop::Never);
            assert!((score.sum - 1.0).abs() < 1e-6);
        }
    }
}
