//! Where a run would end that knew everything but the noise of the goal image.

use nalgebra::{Matrix2x6, Matrix6, Vector2, Vector3, Vector6};
use quest_core::servo::FilterOptions;

/// The pose at which the goal's noisy image was taken, relative to the true one, as a resection finds it that knows the features'
/// places exactly: a rotation in radians, then metres.
///
/// No later image tells anything about this noise, so that no loop can end closer but by chance. Linear in the noise, which is the
/// least squares solution to first order; where the robot's plane is known it counts as the filter counts it. `takes` chooses the
/// features, of which `points` are the places in metres.
pub(crate) fn resection(
    points: &[Vector3<f64>],
    takes: impl Fn(usize) -> bool,
    goal: &[[f64; 2]],
    options: &FilterOptions,
    unit: f64,
) -> Vector6<f64> {
    let weight = options.goal_noise.powi(-2);
    let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
    if let Some(plane) = options.plane {
        // The tilt about x and z, the height along y.
        normal[(0, 0)] = plane.tilt.powi(-2);
        normal[(2, 2)] = normal[(0, 0)];
        normal[(4, 4)] = (plane.height * unit).powi(-2);
    }
    for (i, (x, seen)) in points.iter().zip(goal).enumerate() {
        if !takes(i) {
            continue;
        }
        let (u, v, rho) = (x.x / x.z, x.y / x.z, 1.0 / x.z);
        // x moves by w × x + t.
        #[rustfmt::skip]
        let jacobian = Matrix2x6::new(
            -u * v, 1.0 + u * u, -v, rho, 0.0, -u * rho,
            -1.0 - v * v, u * v, u, 0.0, rho, -v * rho,
        );
        normal += jacobian.transpose() * jacobian * weight;
        right += jacobian.transpose() * Vector2::new(seen[0] - u, seen[1] - v) * weight;
    }
    normal.cholesky().map_or(Vector6::repeat(f64::INFINITY), |factor| factor.solve(&right))
}

/// How far a resection is off, in metres and degrees.
pub(crate) fn error(resection: &Vector6<f64>) -> (f64, f64) {
    (resection.fixed_rows::<3>(3).norm(), resection.fixed_rows::<3>(0).norm().to_degrees())
}
