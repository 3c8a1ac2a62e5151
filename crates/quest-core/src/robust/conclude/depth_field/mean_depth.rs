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

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::robust::conclude::depth_field::field::{Field, terms};
    use crate::robust::conclude::depth_field::planted::{likelihood, moved, of_field, turn};

    const COUNT: usize = 43;

    fn start(t_21: Vector3<f64>, spread: f64) -> DepthField {
        DepthField { near: 0.0, ..DepthField::start(turn(), t_21, spread) }
    }

    /// Inverse depths without a pattern in the image.
    fn scattered() -> Vec<f64> {
        (0..COUNT).map(|k| 1.0 + 0.3 * (7.0 * k as f64).sin()).collect()
    }

    #[test]
    fn where_depths_are_seen_well_their_mean_is_measured() {
        // To the side: what moves points is linear in their inverse depths.
        let t_21 = Vector3::new(0.15, -0.05, 0.0);
        let rhos = scattered();
        // A spread of twenty pixels along the lines beside noise of a hundredth: the matches say all of the depths.
        let at = start(t_21, 0.2);
        let likelihood = likelihood(&rhos, &t_21, |_| [0.0; 2], 0.01);
        let terms = terms(&likelihood);
        let mean = |at: &DepthField| mean_depth(at, &terms, &likelihood).unwrap();
        let found = mean(&at);
        let expected = rhos.iter().map(|rho| 1.0 / rho).sum::<f64>() / COUNT as f64;
        assert!((found.value / expected - 1.0).abs() < 1e-5, "{} {expected}", found.value);
        assert!(found.slope.fixed_rows::<TERMS>(6).amax() < 1e-4 && found.variance < 1e-6);
        for k in 0..6 {
            let step = 1e-6;
            let derivative =
                (mean(&moved(&at, k, step)).value - mean(&moved(&at, k, -step)).value) / (2.0 * step);
            // A turn changes what whitens a residual by the residual over the focal length, a tenth at most.
            let tolerance = if k < 3 { 0.1 } else { 1e-3 } * found.slope.fixed_rows::<6>(0).amax();
            assert!((found.slope[k] - derivative).abs() < tolerance, "{k}: {} {derivative}", found.slope[k]);
        }
    }

    #[test]
    fn where_depths_are_not_seen_their_mean_is_that_of_the_field() {
        let t_21 = Vector3::new(0.05, -0.02, 0.03);
        let field = Field::from_fn(|k, _| 0.02 * (k as f64).cos());
        let rhos = of_field(&field, COUNT);
        let at = DepthField { field, ..start(t_21, 0.0) };
        let likelihood = likelihood(&rhos, &t_21, |_| [0.0; 2], 0.5);
        let terms = terms(&likelihood);
        let mean = |at: &DepthField| mean_depth(at, &terms, &likelihood).unwrap();
        let found = mean(&at);
        let expected = rhos.iter().map(|rho| 1.0 / rho).sum::<f64>() / COUNT as f64;
        assert!((found.value / expected - 1.0).abs() < 1e-5, "{} {expected}", found.value);
        assert!(found.slope.fixed_rows::<6>(0).amax() < 1e-12);
        for k in 6..PARAMETERS {
            let step = 1e-5;
            let derivative =
                (mean(&moved(&at, k, step)).value - mean(&moved(&at, k, -step)).value) / (2.0 * step);
            assert!((found.slope[k] - derivative).abs() < 1e-5, "{k}: {} {derivative}", found.slope[k]);
        }
    }

    #[test]
    fn what_no_match_says_of_a_mean_depth_is_its_variance() {
        // Hardly any translation: all depths are the field's, of a spread s, and their mean is 1 + s².
        let (s, count) = (0.2, COUNT as f64);
        let likelihood = likelihood(&[1.0; COUNT], &Vector3::zeros(), |_| [0.0; 2], 0.5);
        let terms = terms(&likelihood);
        let found = mean_depth(&start(Vector3::x() * 1e-7, s), &terms, &likelihood).unwrap();
        assert!((found.value - 1.0 - s * s).abs() < 1e-5, "{}", found.value);
        // Half of what is added is not known, and each depth scatters.
        let expected = (UNKNOWN * s * s).powi(2) + s * s / count;
        assert!((found.variance / expected - 1.0).abs() < 1e-4, "{} {expected}", found.variance);
    }

    #[test]
    fn near_points_have_their_own_depths() {
        let t_21 = Vector3::new(0.03, -0.01, 0.0);
        let rhos: Vec<f64> = (0..COUNT).map(|k| if k % 10 == 3 { 5.0 } else { 1.0 }).collect();
        let likelihood = likelihood(&rhos, &t_21, |_| [0.0; 2], 0.1);
        let terms = terms(&likelihood);
        let at = DepthField { near: 0.1, ..start(t_21, 0.02) };
        let found = mean_depth(&at, &terms, &likelihood).unwrap();
        let expected = rhos.iter().map(|rho| 1.0 / rho).sum::<f64>() / COUNT as f64;
        assert!((found.value / expected - 1.0).abs() < 0.01, "{} {expected}", found.value);
        let without = mean_depth(&DepthField { near: 0.0, ..at.clone() }, &terms, &likelihood).unwrap();
        assert!((without.value - 1.0).abs() < 0.01, "{}", without.value);
    }
}
