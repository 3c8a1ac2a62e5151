//! What is known of the matches that agree with a pose by chance; [`chance_inliers`](crate::robust::conclude::chance_inliers) finds it out.

use crate::robust::conclude::inverse_depth::{InverseDepth, Usual};

/// Depths within this multiple of `γ` are usual.
pub(crate) const USUAL: f64 = 3.0;

/// What is known of the matches that agree with a pose by chance.
#[derive(Clone, Debug)]
pub(crate) struct ByChance {
    /// Those that are recognised: they are within the threshold, and no inliers.
    pub(crate) matches: Vec<u32>,
    /// Where depths are usual, if that was asked.
    pub(crate) usual: Option<Usual>,
    /// How many points of unusual depths there are, as a share of what `p(ρ)` says.
    pub(crate) believed: f64,
}

impl ByChance {
    /// Nothing is known.
    pub(crate) fn unknown() -> Self {
        Self { matches: Vec::new(), usual: None, believed: 1.0 }
    }

    /// How likely a false match of this depth stays among the inliers, with noise of so many pixels.
    pub(crate) fn stays(&self, depth: &InverseDepth, sigma: f64) -> f64 {
        let is_unusual = self.usual.is_some_and(|usual| usual.distance(depth, sigma) > USUAL);
        if is_unusual { self.believed } else { 1.0 }
    }
}
