//! `bᵀ E a` of unit vectors and an essential matrix to twice the digits, as far as its value is small.
//!
//! Near a solution the constraint is a difference of numbers of order one. Computed in plain `f64` it is off by about 2e-16, which moves the
//! solution by more than the rounding of the bearings does. Cut at a fixed place, 26 bits behind the point, the leading parts of two
//! factors have a product of 52 bits behind the point, and sums of those that stay below 2 are exact; what is left is 2⁻²⁶ times as
//! large, and so is its rounding.

use crate::algebra::vectors::two::{Two, TwoVectors};

/// `1.5 × 2²⁶`: beside it a number of order one keeps 26 bits behind the point.
const CUT: f64 = 1.5 * (1_u64 << 26) as f64;

/// Two numbers of order one, and what they are cut into.
#[derive(Clone, Copy)]
pub(crate) struct Split {
    whole: Two,
    /// Multiples of 2⁻²⁶.
    high: Two,
    /// The rest, at most 2⁻²⁷.
    low: Two,
}

impl Split {
    #[inline]
    pub(crate) fn new(whole: Two) -> Self {
        let high = (whole + Two::splat(CUT)) - Two::splat(CUT);
        Self { whole, high, low: whole - high }
    }
}

/// The product of two vectors as multiples of 2⁻⁵², without rounding, and the rest.
#[inline]
fn dot(x: &[Split; 3], y: &[Split; 3]) -> (Two, Two) {
    let high = |k: usize| x[k].high * y[k].high;
    let rest = |k: usize| x[k].whole * y[k].low + x[k].low * y[k].high;
    (high(0) + high(1) + high(2), rest(0) + rest(1) + rest(2))
}

/// `bᵀ E a`.
#[inline]
pub(crate) fn form(b: &TwoVectors, e: &[[Split; 3]; 3], a: &TwoVectors) -> Two {
    let (b, a) = (b.map(Split::new), a.map(Split::new));
    let image = e.each_ref().map(|row| {
        let (high, rest) = dot(row, &a);
        let cut = Split::new(high);
        Split { low: cut.low + rest, ..cut }
    });
    let (high, rest) = dot(&b, &image);
    high + rest
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

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
            let split = e.map(|row| row.map(|x| Split::new(Two::splat(x))));
            let [found, _] = form(&b.map(Two::splat), &split, &a.map(Two::splat)).to_array();
            let exact = form_of(&e);
            assert!(exact.abs() < 1.0 / UNIT);
            // Fifteen roundings of numbers up to 2⁻²⁵, each by 2⁻⁷⁸ at most.
            assert!((found - exact).abs() < 15.0 * 2_f64.powi(-78), "{found:e} for {exact:e}");
        }
    }
}
