//! The pose of one image on a map of goal features whose depths are known only so well.
//!
//! Minimises a robust sum over the features seen, `r² = eᵀ C⁻¹ e` with
//!
//! ```text
//! e = π(R m + ρ t) − z        C = σ² I + P a aᵀ + Q G Gᵀ        a = ∂π/∂ρ ∥ D t,   G = ∂π/∂(u, v)
//! ```
//!
//! by reweighted Gauss–Newton steps in which `C` is held fixed: its derivative by t is not taken. A joint fit of pose and free
//! depths is inconsistent (Neyman and Scott 1948), for each free depth fits one residual, the better the longer t is. With 180
//! features and t = 0 the joint fit finds |t| = 0.04 and a rotation that is off by 2°; these steps find 0.006 and 0.3°. A feature
//! of unknown depth has a large P, so that it counts across its epipolar line alone.

use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3, Vector6};

use crate::RelativePose;
use crate::servo::estimators::depth_filter::fit::Plane;

/// Squared residuals above this count less and less: three standard deviations in two dimensions hold 98.9 %.
pub(crate) const KNEE: f64 = 9.0;
/// Features below this agree with the pose: four standard deviations.
pub(crate) const INLIER: f64 = 16.0;
/// Points nearer than this to the camera, in the unit of length, do not agree with anything.
const NEAREST: f64 = 0.02;
/// What such a point counts as.
const BEHIND: f64 = 1e6;

/// A feature of the goal as a hypothesis knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    /// Its place in the goal image without noise, on the plane z = 1.
    pub(crate) place: [f64; 2],
    /// Its inverse depth at the goal.
    pub(crate) rho: f64,
    /// The variance of the inverse depth.
    pub(crate) variance: f64,
    /// Whether the map has seen it outside of the goal image, or its depth was given.
    pub(crate) is_mapped: bool,
    /// Whether it was found to be a wrong match, which has no say in the map.
    pub(crate) is_wrong: bool,
}

/// What a pose is held against beside the features.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ground {
    pub(crate) plane: Plane,
    /// The camera in the frame of the base, in the unit of t.
    pub(crate) base: RelativePose,
}

/// How an image is to be fitted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Task {
    /// The variance of a coordinate in the image.
    pub(crate) variance: f64,
    /// The variance of a feature's place in the goal.
    pub(crate) place_variance: f64,
    pub(crate) ground: Option<Ground>,
    pub(crate) is_translation_fixed: bool,
    /// Only features that are on the map count.
    pub(crate) mapped_only: bool,
    /// This variance of the inverse depths in place of their own, if any.
    pub(crate) depth_variance: Option<f64>,
    pub(crate) iterations: usize,
}

/// Where a fit ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    pub(crate) pose: RelativePose,
    /// The inverse of the covariance.
    pub(crate) information: Matrix6<f64>,
    /// The bounded cost of all features seen.
    pub(crate) cost: f64,
    pub(crate) seen: usize,
    pub(crate) inliers: usize,
    /// The sum of the inliers' squared distances in the image.
    pub(crate) square: f64,
}

impl Fit {
    /// The covariance of rotation and translation; `None` where they are not determined.
    pub(crate) fn covariance(&self) -> Option<Matrix6<f64>> {
        self.information.cholesky().map(|factor| factor.inverse())
    }
}

/// A squared residual as it counts: the parabola up to the knee, then bounded by twice the knee.
pub(crate) fn bounded(square: f64, knee: f64) -> f64 {
    if square < knee { square } else { 2.0 * knee - knee * knee / square }
}

/// The weight of its derivative.
pub(crate) fn weight(square: f64, knee: f64) -> f64 {
    if square < knee { 1.0 } else { (knee / square).powi(2) }
}

/// One feature at one pose.
struct Seen {
    /// The point without its translation, for the rotation's derivative.
    turned: Vector3<f64>,
    /// The rows of ∂π/∂X.
    rows: [Vector3<f64>; 2],
    error: [f64; 2],
    /// C⁻¹: `xx, xy, yy`.
    inverse: [f64; 3],
    square: f64,
}

fn look(point: &Point, z: [f64; 2], r_21: &Matrix3<f64>, t_21: &Vector3<f64>, task: &Task) -> Option<Seen> {
    let turned = r_21 * Vector3::new(point.place[0], point.place[1], 1.0);
    let x2 = turned + t_21 * point.rho;
    if x2.z.is_nan() || x2.z <= NEAREST {
        return None;
    }
    let inv = 1.0 / x2.z;
    let (u, v) = (x2.x * inv, x2.y * inv);
    let error = [u - z[0], v - z[1]];
    let rows = [Vector3::new(inv, 0.0, -u * inv), Vector3::new(0.0, inv, -v * inv)];
    let a = [inv * (t_21.x - u * t_21.z), inv * (t_21.y - v * t_21.z)];
    let p = task.depth_variance.unwrap_or(point.variance);
    let g = |row: usize, column: usize| inv * (r_21[(row, column)] - [u, v][row] * r_21[(2, column)]);
    let (g00, g01, g10, g11) = (g(0, 0), g(0, 1), g(1, 0), g(1, 1));
    let q = task.place_variance;
    let cxx = task.variance + p * a[0] * a[0] + q * (g00 * g00 + g01 * g01);
    let cxy = p * a[0] * a[1] + q * (g00 * g10 + g01 * g11);
    let cyy = task.variance + p * a[1] * a[1] + q * (g10 * g10 + g11 * g11);
    let det = 1.0 / (cxx * cyy - cxy * cxy);
    let inverse = [cyy * det, -cxy * det, cxx * det];
    let square = inverse[0] * error[0] * error[0]
        + 2.0 * inverse[1] * error[0] * error[1]
        + inverse[2] * error[1] * error[1];
    square.is_finite().then_some(Seen { turned, rows, error, inverse, square })
}

/// The squared residuals of all features at a pose, by their covariance; NaN where not seen. Returns the bounded cost.
pub(crate) fn residuals(
    points: &[Point],
    frame: &[Option<[f64; 2]>],
    pose: &RelativePose,
    task: &Task,
    squares: &mut [f64],
) -> f64 {
    let (r_21, mut cost) = (pose.r_21(), 0.0);
    for ((point, image), square) in points.iter().zip(frame).zip(squares) {
        *square = f64::NAN;
        let Some(z) = image else { continue };
        if task.mapped_only && !point.is_mapped {
            continue;
        }
        *square = look(point, *z, &r_21, &pose.t_21, task).map_or(BEHIND, |seen| seen.square);
        cost += bounded(*square, KNEE);
    }
    cost
}

/// The knee for these residuals: where most are large because the pose is still off, it is far out.
fn knee(squares: &[f64], scratch: &mut Vec<f64>) -> f64 {
    scratch.clear();
    scratch.extend(squares.iter().filter(|s| !s.is_nan()));
    if scratch.is_empty() {
        return KNEE;
    }
    // Two in five: up to half of the matches may be wrong.
    let place = 2 * (scratch.len() - 1) / 5;
    let (_, &mut middle, _) = scratch.select_nth_unstable_by(place, f64::total_cmp);
    KNEE.max(4.0 * middle)
}

/// Fits from a pose whose residuals are in `squares`; they are replaced by those of the fit.
pub(crate) fn resect(
    points: &[Point],
    frame: &[Option<[f64; 2]>],
    start: &RelativePose,
    task: &Task,
    squares: &mut [f64],
    scratch: &mut Vec<f64>,
) -> Option<Fit> {
    let mut pose = *start;
    let mut last = None;
    for iteration in 0..=task.iterations {
        let knee = knee(squares, scratch);
        let (fit, gradient) = normal_equations(points, frame, &pose, task, knee, squares);
        let step = fit.information.cholesky()?.solve(&-gradient);
        if !step.iter().all(|s| s.is_finite()) {
            return None;
        }
        let length = step.norm();
        let decrease = -step.dot(&gradient);
        let is_last = iteration == task.iterations;
        last = Some(fit);
        if is_last {
            break;
        }
        let step = if length > 0.5 { step * (0.5 / length) } else { step };
        pose = moved(&pose, &step);
        // A twentieth of a standard deviation: the next step would be far smaller. Its residuals are those of the pose before.
        if knee <= KNEE && decrease < 2.5e-3 {
            last = last.map(|fit| Fit { pose, ..fit });
            break;
        }
    }
    last
}

fn normal_equations(
    points: &[Point],
    frame: &[Option<[f64; 2]>],
    pose: &RelativePose,
    task: &Task,
    knee: f64,
    squares: &mut [f64],
) -> (Fit, Vector6<f64>) {
    let r_21 = pose.r_21();
    let (mut a, mut b) = ([[0.0; 6]; 6], [0.0; 6]);
    let mut fit =
        Fit { pose: *pose, information: Matrix6::zeros(), cost: 0.0, seen: 0, inliers: 0, square: 0.0 };
    for ((point, image), square) in points.iter().zip(frame).zip(squares) {
        *square = f64::NAN;
        let Some(z) = image else { continue };
        if task.mapped_only && !point.is_mapped {
            continue;
        }
        fit.seen += 1;
        let Some(seen) = look(point, *z, &r_21, &pose.t_21, task) else {
            *square = BEHIND;
            fit.cost += 2.0 * KNEE;
            continue;
        };
        *square = seen.square;
        fit.cost += bounded(seen.square, KNEE);
        if seen.square < INLIER {
            fit.inliers += 1;
            fit.square += seen.error[0] * seen.error[0] + seen.error[1] * seen.error[1];
        }
        add(&mut a, &mut b, &seen, point.rho, weight(seen.square, knee));
    }
    let mut gradient = Vector6::from(b);
    fit.information = Matrix6::from_fn(|i, k| if i <= k { a[i][k] } else { a[k][i] });
    if let Some(ground) = &task.ground {
        add_ground(ground, pose, &mut fit.information, &mut gradient);
    }
    if task.is_translation_fixed {
        for k in 3..6 {
            fit.information.row_mut(k).fill(0.0);
            fit.information.column_mut(k).fill(0.0);
            (fit.information[(k, k)], gradient[k]) = (1.0, 0.0);
        }
    }
    // Far below any information of an image: a billionth keeps a degenerate image solvable.
    let least = 1e-9 * fit.information.trace() + 1e-6;
    (0..6).for_each(|k| fit.information[(k, k)] += least);
    (fit, gradient)
}

/// Adds one feature to the normal equations; only the upper triangle.
fn add(a: &mut [[f64; 6]; 6], b: &mut [f64; 6], seen: &Seen, rho: f64, weight: f64) {
    let j = seen.rows.map(|row| {
        let turn = seen.turned.cross(&row);
        [turn.x, turn.y, turn.z, row.x * rho, row.y * rho, row.z * rho]
    });
    let [xx, xy, yy] = seen.inverse.map(|c| c * weight);
    let (ex, ey) = (xx * seen.error[0] + xy * seen.error[1], xy * seen.error[0] + yy * seen.error[1]);
    for i in 0..6 {
        let (k0, k1) = (xx * j[0][i] + xy * j[1][i], xy * j[0][i] + yy * j[1][i]);
        b[i] += j[0][i] * ex + j[1][i] * ey;
        for k in i..6 {
            a[i][k] += k0 * j[0][k] + k1 * j[1][k];
        }
    }
}

/// Adds what is known of a base that keeps to its plane: its vertical stays, and its height.
pub(crate) fn add_ground(
    ground: &Ground,
    pose: &RelativePose,
    information: &mut Matrix6<f64>,
    gradient: &mut Vector6<f64>,
) {
    let (residuals, jacobian) = ground_residuals(ground, pose);
    *information += jacobian.transpose() * jacobian;
    *gradient += jacobian.transpose() * residuals;
}

/// How far a pose leaves the plane, by its deviations, and the derivatives.
pub(crate) fn ground_residuals(
    ground: &Ground,
    pose: &RelativePose,
) -> (Vector3<f64>, nalgebra::Matrix3x6<f64>) {
    let Ground { plane, base } = ground;
    let b = base.r_21();
    let vertical = pose.q_21 * (base.q_21.inverse() * Vector3::y());
    // The axle in the camera's frame, turned with it.
    let axle = pose.q_21 * (base.q_21.inverse() * base.t_21);
    let level = b * vertical;
    let height = (b * (pose.t_21 - axle) + base.t_21).y;
    let residuals = Vector3::new(level.x / plane.tilt, level.z / plane.tilt, height / plane.height);
    // A vector v changes by ω × v = −[v]× ω.
    let by_turn = b * -vertical.cross_matrix() / plane.tilt;
    let height_by_turn = b * axle.cross_matrix() / plane.height;
    let mut jacobian = nalgebra::Matrix3x6::zeros();
    for k in 0..3 {
        jacobian[(0, k)] = by_turn[(0, k)];
        jacobian[(1, k)] = by_turn[(2, k)];
        jacobian[(2, k)] = height_by_turn[(1, k)];
        jacobian[(2, 3 + k)] = b[(1, k)] / plane.height;
    }
    (residuals, jacobian)
}

/// The pose after a small rotation from the left and a change of t.
pub(crate) fn moved(pose: &RelativePose, step: &Vector6<f64>) -> RelativePose {
    let turn = UnitQuaternion::new(Vector3::new(step[0], step[1], step[2]));
    let q_21 = UnitQuaternion::new_normalize((turn * pose.q_21).into_inner());
    RelativePose::new(q_21, pose.t_21 + Vector3::new(step[3], step[4], step[5]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TASK: Task = Task {
        variance: 1e-6,
        place_variance: 1e-6,
        ground: None,
        is_translation_fixed: false,
        mapped_only: false,
        depth_variance: None,
        iterations: 8,
    };

    fn points() -> Vec<Point> {
        let point = |k: f64| Point {
            place: [0.5 * (1.7 * k).sin(), 0.5 * (2.9 * k + 1.0).cos()],
            rho: 1.0 + 0.3 * (2.3 * k).sin(),
            variance: 1e-6,
            is_mapped: true,
            is_wrong: false,
        };
        (0..12).map(|k| point(f64::from(k))).collect()
    }

    fn seen(points: &[Point], pose: &RelativePose) -> Vec<Option<[f64; 2]>> {
        let of = |point: &Point| {
            let x2 = pose.q_21 * Vector3::new(point.place[0], point.place[1], 1.0) + pose.t_21 * point.rho;
            Some([x2.x / x2.z, x2.y / x2.z])
        };
        points.iter().map(of).collect()
    }

    fn fitted(
        points: &[Point],
        frame: &[Option<[f64; 2]>],
        start: &RelativePose,
        task: &Task,
    ) -> Option<Fit> {
        let mut squares = vec![f64::NAN; points.len()];
        residuals(points, frame, start, task, &mut squares);
        resect(points, frame, start, task, &mut squares, &mut Vec::new())
    }

    #[test]
    fn a_planted_pose_is_found_and_lost_points_take_no_part() {
        let points = points();
        let truth = RelativePose::new(
            UnitQuaternion::new(Vector3::new(0.05, -0.1, 0.2)),
            Vector3::new(0.1, -0.05, 0.2),
        );
        let start = RelativePose::identity();
        let mut frame = seen(&points, &truth);
        let fit = fitted(&points, &frame, &start, &TASK).unwrap();
        assert!(fit.pose.rotation_error(&truth) < 1e-6 && (fit.pose.t_21 - truth.t_21).norm() < 1e-6);
        assert_eq!((fit.seen, fit.inliers), (12, 12));
        let covariance = fit.covariance().unwrap();
        assert!((0..6).all(|k| covariance[(k, k)] > 0.0 && covariance[(k, k)] < 1e-3), "{covariance}");
        (frame[2], frame[5]) = (None, Some([3.0, -2.0]));
        let fit = fitted(&points, &frame, &start, &TASK).unwrap();
        assert!(fit.pose.rotation_error(&truth) < 1e-2 && (fit.pose.t_21 - truth.t_21).norm() < 1e-2);
        assert_eq!((fit.seen, fit.inliers), (11, 10));
    }

    #[test]
    fn an_image_that_shows_nothing_leaves_the_pose_and_determines_none() {
        let points = points();
        let pose = RelativePose::new(UnitQuaternion::new(Vector3::x() * 0.2), Vector3::y() * 0.1);
        let fit = fitted(&points, &[None; 12], &pose, &TASK).unwrap();
        assert_eq!((fit.seen, fit.inliers), (0, 0));
        assert!(fit.cost <= 0.0 && fit.square <= 0.0);
        assert!(fit.pose.rotation_error(&pose) < 1e-12 && (fit.pose.t_21 - pose.t_21).norm() < 1e-12);
        // What is left of the information is far below that of an image.
        assert!((0..6).all(|k| fit.information[(k, k)] < 1e-3));
    }

    #[test]
    fn points_that_are_behind_or_nowhere_agree_with_nothing() {
        let mut points = points();
        let frame = seen(&points, &RelativePose::identity());
        let mut squares = vec![0.0; 12];
        let behind = RelativePose::new(UnitQuaternion::identity(), Vector3::z() * -3.0);
        let cost = residuals(&points, &frame, &behind, &TASK, &mut squares);
        assert!(
            squares.iter().all(|square| square.to_bits() == BEHIND.to_bits()) && cost > 11.9 * 2.0 * KNEE
        );
        let nowhere = RelativePose::new(UnitQuaternion::identity(), Vector3::repeat(f64::NAN));
        assert!(residuals(&points, &frame, &nowhere, &TASK, &mut squares).is_finite());
        assert!(squares.iter().all(|square| square.to_bits() == BEHIND.to_bits()));
        // A place that is no number is that of one feature alone.
        points[4].place[1] = f64::NAN;
        residuals(&points, &frame, &RelativePose::identity(), &TASK, &mut squares);
        assert!(squares.iter().enumerate().all(|(k, square)| (*square > INLIER) == (k == 4)), "{squares:?}");
        let fit = fitted(&points, &frame, &RelativePose::identity(), &TASK).unwrap();
        assert_eq!((fit.seen, fit.inliers), (12, 11));
        assert!(fit.pose.q_21.angle() < 1e-9 && fit.pose.t_21.norm() < 1e-9);
    }

    #[test]
    fn a_feature_of_unknown_depth_counts_across_its_epipolar_line_alone() {
        let (r_21, t_21) = (Matrix3::identity(), Vector3::new(0.3, 0.2, -0.1));
        let point = Point { place: [0.2, -0.1], rho: 0.5, variance: 1e6, is_mapped: true, is_wrong: false };
        let task = Task {
            variance: 1e-6,
            place_variance: 0.0,
            ground: None,
            is_translation_fixed: false,
            mapped_only: false,
            depth_variance: None,
            iterations: 1,
        };
        let seen = |rho: f64, off: [f64; 2]| {
            let x2 = Vector3::new(0.2, -0.1, 1.0) + t_21 * rho;
            [x2.x / x2.z + off[0], x2.y / x2.z + off[1]]
        };
        let square = |z: [f64; 2], task: &Task| look(&point, z, &r_21, &t_21, task).unwrap().square;
        // Three deviations across the line that leads to the same point at another depth.
        let [a, b] = [0.5, 0.5 + 1e-6].map(|rho| seen(rho, [0.0; 2]));
        let (along, length) = ([b[0] - a[0], b[1] - a[1]], (b[0] - a[0]).hypot(b[1] - a[1]));
        let across = [-along[1] / length * 3e-3, along[0] / length * 3e-3];
        assert!((square(seen(0.5, across), &task) - 9.0).abs() < 1e-3);
        // At another depth nothing is off, unless the depth is known.
        assert!(square(seen(0.6, [0.0; 2]), &task) < 1e-3);
        let known = Task { depth_variance: Some(0.0), ..task };
        assert!(square(seen(0.6, [0.0; 2]), &known) > 100.0);
        // Of a place in the goal that is as uncertain as that in the image, the noise is about twice as large.
        let both = Task { place_variance: 1e-6, ..known };
        let ratio = square(seen(0.5, across), &both) / square(seen(0.5, across), &known);
        assert!((ratio - 0.5).abs() < 0.1, "{ratio}");
    }
}
