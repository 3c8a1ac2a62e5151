//! From the rotations that a solver finds to the ranked list of candidates: what all solvers share.

use nalgebra::{UnitQuaternion, Vector3};

use super::Kinds;
use super::aligned::{Alignment, Gram};
use super::motion::{Motion, Outcome};
use crate::degeneracy::{all_parallel, diagnose};
use crate::feasibility::in_front;
use crate::structure::{Completed, translation_direction, with_depths};
use crate::{Candidate, CandidateKind, Candidates, Correspondence, Degeneracy, RelativePose};

/// Solutions closer than this, in rotation and in direction of translation (radians), are one.
const SAME: f64 = 1e-6;

/// The same for local minima over many matches, which no two of a different origin reach in the same place.
const SAME_MINIMUM: f64 = 1e-3;

/// Residuals below this are zero: rounding, not quality, and must not decide the order.
const ROUNDING: f64 = 1e-12;

/// Motions found so far, without duplicates.
#[derive(Clone, Debug)]
pub(crate) struct Shortlist {
    items: [Option<(CandidateKind, Motion)>; Candidates::CAPACITY],
    len: usize,
    /// Motions closer than this are one.
    same: f64,
}

impl Shortlist {
    pub(crate) fn new() -> Self {
        Self { items: [None; Candidates::CAPACITY], len: 0, same: SAME }
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &(CandidateKind, Motion)> {
        self.items[..self.len].iter().flatten()
    }

    /// How many there are of a kind.
    pub(crate) fn count(&self, kind: CandidateKind) -> usize {
        self.iter().filter(|(k, _)| *k == kind).count()
    }

    /// Drops all but one kind.
    pub(crate) fn retain(&mut self, kind: CandidateKind) {
        let all = std::mem::replace(self, Self::new());
        for (_, motion) in all.iter().filter(|(k, _)| *k == kind) {
            self.push(kind, *motion);
        }
    }

    /// Adds a motion unless it is there already. A duplicate counts as exact if either of the two is.
    pub(crate) fn push(&mut self, kind: CandidateKind, motion: Motion) {
        for (other_kind, other) in self.items[..self.len].iter_mut().flatten() {
            if other.is_close(&motion, self.same) {
                if kind == CandidateKind::Exact && *other_kind != CandidateKind::Exact {
                    (*other_kind, *other) = (kind, motion);
                }
                return;
            }
        }
        self.append(kind, motion);
    }

    fn append(&mut self, kind: CandidateKind, motion: Motion) {
        if self.len < self.items.len() {
            self.items[self.len] = Some((kind, motion));
            self.len += 1;
        }
    }

    /// Adds the two motions of an essential matrix.
    pub(crate) fn push_pair(&mut self, kind: CandidateKind, motion: Motion) {
        let before = self.len;
        self.push(kind, motion);
        // Either both rotations are there already, or neither.
        if self.len > before {
            self.append(kind, motion.twisted());
        }
    }

    /// Adds the solution of five constraints near `motion`, and the twisted one beside it; a start from which
    /// Newton's iteration does not converge is kept as it is, and reported as `None`: it stands for a
    /// complex solution that happens to be nearly real.
    pub(crate) fn push_solution(
        &mut self,
        start: Motion,
        alignment: &Alignment,
        matches: &[Correspondence; 5],
    ) -> Option<Motion> {
        let mut motion = start;
        match motion.solve_five(alignment, matches) {
            Outcome::Converged => {
                self.push_pair(CandidateKind::Exact, motion);
                Some(motion)
            }
            Outcome::Stalled => {
                self.push(CandidateKind::FromComplex, start);
                None
            }
        }
    }

    /// The local minima of the squared Sampson errors over all matches that these motions lead to.
    pub(crate) fn refined(&self, gram: &Gram, matches: &[Correspondence]) -> Self {
        let mut coarse = Self::new();
        for (kind, motion) in self.iter() {
            let mut motion = *motion;
            motion.minimise_gram(gram, 30);
            // Twisted partners have the same errors.
            if !coarse.contains(&motion.twisted()) {
                coarse.push(*kind, motion);
            }
        }
        // Of two that end in the same place the better one is to stay.
        let cost =
            |item: &Option<(CandidateKind, Motion)>| item.map_or(0.0, |(_, motion)| gram.cost(&motion));
        coarse.items[..coarse.len].sort_unstable_by(|x, y| cost(x).total_cmp(&cost(y)));
        let mut fine = Self { same: SAME_MINIMUM, ..Self::new() };
        for (kind, motion) in coarse.iter() {
            let mut motion = *motion;
            motion.minimise_sampson(matches, f64::INFINITY, 30);
            fine.push_pair(*kind, motion);
        }
        fine
    }

    fn contains(&self, motion: &Motion) -> bool {
        self.iter().any(|(_, other)| other.is_close(motion, self.same))
    }

    /// Fills `out` with translations, depths, residuals and the order of [`Candidates`].
    pub(crate) fn write(&self, kinds: Kinds, matches: &[Correspondence], out: &mut Candidates) {
        for (kind, motion) in self.iter() {
            if kinds == Kinds::All || *kind == CandidateKind::Exact {
                out.push(candidate(*kind, motion.q_21, &motion.direction, matches));
            }
        }
        rank(out);
    }
}

/// A candidate with its translation's length and sign, its residual and its points in front.
fn candidate(
    kind: CandidateKind,
    q_21: UnitQuaternion<f64>,
    direction: &Vector3<f64>,
    matches: &[Correspondence],
) -> Candidate {
    let Completed { pose, in_front, residual } = with_depths(q_21, direction, matches);
    Candidate { kind, pose, residual, in_front }
}

/// The rotation-only candidate: the best alignment, and the translation that fits it best.
pub(crate) fn rotation_only(alignment: &Alignment, matches: &[Correspondence]) -> Candidate {
    let direction = translation_direction(&alignment.q0_21, matches);
    candidate(CandidateKind::RotationOnly, alignment.q0_21, &direction, matches)
}

/// The one candidate of an exact pure rotation, unless the matches leave that undetermined too.
pub(crate) fn pure_rotation(alignment: &Alignment, matches: &[Correspondence], out: &mut Candidates) {
    if all_parallel(matches) {
        return out.set_degeneracy(diagnose(matches));
    }
    let pose = RelativePose::new(alignment.q0_21, Vector3::zeros());
    let (kind, residual) = (CandidateKind::RotationOnly, pose.residual(matches));
    let in_front = in_front(&pose, matches);
    out.set_degeneracy(Degeneracy::PureRotation);
    out.push(Candidate { kind, pose, residual, in_front });
}

/// Best first: most points in front, then the smallest residual, then the smallest rotation.
pub(crate) fn rank(out: &mut Candidates) {
    let key = |c: &Candidate| (c.residual.max(ROUNDING), -c.pose.wxyz()[0]);
    out.as_mut_slice().sort_unstable_by(|x, y| {
        let ((r, w), (s, v)) = (key(x), key(y));
        y.in_front.cmp(&x.in_front).then(r.total_cmp(&s)).then(w.total_cmp(&v))
    });
}
