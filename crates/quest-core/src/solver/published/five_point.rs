//! What the published five-point solvers share: everything but the way from four essential matrices to the ten that are
//! solutions.
//!
//! 1. Fewer than five matches, an exact pure rotation and dependent constraints are answered with their reason.
//! 2. The null space of the rows `x2ᵀ E x1 = 0`: `E = x E1 + y E2 + z E3 + w E4`. For more than five matches, the four
//!    directions that their sum of squares constrains least.
//! 3. The solver finds points `(x, y, z, w)`, up to scale, and each gives two rotations and a translation.
//! 4. Where these miss one of five matches by more than rounding, Newton's iteration on rotation and translation brings them
//!    to the solution. The published methods stop before: near a double root half of the digits are gone. A start from which it
//!    does not converge is no real solution. Where solutions may be missing (a start that led nowhere or to another one's
//!    solution, roots too close to tell whether they are real), steps 3 and 4 are done again with another basis.
//! 5. Scale, sign, depths, residuals and order as for every solver.
//!
//! For more than five matches nothing is refined: the candidates are essential matrices in the space that fits all matches
//! best, not the best of all essential matrices.

use nalgebra::{Complex, Quaternion, UnitQuaternion, Vector3};

use crate::algebra::null_space;
use crate::degeneracy::diagnose;
use crate::solver::Kinds;
use crate::solver::published::least_squares::{outer, principal_basis};
use crate::solver::published::trace_cubics::Basis;
use crate::solver::quest::cubics::combine;
use crate::solver::shared::essential::{decompose, real_part, twisted};
use crate::solver::shared::motion::Motion;
use crate::solver::shared::newton_pair::solution;
use crate::solver::shared::parallax_frame::{Alignment, DEPENDENT, GRAM_DEPENDENT};
use crate::solver::shared::shortlist::{Shortlist, is_answered};
use crate::structure::translation_direction;
use crate::{CandidateKind, Candidates, Correspondence, Degeneracy};

/// The smallest number of matches of every solver here.
pub(crate) const MIN_MATCHES: usize = 5;

/// Fills `out` with the essential matrices that `method` finds. `method` says whether its elimination went through.
pub(crate) fn solve(
    kinds: Kinds,
    matches: &[Correspondence],
    out: &mut Candidates,
    method: impl Fn(&mut Solutions) -> bool,
) {
    if is_answered(MIN_MATCHES, matches, out) {
        return;
    }
    let basis = match null_space(matches) {
        Err(degeneracy) => return out.set_degeneracy(degeneracy),
        Ok(basis) => basis,
    };
    let kinds = kinds.without_plane();
    let mut solutions = Solutions {
        basis,
        kinds,
        matches,
        attempt: 0,
        doubtful: false,
        real: 0,
        shortlist: Shortlist::new(),
    };
    let mut solved = method(&mut solutions);
    for mixing in &MIXINGS {
        if solved && solutions.is_complete() {
            break;
        }
        solutions.mix(mixing);
        solved |= method(&mut solutions);
    }
    if !solved {
        return out.set_degeneracy(Degeneracy::RankDeficient);
    }
    solutions.shortlist.keep_motions_of_five(matches);
    solutions.shortlist.write(kinds, matches, out);
}

/// Orthogonal changes of the null space's basis, for another attempt where the first is in doubt: solutions that have nearly the
/// same `z` in one basis are apart in another.
const MIXINGS: [[[f64; 4]; 4]; 2] = [
    [[0.8, 0.0, 0.6, 0.0], [0.0, 0.28, 0.0, 0.96], [-0.6, 0.0, 0.8, 0.0], [0.0, -0.96, 0.0, 0.28]],
    [[0.5, 0.5, 0.5, 0.5], [0.5, -0.5, 0.5, -0.5], [0.5, 0.5, -0.5, -0.5], [0.5, -0.5, -0.5, 0.5]],
];

/// The essential matrices that satisfy the constraints of the matches, in the least-squares sense for more than five;
/// the last one does so best.
pub(crate) fn null_space(matches: &[Correspondence]) -> Result<Basis, Degeneracy> {
    let row = |m: &Correspondence| outer(m.bearing2(), m.bearing1());
    let (basis, independent) = if let Ok(five) = <&[Correspondence; 5]>::try_from(matches) {
        let (basis, pivot) = null_space::null_space(&five.each_ref().map(row));
        (basis, pivot > DEPENDENT)
    } else {
        let (squares, [_, _, _, _, _, basis @ ..]) = principal_basis(matches.iter().map(row));
        (basis, squares[4] > GRAM_DEPENDENT * squares[0])
    };
    if independent { Ok(basis) } else { Err(diagnose(matches)) }
}

/// The solutions found so far.
pub(crate) struct Solutions<'a> {
    /// The four essential matrices that solutions are combinations of.
    pub(crate) basis: Basis,
    kinds: Kinds,
    /// The matches.
    pub(crate) matches: &'a [Correspondence],
    /// How many bases came before this one.
    pub(crate) attempt: usize,
    /// Whether a real solution may have been overlooked.
    pub(crate) doubtful: bool,
    /// How many real motions there are, as far as the method knows.
    real: usize,
    shortlist: Shortlist,
}

/// A solution that misses a match by more than this (the sine of an angle) is refined: rounding is below.
const PRECISE: f64 = 1e-13;

/// Imaginary parts up to here are tried as real: several real roots close together can be joined by rounding to a pair that
/// is as far off the line as they are apart. Newton's iteration decides.
const NEARLY_REAL: f64 = 1e-2;

fn is_nearly_real(value: Complex<f64>) -> bool {
    value.im < NEARLY_REAL * (1.0 + value.re.abs())
}

impl Solutions<'_> {
    /// Adds the two motions of the essential matrix `x E1 + y E2 + z E3 + w E4`.
    pub(crate) fn push_real(&mut self, point: &[f64; 4]) {
        self.real += 2;
        if let Some((q, t)) = decompose(&rows(&combine(&self.basis, point))) {
            self.push_solution(Motion { q_21: unit(q), direction: Vector3::from(t).normalize() });
        }
    }

    /// Adds a real motion and its twisted partner, of which a method has said how many to expect.
    pub(crate) fn push_motion(&mut self, motion: Motion) {
        self.push_solution(motion);
    }

    /// How many real motions there are.
    pub(crate) fn expect_real(&mut self, count: usize) {
        self.real = count;
    }

    /// Adds what stands behind a conjugate pair of values of an unknown: the real parts of both rotations of the essential
    /// matrix at the point of the one with the positive imaginary part.
    pub(crate) fn push_conjugates(
        &mut self,
        value: Complex<f64>,
        point: impl FnOnce() -> Option<[Complex<f64>; 4]>,
    ) {
        if self.is_wanted(value) {
            let decomposed = point().and_then(|point| decompose(&rows(&combine(&self.basis, &point))));
            let Some((q, t)) = decomposed else { return };
            self.push_real_part(value, q);
            self.push_real_part(value, twisted(&q, &t));
        }
    }

    /// Whether anything comes of a conjugate pair of values.
    pub(crate) fn is_wanted(&self, value: Complex<f64>) -> bool {
        self.kinds == Kinds::All || is_nearly_real(value)
    }

    /// Adds the real part of a complex quaternion, with the translation that fits it best; or two real solutions that rounding
    /// has joined, where there is next to no imaginary part.
    pub(crate) fn push_real_part(&mut self, value: Complex<f64>, q: [Complex<f64>; 4]) {
        let q_21 = unit(real_part(q));
        // Nothing real may be left of it.
        if !q_21.coords.sum().is_finite() {
            return;
        }
        let start = Motion { q_21, direction: translation_direction(&q_21, self.matches) };
        if !(is_nearly_real(value) && self.push_solution(start)) {
            self.shortlist.push(CandidateKind::FromComplex, start);
        }
    }

    /// Adds the solution of five matches near a motion, and its twisted partner; of more matches the motion itself. Whether there
    /// is one, and a new one.
    fn push_solution(&mut self, mut motion: Motion) -> bool {
        if let Ok(five) = <&[Correspondence; 5]>::try_from(self.matches)
            && motion.largest_sine(five) > PRECISE
        {
            let aligned = Alignment::with_rotation(motion.q_21, five);
            let Some(solution) = solution(&motion, &aligned, five) else { return false };
            motion = solution;
        }
        let before = self.shortlist.count(CandidateKind::Exact);
        self.shortlist.push_pair(CandidateKind::Exact, motion);
        self.shortlist.count(CandidateKind::Exact) > before
    }

    /// Whether as many different motions were found as there are.
    fn is_complete(&self) -> bool {
        !self.doubtful && self.shortlist.count(CandidateKind::Exact) >= self.real
    }

    /// Another basis of the same space. What is exact stays.
    fn mix(&mut self, mixing: &[[f64; 4]; 4]) {
        self.basis = mixing.map(|row| combine(&self.basis, &row));
        self.shortlist.retain(CandidateKind::Exact);
        (self.attempt, self.doubtful, self.real) = (self.attempt + 1, false, 0);
    }
}

#[inline]
fn rows<T: Copy>(e: &[T; 9]) -> [[T; 3]; 3] {
    [[e[0], e[1], e[2]], [e[3], e[4], e[5]], [e[6], e[7], e[8]]]
}

/// The rotation of a quaternion of any scale.
#[inline]
pub(crate) fn unit([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
}
