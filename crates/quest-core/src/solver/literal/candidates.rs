//! From matches to quartics and from quaternions to candidates: what both of the paper's algorithms share.
//!
//! For five matches a real solution is brought to its last digits by Newton's iteration, as for every published method
//! here; the paper stops before. Translation and depths are those of section 8.

use nalgebra::{Complex, Quaternion, UnitQuaternion};

use super::constraints::Constraints;
use crate::degeneracy::diagnose;
use crate::quaternion::monomials::Quartic;
use crate::solver::Kinds;
use crate::solver::published::five_point;
use crate::solver::shared::essential::real_part;
use crate::solver::shared::motion::Motion;
use crate::solver::shared::newton_pair::solution;
use crate::solver::shared::parallax_frame::Alignment;
use crate::solver::shared::shortlist::{Shortlist, is_answered};
use crate::structure::translation_direction;
use crate::{CandidateKind, Candidates, Correspondence, Degeneracy};

/// The smallest number of matches.
pub(super) const MIN_MATCHES: usize = 5;

/// A solution of an algorithm: a complex quaternion of any scale, and whether its eigenvalue is real.
pub(super) type Found = ([Complex<f64>; 4], bool);

/// What one of the paper's algorithms does with the quartics (39).
pub(super) trait Steps {
    /// Hands over the solutions that it finds for so many matches; whether they could be computed.
    fn solve(&mut self, matches: usize, quartics: &[Quartic], push: &mut dyn FnMut(Found)) -> bool;
}

/// An algorithm with the memory that it works in.
#[derive(Default)]
pub(super) struct Driver<S> {
    constraints: Constraints,
    quartics: Vec<Quartic>,
    steps: S,
}

impl<S: Steps> Driver<S> {
    /// Fills `out` with the solutions; bad input is answered with its reason.
    pub(super) fn solve(&mut self, kinds: Kinds, matches: &[Correspondence], out: &mut Candidates) {
        if is_answered(MIN_MATCHES, matches, out) {
            return;
        }
        if let Err(degeneracy) = five_point::null_space(matches) {
            return out.set_degeneracy(degeneracy);
        }
        self.constraints.quartics(matches, &mut self.quartics);
        let mut shortlist = Shortlist::new();
        let mut push = |found| push(&mut shortlist, found, matches);
        if !self.steps.solve(matches.len(), &self.quartics, &mut push) {
            return out.set_degeneracy(match diagnose(matches) {
                Degeneracy::TooFewMatches => Degeneracy::RankDeficient,
                reason => reason,
            });
        }
        shortlist.write(kinds.without_plane(), matches, out);
    }
}

fn push(shortlist: &mut Shortlist, (q, is_real): Found, matches: &[Correspondence]) {
    let [w, x, y, z] = if is_real { q.map(|c| c.re) } else { real_part(q) };
    let q_21 = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    if !q_21.coords.sum().is_finite() {
        return;
    }
    let motion = Motion { q_21, direction: translation_direction(&q_21, matches) };
    match <&[Correspondence; 5]>::try_from(matches) {
        Ok(five) if is_real => {
            let aligned = Alignment::with_rotation(q_21, five);
            match solution(&motion, &aligned, five) {
                Some(motion) => shortlist.push(CandidateKind::Exact, motion),
                None => shortlist.push(CandidateKind::FromComplex, motion),
            }
        }
        _ if is_real => shortlist.push(CandidateKind::Exact, motion),
        _ => shortlist.push(CandidateKind::FromComplex, motion),
    }
}
