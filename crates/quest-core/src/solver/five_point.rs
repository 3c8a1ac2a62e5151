//! What the published five-point solvers share: everything but the way from four essential matrices to the ten that are
//! solutions.
//!
//! 1. Fewer than five matches, an exact pure rotation and dependent constraints are answered with their reason.
//! 2. The null space of the rows `x2ᵀ E x1 = 0`: `E = x E1 + y E2 + z E3 + w E4`. For more than five matches, the four
//!    directions that their sum of squares constrains least.
//! 3. The solver finds points `(x, y, z, w)`, up to scale.
//! 4. Each gives two rotations and a translation, without refinement; scale, sign, depths, residuals and order as for
//!    every solver.

use nalgebra::{Complex, Quaternion, UnitQuaternion, Vector3};

use super::Kinds;
use super::aligned::{Alignment, DEPENDENT, GRAM_DEPENDENT};
use super::cubics::combine;
use super::essential::{decompose, real_part, twisted};
use super::least_squares::{outer, principal_basis};
use super::motion::Motion;
use super::shortlist::{Shortlist, pure_rotation};
use super::trace_cubics::Basis;
use crate::algebra::null_space;
use crate::degeneracy::diagnose;
use crate::structure::translation_direction;
use crate::{CandidateKind, Candidates, Correspondence, Degeneracy};

/// The smallest number of matches of every solver here.
pub(crate) const MIN_MATCHES: usize = 5;

/// Fills `out` with the essential matrices that `method` finds. `method` says whether its elimination went through.
pub(crate) fn solve(
    kinds: Kinds,
    matches: &[Correspondence],
    out: &mut Candidates,
    method: impl FnOnce(&mut Solutions) -> bool,
) {
    out.clear();
    if matches.len() < MIN_MATCHES {
        return out.set_degeneracy(Degeneracy::TooFewMatches);
    }
    if let Some(alignment) = Alignment::of_pure_rotation(matches) {
        return pure_rotation(&alignment, matches, out);
    }
    match null_space(matches) {
        Err(degeneracy) => out.set_degeneracy(degeneracy),
        Ok(basis) => {
            let mut solutions = Solutions { basis, matches, shortlist: Shortlist::new() };
            if !method(&mut solutions) {
                return out.set_degeneracy(Degeneracy::RankDeficient);
            }
            solutions.shortlist.write(kinds, matches, out);
        }
    }
}

/// The essential matrices that satisfy the constraints of the matches, in the least-squares sense for more than five;
/// the last one does so best.
fn null_space(matches: &[Correspondence]) -> Result<Basis, Degeneracy> {
    let row = |m: &Correspondence| outer(m.bearing2(), m.bearing1());
    let (basis, independent) = if let Ok(five) = <&[Correspondence; 5]>::try_from(matches) {
        let (basis, pivot) = null_space::null_space(&mut five.each_ref().map(row));
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
    matches: &'a [Correspondence],
    shortlist: Shortlist,
}

impl Solutions<'_> {
    /// Adds the two motions of the essential matrix `x E1 + y E2 + z E3 + w E4`.
    pub(crate) fn push_real(&mut self, point: &[f64; 4]) {
        let Some((q, t)) = decompose(&rows(&combine(&self.basis, point))) else { return };
        let motion = Motion { q_21: unit(q), direction: Vector3::from(t).normalize() };
        self.shortlist.push_pair(CandidateKind::Exact, motion);
    }

    /// Adds the real parts of the two rotations of a complex essential matrix, each with the translation that fits
    /// it best. One of a conjugate pair is enough.
    pub(crate) fn push_complex(&mut self, point: &[Complex<f64>; 4]) {
        let Some((q, t)) = decompose(&rows(&combine(&self.basis, point))) else { return };
        for q in [q, twisted(&q, &t)] {
            let q_21 = unit(real_part(q));
            let direction = translation_direction(&q_21, self.matches);
            self.shortlist.push(CandidateKind::FromComplex, Motion { q_21, direction });
        }
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
