//! From the rotations that a solver finds to the ranked list of candidates: what all solvers share.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::algebra::vectors::columns::MotionColumns;
use crate::algebra::vectors::lane::MAX_F64_LANES;
use crate::algebra::vectors::two::Two;
use crate::degeneracy::{all_parallel, diagnose};
use crate::feasibility::in_front;
use crate::solver::Kinds;
use crate::solver::shared::descent_pair;
use crate::solver::shared::gram::Gram;
use crate::solver::shared::motion::{COARSE, FINE, Motion, Until};
use crate::solver::shared::newton_pair::{TwoMotions, solution};
use crate::solver::shared::parallax_frame::Alignment;
use crate::structure::{Completed, CompletedColumns, many_with_depths, with_depths, with_noise};
use crate::{Candidate, CandidateKind, Candidates, Correspondence, Degeneracy, RelativePose};

/// Solutions closer than this, in rotation and in direction of translation (radians), are one.
const SAME: f64 = 1e-6;

/// The same for local minima over many matches, which no two of a different origin reach in the same place.
const SAME_MINIMUM: f64 = 1e-3;

/// Up to so many matches a step on the Sampson errors themselves costs half of one on their [`Gram`] matrix, and is the better
/// one: little noise is averaged.
const FEW: usize = 8;

/// How far behind the best a motion may be and still be kept.
struct Allowance {
    /// The logarithm of its likelihood.
    likelihood: f64,
    /// The factor between the costs that is granted in any case.
    factor: f64,
    /// What a match may cost without counting: the square of an angle over the parallax.
    unresolved: f64,
}

/// A start is not at its minimum yet.
const STARTS: Allowance = Allowance { likelihood: 30.0, factor: 1e3, unresolved: 1e-7 };

/// A coarse minimum is not one of the Sampson errors yet.
const MINIMA: Allowance = Allowance { likelihood: 15.0, factor: 3.0, unresolved: 1e-10 };

/// Residuals below this are zero: rounding, not quality, and must not decide the order.
const ROUNDING: f64 = 1e-12;

/// One motion, or the two of an essential matrix: the motion and its twisted partner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    /// Where it comes from.
    pub(crate) kind: CandidateKind,
    /// The motion.
    pub(crate) motion: Motion,
    is_pair: bool,
}

impl Item {
    /// How many motions it stands for.
    fn motions(&self) -> usize {
        1 + usize::from(self.is_pair)
    }

    /// Whether the essential matrix or the one motion of `other` is here as well.
    #[inline]
    fn covers(&self, other: &Self, tolerance: f64) -> bool {
        let (old, new) = (&self.motion, &other.motion);
        old.has_direction_of(new, tolerance)
            && (old.has_rotation_of(new, tolerance)
                || (self.is_pair || other.is_pair) && old.twisted().has_rotation_of(new, tolerance))
    }
}

/// Motions found so far, without duplicates.
#[derive(Clone, Debug)]
pub(crate) struct Shortlist {
    /// Optional, as nothing has to be written of those that are not there.
    items: [Option<Item>; Candidates::CAPACITY],
    len: usize,
    /// Motions closer than this are one.
    same: f64,
}

impl Shortlist {
    pub(crate) fn new() -> Self {
        Self { items: [None; Candidates::CAPACITY], len: 0, same: SAME }
    }

    /// For solutions of five matches, which with little parallax differ by more than [`SAME`] where they are found twice.
    pub(crate) fn of_five(alignment: &Alignment) -> Self {
        Self { same: SAME.max(alignment.direction_resolution()), ..Self::new() }
    }

    /// The motions, of two twisted partners one.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Item> {
        self.items[..self.len].iter().flatten()
    }

    /// How many motions there are of a kind.
    pub(crate) fn count(&self, kind: CandidateKind) -> usize {
        self.iter().filter(|item| item.kind == kind).map(Item::motions).sum()
    }

    /// Drops all but one kind.
    pub(crate) fn retain(&mut self, kind: CandidateKind) {
        self.retain_where(|item| item.kind == kind);
    }

    fn retain_where(&mut self, keep: impl Fn(&Item) -> bool) {
        let mut kept = 0;
        for k in 0..self.len {
            if self.items[k].as_ref().is_some_and(&keep) {
                self.items[kept] = self.items[k];
                kept += 1;
            }
        }
        self.len = kept;
    }

    /// Adds a motion unless it is there already.
    pub(crate) fn push(&mut self, kind: CandidateKind, motion: Motion) {
        self.push_item(&Item { kind, motion, is_pair: false });
    }

    /// Adds the two motions of an essential matrix unless they are there already.
    pub(crate) fn push_pair(&mut self, kind: CandidateKind, motion: Motion) {
        self.push_item(&Item { kind, motion, is_pair: true });
    }

    /// A duplicate counts as exact if either of the two is.
    fn push_item(&mut self, new: &Item) {
        let same = self.same;
        let replaces = |old: &Item| new.kind == CandidateKind::Exact && old.kind != CandidateKind::Exact;
        if self.iter().any(|old| !replaces(old) && old.covers(new, same)) {
            return;
        }
        if self.iter().any(replaces) {
            self.retain_where(|old| !(replaces(old) && old.covers(new, same)));
        }
        if let Some(place) = self.items.get_mut(self.len) {
            *place = Some(*new);
            self.len += 1;
        }
    }

    /// Adds the solution of five constraints near `start`, and the twisted one beside it; a start from which
    /// Newton's iteration does not converge is kept as it is, and reported as `None`: it stands for a
    /// complex solution that happens to be nearly real.
    pub(crate) fn push_solution(
        &mut self,
        start: Motion,
        alignment: &Alignment,
        matches: &[Correspondence; 5],
    ) -> Option<Motion> {
        let solution = solution(&start, alignment, matches);
        match solution {
            Some(motion) => self.push_pair(CandidateKind::Exact, motion),
            None => self.push(CandidateKind::FromComplex, start),
        }
        solution
    }

    /// The same for the first `count` of two starts. Whether all of them led to a solution.
    pub(crate) fn push_solutions(
        &mut self,
        starts: &TwoMotions,
        count: usize,
        alignment: &Alignment,
        matches: &[Correspondence; 5],
    ) -> bool {
        let mut complete = true;
        for (k, solution) in starts.solutions(alignment, matches).into_iter().enumerate().take(count) {
            complete &= self.push_solved(|| starts.apart()[k], solution);
        }
        complete
    }

    /// Adds a solution, or its start where it has led to none. Whether there is one.
    pub(crate) fn push_solved(
        &mut self,
        start: impl FnOnce() -> Option<Motion>,
        solution: Option<Motion>,
    ) -> bool {
        if let Some(motion) = solution {
            self.push_pair(CandidateKind::Exact, motion);
        } else if let Some(start) = start() {
            self.push(CandidateKind::FromComplex, start);
        }
        solution.is_some()
    }

    /// Adds the solutions near two real essential matrices.
    pub(crate) fn push_essential(
        &mut self,
        pair: &[Matrix3<f64>; 2],
        alignment: &Alignment,
        matches: &[Correspondence; 5],
    ) {
        let two = std::array::from_fn(|i| std::array::from_fn(|j| Two::new(pair.map(|e| e[(i, j)]))));
        for solution in TwoMotions::of_essential(&two).solutions(alignment, matches).into_iter().flatten() {
            self.push_pair(CandidateKind::Exact, solution);
        }
    }

    /// The local minima of the summed squares of the Sampson errors over all matches that these motions lead to, and the
    /// smallest sum.
    pub(crate) fn refined(&self, gram: &Gram, matches: &[Correspondence]) -> (Self, f64) {
        let starts = self.plausible(gram, &STARTS);
        let coarse = if matches.len() <= FEW {
            starts.descended(matches, &COARSE).0
        } else {
            let mut coarse = Self { same: SAME_MINIMUM, ..Self::new() };
            for &Item { kind, mut motion, .. } in starts.iter() {
                gram.minimise(&mut motion);
                coarse.push_pair(kind, motion);
            }
            coarse
        };
        coarse.plausible(gram, &MINIMA).descended(matches, &FINE)
    }

    /// Where descents on the Sampson errors lead, and the smallest sum of their squares.
    fn descended(&self, matches: &[Correspondence], until: &Until) -> (Self, f64) {
        let (mut minima, mut smallest) = (Self { same: SAME_MINIMUM, ..Self::new() }, f64::INFINITY);
        let mut items = self.iter();
        while let Some(first) = items.next() {
            let second = items.next();
            let mut motions = [first.motion, second.unwrap_or(first).motion];
            let costs = if second.is_none() {
                [motions[0].minimise_sampson(matches, f64::INFINITY, until); 2]
            } else {
                descent_pair::minimise_sampson(&mut motions, matches, until)
            };
            for ((item, motion), cost) in [Some(first), second].into_iter().flatten().zip(motions).zip(costs)
            {
                smallest = smallest.min(cost);
                minima.push_pair(item.kind, motion);
            }
        }
        (minima, smallest)
    }

    /// Drops all but so many, those with the smallest costs.
    pub(crate) fn keep_best(&mut self, most: usize, gram: &Gram) {
        while self.len > most {
            self.remove_worst(|item| gram.cost(&item.motion));
        }
    }

    /// Drops what is beyond the motions that five matches may have, two of each of ten essential matrices: those that fit worst.
    /// Degenerate matches have endlessly many, of which every basis of the null space shows others.
    pub(crate) fn keep_motions_of_five(&mut self, matches: &[Correspondence]) {
        const MOST: usize = 20;
        while 2 * self.len > MOST && self.iter().map(Item::motions).sum::<usize>() > MOST {
            self.remove_worst(|item| item.motion.truncated_cost(matches, f64::INFINITY));
        }
    }

    fn remove_worst(&mut self, cost: impl Fn(&Item) -> f64) {
        let costs = self.iter().map(cost).enumerate();
        if let Some((worst, _)) = costs.max_by(|(_, x), (_, y)| x.total_cmp(y)) {
            self.items.copy_within(worst + 1..self.len, worst);
            self.len -= 1;
        }
    }

    /// Those whose costs are not too far above the smallest, the best first.
    ///
    /// With noise of unknown size the logarithm of the likelihood is `−n/2 ln(cost)`, with `n` matches beyond the five that
    /// any motion fits.
    fn plausible(&self, gram: &Gram, allowance: &Allowance) -> Self {
        let mut costs = [(0.0, 0); Candidates::CAPACITY];
        for (k, item) in self.iter().enumerate() {
            costs[k] = (gram.cost(&item.motion), k);
        }
        let costs = &mut costs[..self.len];
        costs.sort_unstable_by(|x, y| x.0.total_cmp(&y.0));
        let factor = (2.0 * allowance.likelihood / gram.beyond_five()).exp().max(allowance.factor);
        let unresolved = allowance.unresolved * gram.count;
        let limit = costs.first().map_or(0.0, |(smallest, _)| factor * (smallest + unresolved));
        let mut sorted = Self { len: costs.iter().take_while(|(cost, _)| *cost <= limit).count(), ..*self };
        for (place, (_, k)) in sorted.items.iter_mut().zip(&*costs) {
            *place = self.items[*k];
        }
        sorted
    }

    /// Fills `out` with translations, depths, residuals and the order of [`Candidates`].
    pub(crate) fn write(&self, kinds: Kinds, matches: &[Correspondence], out: &mut Candidates) {
        let (mut motions, mut completed) = (MotionColumns::new(), [const { CompletedColumns::new() }; 2]);
        for is_pair in [true, false] {
            let is_wanted = |item: &&Item| kinds == Kinds::All || item.kind == CandidateKind::Exact;
            let mut items = self.iter().filter(is_wanted).filter(|item| item.is_pair == is_pair);
            loop {
                let (mut some, mut count) = ([CandidateKind::Exact; MAX_F64_LANES], 0);
                for item in items.by_ref().take(MAX_F64_LANES) {
                    motions.set(count, &item.motion.q_21, &item.motion.direction);
                    some[count] = item.kind;
                    count += 1;
                }
                if count == 0 {
                    break;
                }
                // A motion of a pair and its twisted partner.
                let completed = &mut completed[..=usize::from(is_pair)];
                many_with_depths(&motions, count, matches, completed);
                for (k, kind) in some[..count].iter().enumerate() {
                    for columns in &*completed {
                        out.push(candidate(*kind, &in_noise(*kind, columns.get(k, matches), matches)));
                    }
                }
            }
        }
        rank(out);
    }
}

/// With its points counted with the noise in mind, where there are more than five: those that five matches have show none. A
/// rotation alone takes parallax for noise.
fn in_noise(kind: CandidateKind, completed: Completed, matches: &[Correspondence]) -> Completed {
    let shows_noise = kind != CandidateKind::RotationOnly && matches.len() > 5;
    if shows_noise && completed.in_front < matches.len() && completed.residual > ROUNDING {
        with_noise(&completed, matches)
    } else {
        completed
    }
}

fn candidate(kind: CandidateKind, completed: &Completed) -> Candidate {
    let Completed { pose, in_front, residual } = *completed;
    Candidate { kind, pose, residual, in_front }
}

/// The rotation-only candidate: the best alignment, and the direction of the translation that fits it best.
pub(crate) fn rotation_only(
    q0_21: UnitQuaternion<f64>,
    direction: &Vector3<f64>,
    matches: &[Correspondence],
) -> Candidate {
    candidate(CandidateKind::RotationOnly, &with_depths(q0_21, direction, matches))
}

/// Empties `out` and answers too few matches and exact pure rotations, which no solver needs to look at; whether it did.
pub(crate) fn is_answered(least: usize, matches: &[Correspondence], out: &mut Candidates) -> bool {
    out.clear();
    if matches.len() < least {
        out.set_degeneracy(Degeneracy::TooFewMatches);
        return true;
    }
    match Alignment::of_pure_rotation(matches) {
        None => false,
        Some(alignment) => {
            pure_rotation(&alignment, matches, out);
            true
        }
    }
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
    let mut keys = [0; Candidates::CAPACITY];
    for (k, (key, candidate)) in keys.iter_mut().zip(out.iter()).enumerate() {
        *key = rank_key(candidate) | k as u128;
    }
    let keys = &keys[..out.len()];
    let unordered = out.clone();
    let places = out.as_mut_slice();
    for (key, candidate) in keys.iter().zip(unordered.iter()) {
        // More comparisons than sorting takes, but none that a branch waits for.
        let place: usize = keys.iter().map(|other| usize::from(other < key)).sum();
        places[place] = *candidate;
    }
}

/// Room for the place of a candidate below its key.
const KEY_UNIT: usize = Candidates::CAPACITY.next_power_of_two();

/// A number that is smaller for what comes first: 24 bits for the points in front, 64 for the residual (positive numbers are
/// ordered as their bits are), and 35 for the rotation, above those that are left free.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within 35 bits")]
#[inline]
fn rank_key(candidate: &Candidate) -> u128 {
    let behind = (1_u128 << 24) - 1 - (candidate.in_front as u128).min((1 << 24) - 1);
    let residual = u128::from(candidate.residual.max(ROUNDING).to_bits());
    let turned = ((1.0 - candidate.pose.wxyz()[0].abs()).max(0.0) * (1_u64 << 34) as f64) as u64;
    (behind << 104) | (residual << 40) | (u128::from(turned) * KEY_UNIT as u128)
}
