//! Polynomials in q1, q2, q3, q4 with exact bookkeeping: a map from exponents to coefficients.

use std::collections::BTreeMap;

use faer::c64;

/// The powers of q1, q2, q3, q4 in a monomial.
pub type Exponents = [u8; 4];

/// A polynomial in q1, q2, q3, q4.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polynomial(BTreeMap<Exponents, f64>);

impl Polynomial {
    /// The linear form `c · q`.
    #[must_use]
    pub fn linear(c: [f64; 4]) -> Self {
        Self((0..4).map(|k| (power(k), c[k])).collect())
    }

    /// The unknown `q_{k+1}`.
    #[must_use]
    pub fn unknown(k: usize) -> Self {
        Self(BTreeMap::from([(power(k), 1.0)]))
    }

    /// The coefficient of a monomial.
    #[must_use]
    pub fn coefficient(&self, monomial: Exponents) -> f64 {
        self.0.get(&monomial).copied().unwrap_or(0.0)
    }

    /// The coefficients of a list of monomials.
    #[must_use]
    pub fn coefficients(&self, monomials: &[Exponents]) -> Vec<f64> {
        monomials.iter().map(|&m| self.coefficient(m)).collect()
    }

    /// The largest absolute coefficient.
    #[must_use]
    pub fn amax(&self) -> f64 {
        self.0.values().fold(0.0, |largest, c| largest.max(c.abs()))
    }

    /// The sum of this and `factor` times another.
    #[must_use]
    pub fn plus(mut self, factor: f64, other: &Self) -> Self {
        for (monomial, c) in &other.0 {
            *self.0.entry(*monomial).or_default() += factor * c;
        }
        self
    }

    /// The product with another.
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        let mut product = Self::default();
        for (a, c) in &self.0 {
            for (b, d) in &other.0 {
                *product.0.entry([0, 1, 2, 3].map(|k| a[k] + b[k])).or_default() += c * d;
            }
        }
        product
    }

    /// Quotient and remainder of the division by `q·q = q1² + q2² + q3² + q4²`: term by term, the highest power
    /// of q1 first, until nothing is left that q1² divides.
    #[must_use]
    pub fn divided_by_norm(&self) -> (Self, Self) {
        let (mut quotient, mut rest) = (Self::default(), self.clone());
        let squares: Vec<_> = (0..4).map(|k| power(k).map(|e| 2 * e)).collect();
        while let Some((&monomial, &c)) = rest.0.iter().rev().find(|(m, _)| m[0] >= 2) {
            let reduced = [monomial[0] - 2, monomial[1], monomial[2], monomial[3]];
            quotient.0.insert(reduced, c);
            for square in &squares {
                *rest.0.entry([0, 1, 2, 3].map(|k| reduced[k] + square[k])).or_default() -= c;
            }
            rest.0.remove(&monomial);
        }
        (quotient, rest)
    }

    /// The value at a complex quaternion.
    #[must_use]
    pub fn evaluate(&self, q: [c64; 4]) -> c64 {
        self.0.iter().fold(c64::new(0.0, 0.0), |sum, (m, c)| sum + monomial_value(*m, q) * *c)
    }
}

/// The value of a monomial at a complex quaternion.
#[must_use]
pub fn monomial_value(monomial: Exponents, q: [c64; 4]) -> c64 {
    (0..4).fold(c64::new(1.0, 0.0), |product, k| product * q[k].powu(u32::from(monomial[k])))
}

fn power(k: usize) -> Exponents {
    let mut e = [0; 4];
    e[k] = 1;
    e
}

/// The monomials of a degree, in lexicographic order, q1⁴ first.
#[must_use]
pub fn monomials(degree: u8) -> Vec<Exponents> {
    let mut all = Vec::new();
    for a in (0..=degree).rev() {
        for b in (0..=degree - a).rev() {
            for c in (0..=degree - a - b).rev() {
                all.push([a, b, c, degree - a - b - c]);
            }
        }
    }
    all
}

/// The determinant of a square matrix of polynomials, given by its columns, by expansion.
#[must_use]
pub fn determinant(columns: &[Vec<Polynomial>]) -> Polynomial {
    if columns.len() == 1 {
        return columns[0][0].clone();
    }
    let mut sum = Polynomial::default();
    for row in 0..columns.len() {
        let without = |column: &Vec<Polynomial>| {
            let kept = column.iter().enumerate().filter(|(i, _)| *i != row);
            kept.map(|(_, p)| p.clone()).collect()
        };
        let minor: Vec<Vec<_>> = columns[1..].iter().map(without).collect();
        let sign = if row % 2 == 0 { 1.0 } else { -1.0 };
        sum = sum.plus(sign, &columns[0][row].times(&determinant(&minor)));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_35_quartic_and_56_quintic_monomials() {
        assert_eq!(monomials(4).len(), 35);
        assert_eq!(monomials(5).len(), 56);
        assert_eq!(monomials(4)[..2], [[4, 0, 0, 0], [3, 1, 0, 0]]);
    }

    #[test]
    fn division_undoes_the_multiplication_by_the_norm() {
        let a = Polynomial::linear([1.0, -2.0, 0.5, 3.0]);
        let p = a.times(&a).plus(2.0, &Polynomial::unknown(3).times(&Polynomial::unknown(1)));
        let norm = (0..4).fold(Polynomial::default(), |sum, k| {
            sum.plus(1.0, &Polynomial::unknown(k).times(&Polynomial::unknown(k)))
        });
        let (quotient, rest) = p.times(&norm).divided_by_norm();
        assert!(quotient.plus(-1.0, &p).amax() < 1e-14);
        assert!(rest.amax() < 1e-14);
        let (_, rest) = p.times(&norm).plus(1.0, &p).divided_by_norm();
        assert!(rest.amax() > 0.1);
    }
}
