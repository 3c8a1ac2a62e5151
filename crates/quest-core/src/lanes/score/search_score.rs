//! What a match counts in the search: a [`SearchScore`] stands in this file alone.
//!
//! With `u = r/T`, the residual in units of the threshold, a match counts `1 − ρ(u)` where `u < 1`, and nothing elsewhere:
//!
//! ```text
//! ρ(u) = u²          Truncated         MSAC (P. H. S. Torr, A. Zisserman, MLESAC, CVIU 2000)
//! ρ(u) = 2u − u²     Marginalised      the same averaged over all thresholds up to T, so that it does not depend on one of them
//! ```
//!
//! The second is the idea of MAGSAC (D. Barath, J. Matas, J. Noskova, CVPR 2019) in one dimension.

use std::str::FromStr;

use super::columns::Real;
use crate::algebra::vectors::lane::Float;

/// What a match within the threshold counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum SearchScore {
    /// `1 − (r/T)²`.
    Truncated,
    /// `(1 − r/T)²`.
    #[default]
    Marginalised,
}

impl SearchScore {
    /// Every choice, the default first.
    pub const CHOICES: [Self; 2] = [Self::Marginalised, Self::Truncated];

    /// The name on the command line, in Python and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Truncated => "truncated",
            Self::Marginalised => "marginalised",
        }
    }

    /// `ρ(u)` of one residual, which is 1 from `u = 1` on.
    #[inline(always)]
    pub(crate) fn loss(self, u: f64) -> f64 {
        let u = u.abs().min(1.0);
        match self {
            Self::Truncated => u * u,
            Self::Marginalised => u * (2.0 - u),
        }
    }

    /// Runs a loop with this loss, compiled for it: a choice in the loop would cost more than the loss.
    #[inline(always)]
    pub(crate) fn run<W: WithLoss>(self, work: W) -> W::Output {
        match self {
            Self::Truncated => work.run(|u| Self::Truncated.loss(u)),
            Self::Marginalised => work.run(|u| Self::Marginalised.loss(u)),
        }
    }

    /// The same for vectors of residuals.
    #[inline(always)]
    pub(super) fn run_vectors<K: WithWorth>(self, work: K) -> K::Output {
        match self {
            Self::Truncated => work.run::<Truncated>(),
            Self::Marginalised => work.run::<Marginalised>(),
        }
    }
}

/// A loop over residuals.
pub(crate) trait WithLoss {
    /// What it comes to.
    type Output;

    /// Runs with this loss `ρ(u)`.
    fn run(self, loss: impl Fn(f64) -> f64) -> Self::Output;
}

/// A loop over vectors of residuals.
pub(super) trait WithWorth {
    /// What it comes to.
    type Output;

    /// Runs with what an inlier counts.
    fn run<W: Worth>(self) -> Self::Output;
}

/// What an inlier counts, by the threshold `T`, its error `e` and the square of its gradient `g²`, with `T u = e/g`.
///
/// This is a type and no closure: a loop that calls a closure may be compiled for the instructions that every processor has.
pub(super) trait Worth {
    fn of_inlier<T: Real, V: Float<T>>(threshold: V, error: V, square_gradient: V) -> V;
}

/// `T² (1 − u²)`.
struct Truncated;

/// `T² (1 − u)²`.
struct Marginalised;

impl Worth for Truncated {
    #[inline(always)]
    fn of_inlier<T: Real, V: Float<T>>(threshold: V, error: V, square_gradient: V) -> V {
        threshold * threshold - error * error / square_gradient
    }
}

impl Worth for Marginalised {
    #[inline(always)]
    fn of_inlier<T: Real, V: Float<T>>(threshold: V, error: V, square_gradient: V) -> V {
        let rest = threshold - error.abs() * square_gradient.inverse_sqrt();
        rest * rest
    }
}

/// The name of [`SearchScore`] before version 0.2.
#[deprecated(since = "0.1.0", note = "it is called `SearchScore` now")]
pub type Loss = SearchScore;

/// No search score has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("loss is {found:?}, expected one of {}", SearchScore::CHOICES.map(SearchScore::name).join(", "))]
pub struct UnknownLoss {
    /// The name that was asked for.
    pub found: String,
}

impl FromStr for SearchScore {
    type Err = UnknownLoss;

    fn from_str(name: &str) -> Result<Self, UnknownLoss> {
        let found = Self::CHOICES.into_iter().find(|loss| loss.name() == name);
        found.ok_or_else(|| UnknownLoss { found: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use crate::lanes::{ImageMatches, Scorer, SearchScore, Stop};

    #[test]
    fn one_number_and_the_vectors_have_the_same_formula() {
        // A shift along x takes a point to its line y2 = y1; the residual is half of the difference, in both views.
        let e = [0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0];
        let kernel = Scorer::new();
        for kind in SearchScore::CHOICES {
            for k in 0..=120 {
                let u = f64::from(k) / 100.0;
                let mut matches = ImageMatches::<f64>::new();
                matches.push([0.1, 0.2], [0.4, 0.2 + u * 2.0_f64.sqrt() * 1e-3]);
                let found = kernel.score(&matches, &e, 1e-3, kind, Stop::Never);
                assert!((1.0 - found.sum - kind.loss(u)).abs() < 1e-9, "{kind:?} {u}: {found:?}");
            }
        }
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        for kind in SearchScore::CHOICES {
            assert_eq!(kind.name().parse(), Ok(kind));
        }
        assert_eq!(SearchScore::CHOICES[0], SearchScore::default());
        assert!("huber".parse::<SearchScore>().unwrap_err().to_string().contains("truncated"));
    }
}
