//! The cost of a map.

use nalgebra::{Matrix3, Vector3};

use super::Survey;
use crate::RelativePose;
use crate::servo::estimators::tracker::map::{Map, PLANE_SLOPE, PLANE_UNIT};
use crate::servo::estimators::tracker::resection::{INLIER, KNEE, Point, bounded, ground_residuals};

/// The squared distance of a feature from where a key image shows it, by the variance.
fn square(point: &Point, z: [f64; 2], r_21: &Matrix3<f64>, t_21: &Vector3<f64>, variance: f64) -> f64 {
    let x2 = r_21 * Vector3::new(point.place[0], point.place[1], 1.0) + t_21 * point.rho;
    if x2.z > 0.02 {
        ((x2.x / x2.z - z[0]).powi(2) + (x2.y / x2.z - z[1]).powi(2)) / variance
    } else {
        f64::MAX
    }
}

/// What the images say of one feature on a map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Disagreement {
    /// How many key images agree with it.
    pub(crate) agreeing: usize,
    /// What it costs in these and in the goal image.
    pub(crate) of_the_agreeing: f64,
    /// What it costs in the others.
    pub(crate) of_the_others: f64,
}

/// What a feature costs that takes part.
pub(crate) fn disagreement(map: &Map, survey: &Survey<'_>, i: usize) -> Disagreement {
    let (point, goal) = (&map.points[i], survey.goal[i]);
    let off = (point.place[0] - goal[0]).powi(2) + (point.place[1] - goal[1]).powi(2);
    let mut sum = Disagreement {
        agreeing: 0,
        of_the_agreeing: off / (survey.noise * survey.goal_variance),
        of_the_others: 0.0,
    };
    for (image, pose) in survey.keys.iter().zip(&map.keys) {
        let Some(z) = image.frame[i] else { continue };
        let square = square(point, z, &pose.r_21(), &pose.t_21, survey.noise * image.variance);
        if square < INLIER {
            sum.agreeing += 1;
            sum.of_the_agreeing += bounded(square, KNEE);
        } else {
            sum.of_the_others += bounded(square, KNEE);
        }
    }
    sum
}

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
            if survey.wants(i, point) {
                sum += bounded(square(point, *z, &r_21, &pose.t_21, survey.noise * image.variance), KNEE);
            }
        }
    }
    for (i, point) in points.iter().enumerate() {
        if !survey.takes(i, point) {
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
