//! The solutions of five matches as twenty eigenvalues: what the methods of section 7 share.
//!
//! The quartics have twenty common zeros, complex ones included. Multiplication by a function of `q`, modulo the quartics, has
//! its values there as eigenvalues. Which function, and how the quaternion is read off, is the method's.
//!
//! View 2 is rotated first, so that no solution of an everyday problem has `q1 = 0`, which the methods divide by.

use nalgebra::{Complex, ComplexField, Quaternion, UnitQuaternion};

use crate::quaternion::monomials::Quartic;
use crate::quaternion::{bilinear, minors_without_q, ten_quartics};
use crate::solver::Kinds;
use crate::solver::shared::essential::real_part;
use crate::solver::shared::motion::Motion;
use crate::solver::shared::parallax_frame::Alignment;
use crate::solver::shared::shortlist::Shortlist;
use crate::structure::translation_direction;
use crate::{CandidateKind, Correspondence, Degeneracy};

/// Fixed rotations of view 2, as quaternions without symmetry; the second serves where the first does badly.
const PRE_ROTATIONS: [[f64; 4]; 3] =
    [[0.39, 0.57, -0.31, 0.65], [0.61, -0.27, 0.54, -0.51], [-0.23, 0.44, 0.71, 0.50]];

/// Fixed rotations of view 2, without symmetry.
pub(crate) fn pre_rotations() -> [UnitQuaternion<f64>; 3] {
    PRE_ROTATIONS.map(|[w, x, y, z]| UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)))
}

/// The twenty solutions of five matches as the eigenvalues of multiplication by a function of `q`, modulo the quartics.
pub(crate) trait TwentySolutions: Sized {
    /// `None` where the quartics are dependent.
    fn new(with_q: &[Quartic; 10], without_q: &[Quartic; 5]) -> Option<Self>;

    /// The eigenvalues.
    fn values(&self) -> &[Complex<f64>; 20];

    /// The quaternion of an eigenvalue, of any scale.
    fn quaternion<T: ComplexField<RealField = f64> + Copy>(&self, value: T) -> Option<[T; 4]>;

    /// The eigenvalue of a quaternion: what the function is there.
    fn value_at(q: &UnitQuaternion<f64>) -> f64;

    /// The rotation of an eigenvalue, with the pre-rotation undone: of a complex pair the real part, once.
    fn rotation(
        &self,
        value: Complex<f64>,
        g: &UnitQuaternion<f64>,
    ) -> Option<(CandidateKind, UnitQuaternion<f64>)> {
        let (kind, [w, x, y, z]) = if value.im == 0.0 {
            (CandidateKind::Exact, self.quaternion(value.re)?)
        } else if value.im > 0.0 {
            (CandidateKind::FromComplex, real_part(self.quaternion(value)?))
        } else {
            return None;
        };
        let q = g.inverse() * UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        q.coords.iter().all(ComplexField::is_finite).then_some((kind, q))
    }

    /// Adds the solution of every eigenvalue. Whether all of the real ones were found.
    fn collect(
        &self,
        kinds: Kinds,
        g: &UnitQuaternion<f64>,
        alignment: &Alignment,
        matches: &[Correspondence; 5],
        shortlist: &mut Shortlist,
    ) -> bool {
        let mut complete = true;
        let mut values = *self.values();
        for k in 0..values.len() {
            let value = values[k];
            if value.im < 0.0 || value.re.is_nan() || (kinds == Kinds::Exact && value.im > 0.0) {
                continue;
            }
            let Some((kind, q_21)) = self.rotation(value, g) else {
                complete = false;
                continue;
            };
            let motion = Motion { q_21, direction: translation_direction(&q_21, matches) };
            if kind == CandidateKind::FromComplex {
                shortlist.push(kind, motion);
                continue;
            }
            let Some(solution) = shortlist.push_solution(motion, alignment, matches) else {
                complete = false;
                continue;
            };
            // The twisted partner has been found with it.
            let twin = g * solution.twisted().q_21;
            if let Some(known) = nearest_real(&values[k + 1..], Self::value_at(&twin)) {
                values[k + 1 + known].re = f64::NAN;
            }
        }
        let real = self.values().iter().filter(|value| value.im == 0.0).count();
        complete && shortlist.count(CandidateKind::Exact) >= real
    }
}

/// Adds the solutions of five matches.
pub(crate) fn from_five<S: TwentySolutions>(
    kinds: Kinds,
    alignment: &Alignment,
    matches: &[Correspondence; 5],
    shortlist: &mut Shortlist,
) -> Result<(), Degeneracy> {
    alignment.null_space(matches)?;
    for g in pre_rotations() {
        let turned = matches.map(|m| m.with_view2_rotated(&g));
        let m = turned.map(|m| bilinear(&(m.bearing2() * m.bearing1().transpose())));
        let Some(spectrum) = S::new(&ten_quartics(&turned), &minors_without_q(&m)) else { continue };
        shortlist.retain(CandidateKind::Exact);
        if spectrum.collect(kinds, &g, alignment, matches, shortlist) {
            break;
        }
    }
    Ok(())
}

/// The real eigenvalue that is `wanted`, as far as eigenvalues are precise.
fn nearest_real(values: &[Complex<f64>], wanted: f64) -> Option<usize> {
    let distance = |k: &usize| (values[*k].re - wanted).abs();
    let real = (0..values.len()).filter(|&k| values[k].im == 0.0 && !values[k].re.is_nan());
    let nearest = real.min_by(|i, j| distance(i).total_cmp(&distance(j)))?;
    (distance(&nearest) < 1e-6 * (1.0 + wanted.abs())).then_some(nearest)
}
