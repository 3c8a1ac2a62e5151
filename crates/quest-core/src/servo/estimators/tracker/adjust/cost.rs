//! The cost of a map.

use nalgebra::Vector3;

use super::Survey;
use crate::RelativePose;
use crate::servo::estimators::tracker::map::{PLANE_SLOPE, PLANE_UNIT};
use crate::servo::estimators::tracker::resection::{KNEE, Point, bounded, ground_residuals};

/// The whole cost.
pub(super) fn cost(
    points: &[Point],
    keys: &[RelativePose],
    normal: &Vector3<f64>,
    relief: f64,
    survey: &Survey<'_>,
) -> f64 {
    let slope = (normal.x.powi(2) + normal.y.powi(2)) / PLANE_SLOPE.powi(2);
    let mut sum = slope + ((normal.z - 1.0) / PLANE_UNIT).powi(2);
    for (image, pose) in survey.keys.iter().zip(keys) {
        if let Some(ground) = &survey.ground {
            sum += ground_residuals(ground, pose).0.norm_squared();
        }
        let r_21 = pose.r_21();
        for (i, (point, z)) in points.iter().zip(&image.frame).enumerate() {
            let Some(z) = z else { continue };
            if !(survey.chosen.is_empty() || survey.chosen[i]) {
                continue;
            }
            let x2 = r_21 * Vector3::new(point.place[0], point.place[1], 1.0) + pose.t_21 * point.rho;
            let square = if x2.z > 0.02 {
                ((x2.x / x2.z - z[0]).powi(2) + (x2.y / x2.z - z[1]).powi(2))
                    / (survey.noise * image.variance)
            } else {
                f64::MAX
            };
            sum += bounded(square, KNEE);
        }
    }
    for (i, point) in points.iter().enumerate() {
        if !survey.takes(i) {
            continue;
        }
        let goal = survey.goal[i];
        sum += ((point.place[0] - goal[0]).powi(2) + (point.place[1] - goal[1]).powi(2))
            / (survey.noise * survey.goal_variance);
        sum += match survey.known[i] {
            Some(known) => (point.rho - known.rho).powi(2) / known.variance,
            None => ((point.rho - normal.x * goal[0] - normal.y * goal[1] - normal.z) / relief).powi(2),
        };
    }
    sum
}
