//! The monomials of a system up to a degree, and where each stands.

use std::collections::HashMap;

use faer::c64;

/// The degree of a monomial.
pub(super) fn degree(exponents: &[u8]) -> usize {
    exponents.iter().map(|e| usize::from(*e)).sum()
}

pub(super) fn power(x: c64, exponent: u8) -> c64 {
    (0..exponent).fold(c64::ONE, |product, _| product * x)
}

/// `a` and `b` multiplied.
pub(super) fn product(a: &[u8], b: &[u8]) -> Vec<u8> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// The monomials of a degree in so many unknowns, in lexicographic order, the first unknown's power first.
pub(super) fn of_degree(unknowns: usize, degree: usize) -> Vec<Vec<u8>> {
    let Ok(highest) = u8::try_from(degree) else { return Vec::new() };
    if unknowns == 1 {
        return vec![vec![highest]];
    }
    let mut all = Vec::new();
    for first in (0..=highest).rev() {
        for rest in of_degree(unknowns - 1, usize::from(highest - first)) {
            let mut exponents = vec![first];
            exponents.extend(rest);
            all.push(exponents);
        }
    }
    all
}

/// How many ways there are to choose `k` of `n`; the largest number where it does not fit.
pub(super) fn binomial(n: usize, k: usize) -> usize {
    let k = k.min(n - k);
    (0..k).try_fold(1_usize, |product, i| Some(product.checked_mul(n - i)? / (i + 1))).unwrap_or(usize::MAX)
}

/// How a system's monomials are graded: the degrees that belong together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grading {
    /// How many unknowns there are.
    pub(super) unknowns: usize,
    /// Degrees differ by multiples of this; zero for homogeneous systems, all of whose monomials have one degree.
    pub(super) step: usize,
}

impl Grading {
    /// The degrees up to `highest` that belong to it, the highest first.
    pub(super) fn degrees(self, highest: usize) -> Vec<usize> {
        if self.step == 0 { vec![highest] } else { (0..=highest).rev().step_by(self.step).collect() }
    }

    /// The monomials of [`degrees`](Self::degrees) up to `highest`.
    pub(super) fn monomials(self, highest: usize) -> Vec<Vec<u8>> {
        self.degrees(highest).into_iter().flat_map(|degree| of_degree(self.unknowns, degree)).collect()
    }

    /// How many [`monomials`](Self::monomials) there are.
    pub(super) fn count(self, highest: usize) -> usize {
        let of_degree = |degree| binomial(degree + self.unknowns - 1, self.unknowns - 1);
        self.degrees(highest).into_iter().fold(0, |sum: usize, degree| sum.saturating_add(of_degree(degree)))
    }

    /// By what a degree rises in one step.
    pub(super) fn rise(self) -> usize {
        self.step.max(1)
    }

    /// The monomials that take a degree to the next: those of one step, and 1 where a system is not homogeneous. The
    /// values of these are the homogeneous coordinates of a solution.
    pub(super) fn generators(self) -> Vec<Vec<u8>> {
        let mut all = of_degree(self.unknowns, self.rise());
        if self.step > 0 {
            all.push(vec![0; self.unknowns]);
        }
        all
    }
}

/// Monomials up to a degree with their places, and the weights that make a vector of their values as long as the
/// power of the point: the square roots of the coefficients of `(1 + x_1 + … + x_n)^degree`.
#[derive(Clone, Debug)]
pub(super) struct Table {
    pub(super) monomials: Vec<Vec<u8>>,
    pub(super) weights: Vec<f64>,
    places: HashMap<Vec<u8>, usize>,
}

impl Table {
    pub(super) fn new(grading: Grading, highest: usize) -> Self {
        let monomials = grading.monomials(highest);
        let weights = monomials.iter().map(|m| weight(m, highest)).collect();
        let places = monomials.iter().cloned().zip(0..).collect();
        Self { monomials, weights, places }
    }

    pub(super) fn len(&self) -> usize {
        self.monomials.len()
    }

    /// The place of a monomial that is in the table.
    pub(super) fn place(&self, monomial: &[u8]) -> Option<usize> {
        self.places.get(monomial).copied()
    }
}

/// The square root of the multinomial coefficient of a monomial, filled up with a further unknown to a degree.
fn weight(monomial: &[u8], filled_to: usize) -> f64 {
    let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
    let rest = filled_to - degree(monomial);
    let denominator: f64 = monomial.iter().map(|e| factorial(usize::from(*e))).product();
    (factorial(filled_to) / (denominator * factorial(rest))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_those_of_the_lists() {
        assert_eq!(of_degree(4, 4).len(), 35);
        assert_eq!(of_degree(4, 4)[..2], [[4, 0, 0, 0], [3, 1, 0, 0]]);
        for grading in [Grading { unknowns: 3, step: 0 }, Grading { unknowns: 3, step: 2 }] {
            for highest in [2, 4, 6] {
                assert_eq!(grading.count(highest), grading.monomials(highest).len());
            }
        }
        // Of the pose problem: degrees 0, 4 and 8.
        assert_eq!(Grading { unknowns: 4, step: 4 }.count(8), 1 + 35 + 165);
        assert_eq!(binomial(200, 100), usize::MAX);
    }

    #[test]
    fn weighted_values_are_as_long_as_the_power_of_the_point() {
        let table = Table::new(Grading { unknowns: 2, step: 1 }, 5);
        let x = [0.7_f64, -1.3];
        let value = |m: &[u8]| x[0].powi(m[0].into()) * x[1].powi(m[1].into());
        let square: f64 =
            table.monomials.iter().zip(&table.weights).map(|(m, w)| (w * value(m)).powi(2)).sum();
        assert!((square / (1.0 + x[0] * x[0] + x[1] * x[1]).powi(5) - 1.0).abs() < 1e-14);
    }
}
