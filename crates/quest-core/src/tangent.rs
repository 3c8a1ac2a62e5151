//! Covariances of poses in the conventions of other libraries.
//!
//! Here an error of a pose is `(ω, d)`: `R' = exp([ω]×) R`, `t' = t + d`. Libraries of Lie groups write `T' = exp(ξ^) T` or
//! `T' = T exp(ξ^)` with `ξ = (ω, v)`. To first order
//!
//! ```text
//! left:   ω' = ω,      v = d - ω × t
//! right:  ω' = Rᵀ ω,   v = Rᵀ d
//! ```

use nalgebra::{Matrix3, Matrix6};

use crate::RelativePose;

/// How an error of a pose is written; the rotation always comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Tangent {
    /// `R' = exp([ω]×) R`, `t' = t + d`: that of this crate.
    Additive,
    /// `T' = exp(ξ^) T`: COLMAP, Sophus and manif where they perturb on the left.
    Se3Left,
    /// `T' = T exp(ξ^)`: GTSAM's `Pose3`, Sophus and manif where they perturb on the right.
    Se3Right,
}

impl RelativePose {
    /// The covariance of this pose in another convention, where `covariance` is of `(ω, d)` as
    /// [`Estimate::covariance`](crate::robust::Estimate::covariance).
    #[must_use]
    pub fn covariance_in(&self, covariance: &Matrix6<f64>, tangent: Tangent) -> Matrix6<f64> {
        let (r_12, zero) = (self.r_21().transpose(), Matrix3::zeros());
        let jacobian = match tangent {
            Tangent::Additive => return *covariance,
            // d - ω × t = d + t × ω.
            Tangent::Se3Left => {
                blocks([Matrix3::identity(), zero, self.t_21.cross_matrix(), Matrix3::identity()])
            }
            Tangent::Se3Right => blocks([r_12, zero, zero, r_12]),
        };
        jacobian * covariance * jacobian.transpose()
    }
}

fn blocks([a, b, c, d]: [Matrix3<f64>; 4]) -> Matrix6<f64> {
    let mut all = Matrix6::zeros();
    for (block, (row, column)) in [a, b, c, d].into_iter().zip([(0, 0), (0, 3), (3, 0), (3, 3)]) {
        all.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
    }
    all
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, UnitQuaternion, Vector3, Vector6};

    use super::*;

    fn matrix(pose: &RelativePose) -> Matrix4<f64> {
        pose.r_21().insert_row(3, 0.0).insert_column(3, 0.0) + {
            let mut last = Matrix4::zeros();
            last.fixed_view_mut::<3, 1>(0, 3).copy_from(&pose.t_21);
            last[(3, 3)] = 1.0;
            last
        }
    }

    /// `log(T)` of a matrix near the identity, by its series.
    fn log(t: &Matrix4<f64>) -> Vector6<f64> {
        let x = t - Matrix4::identity();
        let log = x - x * x / 2.0 + x * x * x / 3.0;
        Vector6::new(log[(2, 1)], log[(0, 2)], log[(1, 0)], log[(0, 3)], log[(1, 3)], log[(2, 3)])
    }

    #[test]
    fn conventions_agree_with_numerical_derivatives() {
        let pose = RelativePose::new(
            UnitQuaternion::from_euler_angles(0.4, -0.7, 1.1),
            Vector3::new(0.3, -0.2, 0.5),
        );
        let changed = |delta: Vector6<f64>| {
            let turned = UnitQuaternion::new(delta.fixed_rows::<3>(0).into_owned()) * pose.q_21;
            matrix(&RelativePose::new(turned, pose.t_21 + delta.fixed_rows::<3>(3)))
        };
        let inverse = matrix(&pose).try_inverse().unwrap();
        let root = Matrix6::from_fn(|i, j| if i == j { 0.3 } else { 0.02 * (3.0 * i as f64 - j as f64) });
        let covariance = root * root.transpose();
        let step = 1e-5;
        for tangent in [Tangent::Se3Left, Tangent::Se3Right] {
            let error = |delta| match tangent {
                Tangent::Se3Left => log(&(changed(delta) * inverse)),
                _ => log(&(inverse * changed(delta))),
            };
            let mut jacobian = Matrix6::zeros();
            for k in 0..6 {
                let delta = Vector6::ith(k, step);
                jacobian.set_column(k, &((error(delta) - error(-delta)) / (2.0 * step)));
            }
            let expected = jacobian * covariance * jacobian.transpose();
            // Central differences of step 1e-5 are exact to the square of the step.
            assert!((pose.covariance_in(&covariance, tangent) - expected).norm() < 1e-8, "{tangent:?}");
        }
        assert_eq!(pose.covariance_in(&covariance, Tangent::Additive), covariance);
    }
}
