//! The covariance of a pose, from the normal equations of its last refinement.
//!
//! It is `H⁻¹ (E[ψ²] M + S) H⁻¹ / E[ψ']²` with `H = E[Σ J Jᵀ]` over the inliers and `ψ` the influence of a residual under the
//! last refinement's loss, the means being those of normal noise as large as the inliers show. For few inliers there is a factor
//! close to one (P. J. Huber, *Robust statistics*, 1981, section 7.6).
//!
//! `∂r/∂t` is proportional to the inverse depth. Where a match has hardly moved, as near the epipole of a camera that goes forward, its
//! measured inverse depth is noise. The square of that noise adds up, and one such match may outweigh all others. So `H` is the mean
//! over what the inverse depths may be, given their measurements and the others'. The gradient `Σ ψ J`, though, also scatters with
//! the noise of `J`: `M` is the mean of `Σ J Jᵀ` over inverse depths with their noise added. Where the parallax is well above the
//! noise, `H` and `M` are equal. Where it is not, `H⁻¹` alone is too small by the square of the ratio of noise and parallax.
//!
//! `S` is what false matches that happen to agree with the pose pull at it. As many as there are outliers are expected to have
//! `S = Σ ψ² J Jᵀ / (1 + h)`, which is measured on false matches (see [`false_alarms`](crate::robust::conclude::false_alarms)). A match with the
//! leverage `h = ψ/r Jᵀ H⁻¹ J` turns the pose `1 + h` times less than one without, but agrees up to `√(1 + h)` times as far away
//! as soon as it is fitted: `√(1 + h)` if all of those stay, `(1 + h)²` if none do; those of unusual depths are
//! [left out](crate::robust::conclude::chance_inliers) as far as chance explains them.
//!
//! The five parameters of a motion become the six of a pose by the length of the translation and its derivatives.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Matrix5, Matrix6, SMatrix, UnitQuaternion};

use crate::RelativePose;
use crate::epipolar_frame::tangent_basis;
use crate::robust::conclude::final_refinement::Polished;
use crate::robust::conclude::inverse_depth::{InverseDepth, Usual};
use crate::robust::conclude::length::Length;
use crate::robust::data::columns::Columns;
use crate::robust::data::observations::Observations;
use crate::robust::refine::epipolar::{One, Subset};
use crate::robust::refine::loss::LEAST_SQUARES;
use crate::robust::refine::point_transfer::rotation_hessian;

/// The most inliers that the normal equations are summed over.
const ENOUGH: usize = 2_000;

/// The variance of an inverse depth counts as at most this many times the median.
const LARGEST_NOISE: f64 = 9.0;

/// Normal equations of unit diagonal have no eigenvalue below this: rounding would make a thousandth of a variance.
const SINGULAR: f64 = 1e-12;

/// The covariance of the five parameters of a motion.
fn of_motion(
    observations: &Observations,
    polished: &Polished,
    false_matches: &Columns,
) -> Option<Matrix5<f64>> {
    let (motion, inliers) = (polished.motion(), &polished.pose.inliers);
    let some = &inliers[..inliers.len().min(ENOUGH)];
    let share = inliers.len() as f64 / some.len() as f64;
    let [certain, noisy] = probable_points(observations, some, polished).map(|points| {
        let indices: Vec<u32> = (0..).take(points.len()).collect();
        Subset::new(&points, &indices).equations(motion, &LEAST_SQUARES).hessian * (0.5 * share)
    });
    let inverse = inverse(&certain)?;
    let normal = polished.loss.of_normal(polished.sigma);
    let mut pull = Matrix5::zeros();
    let outliers = (observations.len() - inliers.len()) as f64;
    if outliers > 0.0 {
        pull = pull_of_a_match(false_matches, polished, &inverse) * outliers;
    }
    let spread = normal.square_slope / normal.slope.powi(2) - 1.0;
    let few = (1.0 + 5.0 / inliers.len() as f64 * spread) / normal.slope;
    Some((inverse * noisy * inverse * normal.square + pull) * (few * few))
}

/// The inverse of normal equations; `None` where a change of the motion moves no point by more than rounding does.
///
/// The question needs parameters in units of their own, because directions count for little where the parallax is small.
fn inverse(hessian: &Matrix5<f64>) -> Option<Matrix5<f64>> {
    let scales = hessian.diagonal().map(|square| 1.0 / square.sqrt());
    let scaled = |matrix: &Matrix5<f64>| matrix.component_mul(&(scales * scales.transpose()));
    let correlated = scaled(hessian);
    (correlated - Matrix5::identity() * SINGULAR).cholesky()?;
    Some(scaled(&correlated.cholesky()?.inverse()))
}

/// The inliers, exactly as the motion sees them, with inverse depths one standard deviation before and behind what they most
/// probably are: of both together the mean and the square are right. And with their noise in addition.
fn probable_points(observations: &Observations, inliers: &[u32], polished: &Polished) -> [Columns; 2] {
    let (motion, columns) = (polished.motion(), &observations.columns);
    let depths = InverseDepth::all(columns, motion, inliers);
    let usual = Usual::new(&depths);
    let mut noises: Vec<f64> = depths.iter().map(|depth| depth.variance(polished.sigma)).collect();
    let middle = noises.len() / 2;
    let noise = *noises.select_nth_unstable_by(middle, f64::total_cmp).1;
    let spread = usual.spread(noise, depths.len());
    [false, true].map(|is_noisy| {
        let points = (0..2 * depths.len()).map(|k| {
            let depth = &depths[k / 2];
            let [mean, mut deviation] = usual.given(depth, polished.sigma, spread);
            if is_noisy {
                // Near an epipole nothing is linear over the noise.
                let own = depth.variance(polished.sigma).min(LARGEST_NOISE * noise);
                deviation = (deviation * deviation + own).sqrt();
            }
            let rho = if k % 2 == 0 { mean + deviation } else { mean - deviation };
            [depth.x1, motion.q_21 * depth.x1 + motion.direction * rho]
        });
        Columns::of_points(columns.images(), columns.threshold(), points)
    })
}

/// The mean of `ψ² H⁻¹ J Jᵀ H⁻¹ / (1 + h)` over false matches, most of which are too far off to count; `inverse` is `H⁻¹`.
fn pull_of_a_match(false_matches: &Columns, polished: &Polished, inverse: &Matrix5<f64>) -> Matrix5<f64> {
    let (motion, Polished { loss, limit, sigma, by_chance, .. }) = (polished.motion(), polished);
    let mut sum = Matrix5::zeros();
    for index in false_matches.agreeing(motion, *limit) {
        let own = One::new(false_matches, index, motion, loss, inverse);
        let stays = by_chance.stays(&InverseDepth::new(false_matches, motion, index as usize), *sigma);
        let turn = inverse * own.gradient * own.weight;
        sum += turn * turn.transpose() * (stays / (1.0 + own.leverage));
    }
    sum / false_matches.len().max(1) as f64
}

/// The covariance of `(ω, t_21)` of a motion whose translation has this length.
pub(crate) fn of_pose(
    observations: &Observations,
    polished: &Polished,
    size: Length,
    false_matches: &Columns,
) -> Option<Matrix6<f64>> {
    // As the square of a root no variance is negative, however much of the others cancels.
    let five = of_motion(observations, polished, false_matches)?.cholesky()?.unpack();
    let motion = polished.motion();
    let tangent = tangent_basis(&motion.direction);
    let slope = size.slope(&tangent);
    let mut jacobian = SMatrix::<f64, 6, 5>::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    for k in 0..5 {
        let mut column = motion.direction * slope[k];
        if k >= 3 {
            column += tangent[k - 3] * size.value;
        }
        jacobian.fixed_view_mut::<3, 1>(3, k).copy_from(&column);
    }
    let root = jacobian * five;
    let mut covariance = root * root.transpose();
    // To second order the length is |t| (1 + x + x²), as if the motion had its inverse, x² having twice the square of the variance.
    let by_motion = five.tr_mul(&slope).norm_squared();
    let second_order = 2.0 * by_motion * (by_motion / size.value.powi(2)).min(1.0);
    let along = motion.direction * motion.direction.transpose() * (size.variance + second_order);
    let mut block = covariance.fixed_view_mut::<3, 3>(3, 3);
    block += along;
    // Rounding must not show which triangle it was computed from.
    Some((covariance + covariance.transpose()) * 0.5).filter(says_something)
}

/// The covariance of `(ω, t_21)` where there is no translation: that of the rotation alone, and for a translation of which
/// only the length is known to be small, its square in every direction.
pub(crate) fn of_rotation(
    observations: &Observations,
    q_21: &UnitQuaternion<f64>,
    inliers: &[u32],
    sigma: f64,
    size: Length,
) -> Option<Matrix6<f64>> {
    let rotation =
        rotation_hessian(&observations.framed(inliers), q_21).cholesky()?.inverse() * (sigma * sigma);
    let mut covariance = Matrix6::zeros();
    covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    let any = Matrix3::identity() * (size.value * size.value + size.variance);
    covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&any);
    Some(covariance).filter(says_something)
}

/// That of a pose of which the matches leave the rotation open: any rotation, and a translation that may be off by its length.
pub(crate) fn of_nothing(pose: &RelativePose) -> Matrix6<f64> {
    // A little less, so that rounding does not make more of it than there is to know.
    let (turn, length) = (0.999 * PI * PI / 3.0, pose.t_21.norm_squared());
    Matrix6::from_diagonal(&[turn, turn, turn, length, length, length].into())
}

/// Whether the rotation is known to half a turn. And the squares of lengths that bearings of 1e150 bring about are more than a
/// number holds.
pub(crate) fn says_something(covariance: &Matrix6<f64>) -> bool {
    covariance.iter().all(|x| x.is_finite()) && covariance.fixed_view::<3, 3>(0, 0).trace() <= PI * PI
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Correspondence;
    use crate::lanes::SearchScore as Score;
    use crate::robust::conclude::by_chance::ByChance;
    use crate::robust::conclude::false_alarms;
    use crate::robust::conclude::length::{Noise, length};
    use crate::robust::refine::loss::HeavyTailed;
    use crate::robust::search::pose_score::PoseScorer;
    use crate::simulate::{FOCAL_LENGTH, Scene, SceneOptions};
    use crate::solver::shared::motion::Motion;
    use nalgebra::{UnitQuaternion, Vector3};

    /// The determinant of the covariance of the direction, as it is given and by the normal equations alone.
    fn determinants(matches: &[Correspondence], motion: Motion) -> [f64; 2] {
        let order = (0..).take(matches.len()).collect();
        let observations = Observations::new(matches, order, [[FOCAL_LENGTH; 2]; 2], 1.5);
        let mut poses = PoseScorer::new(&observations, Score::default());
        let pose = poses.score(motion, 1.5);
        assert_eq!(pose.inliers.len(), 100);
        let polished = Polished {
            pose,
            sigma: 0.5,
            loss: HeavyTailed::new(2.5),
            limit: 4.5,
            by_chance: ByChance::unknown(),
        };
        let false_matches = false_alarms::false_matches(&observations);
        let five = of_motion(&observations, &polished, &false_matches).unwrap();
        let subset = Subset::new(&observations.columns, &polished.pose.inliers);
        let plain = subset.equations(&motion, &LEAST_SQUARES).hessian.cholesky().unwrap().inverse() * 0.25;
        [five, plain].map(|c| c.fixed_view::<2, 2>(3, 3).determinant())
    }

    #[test]
    fn what_is_not_determined_has_no_covariance() {
        // Five rows, of which the last four are dependent, in units of their own.
        let rows = Matrix5::from_fn(|i, j| ((3 * i * i + 7 * j * j * j + i * j) as f64).sin());
        let mut dependent = rows;
        let sum = rows.row(1) + rows.row(2) + rows.row(3);
        dependent.row_mut(4).copy_from(&sum);
        let units = Matrix5::from_diagonal(&[1.0, 1.0, 1e3, 1e-8, 1e-8].into());
        let [full, singular] = [rows, dependent].map(|rows| units * rows.transpose() * rows * units);
        let found = inverse(&full).unwrap();
        // The rows' condition, squared, over rounding.
        assert!((full * found - Matrix5::identity()).component_mul(&Matrix5::identity()).amax() < 1e-10);
        assert!(inverse(&singular).is_none());
        assert!(inverse(&Matrix5::zeros()).is_none() && inverse(&(full * f64::NAN)).is_none());
    }

    #[test]
    fn a_match_at_the_epipole_says_nothing() {
        let options = SceneOptions { points: 100, ..SceneOptions::realistic() };
        let mut scene = Scene::generate(&options, 78, 0).unwrap();
        // Forward, by a fifth of the depth: the points have no noise, and the parallax is well above that which is assumed.
        scene.truth.q_21 = UnitQuaternion::identity();
        scene.truth.t_21 = Vector3::new(0.0, 0.0, -0.2);
        let points: Vec<_> =
            scene.points1.iter().map(|x| [x, &(x + scene.truth.t_21)].map(|x| x.xy() / x.z)).collect();
        let mut matches: Vec<_> = points
            .iter()
            .map(|[a, b]| Correspondence::from_image_points([a.x, a.y], [b.x, b.y]).unwrap())
            .collect();
        let motion = Motion { q_21: scene.truth.q_21, direction: -Vector3::z() };
        let [without, plain_without] = determinants(&matches, motion);
        // Of points as they are seen the two agree, but for the loss and the spread of depths.
        assert!((without / plain_without - 1.0).abs() < 0.5, "{without} {plain_without}");
        // One pixel away from the epipole, and turned to be 0.2 pixels away by its noise: as if it were very near.
        let pixel = 1.0 / FOCAL_LENGTH;
        matches.push(Correspondence::from_image_points([pixel, 0.0], [0.2 * pixel, 0.0]).unwrap());
        let [with, _] = determinants(&matches, motion);
        // It is no inlier, but one more match may be false.
        assert!((with / without - 1.0).abs() < 0.5, "{with} {without}");
    }

    #[test]
    fn the_covariance_of_a_rotation_is_that_of_its_noise() {
        let count = 400;
        let places = (0..count).map(|k| {
            let k = f64::from(k);
            [0.05 * (2.1 * k).sin(), 0.05 * (3.7 * k).cos()]
        });
        let places: Vec<[f64; 2]> = places.collect();
        let matches = crate::correspondence::from_image_points(&places, &places).unwrap();
        let all: Vec<u32> = (0..).take(matches.len()).collect();
        let observations = Observations::new(&matches, all.clone(), [[500.0; 2]; 2], 1.5);
        let still = Motion { q_21: UnitQuaternion::identity(), direction: Vector3::x() };
        let false_matches = false_alarms::false_matches(&observations);
        let noise = Noise { sigma: 1.0, false_matches: &false_matches, by_chance: &ByChance::unknown() };
        let mut size = length(&observations, &still, &[], &noise);
        (size.value, size.variance) = (0.3, 0.01);
        for sigma in [0.5, 3.0] {
            let found = of_rotation(&observations, &still.q_21, &all, sigma, size).unwrap();
            // A turn about x or y moves all points alike by the focal length; both views have the noise.
            let expected = 2.0 * (sigma / 500.0).powi(2) / f64::from(count);
            for k in 0..2 {
                assert!((found[(k, k)] / expected - 1.0).abs() < 0.02, "{} {expected}", found[(k, k)]);
                assert!((found[(3 + k, 3 + k)] - 0.1).abs() < 1e-15);
            }
            assert!(found.fixed_view::<3, 3>(0, 3).amax() <= 0.0);
        }
    }

    #[test]
    fn of_an_open_pose_any_rotation_is_possible() {
        let pose = RelativePose::new(UnitQuaternion::identity(), Vector3::new(0.3, 0.0, -0.4));
        let found = of_nothing(&pose);
        // A turn about an axis is at most π: what is just not said is that of rotations of half a turn.
        let turn = found.fixed_view::<3, 3>(0, 0).trace();
        assert!((0.99 * PI * PI..PI * PI).contains(&turn) && says_something(&found), "{turn}");
        assert!((found[(4, 4)] - 0.25).abs() < 1e-15);
    }
}
