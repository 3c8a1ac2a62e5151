//! The mean depth of the points of a depth field, in which the length of the translation is measured, and the covariance that comes
//! with it.

use nalgebra::{Matrix6, SMatrix};

use crate::robust::conclude::depth_field::field::{DepthField, PARAMETERS, Parameters, TERMS, Terms};
use crate::robust::conclude::depth_field::fit::Fit;
use crate::robust::conclude::depth_field::sums::Placed;
use crate::robust::conclude::evidence::Likelihood;
use crate::robust::conclude::length::{FARTHEST, UNKNOWN};
use crate::robust::data::point_transfer::{WIDTH, rows, whitened};

/// A fit with the mean depth of its points.
#[derive(Clone, Debug)]
pub(crate) struct Mode {
    pub(crate) at: DepthField,
    /// The logarithm of the likelihood over that without a translation, in nats.
    pub(crate) nats: f64,
    /// Of the turn and of the translation in units of the field.
    pub(crate) covariance: Matrix6<f64>,
    /// The mean depth in the unit of the field, and the covariance with the translation in units of the mean depth.
    pub(crate) mean_depth: f64,
    pub(crate) covariance_by_depth: Matrix6<f64>,
}

/// The mean depth, its derivative by the parameters, and the variance of what no match says of it.
struct MeanDepth {
    value: f64,
    slope: Parameters,
    variance: f64,
}

impl Mode {
    /// `None` where no point is one of the field.
    pub(crate) fn new(fit: Fit, terms: &[Terms], likelihood: &Likelihood) -> Option<Self> {
        let Fit { at, nats, covariance: all } = fit;
        let depth = mean_depth(&at, terms, likelihood)?;
        let by_depth = by_depth(&at, &depth);
        let mut covariance_by_depth = by_depth * all * by_depth.transpose();
        let mut block = covariance_by_depth.fixed_view_mut::<3, 3>(3, 3);
        block += at.t_21 * at.t_21.transpose() * (depth.variance / depth.value.powi(4));
        let covariance = all.fixed_view::<6, 6>(0, 0).into_owned();
        let is_finite = covariance_by_depth.iter().all(|x| x.is_finite());
        is_finite.then_some(Self { at, nats, covariance, mean_depth: depth.value, covariance_by_depth })
    }
}

/// The derivative of the pose, with its translation in units of the mean depth, by all parameters.
fn by_depth(at: &DepthField, depth: &MeanDepth) -> SMatrix<f64, 6, PARAMETERS> {
    let mut derivative = SMatrix::<f64, 6, PARAMETERS>::identity();
    derivative.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(1.0 / depth.value);
    let mut of_length = derivative.fixed_view_mut::<3, PARAMETERS>(3, 0);
    of_length -= at.t_21 * depth.slope.transpose() / (depth.value * depth.value);
    derivative
}

/// The mean depth of the points of the field and of near points. The mean of `1/ρ`, of a normal variable with the mean `m` and the
/// variance `v`, is `(1 + v/m²)/m` to second order; of depths whose logarithms are normal it is that exactly. Depths of
/// other shapes have about `(v/m²)²` more or less.
fn mean_depth(at: &DepthField, terms: &[Terms], likelihood: &Likelihood) -> Option<MeanDepth> {
    let (mut sum, mut weights, mut slope) = (0.0, 0.0, Parameters::zeros());
    let (mut unknown, mut of_each) = (0.0, 0.0);
    let r_21 = rows(&at.q_21.to_rotation_matrix().into_inner());
    for (index, (block, terms)) in likelihood.blocks().iter().zip(terms).enumerate() {
        let placed = Placed::new(at, &whitened(&r_21, block), terms, likelihood, index);
        for j in (0..WIDTH).filter(|&j| block.is_live[j]) {
            let (usual, near) = (placed.explained.usual[j], placed.explained.near[j]);
            let share = placed.share[j];
            let variance = at.square_spread * (1.0 - share);
            let rho = placed.rho(j).max(variance.sqrt()).max(1.0 / FARTHEST);
            let square = if rho > placed.rho(j) { 2.0 } else { variance / (rho * rho) };
            sum += usual * (1.0 + square.min(1.0)) / rho + near / placed.depth[j].max(1.0);
            unknown += usual * square / rho;
            of_each += usual * square / (rho * rho);
            weights += usual + near;
            let by_rho = -usual * (1.0 + 3.0 * square) / (rho * rho);
            let by_match = by_rho * share * placed.inverse_length[j];
            for k in 0..3 {
                slope[k] -= placed.by_turn[k][j] * by_match;
                slope[3 + k] -= placed.by_unit[k][j] * (by_match * placed.depth[j]);
            }
            for k in 0..TERMS {
                slope[6 + k] += terms[k][j] * (by_rho * (1.0 - share));
            }
        }
    }
    (weights > 0.0).then(|| MeanDepth {
        value: sum / weights,
        slope: slope / weights,
        variance: (UNKNOWN * (unknown / weights + at.near)).powi(2) + of_each / (weights * weights),
    })
}
