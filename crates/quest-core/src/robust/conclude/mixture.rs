//! The pose of a camera that hardly moves, with a covariance that holds whether it moves or not: the mean and the covariance of a
//! mixture of the explanations of the matches.
//!
//! - There is no translation: the best rotation, with its own covariance. This has an advantage of [`STILL`].
//! - There is one, with depths that follow a smooth field ([`depth_field`](crate::robust::conclude::depth_field)). Several
//!   translations may explain the matches about as well.
//!
//! The weights are a power of the likelihoods of all matches ([`evidence`](crate::robust::conclude::evidence)). A choice of one of the
//! explanations would have a covariance that knows nothing of the others; near the change from one to the other that is too
//! small by orders of magnitude.

use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3, Vector6};

use crate::RelativePose;
use crate::algebra::vectors::exponential::exp;
use crate::robust::conclude::depth_field::Mode;
use crate::robust::conclude::length::Length;
use crate::robust::conclude::rotation_alone::NOT_A_ROTATION;
use crate::robust::conclude::small_motion::SmallMotion;
use crate::robust::data::observations::Observations;
use crate::robust::refine::point_transfer::rotation_hessian;

/// The advantage of a camera that does not move, before any match is seen, in nats. It is a choice between two errors, measured
/// with 500 matches: with 3 nats the rotation of a camera that turns in place is off by 0.040° in the median, with 6 by 0.007°; the
/// covariance of a camera that moves by half a pixel covers 85 % with 3 nats and 79 % with 6. From one pixel nothing changes.
const STILL: f64 = 6.0;

/// The covariance to first order is too small where the direction of the translation is uncertain. It is enlarged by this times the
/// variance of the direction, in square radians and at most one. Measured at half a pixel: 79 to 83 % of poses are inside of
/// their 95 % region without it, 85 to 91 % with it.
const CURVED: f64 = 6.0;

/// The power of the likelihoods that are the weights. Depths are not the smooth fields with normal spreads that they are taken for, so that
/// the likelihood of thousands of matches is surer than it should be of which explanation is right (P. Grünwald, T. van Ommen,
/// *Inconsistency of Bayesian inference for misspecified linear models, and a proposal for repairing it*, Bayesian Analysis
/// 2017). Measured at 0.5 to 2 px of parallax, beside a power of one: the squared errors in units of the covariance fall from 1.3 to 1.1
/// times their expectation, and the rotation is up to a tenth closer. Powers of 0.35 to 0.5 differ little.
const POWER: f64 = 0.5;

/// The rotation explains a match that is within this many standard deviations of where it takes the point. With
/// the tails of [`evidence`](crate::robust::conclude::evidence) one true match in fourteen is beyond three, one in seventy beyond six.
const EXPLAINED: f64 = 6.0;

/// So many matches determine the rotation alone. This bounds the time.
const ENOUGH: usize = 3_000;

/// A pose and its covariance.
pub(crate) type Distribution = (RelativePose, Matrix6<f64>);

/// One explanation: its weight in nats, the turn after the best rotation and the translation, their covariance.
struct Component {
    nats: f64,
    mean: Vector6<f64>,
    covariance: Matrix6<f64>,
}

/// The mixture. `general` is the pose of the essential matrix and its covariance, asked for where no mode is known.
pub(crate) fn mixture(
    observations: &Observations,
    small: &SmallMotion,
    sigma: f64,
    general: impl FnOnce() -> Option<Distribution>,
) -> Option<Distribution> {
    let after = |q_21: &UnitQuaternion<f64>, t_21: Vector3<f64>| {
        let turn = (q_21 * small.q_21.inverse()).scaled_axis();
        Vector6::from_fn(|k, _| if k < 3 { turn[k] } else { t_21[k - 3] })
    };
    let mut components: Vec<Component> = small.modes.iter().map(|mode| of_mode(mode, &after)).collect();
    if components.is_empty() {
        components.extend(general().map(|(pose, covariance)| Component {
            nats: small.nats,
            mean: after(&pose.q_21, pose.t_21),
            covariance,
        }));
    }
    if small.excess < NOT_A_ROTATION || components.is_empty() {
        components.extend(still(observations, small, sigma));
    }
    (!components.is_empty()).then(|| merged(&small.q_21, &components))
}

/// The rotation alone, over the matches that it explains; `None` where they do not determine it.
fn still(observations: &Observations, small: &SmallMotion, sigma: f64) -> Option<Component> {
    let r_21 = small.q_21.to_rotation_matrix().into_inner();
    let all: Vec<u32> = (0_u32..).take(observations.len().min(ENOUGH)).collect();
    let squares = observations.framed(&all).square_errors(&r_21);
    let limit = (EXPLAINED * small.sigma).powi(2);
    let some: Vec<u32> = all.into_iter().zip(squares).filter(|(_, s)| *s < limit).map(|(i, _)| i).collect();
    let inverse = rotation_hessian(&observations.framed(&some), &small.q_21).cholesky()?.inverse();
    let square = observations.columns.focal_length().powi(2) * some.len() as f64;
    let mut covariance = Matrix6::zeros();
    covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&(inverse * (sigma * sigma)));
    covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() * (sigma * sigma / square)));
    Some(Component { nats: STILL, mean: Vector6::zeros(), covariance })
}

/// A covariance of a rotation and a translation in another unit.
fn in_unit(covariance: &Matrix6<f64>, scale: f64) -> Matrix6<f64> {
    let units = Vector6::new(1.0, 1.0, 1.0, scale, scale, scale);
    covariance.component_mul(&(units * units.transpose()))
}

/// A mode, with its translation in units of the mean depth. Noise across a translation makes it longer: its square grows by the
/// variance across it.
fn of_mode(mode: &Mode, after: &impl Fn(&UnitQuaternion<f64>, Vector3<f64>) -> Vector6<f64>) -> Component {
    let square = mode.at.t_21.norm_squared().max(f64::MIN_POSITIVE);
    let block = mode.covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let along = mode.at.t_21.dot(&(block * mode.at.t_21)) / square;
    let direction = ((block.trace() - along) / square).clamp(0.0, 1.0);
    let scale = 1.0 / mode.mean_depth;
    let t_21 = mode.at.t_21 * (scale * (1.0 - 0.5 * direction));
    let covariance = mode.covariance_by_depth * (1.0 + CURVED * direction);
    Component { nats: mode.nats, mean: after(&mode.at.q_21, t_21), covariance }
}

/// The same with the best rotation alone and the translation that is the likeliest with it. As long as no translation is evident,
/// that rotation is nearer the truth than the mean is. The covariance grows by the distance of the mean.
pub(crate) fn held(q_21: &UnitQuaternion<f64>, (pose, covariance): Distribution) -> Distribution {
    let turn = (pose.q_21 * q_21.inverse()).scaled_axis();
    let block = |row, column| covariance.fixed_view::<3, 3>(row, column).into_owned();
    let Some(factor) = block(0, 0).cholesky() else { return (pose, covariance) };
    let step = block(3, 0) * factor.solve(&turn);
    let by = Vector6::from_fn(|k, _| if k < 3 { turn[k] } else { step[k - 3] });
    (RelativePose::new(*q_21, pose.t_21 - step), covariance + by * by.transpose())
}

/// The same with a translation of this length, which is in units of the mean depth. The unit of a field only approximates it. The
/// variance of the length for a given motion is added: that of which points the mean depth is over.
pub(crate) fn of_length((pose, covariance): Distribution, length: &Length) -> Distribution {
    let norm = pose.t_21.norm();
    let scale = length.value / norm;
    if !(scale > 0.0 && scale.is_finite()) {
        return (pose, covariance);
    }
    let mut covariance = in_unit(&covariance, scale);
    let mut block = covariance.fixed_view_mut::<3, 3>(3, 3);
    block += pose.t_21 * pose.t_21.transpose() * (length.variance / (norm * norm));
    (RelativePose::new(pose.q_21, pose.t_21 * scale), covariance)
}

/// The mean and the covariance of a mixture.
fn merged(q_21: &UnitQuaternion<f64>, all: &[Component]) -> Distribution {
    let most = all.iter().map(|c| c.nats).fold(f64::NEG_INFINITY, f64::max);
    let weight = |c: &Component| exp(POWER * (c.nats - most));
    let sum: f64 = all.iter().map(weight).sum();
    let mean: Vector6<f64> = all.iter().map(|c| c.mean * (weight(c) / sum)).sum();
    let spread = |c: &Component| c.covariance + (c.mean - mean) * (c.mean - mean).transpose();
    let covariance: Matrix6<f64> = all.iter().map(|c| spread(c) * (weight(c) / sum)).sum();
    let [turn, t_21] = [0, 3].map(|k| Vector3::new(mean[k], mean[k + 1], mean[k + 2]));
    (RelativePose::new(UnitQuaternion::new(turn) * q_21, t_21), covariance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robust::conclude::depth_field::DepthField;

    /// A covariance of no pattern.
    fn covariance() -> Matrix6<f64> {
        let root = Matrix6::from_fn(|i, j| 0.1 * ((3 * i + 5 * j * j + 1) as f64).sin());
        root * root.transpose() + Matrix6::identity() * 1e-3
    }

    fn start() -> UnitQuaternion<f64> {
        UnitQuaternion::new(Vector3::new(0.3, -0.2, 0.1))
    }

    #[test]
    fn a_mixture_has_the_mean_and_the_covariance_of_its_parts() {
        let part = |nats: f64, mean: [f64; 6], variance: f64| Component {
            nats,
            mean: mean.into(),
            covariance: Matrix6::identity() * variance,
        };
        // Three to one by the root of the likelihoods, which are nine to one.
        let first = part(5.0, [0.02, 0.0, 0.0, 0.2, 0.0, 0.0], 1e-4);
        let second = part(5.0 - 9_f64.ln(), [-0.02, 0.0, 0.0, 0.0, 0.4, 0.0], 4e-4);
        let (pose, covariance) = merged(&start(), &[first, second]);
        let turn = (pose.q_21 * start().inverse()).scaled_axis();
        assert!((turn - Vector3::x() * 0.01).amax() < 1e-15, "{turn}");
        assert!((pose.t_21 - Vector3::new(0.15, 0.1, 0.0)).amax() < 1e-15);
        let apart = Vector6::new(0.04, 0.0, 0.0, 0.2, -0.4, 0.0);
        let expected = Matrix6::identity() * 1.75e-4 + apart * apart.transpose() * (0.75 * 0.25);
        assert!((covariance - expected).amax() < 1e-15, "{covariance}");
    }

    #[test]
    fn with_the_rotation_held_the_translation_is_the_likeliest() {
        let pose = RelativePose::new(
            UnitQuaternion::new(Vector3::new(0.01, -0.02, 0.03)) * start(),
            Vector3::new(0.1, 0.2, -0.1),
        );
        let (found, wider) = held(&start(), (pose, covariance()));
        assert_eq!(found.q_21, start());
        let turn = (start() * pose.q_21.inverse()).scaled_axis();
        let step = found.t_21 - pose.t_21;
        let by = Vector6::new(turn.x, turn.y, turn.z, step.x, step.y, step.z);
        // The squared distance in units of the covariance has its least value there.
        let slope = covariance().cholesky().unwrap().solve(&by);
        assert!(slope.fixed_rows::<3>(3).amax() < 1e-12 * slope.amax(), "{slope}");
        assert!((wider - covariance() - by * by.transpose()).amax() < 1e-15);
    }

    #[test]
    fn a_covariance_in_another_unit_is_that_of_scaled_translations() {
        let units = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 3.0, 3.0, 3.0));
        assert!((in_unit(&covariance(), 3.0) - units * covariance() * units).amax() < 1e-15);
    }

    /// Noise across a translation of length one makes it longer by half of its variance, which is taken back.
    #[test]
    fn a_mode_is_as_long_as_it_is_without_its_noise() {
        let known = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 0.5, 0.02, 0.03));
        let mode = Mode {
            at: DepthField::start(start(), Vector3::x(), 0.2),
            nats: 3.0,
            covariance: known,
            mean_depth: 2.0,
            covariance_by_depth: Matrix6::identity(),
        };
        let after =
            |_: &UnitQuaternion<f64>, t_21: Vector3<f64>| Vector6::new(0.0, 0.0, 0.0, t_21.x, t_21.y, t_21.z);
        let found = of_mode(&mode, &after);
        // Along the translation the noise has the mean zero. The unit is the mean depth.
        assert!((found.mean - Vector6::new(0.0, 0.0, 0.0, 0.4875, 0.0, 0.0)).amax() < 1e-15);
        assert!((found.covariance[(3, 3)] - (1.0 + CURVED * 0.05)).abs() < 1e-12);
    }
}
