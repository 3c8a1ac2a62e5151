//! The rotation that best aligns two sets of bearings (Wahba's problem).

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::Correspondence;
use crate::algebra::symmetric::smallest_eigenvector_4;
use crate::quaternion::{bilinear, from_wxyz};

/// The rotation `R_21` that maximises `Σ b · R a` over the unit bearings `a` in view 1 and `b` in view 2.
///
/// For a unit quaternion `b · R a = −qᵀ M q`, so the best one is the eigenvector of `Σ M` with the smallest eigenvalue
/// (Davenport's q-method, 1968). The result is exact for pure rotations by any angle. If all bearings are parallel, several
/// rotations align them equally well, and the result is one of these.
#[must_use]
pub fn best_rotation(matches: &[Correspondence]) -> UnitQuaternion<f64> {
    align(matches, |_| 1.0)
}

/// The rotation that best aligns the bearings as lines, for matches where that may differ from [`best_rotation`]. A bearing is
/// reversed if its point lies behind a camera and its image point was taken as if in front. `None` for ordinary matches.
///
/// A rotation preserves the angles between bearings, so the angles to the first bearing give all signs up to a common one. It
/// also preserves orientation: with the right signs, `Σ b aᵀ` is near `R Σ a aᵀ` and has a positive determinant.
///
/// `sum` is the [`outer_sum`].
pub(crate) fn best_rotation_of_lines(
    matches: &[Correspondence],
    sum: &Matrix3<f64>,
) -> Option<UnitQuaternion<f64>> {
    let first = matches.first()?;
    let sign = |m: &Correspondence| {
        1.0_f64.copysign(first.bearing1().dot(m.bearing1()) * first.bearing2().dot(m.bearing2()))
    };
    let turned = matches.iter().any(|m| sign(m) < 0.0);
    let determinant = if turned { signed_sum(matches, sign).determinant() } else { sum.determinant() };
    let common = 1.0_f64.copysign(determinant);
    (turned || common < 0.0).then(|| align(matches, |m| common * sign(m)))
}

/// `Σ b aᵀ`.
pub(crate) fn outer_sum(matches: &[Correspondence]) -> Matrix3<f64> {
    signed_sum(matches, |_| 1.0)
}

fn signed_sum(matches: &[Correspondence], sign: impl Fn(&Correspondence) -> f64) -> Matrix3<f64> {
    matches.iter().map(|m| m.bearing2() * (m.bearing1() * sign(m)).transpose()).sum()
}

fn align(matches: &[Correspondence], sign: impl Fn(&Correspondence) -> f64) -> UnitQuaternion<f64> {
    let sum = signed_sum(matches, &sign);
    polished(rotation_of_outer_sum(&sum, matches.len()), matches, sign)
}

/// The rotation that best aligns `count` bearings with `Σ b aᵀ = sum`, to rounding over how far they are from a line.
pub(crate) fn rotation_of_outer_sum(sum: &Matrix3<f64>, count: usize) -> UnitQuaternion<f64> {
    match smallest_eigenvector_4(&bilinear(sum), -(count as f64)) {
        Some(q) => UnitQuaternion::new_normalize(from_wxyz(&q)),
        None => UnitQuaternion::identity(),
    }
}

/// One Gauss–Newton step on `Σ |b − R a|²`. The eigenvector squares the condition of the problem, which costs digits if the
/// bearings nearly lie in a line. The residuals do not square it.
fn polished(
    q_21: UnitQuaternion<f64>,
    matches: &[Correspondence],
    sign: impl Fn(&Correspondence) -> f64,
) -> UnitQuaternion<f64> {
    let r_21 = q_21.to_rotation_matrix();
    let (mut hessian, mut gradient) = (Matrix3::zeros(), Vector3::zeros());
    for m in matches {
        let c = r_21 * m.bearing1() * sign(m);
        hessian += Matrix3::from_diagonal_element(c.norm_squared()) - c * c.transpose();
        gradient += c.cross(&(m.bearing2() - c));
    }
    match hessian.try_inverse().map(|h| h * gradient) {
        Some(step) if step.norm() < 1e-3 => {
            UnitQuaternion::new_normalize((UnitQuaternion::new(step) * q_21).into_inner())
        }
        _ => q_21,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Vector3};

    fn rotated(axis_angle: Vector3<f64>, bearings: &[[f64; 3]]) -> Vec<Correspondence> {
        let r = Rotation3::new(axis_angle);
        let pair = |a: &[f64; 3]| Correspondence::from_bearings(*a, (r * Vector3::from(*a)).into()).unwrap();
        bearings.iter().map(pair).collect()
    }

    #[test]
    fn pure_rotations_are_recovered_at_every_angle() {
        let pi = std::f64::consts::PI;
        let general = [[0.1, 0.4, 1.0], [-0.3, 0.2, 1.0], [0.5, -0.2, -1.0]];
        let planar = [[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [-0.8, 0.6, 0.0]];
        for bearings in [general, planar] {
            for angle in [0.0, 1e-9, 0.3, 2.0, pi - 1e-9, pi] {
                let axis_angle = Vector3::new(0.48, -0.6, 0.64) * angle;
                let q = best_rotation(&rotated(axis_angle, &bearings));
                let error = q.angle_to(&UnitQuaternion::new(axis_angle));
                // The bearings are rounded at 1e-16; angle_to loses half the digits near zero.
                assert!(error < 5e-8, "{angle}: {error:e}");
                for m in rotated(axis_angle, &bearings) {
                    assert!((q * m.bearing1() - m.bearing2()).norm() < 1e-14);
                }
            }
        }
    }
}
