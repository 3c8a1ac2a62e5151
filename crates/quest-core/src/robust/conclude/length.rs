//! The length of the translation in the scale of [`conventions`](crate::conventions): the mean absolute depth is one.
//!
//! Where most depths stand clear of their noise, the mean is computed, over the points that are seen well enough at a usual depth. Among
//! those near an epipole, which are not, only near points would stand clear, and the mean would be too small. Where some depths do not
//! stand clear, the median of the inverse depths is taken, signs included: their noise is symmetric, and the median goes to zero with the
//! parallax. Weighted means would be ruled by a few chance inliers.
//!
//! The noise of depths, given the motion, averages out soon. The rest of the variance comes from which points the mean is over: true
//! matches beyond the threshold are missing, and false matches with any depth are among the inliers.

use nalgebra::{Vector3, Vector5};

use crate::robust::conclude::chance_inliers::ByChance;
use crate::robust::conclude::inverse_depth::{Differentiated, InverseDepth};
use crate::robust::data::columns::Columns;
use crate::robust::data::observations::Observations;
use crate::solver::shared::motion::Motion;

/// A depth stands clear of its noise at this many standard deviations.
const CLEAR: f64 = 3.0;

/// A point is seen well if its depth, were it a usual one, would stand clear by so many times more: points that are twice as far away
/// are then clear as well.
const WELL: f64 = 2.0;

/// More points are in front of the cameras than behind by so many standard deviations of a vote by chance.
const BY_CHANCE: f64 = 2.0;

/// The share of depths that must stand clear.
const MOST: f64 = 0.9;

/// More matches than this are not looked at.
const ENOUGH: usize = 2_000;

/// The variance of a median over that of the mean, of normal variables.
const MEDIAN_VARIANCE: f64 = std::f64::consts::FRAC_PI_2;

/// A length, its variance for a given motion, and its derivatives by that.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Length {
    pub(crate) value: f64,
    pub(crate) variance: f64,
    /// Whether it is by depths that are clear of their noise.
    pub(crate) is_clear: bool,
    by_rotation: Vector3<f64>,
    by_direction: Vector3<f64>,
}

impl Length {
    /// The derivatives by the parameters of [`Motion::stepped`].
    pub(crate) fn slope(&self, tangent: &[Vector3<f64>; 2]) -> Vector5<f64> {
        let [t0, t1] = tangent.map(|tangent| self.by_direction.dot(&tangent));
        Vector5::new(self.by_rotation.x, self.by_rotation.y, self.by_rotation.z, t0, t1)
    }
}

/// The inverse depths of a match in view 1 and in view 2, and their variance.
#[derive(Clone, Copy, Debug)]
struct BothDepths {
    rho: [Differentiated; 2],
    variance: f64,
}

impl BothDepths {
    /// The depths of a match whose vectors were given with these lengths: depths are multiples of them.
    fn new(columns: &Columns, index: usize, lengths: Option<[f64; 2]>, motion: &Motion, sigma: f64) -> Self {
        let depth = InverseDepth::new(columns, motion, index);
        let scales =
            lengths.map_or([1.0; 2], |[first, second]| [first / depth.x1.norm(), second / depth.x2.norm()]);
        let [one, two] = depth.differentiated(motion);
        Self { rho: [one * scales[0], two * scales[1]], variance: depth.variance(sigma) }
    }

    fn sum(&self) -> f64 {
        self.rho[0].value + self.rho[1].value
    }

    /// Its variance over its square.
    fn relative(&self) -> f64 {
        4.0 * self.variance / self.sum().powi(2)
    }

    /// The mean of the two depths.
    fn z(&self) -> f64 {
        0.5 * (1.0 / self.rho[0].value + 1.0 / self.rho[1].value)
    }

    fn is_clear(&self) -> bool {
        self.side() > 0.0
    }

    /// One in front of both cameras, minus one behind both, zero where neither stands clear.
    fn side(&self) -> f64 {
        let [first, second] = [0, 1].map(|k| self.rho[k].value);
        let is_clear = first * second > 0.0 && self.relative() < 1.0 / (CLEAR * CLEAR);
        if is_clear { first.signum() } else { 0.0 }
    }
}

/// What is known of the noise of the inliers and of the matches that are among them by chance.
pub(crate) struct Noise<'a> {
    /// In pixels.
    pub(crate) sigma: f64,
    pub(crate) false_matches: &'a Columns,
    pub(crate) by_chance: &'a ByChance,
}

/// The length of the translation of a motion, negative where most of the points are behind the cameras.
pub(crate) fn length(observations: &Observations, motion: &Motion, inliers: &[u32], noise: &Noise) -> Length {
    let some = &inliers[..inliers.len().min(ENOUGH)];
    if some.is_empty() {
        let zero = Vector3::zeros();
        return Length { value: 0.0, variance: 0.0, is_clear: false, by_rotation: zero, by_direction: zero };
    }
    let of_inlier = |&index: &u32| {
        let m = &observations.matches[index as usize];
        let lengths = Some([m.length1(), m.length2()]);
        BothDepths::new(&observations.columns, index as usize, lengths, motion, noise.sigma)
    };
    let all: Vec<_> = some.iter().map(of_inlier).collect();
    let clear: Vec<_> = all.iter().copied().filter(BothDepths::is_clear).collect();
    if (clear.len() as f64) < MOST * all.len() as f64 {
        return by_inverse_depths(&all);
    }
    let Noise { sigma, false_matches, by_chance } = *noise;
    let threshold = false_matches.threshold();
    let of_false = |index: u32| {
        let stays = by_chance.stays(&InverseDepth::new(false_matches, motion, index as usize), sigma);
        (BothDepths::new(false_matches, index as usize, None, motion, sigma), stays)
    };
    let agreeing = false_matches.agreeing(motion, threshold).into_iter().map(of_false);
    let outliers = (observations.len() - inliers.len()) as f64 * some.len() as f64 / inliers.len() as f64;
    let chance = Chance {
        depths: agreeing
            .filter(|(depth, _)| depth.is_clear())
            .map(|(depth, stays)| (depth.z(), stays))
            .collect(),
        each: outliers / false_matches.len().max(1) as f64,
        missed: beyond(threshold / sigma),
    };
    let well = seen_well(&clear);
    let unseen = (all.len() - well.len()) as f64 / well.len() as f64;
    by_depths(&well, &Chance { missed: chance.missed + unseen, ..chance })
}

/// Those of which a usual depth would stand clear with room to spare; all of them where there are few of these.
fn seen_well(clear: &[BothDepths]) -> Vec<BothDepths> {
    let mut sums: Vec<f64> = clear.iter().map(BothDepths::sum).collect();
    let usual = median(&mut sums);
    let limit = (0.5 * usual / (WELL * CLEAR)).powi(2);
    let well: Vec<_> = clear.iter().copied().filter(|depth| depth.variance < limit).collect();
    if 2 * well.len() < clear.len() { clear.to_vec() } else { well }
}

/// The share of a normal variable beyond this many standard deviations, by the bound of Mills' ratio.
fn beyond(deviations: f64) -> f64 {
    let bound = std::f64::consts::FRAC_2_PI.sqrt() * (-0.5 * deviations * deviations).exp() / deviations;
    bound.min(1.0)
}

/// The inliers that are false, and the true matches that are not among them.
struct Chance {
    /// The depths of some that are false, and how likely each stays among the inliers.
    depths: Vec<(f64, f64)>,
    /// As how many inliers each of them counts.
    each: f64,
    /// The share of true matches that are no inliers.
    missed: f64,
}

/// The inverse of the mean of depths that are clear of noise.
fn by_depths(all: &[BothDepths], chance: &Chance) -> Length {
    let (mut sum, mut by_rotation, mut by_direction) = (0.0, Vector3::zeros(), Vector3::zeros());
    for depth in all {
        // The mean of 1/ρ over the noise is (1 + relative variance)/ρ to second order.
        sum += depth.z() * (1.0 - depth.relative());
        for rho in &depth.rho {
            let weight = 0.5 / (rho.value * rho.value);
            by_rotation += rho.by_rotation * weight;
            by_direction += rho.by_direction * weight;
        }
    }
    let count = all.len() as f64;
    let value = count / sum;
    let square = |z: &f64| (z * value - 1.0).powi(2);
    let of_noise: f64 =
        all.iter().map(|depth| depth.variance * depth.z().powi(4)).sum::<f64>() * value * value;
    let of_missed = chance.missed * all.iter().map(|depth| square(&depth.z())).sum::<f64>();
    let of_false = chance.each * chance.depths.iter().map(|(z, stays)| stays * square(z)).sum::<f64>();
    // d(n/Σz) = (n/Σz)² Σ z² dρ / n.
    let by_mean = value * value / count;
    Length {
        value,
        variance: (of_noise + of_missed + of_false) * (value / count).powi(2),
        is_clear: true,
        by_rotation: by_rotation * by_mean,
        by_direction: by_direction * by_mean,
    }
}

/// The median of the inverse depths, with the slope of their mean. It is positive where near points say so: the median of distant
/// ones is noise, whose sign would turn the translation around.
fn by_inverse_depths(all: &[BothDepths]) -> Length {
    let count = all.len() as f64;
    let [mut first, mut second] =
        [0, 1].map(|k| all.iter().map(|depth| depth.rho[k].value).collect::<Vec<_>>());
    let variance: f64 = all.iter().map(|depth| depth.variance).sum();
    let rhos = || all.iter().flat_map(|depth| &depth.rho);
    let of_median = 0.5 * (median(&mut first) + median(&mut second));
    let variance = MEDIAN_VARIANCE * variance / (count * count);
    let (value, slope) = if are_in_front(all) { positive(of_median, variance) } else { (of_median, 1.0) };
    let by_mean = slope / (2.0 * count);
    Length {
        value,
        variance,
        is_clear: false,
        by_rotation: rhos().map(|rho| rho.by_rotation).sum::<Vector3<f64>>() * by_mean,
        by_direction: rhos().map(|rho| rho.by_direction).sum::<Vector3<f64>>() * by_mean,
    }
}

/// Whether the points whose depths stand clear of their noise are in front, by more than chance.
fn are_in_front(all: &[BothDepths]) -> bool {
    let sides = || all.iter().map(BothDepths::side);
    let (sum, count) = (sides().sum::<f64>(), sides().map(f64::abs).sum::<f64>());
    sum > BY_CHANCE * count.sqrt()
}

/// About the mean of a normal variable that is known to be positive, and its derivative by the mean that it would have otherwise: the
/// same at zero and far from it.
fn positive(mean: f64, variance: f64) -> (f64, f64) {
    let root = (mean * mean + 8.0 / std::f64::consts::PI * variance).sqrt().max(f64::MIN_POSITIVE);
    (0.5 * (mean + root), 0.5 * (1.0 + mean / root))
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
