//! The rotation that best aligns two sets of bearings (Wahba's problem).

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::Correspondence;
use crate::algebra::symmetric::smallest_eigenvector_4;
use crate::quaternion::{bilinear, from_wxyz};

/// The rotation `R_21` that maximises `Σ b · R a` over the unit bearings `a` in view 1 and `b` in view 2.
///
/// For a unit quaternion `b · R a = −qᵀ M q`, so it is the eigenvector of `Σ M` with the smallest eigenvalue
/// (Davenport's q-method, 1968). Exact for pure rotations, by any angle; where several rotations align the
/// bearings equally well (all of them parallel) it is one of these.
#[must_use]
pub fn best_rotation(matches: &[Correspondence]) -> UnitQuaternion<f64> {
    let sum: Matrix3<f64> = matches.iter().map(|m| m.bearing2() * m.bearing1().transpose()).sum();
    let below = -(matches.len() as f64);
    match smallest_eigenvector_4(&bilinear(&sum), below) {
        Some(q) => polished(UnitQuaternion::new_normalize(from_wxyz(&q)), matches),
        None => UnitQuaternion::identity(),
    }
}

/// One Gauss–Newton step on `Σ |b − R a|²`. The eigenvector squares the condition of the problem, which shows where the
/// bearings nearly lie in a line; the residuals do not.
fn polished(q_21: UnitQuaternion<f64>, matches: &[Correspondence]) -> UnitQuaternion<f64> {
    let r_21 = q_21.to_rotation_matrix();
    let (mut hessian, mut gradient) = (Matrix3::zeros(), Vector3::zeros());
    for m in matches {
        let c = r_21 * m.bearing1();
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
