//! `bᵀ E a` of unit vectors and an essential matrix to twice the digits, as far as its value is small.
//!
//! Near a solution the constraint is a difference of numbers of order one. Computed in plain `f64` it is off by about 2e-16, which moves the
//! solution by more than the rounding of the bearings does. Cut at a fixed place, 26 bits behind the point, the leading parts of two
//! factors have a product of 52 bits behind the point, and sums of those that stay below 2 are exact; what is left is 2⁻²⁶ times as
//! large, and so is its rounding.
#![expect(clippy::inline_always, reason = "a call would leave the instructions of the lanes")]

use crate::algebra::vectors::geometry::{Matrix3, Vector3};
use crate::algebra::vectors::lane::{F, Float, Lanes};

/// `1.5 × 2²⁶`: beside it a number of order one keeps 26 bits behind the point.
const CUT: f64 = 1.5 * (1_u64 << 26) as f64;

/// Numbers of order one, and what they are cut into.
#[derive(Clone, Copy)]
struct Split<V> {
    whole: V,
    /// Multiples of 2⁻²⁶.
    high: V,
    /// The rest, at most 2⁻²⁷.
    low: V,
}

#[inline(always)]
fn split<L: Lanes<f64>>(lanes: L, whole: F<L>) -> Split<F<L>> {
    let high = (whole + lanes.splat(CUT)) - lanes.splat(CUT);
    Split { whole, high, low: whole - high }
}

#[inline(always)]
fn split_vector<L: Lanes<f64>>(lanes: L, v: &Vector3<L>) -> [Split<F<L>>; 3] {
    [split(lanes, v[0]), split(lanes, v[1]), split(lanes, v[2])]
}

/// The product of two vectors as multiples of 2⁻⁵², without rounding, and the rest.
#[inline(always)]
fn dot<L: Lanes<f64>>(x: &[Split<F<L>>; 3], y: &[Split<F<L>>; 3]) -> (F<L>, F<L>) {
    let (mut high, mut rest) = (x[0].high * y[0].high, x[0].low.mul_add(y[0].high, x[0].whole * y[0].low));
    for k in 1..3 {
        high = x[k].high.mul_add(y[k].high, high);
        rest = rest + x[k].low.mul_add(y[k].high, x[k].whole * y[k].low);
    }
    (high, rest)
}

/// Essential matrices, cut.
pub(crate) struct SplitEssential<L: Lanes<f64>>([[Split<F<L>>; 3]; 3]);

impl<L: Lanes<f64>> SplitEssential<L> {
    #[inline(always)]
    pub(crate) fn new(lanes: L, [x, y, z]: &Matrix3<L>) -> Self {
        Self([split_vector(lanes, x), split_vector(lanes, y), split_vector(lanes, z)])
    }

    /// `bᵀ E a`.
    #[inline(always)]
    pub(crate) fn form(&self, lanes: L, b: &Vector3<L>, a: &Vector3<L>) -> F<L> {
        let (mut image, a) = (split_vector(lanes, b), split_vector(lanes, a));
        let b = image;
        for k in 0..3 {
            let (high, rest) = dot::<L>(&self.0[k], &a);
            let cut = split(lanes, high);
            image[k] = Split { low: cut.low + rest, ..cut };
        }
        let (high, rest) = dot::<L>(&b, &image);
        high + rest
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::algebra::vectors::two::{Two, TwoLanes};

    /// Multiples of 2⁻³⁵: the products of three are multiples of 2⁻¹⁰⁵, and integers of 128 bits hold their sums.
    const UNIT: f64 = (1_u64 << 35) as f64;

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "whole numbers are cast to integers")]
    fn small_forms_keep_their_digits() {
        let mut rng = ChaCha8Rng::seed_from_u64(14);
        for _ in 0..1_000 {
            let mut draw = |size: f64| (rng.random_range(-size..size) * UNIT).round() / UNIT;
            let [a, b] = [0, 1].map(|_| [draw(0.4), draw(0.4), 0.75]);
            let mut e: [[f64; 3]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| draw(0.5)));
            e[2][2] = 0.0;
            let form_of = |e: &[[f64; 3]; 3]| {
                let whole = |x: f64| (x * UNIT) as i128;
                let product = |k: usize| whole(b[k / 3]) * whole(e[k / 3][k % 3]) * whole(a[k % 3]);
                (0..9).map(product).sum::<i128>() as f64 / UNIT.powi(3)
            };
            // What is left is of the size of a unit.
            e[2][2] = (-form_of(&e) / (a[2] * b[2]) * UNIT).round() / UNIT;
            let split = SplitEssential::new(TwoLanes, &e.map(|row| row.map(Two::splat)));
            let [found, _] = split.form(TwoLanes, &b.map(Two::splat), &a.map(Two::splat)).to_array();
            let exact = form_of(&e);
            assert!(exact.abs() < 1.0 / UNIT);
            // Fifteen roundings of numbers up to 2⁻²⁵, each by 2⁻⁷⁸ at most.
            assert!((found - exact).abs() < 15.0 * 2_f64.powi(-78), "{found:e} for {exact:e}");
        }
    }
}
