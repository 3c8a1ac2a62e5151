//! The error metrics of the paper's figures, (61) and (62), and its parallax, (63).
//!
//! For everything a user looks at, [`RelativePose::rotation_error`](crate::RelativePose::rotation_error) and
//! [`RelativePose::translation_error`](crate::RelativePose::translation_error) are the ones to use: the full
//! angle, and the signed direction.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{UnitQuaternion, Vector3};

/// The metric (61), `acos |q · q_est|` in `[0, π/2]`: HALF the angle of the rotation between the two.
///
/// It is computed from the sine and the cosine, because the arc cosine resolves nothing below 1e-8.
#[must_use]
pub fn rotation_metric(q: &UnitQuaternion<f64>, q_est: &UnitQuaternion<f64>) -> f64 {
    let d = q.inverse() * q_est;
    d.imag().norm().atan2(d.w.abs())
}

/// The metric (62), `acos |t · t_est|` of the directions, in `[0, π/2]`: it ignores the SIGN of t.
///
/// The error is zero if the true translation vanishes, as in the text after (63). If the truth has a direction and the
/// estimate has none, the error is the largest, π/2.
#[must_use]
pub fn translation_metric(t: &Vector3<f64>, t_est: &Vector3<f64>) -> f64 {
    let Some(t) = t.try_normalize(0.0) else { return 0.0 };
    let Some(t_est) = t_est.try_normalize(0.0) else { return FRAC_PI_2 };
    t.cross(&t_est).norm().atan2(t.dot(&t_est).abs())
}

/// The parallax (63): the length of the translation over the mean depth of the points in both views, whose signs do not count.
///
/// `None` without depths, or where their mean is zero or not finite.
#[must_use]
pub fn parallax(t: &Vector3<f64>, depths1: &[f64], depths2: &[f64]) -> Option<f64> {
    let depths = || depths1.iter().chain(depths2).map(|z| z.abs());
    let mean = depths().sum::<f64>() / depths().count() as f64;
    let parallax = t.norm() / mean;
    (mean.is_finite() && parallax.is_finite()).then_some(parallax)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Scene, SceneOptions};

    #[test]
    fn the_parallax_of_a_scene_is_the_length_of_its_translation() {
        let scene = Scene::generate(&SceneOptions::default(), 63, 0).unwrap();
        let depths1: Vec<f64> = scene.points1.iter().map(|x| x.z).collect();
        let depths2: Vec<f64> = scene.points2().map(|x| x.z).collect();
        let found = parallax(&scene.truth.t_21, &depths1, &depths2).unwrap();
        assert!((found - scene.truth.t_21.norm()).abs() < 1e-14);
        let double = parallax(&(2.0 * scene.truth.t_21), &depths1, &depths2).unwrap();
        assert!((double - 2.0 * found).abs() < 1e-14);
        assert_eq!(parallax(&scene.truth.t_21, &[], &[]), None);
        assert_eq!(parallax(&Vector3::zeros(), &[0.0], &[0.0]), None);
        assert_eq!(parallax(&Vector3::zeros(), &[f64::INFINITY], &[]), None);
    }

    #[test]
    fn rotation_metric_is_half_the_angle() {
        for angle in [0.0, 1e-12, 1e-3, 0.5, 3.0] {
            let q = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -1.0, 0.2));
            let turned = q * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle);
            assert!((rotation_metric(&q, &turned) - angle / 2.0).abs() < 1e-15);
            // q and −q are the same rotation.
            let negated = UnitQuaternion::new_unchecked(-turned.into_inner());
            assert!((rotation_metric(&q, &negated) - angle / 2.0).abs() < 1e-15);
        }
    }

    #[test]
    fn translation_metric_ignores_sign_and_length() {
        let t = Vector3::new(1.0, 2.0, -2.0);
        assert!(translation_metric(&t, &(-7.0 * t)) < 1e-15);
        let right_angle = translation_metric(&t, &Vector3::new(2.0, -1.0, 0.0));
        assert!((right_angle - FRAC_PI_2).abs() < 1e-15);
        assert!(translation_metric(&Vector3::zeros(), &t) == 0.0);
        assert!((translation_metric(&t, &Vector3::zeros()) - FRAC_PI_2).abs() < 1e-15);
    }
}
