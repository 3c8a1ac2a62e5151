//! What must hold of every answer, whatever the input was. The tests and the fuzz targets share it.

use std::f64::consts::PI;

use nalgebra::Matrix6;
use quest_core::robust::{self, Estimate};
use quest_core::servo::{Limits, Twist};
use quest_core::{Candidates, Correspondence, RelativePose};

/// Rounding of a unit quaternion and of its rotation matrix.
const UNIT: f64 = 1e-9;

/// A pose is finite, its quaternion has length 1 and `w ≥ 0`, and its rotation has determinant 1.
pub fn pose(pose: &RelativePose) {
    assert!(pose.t_21.iter().all(|x| x.is_finite()), "t is {:?}", pose.t_21);
    let [w, ..] = pose.wxyz();
    assert!((pose.q_21.coords.norm() - 1.0).abs() < UNIT && w >= 0.0, "q is {:?}", pose.wxyz());
    let r_21 = pose.r_21();
    assert!((r_21.determinant() - 1.0).abs() < UNIT, "det R is {}", r_21.determinant());
    assert!((r_21 * r_21.transpose() - nalgebra::Matrix3::identity()).amax() < UNIT);
}

/// Candidates are poses, best first, within the capacity, each with a residual of at most π/√2, the largest without a translation.
pub fn candidates(found: &Candidates, matches: &[Correspondence]) {
    assert!(found.len() <= Candidates::CAPACITY);
    for candidate in found.iter() {
        pose(&candidate.pose);
        assert!(
            (0.0..=PI / 2.0_f64.sqrt() + UNIT).contains(&candidate.residual),
            "residual {}",
            candidate.residual
        );
        assert!(candidate.in_front <= matches.len());
        for m in matches {
            let depths = candidate.depths(m);
            assert!(depths.is_none_or(|(z1, z2)| !z1.is_nan() && !z2.is_nan()), "{depths:?}");
        }
    }
}

/// Candidates come best first: most points in front, then the smallest residual, of which what is below 1e-12 is rounding.
pub fn order(found: &Candidates) {
    for pair in found.windows(2) {
        let smaller = pair[0].residual <= pair[1].residual.max(1e-12);
        let in_order =
            pair[0].in_front > pair[1].in_front || (pair[0].in_front == pair[1].in_front && smaller);
        assert!(in_order, "{pair:?}");
    }
}

/// A covariance is finite, symmetric, and has no negative eigenvalue but for rounding.
pub fn covariance(c: &Matrix6<f64>) {
    assert!(c.iter().all(|x| x.is_finite()), "{c}");
    assert_eq!(*c, c.transpose(), "{c}");
    let variances = c.symmetric_eigenvalues();
    assert!(variances.min() >= -1e-12 * variances.max(), "{variances}");
}

/// An estimate is whole: poses, covariance, a mask of every match with as many inliers as it says.
pub fn estimate(found: &Estimate, matches: usize) {
    pose(&found.pose);
    covariance(&found.covariance);
    // More than half a turn is no knowledge of a rotation.
    assert!(found.covariance.fixed_view::<3, 3>(0, 0).trace() <= PI * PI);
    if let Some(other) = &found.runner_up {
        pose(&other.pose);
        assert!((0.0..=1.0).contains(&other.score) && other.inlier_count <= matches);
    }
    let numbers = [found.noise_px, found.score, found.evidence.general_px];
    assert!(numbers.iter().all(|x| x.is_finite() && *x >= 0.0), "{numbers:?}");
    assert_eq!(found.inliers.len(), matches);
    assert_eq!(found.inliers.iter().filter(|is_inlier| **is_inlier).count(), found.inlier_count);
    assert!(found.inlier_count >= robust::MIN_MATCHES);
}

/// A command is finite and within the limits.
pub fn command(twist: &Twist, limits: &Limits) {
    assert!(twist.is_finite(), "{twist:?}");
    assert!(twist.linear.norm() <= limits.speed, "{twist:?}");
    assert!(twist.angular.norm() <= limits.turn_rate, "{twist:?}");
}
