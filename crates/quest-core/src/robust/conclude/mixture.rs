//! The pose of a camera that hardly moves, with a covariance that holds whether it moves or not: the mean and the covariance of a
//! mixture of two explanations.
//!
//! - There is no translation: the best rotation, with its own covariance.
//! - There is one. The pose of the essential matrix leaves each point a depth of its own; where the parallax is no more than the
//!   noise, what it finds is far from linear in the noise, and that of points which are about equally far
//!   ([`equal_depths`](crate::robust::conclude::equal_depths)) is nearer the truth. As far as the likelihood does not tell the two
//!   apart the mean of both is taken, and how far they are apart is a part of the covariance. Where the essential matrix
//!   leaves the translation open the second alone is taken.
//!
//! The weights are the likelihoods of all matches ([`evidence`](crate::robust::conclude::evidence)). The first has an advantage of
//! [`STILL`]. A choice of one of them would have a covariance that knows nothing of the other; near the change from one to
//! the other that is too small by orders of magnitude.

use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3, Vector6};

use crate::RelativePose;
use crate::robust::conclude::equal_depths::EqualDepths;
use crate::robust::conclude::small_motion::SmallMotion;
use crate::robust::data::observations::Observations;
use crate::robust::refine::point_transfer::rotation_hessian;

/// What a camera that does not move is more likely by, before any match is seen, in nats. With less, the rotation of a camera that
/// turns in place is worse (0.044° instead of 0.026° with 100 matches), with more that of one that moves by half a pixel.
const STILL: f64 = 3.0;

/// Matches within this many standard deviations of where the rotation takes them are explained by it.
const EXPLAINED: f64 = 6.0;

/// Matches that the regression looks at.
const ENOUGH: usize = 3_000;

/// A pose and its covariance.
pub(crate) type Distribution = (RelativePose, Matrix6<f64>);

/// Points that are equally far never outweigh points that are not: a covariance cannot say how wrong that is.
const MOST_EQUAL: f64 = 0.5;

/// Where they are less likely than this they are not considered.
const LEAST_EQUAL: f64 = 0.05;

/// One explanation: its weight in nats, the turn after the best rotation and the translation, their covariance.
struct Component {
    nats: f64,
    mean: Vector6<f64>,
    covariance: Matrix6<f64>,
}

/// The mixture, `general` being the pose of the essential matrix, if it has a covariance.
pub(crate) fn mixture(
    observations: &Observations,
    small: &SmallMotion,
    sigma: f64,
    general: Option<&Distribution>,
) -> Option<Distribution> {
    let r_21 = small.q_21.to_rotation_matrix().into_inner();
    let all: Vec<u32> = (0_u32..).take(observations.len().min(ENOUGH)).collect();
    let squares = observations.framed(&all).square_errors(&r_21);
    let limit = (EXPLAINED * small.sigma).powi(2);
    let some: Vec<u32> = all.into_iter().zip(squares).filter(|(_, s)| *s < limit).map(|(i, _)| i).collect();
    let framed = observations.framed(&some);
    let equal = EqualDepths::fit(&framed.displacements(&r_21), sigma).map(|equal| Component {
        nats: small.likelihood.of_squares(equal.squares()),
        mean: equal.parameters,
        covariance: equal.covariance,
    });
    let general = general.map(|(pose, covariance)| {
        let turn = (pose.q_21 * small.q_21.inverse()).scaled_axis();
        let mean = Vector6::from_fn(|k, _| if k < 3 { turn[k] } else { pose.t_21[k - 3] });
        Component { nats: small.nats, mean, covariance: *covariance }
    });
    let nats = [&equal, &general].into_iter().flatten().map(|c| c.nats).fold(f64::NEG_INFINITY, f64::max);
    let moving = match (general, equal) {
        (Some(general), Some(equal)) => Some(blended(general, equal)),
        (general, equal) => general.or(equal),
    };
    let mut components: Vec<Component> = moving.map(|c| Component { nats, ..c }).into_iter().collect();
    if let Some(inverse) = rotation_hessian(&framed, &small.q_21).cholesky().map(|factor| factor.inverse()) {
        let square = observations.columns.focal_length().powi(2) * some.len() as f64;
        let mut covariance = Matrix6::zeros();
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&(inverse * (sigma * sigma)));
        covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() * (sigma * sigma / square)));
        components.push(Component { nats: STILL, mean: Vector6::zeros(), covariance });
    }
    (!components.is_empty()).then(|| merged(&small.q_21, &components))
}

/// The pose of the essential matrix and that of points that are equally far.
fn blended(general: Component, equal: Component) -> Component {
    let share = (1.0 / (1.0 + (general.nats - equal.nats).exp())).min(MOST_EQUAL);
    if share < LEAST_EQUAL {
        return general;
    }
    if equal.covariance.trace() < general.covariance.trace() {
        return equal;
    }
    let apart = equal.mean - general.mean;
    Component {
        nats: general.nats,
        mean: general.mean + apart * share,
        covariance: general.covariance + apart * apart.transpose() * (share * (1.0 - share)),
    }
}

/// The mean and the covariance of a mixture.
fn merged(q_21: &UnitQuaternion<f64>, all: &[Component]) -> Distribution {
    let most = all.iter().map(|c| c.nats).fold(f64::NEG_INFINITY, f64::max);
    let weight = |c: &Component| (c.nats - most).exp();
    let sum: f64 = all.iter().map(weight).sum();
    let mean: Vector6<f64> = all.iter().map(|c| c.mean * (weight(c) / sum)).sum();
    let spread = |c: &Component| c.covariance + (c.mean - mean) * (c.mean - mean).transpose();
    let covariance: Matrix6<f64> = all.iter().map(|c| spread(c) * (weight(c) / sum)).sum();
    let [turn, t_21] = [0, 3].map(|k| Vector3::new(mean[k], mean[k + 1], mean[k + 2]));
    (RelativePose::new(UnitQuaternion::new(turn) * q_21, t_21), covariance)
}
