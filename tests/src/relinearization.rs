//! Section 4.2 on its own: an overdetermined system of polynomials of one degree, solved by relinearisation with the
//! paper's extension to several solutions.
//!
//! 1. The monomials of the unknowns are unknowns `x` themselves: `C x = c`, so `x = x_p + s_1 v_1 + … + s_n v_n` (8).
//! 2. That monomials commute gives equations in the products of `s`: `x_a x_b = x_c x_d` (11), (12).
//! 3. These are linear in `y = (s_i s_j, s_i)`: `D y = d`, or `D̄ ȳ = 0` with `D̄ = [D −d]`, `ȳ = (y, 1)` (14) to (17).
//! 4. `D̄` has as many null vectors `w_1, …, w_K` as the system has solutions; `ȳ = W r` (19), and with the rows of `W`
//!    that belong to `s` and to `s_l s`, `s = W_0 r` and `s_l s = W_l r` (20) to (22).
//! 5. `W_l W_0† s = s_l s` (24): the solutions are the eigenvectors. Here of one generic combination over `l`, and in
//!    the `K` coordinates `r`, where none of the eigenvalues is a zero without meaning.
//!
//! It stands here and not in the library: for five matches `D̄` is 465 × 325, and its null space takes a thousand times
//! as long as the solver that gets it from the structure of the problem. It is what that solver is held against.

use faer::{Mat, c64};
use nalgebra::Complex;

use crate::polynomial::Exponents;

/// Singular values below this part of the largest one are zero.
const ZERO: f64 = 1e-10;

/// A system `C x = c` in the values `x` of monomials, and step 1 of its solution.
#[derive(Clone, Debug)]
pub struct Linearized {
    /// The particular solution `x_p`.
    pub particular: Vec<f64>,
    /// The columns `v_1, …, v_n`.
    pub directions: Mat<f64>,
}

impl Linearized {
    /// The solutions of `C x = c`, in the least-squares sense.
    #[must_use]
    pub fn new(c: &Mat<f64>, rhs: &[f64]) -> Self {
        let rhs = Mat::from_fn(rhs.len(), 1, |i, _| rhs[i]);
        let particular = c.thin_svd().expect("the SVD of C").pseudoinverse() * rhs;
        Self { particular: particular.col(0).iter().copied().collect(), directions: null_space(c) }
    }

    /// The matrix `D̄` of the monomials' commutativity. Its columns are the products `s_i s_j`, `i ≤ j`, in
    /// lexicographic order, then `s_i`, then 1: those of [`pairs`].
    #[must_use]
    pub fn relinearized(&self, monomials: &[Exponents]) -> Mat<f64> {
        let n = self.directions.ncols();
        // x = B (s, 1).
        let b = |a: usize, i: usize| if i == n { self.particular[a] } else { self.directions[(a, i)] };
        let product = |[a, b_]: [usize; 2], [i, j]: [usize; 2]| {
            let one = b(a, i) * b(b_, j);
            if i == j { one } else { one + b(a, j) * b(b_, i) }
        };
        let (relations, pairs) = (relations(monomials), pairs(n));
        Mat::from_fn(relations.len(), pairs.len(), |row, column| {
            let [left, right] = relations[row];
            product(left, pairs[column]) - product(right, pairs[column])
        })
    }

    /// The values of the monomials at every solution, complex ones included; `None` where there are more solutions
    /// than directions, for which one product of `s` does not tell them apart.
    #[must_use]
    pub fn solutions(&self, monomials: &[Exponents]) -> Option<Vec<Vec<c64>>> {
        let n = self.directions.ncols();
        let w = null_space(&self.relinearized(monomials));
        let pairs = pairs(n);
        let row = |i: usize, j: usize| pairs.iter().position(|p| *p == [i.min(j), i.max(j)]);
        let rows = |l: usize| {
            let rows: Vec<_> = (0..n).filter_map(|i| row(i, l)).collect();
            Mat::from_fn(n, w.ncols(), |i, k| w[(rows[i], k)])
        };
        let w0 = rows(n);
        if w.ncols() > n || null_space(&w0).ncols() > 0 {
            return None;
        }
        // Weights without a pattern: solutions that share one s_l do not share the combination.
        let combined = (0..n).fold(Mat::zeros(n, w.ncols()), |sum: Mat<f64>, l| {
            let weight = (1.0 + l as f64).sqrt().fract() + 0.5;
            sum + rows(l) * faer::Scale(weight)
        });
        let action = w0.thin_svd().ok()?.pseudoinverse() * combined;
        let eigen = action.eigen().ok()?;
        let in_y = |row: usize, k: usize| {
            (0..w.ncols()).fold(c64::new(0.0, 0.0), |sum, j| sum + eigen.U()[(j, k)] * w[(row, j)])
        };
        let values = |k: usize| {
            let one = in_y(row(n, n)?, k);
            let s: Vec<_> = (0..n).map(|i| Some(in_y(row(i, n)?, k) / one)).collect::<Option<_>>()?;
            let value = |(a, x_p): (usize, &f64)| {
                (0..n).fold(c64::new(*x_p, 0.0), |sum, i| sum + s[i] * self.directions[(a, i)])
            };
            Some(self.particular.iter().enumerate().map(value).collect())
        };
        (0..w.ncols()).map(values).collect()
    }
}

/// The pairs `[i, j]` of factors of `ȳ`; `n` stands for the factor 1.
#[must_use]
pub fn pairs(n: usize) -> Vec<[usize; 2]> {
    let products = (0..n).flat_map(|i| (i..n).map(move |j| [i, j]));
    products.chain((0..=n).map(|i| [i, n])).collect()
}

/// The independent equations `x_a x_b = x_c x_d` between products of two monomials: for each product of theirs, all
/// ways to write it equal the first one.
#[must_use]
pub fn relations(monomials: &[Exponents]) -> Vec<[[usize; 2]; 2]> {
    let product = |[a, b]: [usize; 2]| [0, 1, 2, 3].map(|k| monomials[a][k] + monomials[b][k]);
    let mut first: Vec<[usize; 2]> = Vec::new();
    let mut relations = Vec::new();
    for a in 0..monomials.len() {
        for b in a..monomials.len() {
            match first.iter().find(|pair| product(**pair) == product([a, b])) {
                Some(pair) => relations.push([*pair, [a, b]]),
                None => first.push([a, b]),
            }
        }
    }
    relations
}

/// An orthonormal basis of the null space, in columns.
#[must_use]
pub fn null_space(a: &Mat<f64>) -> Mat<f64> {
    // Rows of zeros, so that the thin SVD has all right singular vectors.
    let rows = a.nrows().max(a.ncols());
    let tall = Mat::from_fn(rows, a.ncols(), |i, j| if i < a.nrows() { a[(i, j)] } else { 0.0 });
    let svd = tall.thin_svd().expect("the SVD of a finite matrix");
    let values = svd.S().column_vector();
    let rank = values.iter().filter(|s| **s > ZERO * values[0]).count();
    svd.V().subcols(rank, a.ncols() - rank).to_owned()
}

/// The unknowns from the values of all their monomials of a degree: the largest from its power, the others from their
/// ratio to it. Up to a root of unity of that degree.
#[must_use]
pub fn unknowns(monomials: &[Exponents], degree: u8, x: &[c64]) -> [c64; 4] {
    let zero = c64::new(0.0, 0.0);
    let value = |monomial| monomials.iter().position(|m| *m == monomial).map_or(zero, |k| x[k]);
    // q_k^(d−1) q_j.
    let row = |k: usize, j: usize| {
        let mut monomial: Exponents = [0; 4];
        monomial[k] = degree - 1;
        monomial[j] += 1;
        value(monomial)
    };
    let k = (1..4).fold(0, |best, k| if row(k, k).norm() > row(best, best).norm() { k } else { best });
    let power = row(k, k);
    let largest = Complex::powf(power, 1.0 / f64::from(degree));
    [0, 1, 2, 3].map(|j| row(k, j) / power * largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Example 1: monomials of degree 4 in two unknowns.
    const MONOMIALS: [Exponents; 5] = [[4, 0, 0, 0], [3, 1, 0, 0], [2, 2, 0, 0], [1, 3, 0, 0], [0, 4, 0, 0]];

    /// (7), with the two entries in their places that the printed page exchanges.
    fn example_1() -> Linearized {
        let c = [[2.0, 5.0, 6.0, 10.0, 4.0], [2.0, 1.0, -2.0, 11.0, 6.0], [5.0, 8.0, 1.0, 3.0, 2.0]];
        Linearized::new(&Mat::from_fn(3, 5, |i, j| c[i][j]), &[0.0, 0.0, 1.0])
    }

    /// (9).
    fn printed() -> Linearized {
        let v = [[7.0, -4.0, 1.0, 2.0, -5.0], [0.0, -8.0, 20.0, -42.0, 85.0]];
        Linearized {
            particular: vec![-6.0, 2.0, 3.0, -10.0, 21.0],
            directions: Mat::from_fn(5, 2, |i, j| v[j][i]),
        }
    }

    #[test]
    fn example_1_has_its_two_solutions() {
        let example = example_1();
        assert_eq!(example.directions.ncols(), 2);
        let d_bar = example.relinearized(&MONOMIALS);
        assert_eq!((d_bar.nrows(), d_bar.ncols()), (6, 6));
        assert_eq!(null_space(&d_bar).ncols(), 2);
        let solutions = example.solutions(&MONOMIALS).unwrap();
        let ratios = solutions.iter().map(|x| {
            let [q1, q2, q3, q4] = unknowns(&MONOMIALS, 4, x);
            // The scale is that of (4), whose right-hand side is of degree 4: q and −q, i q, −i q.
            assert!((q1.norm() - 1.0).abs() < 1e-9 && q3.norm() == 0.0 && q4.norm() == 0.0);
            q2 / q1
        });
        let mut ratios: Vec<_> = ratios.collect();
        ratios.sort_by(|a, b| a.re.total_cmp(&b.re));
        assert_eq!(ratios.len(), 2);
        assert!((ratios[0] + 2.0).norm() < 1e-9 && (ratios[1] + 0.5).norm() < 1e-9, "{ratios:?}");
    }

    #[test]
    fn the_eigenvalues_of_example_1() {
        // (25), in the printed basis: s = (1, 0) and (1, −3/16).
        let solutions = printed().solutions(&MONOMIALS).unwrap();
        let expected = [[1.0, -2.0, 4.0, -8.0, 16.0], [1.0, -0.5, 0.25, -0.125, 0.0625]];
        assert_eq!(solutions.len(), 2);
        for x in expected {
            let distance = |y: &Vec<c64>| (0..5).map(|k| (y[k] - x[k]).norm()).fold(0.0, f64::max);
            assert!(solutions.iter().any(|y| distance(y) < 1e-9));
        }
    }

    #[test]
    fn the_relinearized_system_of_example_1() {
        // D of (15). Its d, which has no part in the solutions, is printed with the opposite sign.
        let d_bar = printed().relinearized(&MONOMIALS);
        // Columns s1², s2², s1 s2, s1, s2, and d.
        let rows = [
            [-9.0, -64.0, 76.0, 31.0, -88.0, -22.0],
            [18.0, 160.0, -206.0, -72.0, 236.0, 54.0],
            [18.0, 160.0, -298.0, -90.0, 328.0, 72.0],
            [-9.0, -64.0, 153.0, 46.0, -165.0, -37.0],
            [-27.0, -336.0, 443.0, 133.0, -506.0, -106.0],
            [-36.0, -400.0, 555.0, 171.0, -630.0, -135.0],
        ];
        assert_eq!(pairs(2), [[0, 0], [0, 1], [1, 1], [0, 2], [1, 2], [2, 2]]);
        for row in rows {
            let expected = [0, 2, 1, 3, 4, 5].map(|k| row[k]);
            let is_row = |i| (0..6).all(|j| (d_bar[(i, j)] - expected[j]).abs() < 1e-12);
            assert!((0..6).any(is_row), "{row:?}");
        }
    }
}
