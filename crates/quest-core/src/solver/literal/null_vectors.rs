//! The null vectors of `D̄` of (50), for five matches and for more.
//!
//! Of five matches `D̄` is 465 × 325, and its null vectors are the functionals on the octics that vanish on every quartic
//! times every quartic monomial, as in [`polynomial_system`](crate::polynomial_system): 350 equations for 165 numbers, as by (40)
//! the monomials of degree 4 and 0 are octics as well.

use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};

use super::buffers::{Factored, Matrix, Singular, zeros};
use crate::algebra::monomials::{homogeneous, sum};
use crate::quaternion::monomials::{MONOMIALS, Quartic};

/// How many octic monomials there are.
pub(super) const OCTICS: usize = 165;

/// How many solutions five matches have.
pub(super) const SOLUTIONS: usize = 20;

/// Where an octic monomial stands in lexicographic order: behind those with more of the first unknown, and so on.
const fn place(e: [u8; 4]) -> usize {
    let rest = 8 - e[0] as usize;
    let rest2 = rest - e[1] as usize;
    (rest + 2) * (rest + 1) * rest / 6 + (rest2 + 1) * rest2 / 2 + (rest2 - e[2] as usize)
}

/// `PRODUCT[i][j]`: the octic that is the product of two quartic monomials.
pub(super) const PRODUCT: [[usize; 35]; 35] = {
    let mut table = [[0; 35]; 35];
    let mut i = 0;
    while i < 35 {
        let mut j = 0;
        while j < 35 {
            table[i][j] = place(sum(MONOMIALS[i], MONOMIALS[j]));
            j += 1;
        }
        i += 1;
    }
    table
};

/// The square roots of the multinomial coefficients: with them the values of the octics at a unit quaternion are a unit vector.
fn weights() -> [f64; OCTICS] {
    const EXPONENTS: [[u8; 4]; OCTICS] = homogeneous::<OCTICS>(8);
    let factorial = |n: u8| (1..=n).map(f64::from).product::<f64>();
    EXPONENTS.map(|e| (factorial(8) / e.map(factorial).iter().product::<f64>()).sqrt())
}

/// Of five matches: the functionals, in columns, by their values at the octics.
pub(super) struct Functionals {
    weights: [f64; OCTICS],
    multiples: Matrix,
    factored: Factored,
    pub(super) values: Matrix,
}

impl Default for Functionals {
    fn default() -> Self {
        Self {
            weights: weights(),
            multiples: Matrix::default(),
            factored: Factored::default(),
            values: Matrix::default(),
        }
    }
}

impl Functionals {
    /// By a QR decomposition of the multiples of the quartics in columns, with pivots: what is orthogonal to all of them.
    pub(super) fn find(&mut self, quartics: &[Quartic]) {
        zeros(&mut self.multiples, OCTICS, 35 * quartics.len());
        for (k, quartic) in quartics.iter().enumerate() {
            for (j, products) in PRODUCT.iter().enumerate() {
                for (c, &place) in quartic.iter().zip(products) {
                    self.multiples[(place, 35 * k + j)] += c / self.weights[place];
                }
            }
        }
        self.factored.factor_pivoted(&mut self.multiples);
        zeros(&mut self.values, OCTICS, SOLUTIONS);
        for k in 0..SOLUTIONS {
            self.values[(OCTICS - SOLUTIONS + k, k)] = 1.0;
        }
        self.factored.apply(self.multiples.as_ref(), &mut self.values);
        for k in 0..SOLUTIONS {
            for (place, weight) in self.weights.iter().enumerate() {
                self.values[(place, k)] /= weight;
            }
        }
    }
}

/// The equations (11): pairs of products of two quartic monomials that are the same octic, every further way to write it with the
/// first.
fn relations() -> Vec<[[usize; 2]; 2]> {
    let mut first = [None; OCTICS];
    let mut relations = Vec::new();
    for i in 0..35 {
        for j in i..35 {
            match first[PRODUCT[i][j]] {
                Some(pair) => relations.push([pair, [i, j]]),
                None => first[PRODUCT[i][j]] = Some([i, j]),
            }
        }
    }
    relations
}

/// Where `s_i s_j`, `i ≤ j ≤ n`, stands among the products of `n` directions and 1.
pub(super) fn pair(i: usize, j: usize, n: usize) -> usize {
    let (i, j) = (i.min(j), i.max(j));
    i * (n + 1) - i * (i + 1) / 2 + j
}

/// Of more matches: the two null vectors of `D̄`, or what comes nearest to them.
pub(super) struct Relinearized {
    relations: Vec<[[usize; 2]; 2]>,
    d_bar: Matrix,
    triangle: Matrix,
    factored: Factored,
    singular: Singular,
    /// In columns.
    pub(super) vectors: Matrix,
}

impl Default for Relinearized {
    fn default() -> Self {
        Self {
            relations: relations(),
            d_bar: Matrix::default(),
            triangle: Matrix::default(),
            factored: Factored::default(),
            singular: Singular::default(),
            vectors: Matrix::default(),
        }
    }
}

/// Up to so many columns all singular vectors are computed.
const FEW: usize = 12;

/// Steps of the inverse iteration at most: without noise one is enough.
const STEPS: usize = 20;

impl Relinearized {
    /// Of `x = Σ s_i v_i + x_p`, with the `v_i` and then `x_p` the columns of `basis`. `false` where nothing is determined.
    pub(super) fn find(&mut self, basis: &Matrix) -> bool {
        self.fill(basis);
        let columns = self.d_bar.ncols();
        self.factored.factor(&mut self.d_bar);
        zeros(&mut self.triangle, columns, columns);
        for j in 0..columns {
            for i in 0..=j {
                self.triangle[(i, j)] = self.d_bar[(i, j)];
            }
        }
        zeros(&mut self.vectors, columns, 2);
        if columns > FEW {
            return self.iterate();
        }
        let found = self.singular.decompose(self.triangle.as_ref());
        for k in 0..2 {
            for i in 0..columns {
                self.vectors[(i, k)] = self.singular.v[(i, columns - 2 + k)];
            }
        }
        found
    }

    /// `D̄`: the products of `s`, then `s`, then 1, by rows of the relations.
    fn fill(&mut self, basis: &Matrix) {
        let n = basis.ncols() - 1;
        zeros(&mut self.d_bar, self.relations.len(), (n + 1) * (n + 2) / 2);
        for j in 0..=n {
            for i in 0..=j {
                let column = pair(i, j, n);
                let product = |[a, b]: [usize; 2]| {
                    let one = basis[(a, i)] * basis[(b, j)];
                    if i == j { one } else { one + basis[(a, j)] * basis[(b, i)] }
                };
                for (row, [left, right]) in self.relations.iter().enumerate() {
                    self.d_bar[(row, column)] = product(*left) - product(*right);
                }
            }
        }
    }

    /// The two vectors that the triangle shortens most, by inverse iteration on `RᵀR`.
    fn iterate(&mut self) -> bool {
        let n = self.triangle.ncols();
        let largest = (0..n).map(|i| self.triangle[(i, i)].abs()).fold(0.0, f64::max);
        // A zero would be divided by.
        let least = f64::EPSILON * largest;
        for i in 0..n {
            let pivot = &mut self.triangle[(i, i)];
            *pivot = if pivot.abs() < least { least } else { *pivot };
        }
        // Two vectors without a pattern.
        for i in 0..n {
            self.vectors[(i, 0)] = (1.0 + i as f64).sin();
            self.vectors[(i, 1)] = (1.0 + 1.7 * i as f64).cos();
        }
        let mut before = [0.0; 2];
        for _ in 0..STEPS {
            let r = self.triangle.as_ref();
            solve_lower_triangular_in_place(r.transpose(), self.vectors.as_mut(), faer::Par::Seq);
            solve_upper_triangular_in_place(r, self.vectors.as_mut(), faer::Par::Seq);
            let Some(growth) = self.orthonormalize() else { return false };
            let settled = (0..2).all(|k| (growth[k] - before[k]).abs() <= 1e-12 * growth[k]);
            before = growth;
            if settled {
                break;
            }
        }
        true
    }

    /// Makes the two vectors orthonormal; the factors that they were divided by.
    fn orthonormalize(&mut self) -> Option<[f64; 2]> {
        let n = self.vectors.nrows();
        let v = &mut self.vectors;
        let mut norms = [0.0; 2];
        for k in 0..2 {
            if k == 1 {
                let along: f64 = (0..n).map(|i| v[(i, 0)] * v[(i, 1)]).sum();
                (0..n).for_each(|i| v[(i, 1)] -= along * v[(i, 0)]);
            }
            norms[k] = (0..n).map(|i| v[(i, k)] * v[(i, k)]).sum::<f64>().sqrt();
            if !norms[k].is_finite() || norms[k] == 0.0 {
                return None;
            }
            (0..n).for_each(|i| v[(i, k)] /= norms[k]);
        }
        Some(norms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_those_of_the_paper() {
        assert_eq!(relations().len(), 465);
        let exponents = homogeneous::<OCTICS>(8);
        assert!((0..OCTICS).all(|k| place(exponents[k]) == k));
        let all: Vec<usize> = (0..=3).flat_map(|i| (i..=3).map(move |j| pair(i, j, 3))).collect();
        assert_eq!(all, (0..10).collect::<Vec<_>>());
    }
}
