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

use crate::algebra::vectors::exponential::exp;
use crate::robust::conclude::by_chance::ByChance;
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

/// The mean depth of points that are too far away to be clear is known to this share of it, as are the mean depth of points in units of
/// the median inverse depth where depths differ, and which points are near.
pub(crate) const UNKNOWN: f64 = 0.5;

/// A point that is too far away to be clear counts as at most so many times as far away as most: one at infinity says nothing of a scene.
pub(crate) const FARTHEST: f64 = 5.0;

/// The share of depths that must stand clear.
const MOST: f64 = 0.9;

/// In per cent, how many of the values of a normal variable are less than its mean and so many deviations. With a higher quantile a few
/// near points before distant ones would say that all differ.
const QUARTILE: usize = 75;
const DEVIATIONS: f64 = 0.6745;

/// The farther quarter of the points has at least this share less of the median inverse depth: what is left may be noise.
const FARTHER: f64 = 0.8;

/// Depths that differ by a factor of e in one deviation; noise that is larger than the median inverse depth seems to be more.
const MOST_SQUARE: f64 = 1.0;

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

    /// About the depth of a point that is too far away to be clear: the median of what its inverse depth may be, as far as it is positive.
    fn far(&self) -> f64 {
        1.0 / positive(0.5 * self.sum(), self.variance).0.max(0.5 * self.variance.sqrt())
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
        let m = observations.at(index);
        let lengths = Some([m.length1(), m.length2()]);
        BothDepths::new(&observations.columns, index as usize, lengths, motion, noise.sigma)
    };
    let all: Vec<_> = some.iter().map(of_inlier).collect();
    let clear = all.iter().filter(|depth| depth.is_clear()).count();
    if (clear as f64) < MOST * all.len() as f64 {
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
    let [well, badly] = seen_well_or_badly(all);
    by_depths(&well, &badly, &chance)
}

/// Those of which a usual depth would stand clear with room to spare, wherever their own is, and the others; those whose own stands
/// clear where the first are few.
fn seen_well_or_badly(all: Vec<BothDepths>) -> [Vec<BothDepths>; 2] {
    let mut sums: Vec<f64> = all.iter().map(BothDepths::sum).collect();
    let usual = median(&mut sums);
    let limit = (0.5 * usual / (WELL * CLEAR)).powi(2);
    let is_well = |depth: &BothDepths| depth.variance < limit;
    let count = all.iter().filter(|depth| is_well(depth)).count();
    let (well, badly) = if 2 * count < all.len() {
        all.into_iter().partition(BothDepths::is_clear)
    } else {
        all.into_iter().partition(is_well)
    };
    [well, badly]
}

/// The mean depth of points that are seen badly and its variance, by the median of their inverse depths where that stands clear of noise.
fn mean_of_many(badly: &[BothDepths]) -> Option<(f64, f64)> {
    let mut values: Vec<f64> = badly.iter().map(|depth| 0.5 * depth.sum()).collect();
    if values.is_empty() {
        return None;
    }
    let count = values.len() as f64;
    let variance = MEDIAN_VARIANCE * badly.iter().map(|depth| depth.variance).sum::<f64>() / (count * count);
    let rho = median(&mut values);
    (rho > CLEAR * variance.sqrt()).then(|| (1.0 / rho, variance / rho.powi(4)))
}

/// The share of a normal variable beyond this many standard deviations, by the bound of Mills' ratio.
fn beyond(deviations: f64) -> f64 {
    let bound = std::f64::consts::FRAC_2_PI.sqrt() * exp(-0.5 * deviations * deviations) / deviations;
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
fn by_depths(all: &[BothDepths], badly: &[BothDepths], chance: &Chance) -> Length {
    let (mut sum, mut by_rotation, mut by_direction) = (0.0, Vector3::zeros(), Vector3::zeros());
    let mut far = 0.0;
    let farthest = FARTHEST / median(&mut all.iter().map(|depth| 0.5 * depth.sum()).collect::<Vec<_>>());
    for depth in all {
        if !depth.is_clear() {
            far += depth.far().min(farthest);
            continue;
        }
        // The mean of 1/ρ over the noise is (1 + relative variance)/ρ to second order.
        sum += depth.z() * (1.0 - depth.relative());
        for rho in &depth.rho {
            let weight = 0.5 / (rho.value * rho.value);
            by_rotation += rho.by_rotation * weight;
            by_direction += rho.by_direction * weight;
        }
    }
    let (mut count, others) = (all.len() as f64, badly.len() as f64);
    let (mut unseen, mut of_badly) = (0.0, 0.0);
    if let Some((z, variance)) = mean_of_many(badly) {
        sum += z * others;
        count += others;
        of_badly = variance * others * others;
    } else {
        unseen = others;
    }
    let value = count / (sum + far);
    let square = |z: &f64| (z * value - 1.0).powi(2);
    let clear = || all.iter().filter(|depth| depth.is_clear());
    let of_noise: f64 = clear().map(|depth| depth.variance * depth.z().powi(4)).sum::<f64>() * value * value;
    let squares = clear().map(|depth| square(&depth.z())).sum::<f64>();
    let of_missed = chance.missed * squares;
    // What is common to those that are far, or that are not seen well and may be in one place, is not known.
    let of_unseen = (UNKNOWN * unseen).powi(2) * squares / all.len() as f64;
    let of_far = ((UNKNOWN * far).powi(2) + of_badly) * value * value + of_unseen;
    let of_false = chance.each * chance.depths.iter().map(|(z, stays)| stays * square(z)).sum::<f64>();
    // d(n/Σz) = (n/Σz)² Σ z² dρ / n.
    let by_mean = value * value / count;
    Length {
        value,
        variance: (of_noise + of_missed + of_false + of_far) * (value / count).powi(2),
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
    let shorter = exp(-0.5 * square_of_logarithms(all, of_median));
    let (value, slope) = (value * shorter, slope * shorter);
    let by_mean = slope / (2.0 * count);
    Length {
        value,
        variance: variance * shorter * shorter + (UNKNOWN * value * (1.0 - shorter)).powi(2),
        is_clear: false,
        by_rotation: rhos().map(|rho| rho.by_rotation).sum::<Vector3<f64>>() * by_mean,
        by_direction: rhos().map(|rho| rho.by_direction).sum::<Vector3<f64>>() * by_mean,
    }
}

/// The variance of the logarithms of the depths, by the quartiles of the inverse depths: half by the points that are nearer than their
/// median, which stand clear first, half by those that are farther. With normal logarithms the mean depth is `exp(τ²/2)` times the
/// inverse of the median inverse depth.
fn square_of_logarithms(all: &[BothDepths], median_rho: f64) -> f64 {
    if median_rho <= 0.0 {
        return 0.0;
    }
    let mut noises: Vec<f64> = all.iter().map(|depth| depth.variance).collect();
    let noise = median(&mut noises) * DEVIATIONS * DEVIATIONS;
    let mut beyond: Vec<f64> = all.iter().map(|depth| 0.5 * depth.sum() - median_rho).collect();
    let mut own = |percent: usize| {
        let beyond = *beyond.select_nth_unstable_by(percent * all.len() / 100, f64::total_cmp).1;
        (beyond * beyond - noise).max(0.0).sqrt() / median_rho
    };
    let [nearer, farther] = [own(QUARTILE).ln_1p(), -(-own(100 - QUARTILE).min(FARTHER)).ln_1p()];
    (0.5 * (nearer * nearer + farther * farther) / (DEVIATIONS * DEVIATIONS)).min(MOST_SQUARE)
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

/// The median, the upper of two middle ones; zero of nothing.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests;
