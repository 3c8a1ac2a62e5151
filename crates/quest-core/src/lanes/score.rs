//! The score of an essential matrix over many matches, and its inliers.
//!
//! With `r` the Sampson error of a match and `T` the threshold, a match is an inlier where `r < T`, and counts
//!
//! ```text
//! 1 − (r/T)²     Loss::Truncated         MSAC
//! (1 − r/T)²     Loss::Marginalised      MSAC, averaged over all thresholds up to T
//! ```
//!
//! and nothing elsewhere. On image planes, with the points `x1 = (u1, v1, 1)`, `x2 = (u2, v2, 1)`,
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

use super::instructions::Instructions;

mod sealed {
    pub trait Sealed {}
}

/// `f32` or `f64`.
pub trait Real: sealed::Sealed + Copy + PartialOrd + Into<f64> + 'static {
    /// The nearest number of this type.
    fn from_f64(x: f64) -> Self;
}

impl sealed::Sealed for f32 {}
impl sealed::Sealed for f64 {}

impl Real for f32 {
    #[expect(clippy::cast_possible_truncation, reason = "rounding is what it is for")]
    fn from_f64(x: f64) -> Self {
        x as f32
    }
}

impl Real for f64 {
    fn from_f64(x: f64) -> Self {
        x
    }
}

/// Matched points on two image planes, in structure of arrays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImageMatches<T> {
    columns: [Vec<T>; 4],
}

/// Matched unit bearings, in structure of arrays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BearingMatches<T> {
    columns: [Vec<T>; 6],
}

/// [`ImageMatches`] or [`BearingMatches`].
pub trait MatchColumns<T: Real>: sealed::Sealed {
    /// How many matches there are.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    #[doc(hidden)]
    fn squared_error(&self, e: &[f64; 9], k: usize) -> f64;
}

impl<T> sealed::Sealed for ImageMatches<T> {}
impl<T> sealed::Sealed for BearingMatches<T> {}

impl<T: Real> ImageMatches<T> {
    /// No matches.
    #[must_use]
    pub fn new() -> Self {
        Self { columns: [const { Vec::new() }; 4] }
    }

    /// Drops all matches, and keeps the memory.
    pub fn clear(&mut self) {
        self.columns.iter_mut().for_each(Vec::clear);
    }

    /// Appends a match of two points.
    pub fn push(&mut self, x1: [f64; 2], x2: [f64; 2]) {
        for (column, x) in self.columns.iter_mut().zip(x1.into_iter().chain(x2)) {
            column.push(T::from_f64(x));
        }
    }
}

impl<T: Real> BearingMatches<T> {
    /// No matches.
    #[must_use]
    pub fn new() -> Self {
        Self { columns: [const { Vec::new() }; 6] }
    }

    /// Drops all matches, and keeps the memory.
    pub fn clear(&mut self) {
        self.columns.iter_mut().for_each(Vec::clear);
    }

    /// Appends a match of two unit bearings.
    pub fn push(&mut self, x1: [f64; 3], x2: [f64; 3]) {
        for (column, x) in self.columns.iter_mut().zip(x1.into_iter().chain(x2)) {
            column.push(T::from_f64(x));
        }
    }
}

impl<T: Real> MatchColumns<T> for ImageMatches<T> {
    fn len(&self) -> usize {
        self.columns[0].len()
    }

    fn squared_error(&self, e: &[f64; 9], k: usize) -> f64 {
        let [x, y, u, v] = self.columns.each_ref().map(|c| c[k].into());
        let a = [0, 3, 6].map(|i| e[i] * x + e[i + 1] * y + e[i + 2]);
        let b = [0, 1].map(|j| e[j] * u + e[j + 3] * v + e[j + 6]);
        let r = u * a[0] + v * a[1] + a[2];
        r * r / (a[0] * a[0] + a[1] * a[1] + b[0] * b[0] + b[1] * b[1])
    }
}

impl<T: Real> MatchColumns<T> for BearingMatches<T> {
    fn len(&self) -> usize {
        self.columns[0].len()
    }

    fn squared_error(&self, e: &[f64; 9], k: usize) -> f64 {
        let [x, y, z, u, v, w] = self.columns.each_ref().map(|c| c[k].into());
        let a = [0, 3, 6].map(|i| e[i] * x + e[i + 1] * y + e[i + 2] * z);
        let b = [0, 1, 2].map(|j| e[j] * u + e[j + 3] * v + e[j + 6] * w);
        let r = u * a[0] + v * a[1] + w * a[2];
        let square = |s: [f64; 3]| s.iter().map(|x| x * x).sum::<f64>();
        r * r / (square(a) + square(b) - 2.0 * r * r)
    }
}

/// What a match within the threshold counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Loss {
    /// `1 − (r/T)²`.
    Truncated,
    /// `(1 − r/T)²`.
    #[default]
    Marginalised,
}

/// When the matches that are left are not looked at any more. Asked after every 64 matches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Stop {
    /// Never.
    #[default]
    Never,
    /// When the score cannot reach this any more, if every further match counted one.
    CannotReach(f64),
    /// When after `m` matches the score is below `m s − 3 √(m s (1 − s))`, with `s` this mean score of a match: a matrix as good
    /// as that is lost once in a few hundred times. For matches in random order.
    Unlikely(f64),
}

/// What [`Scorer::score`] finds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// The sum over the matches that were looked at: at most one each.
    pub sum: f64,
    /// How many those were; all of them unless it stopped early.
    pub visited: usize,
}

/// Scores essential matrices over many matches.
#[derive(Clone, Copy, Debug)]
pub struct Scorer {
    instructions: Instructions,
}

impl Scorer {
    /// A scorer with the fastest instructions of this processor.
    #[must_use]
    pub fn new() -> Self {
        Self { instructions: Instructions::best() }
    }

    /// A scorer with these instructions; `None` where the processor does not have them.
    #[must_use]
    pub fn with_instructions(instructions: Instructions) -> Option<Self> {
        instructions.is_available().then_some(Self { instructions })
    }

    /// The instructions that are used.
    #[must_use]
    pub fn instructions(&self) -> Instructions {
        self.instructions
    }

    /// The score of the matrix `e`, row by row, at a threshold in the unit of the points.
    #[must_use]
    pub fn score<T: Real>(
        &self,
        matches: &impl MatchColumns<T>,
        e: &[f64; 9],
        threshold: f64,
        loss: Loss,
        stop: Stop,
    ) -> Score {
        let mut score = Score { sum: 0.0, visited: 0 };
        for k in 0..matches.len() {
            let u2 = matches.squared_error(e, k) / (threshold * threshold);
            if u2 < 1.0 {
                score.sum += match loss {
                    Loss::Truncated => 1.0 - u2,
                    Loss::Marginalised => (1.0 - u2.sqrt()).powi(2),
                };
            }
            score.visited += 1;
            let m = score.visited as f64;
            let stopped = match stop {
                Stop::Never => false,
                Stop::CannotReach(best) => score.sum + (matches.len() as f64 - m) < best,
                Stop::Unlikely(s) => score.sum < m * s - 3.0 * (m * s * (1.0 - s)).sqrt(),
            };
            if score.visited % 64 == 0 && stopped {
                break;
            }
        }
        score
    }

    /// Sets bit `k % 64` of `mask[k / 64]` where match `k` is an inlier of the matrix `e`, clears all others, and returns how many
    /// there are. `mask` is made as long as it has to be.
    pub fn inliers<T: Real>(
        &self,
        matches: &impl MatchColumns<T>,
        e: &[f64; 9],
        threshold: f64,
        mask: &mut Vec<u64>,
    ) -> usize {
        mask.clear();
        mask.resize(matches.len().div_ceil(64), 0);
        let mut count = 0;
        for k in 0..matches.len() {
            if matches.squared_error(e, k) < threshold * threshold {
                mask[k / 64] |= 1 << (k % 64);
                count += 1;
            }
        }
        count
    }
}

impl Default for Scorer {
    fn default() -> Self {
        Self::new()
    }
}
