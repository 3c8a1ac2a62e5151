//! The length of the translation in the scale of [`conventions`](crate::conventions): the mean absolute depth is one.
//!
//! Where every depth stands clear of its noise that is what is computed. Where some do not, inverse depths are the
//! quantity whose noise is symmetric, and their median, signs included, goes to zero with the parallax. Weighted means would be
//! ruled by a few chance inliers.

use super::observations::Observations;
use super::plane::{InverseDepth, inverse_depth};
use crate::solver::motion::Motion;

/// A depth is clear of its noise at so many standard deviations.
const CLEAR: f64 = 3.0;

/// The share of depths that have to be.
const MOST: f64 = 0.9;

/// More matches than this are not looked at.
const ENOUGH: usize = 2_000;

/// The variance of a median over that of the mean, of normal variables.
const MEDIAN_VARIANCE: f64 = std::f64::consts::FRAC_PI_2;

/// A length, and its variance by the noise of the depths alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Length {
    pub(super) value: f64,
    pub(super) variance: f64,
}

/// The length of the translation of a motion, negative where most of the points are behind the cameras; `sigma` is the
/// noise of the inliers in pixels.
pub(super) fn length(observations: &Observations, motion: &Motion, inliers: &[u32], sigma: f64) -> Length {
    let inliers = &inliers[..inliers.len().min(ENOUGH)];
    if inliers.is_empty() {
        return Length { value: 0.0, variance: 0.0 };
    }
    let (mut first, mut second) = (Vec::new(), Vec::new());
    let (mut clear, mut depths, mut variance) = (0.0, 0.0, 0.0);
    for &index in inliers {
        let m = &observations.matches[index as usize];
        let [one, two] = both_views(observations, motion, index as usize);
        let scaled = |d: &InverseDepth, length: f64| d.value * length / d.x1.norm();
        let (rho1, rho2) = (scaled(&one, m.length1()), scaled(&two, m.length2()));
        let noise = sigma * sigma / one.precision;
        first.push(rho1);
        second.push(rho2);
        variance += noise;
        let relative = noise / (0.25 * (rho1 + rho2) * (rho1 + rho2));
        if rho1 > 0.0 && rho2 > 0.0 && relative < 1.0 / (CLEAR * CLEAR) {
            clear += 1.0;
            // The mean of 1/ρ over the noise is (1 + relative variance)/ρ to second order.
            depths += 0.5 * (1.0 / rho1 + 1.0 / rho2) * (1.0 - relative);
        }
    }
    let count = inliers.len() as f64;
    let variance = MEDIAN_VARIANCE * variance / (count * count);
    let value =
        if clear >= MOST * count { clear / depths } else { 0.5 * (median(&mut first) + median(&mut second)) };
    Length { value, variance }
}

/// The inverse depths of a match in view 1 and in view 2.
fn both_views(observations: &Observations, motion: &Motion, index: usize) -> [InverseDepth; 2] {
    let [x1, x2] = observations.vectors(index);
    let one = inverse_depth(observations, motion, index);
    let turned = motion.q_21 * x1;
    // z1 R x1 + t = z2 x2 crossed with R x1: the same with the views exchanged.
    let across = turned.cross(&motion.direction);
    let square = across.norm_squared().max(1e-18);
    let value = across.dot(&turned.cross(&x2)) / square;
    [one, InverseDepth { x1: x2, value, precision: one.precision }]
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
