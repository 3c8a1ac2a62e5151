//! Where candidate poses come from.

use crate::solver::{Kinds, SolverName};
use crate::{Candidates, Correspondence};

/// A source of candidate poses: a solver, a robust estimator, another sensor.
///
/// The estimator asks it at the start, and when it has lost the pose.
pub trait PoseSource {
    /// The smallest number of matches it works with.
    fn min_matches(&self) -> usize;

    /// Fills `out` with candidates for the current image (2) relative to the goal (1), best first. Their scale is free.
    fn candidates(&mut self, matches: &[Correspondence], out: &mut Candidates);
}

/// A solver, with all kinds of candidates.
impl PoseSource for SolverName {
    fn min_matches(&self) -> usize {
        self.info().min_matches
    }

    fn candidates(&mut self, matches: &[Correspondence], out: &mut Candidates) {
        self.solve(Kinds::All, matches, out);
    }
}
