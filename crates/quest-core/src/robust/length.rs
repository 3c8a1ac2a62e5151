//! The length of the translation in the scale of [`conventions`](crate::conventions): the mean absolute depth is one.
//!
//! Where every depth stands clear of its noise that is what is computed. Where some do not, inverse depths are the
//! quantity whose noise is symmetric, and their median, signs included, goes to zero with the parallax. Weighted means would be
//! ruled by a few chance inliers.
//!
//! The noise of depths, given the motion, averages out soon. What is left of the variance is which points the mean is over: true
//! matches beyond the threshold are not among the inliers, and false ones are, with any depth.

use nalgebra::Vector5;

use super::columns::Columns;
use super::inverse_depth::{Differentiated, InverseDepth};
use super::observations::Observations;
use crate::epipolar_frame::tangent_basis;
use crate::solver::motion::Motion;

/// A depth is clear of its noise at so many standard deviations.
const CLEAR: f64 = 3.0;

/// The share of depths that have to be.
const MOST: f64 = 0.9;

/// More matches than this are not looked at.
const ENOUGH: usize = 2_000;

/// The variance of a median over that of the mean, of normal variables.
const MEDIAN_VARIANCE: f64 = std::f64::consts::FRAC_PI_2;

/// A length, its variance by the noise of the depths alone, and its derivatives by the parameters of
/// [`Motion::stepped`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Length {
    pub(super) value: f64,
    pub(super) variance: f64,
    pub(super) slope: Vector5<f64>,
}

/// The mean inverse depth of a match in both views.
#[derive(Clone, Copy, Debug)]
struct MeanDepth {
    rho: [f64; 2],
    slopes: [Vector5<f64>; 2],
    variance: f64,
}

impl MeanDepth {
    /// Of a match whose vectors have these lengths where they were given: depths are multiples of them.
    fn new(columns: &Columns, index: usize, lengths: Option<[f64; 2]>, motion: &Motion, sigma: f64) -> Self {
        let tangent = tangent_basis(&motion.direction);
        let points = columns.vectors(index);
        let scales = lengths.map_or([1.0; 2], |lengths| [0, 1].map(|k| lengths[k] / points[k].norm()));
        let both = Differentiated::both(&points, motion);
        let slope = |k: usize| {
            let Differentiated { by_rotation, by_direction, .. } = both[k];
            let [t0, t1] = tangent.map(|tangent| by_direction.dot(&tangent));
            Vector5::new(by_rotation.x, by_rotation.y, by_rotation.z, t0, t1) * scales[k]
        };
        Self {
            rho: [0, 1].map(|k| both[k].value * scales[k]),
            slopes: [0, 1].map(slope),
            variance: InverseDepth::new(columns, motion, index).variance(sigma),
        }
    }

    /// Its variance over its square.
    fn relative(&self) -> f64 {
        let sum = self.rho[0] + self.rho[1];
        4.0 * self.variance / (sum * sum)
    }

    fn z(&self) -> f64 {
        0.5 * (1.0 / self.rho[0] + 1.0 / self.rho[1])
    }

    fn is_clear(&self) -> bool {
        self.rho.iter().all(|rho| *rho > 0.0) && self.relative() < 1.0 / (CLEAR * CLEAR)
    }
}

/// What is known of the noise of the inliers and of the matches that are among them by chance.
pub(super) struct Noise<'a> {
    /// In pixels.
    pub(super) sigma: f64,
    pub(super) threshold: f64,
    pub(super) false_matches: &'a Columns,
}

/// The length of the translation of a motion, negative where most of the points are behind the cameras.
pub(super) fn length(observations: &Observations, motion: &Motion, inliers: &[u32], noise: &Noise) -> Length {
    let some = &inliers[..inliers.len().min(ENOUGH)];
    if some.is_empty() {
        return Length { value: 0.0, variance: 0.0, slope: Vector5::zeros() };
    }
    let of_inlier = |&index: &u32| {
        let m = &observations.matches[index as usize];
        let lengths = Some([m.length1(), m.length2()]);
        MeanDepth::new(&observations.columns, index as usize, lengths, motion, noise.sigma)
    };
    let all: Vec<_> = some.iter().map(of_inlier).collect();
    let clear: Vec<_> = all.iter().copied().filter(MeanDepth::is_clear).collect();
    if (clear.len() as f64) < MOST * all.len() as f64 {
        return by_inverse_depths(&all);
    }
    let Noise { sigma, threshold, false_matches } = *noise;
    let of_false = |index: u32| MeanDepth::new(false_matches, index as usize, None, motion, sigma);
    let agreeing = false_matches.agreeing(motion, threshold).into_iter().map(of_false);
    let outliers = (observations.len() - inliers.len()) as f64 * some.len() as f64 / inliers.len() as f64;
    let chance = Chance {
        depths: agreeing.filter(MeanDepth::is_clear).map(|depth| depth.z()).collect(),
        each: outliers / false_matches.len().max(1) as f64,
        missed: beyond(threshold / sigma),
    };
    by_depths(&clear, &chance)
}

/// What share of a normal variable is beyond so many standard deviations, by the bound of Mills' ratio.
fn beyond(deviations: f64) -> f64 {
    let bound = std::f64::consts::FRAC_2_PI.sqrt() * (-0.5 * deviations * deviations).exp() / deviations;
    bound.min(1.0)
}

/// The inliers that are false, and the true matches that are not among them.
struct Chance {
    /// The depths of some that are false.
    depths: Vec<f64>,
    /// As how many inliers each of them counts.
    each: f64,
    /// The share of true matches that are no inliers.
    missed: f64,
}

/// The inverse of the mean of depths that are clear of noise.
fn by_depths(all: &[MeanDepth], chance: &Chance) -> Length {
    let (mut sum, mut slope) = (0.0, Vector5::zeros());
    for depth in all {
        // The mean of 1/ρ over the noise is (1 + relative variance)/ρ to second order.
        sum += depth.z() * (1.0 - depth.relative());
        let [z1, z2] = depth.rho.map(|rho| 1.0 / rho);
        slope += (depth.slopes[0] * (z1 * z1) + depth.slopes[1] * (z2 * z2)) * 0.5;
    }
    let count = all.len() as f64;
    let value = count / sum;
    let square = |z: &f64| (z * value - 1.0).powi(2);
    let of_noise: f64 =
        all.iter().map(|depth| depth.variance * depth.z().powi(4)).sum::<f64>() * value * value;
    let of_missed = chance.missed * all.iter().map(|depth| square(&depth.z())).sum::<f64>();
    let of_false = chance.each * chance.depths.iter().map(square).sum::<f64>();
    // d(n/Σz) = (n/Σz)² Σ z² dρ / n.
    Length {
        value,
        variance: (of_noise + of_missed + of_false) * (value / count).powi(2),
        slope: slope * (value * value / count),
    }
}

/// The median of the inverse depths, with the slope of their mean.
fn by_inverse_depths(all: &[MeanDepth]) -> Length {
    let count = all.len() as f64;
    let [mut first, mut second] = [0, 1].map(|k| all.iter().map(|depth| depth.rho[k]).collect::<Vec<_>>());
    let variance: f64 = all.iter().map(|depth| depth.variance).sum();
    let slope: Vector5<f64> = all.iter().map(|depth| depth.slopes[0] + depth.slopes[1]).sum();
    Length {
        value: 0.5 * (median(&mut first) + median(&mut second)),
        variance: MEDIAN_VARIANCE * variance / (count * count),
        slope: slope / (2.0 * count),
    }
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
