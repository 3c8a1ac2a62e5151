//! The null space of the relinearised system of five matches, without that system.
//!
//! A null vector of `D̄` is a symmetric form on the quartics modulo the fifteen minors (a value for each product of two directions
//! `s_i s_j`) that depends on the product alone. It is a linear functional `L` on the polynomials of degree 8 that vanishes on all
//! multiples of the minors. Its *moments* are its values at monomials. There are as many such functionals as common zeros: twenty,
//! each of which is the value at one zero. `D̄` is another way to the same quotient of the ring of polynomials.
//!
//! 1. Reduce the minors to a basis `b_1 … b_20` of the monomials with `q1` and fifteen monomials in terms of it: 15 × 35.
//! 2. Combine the paper's `s_l` to `(q·q) f` with a quadratic form `f`. Then `W_0` and `W_l` are
//!    `L_k((q·q)² b_i)` and `L_k((q·q) f b_i)`. No common zero has `q·q = 0`, so multiplying by `q·q` takes polynomials of degree 6
//!    modulo the minors to those of degree 8 one to one. Functionals on degree 6 are therefore enough:
//!    `W_0 = L_k((q·q) b_i)` and `W_l = L_k(f b_i)`. The twenty with `L_k(q1² b_i) = δ_ki` are a basis.
//! 3. Their moments follow from step 1 for monomials with `q1²`, and from the product of two of its rows for those
//!    with `q1`.
//! 4. The eigenvalues of `W_0⁻¹ W_l` are `f / (q·q)` at the twenty solutions; no real one is large. The eigenvectors are
//!    the functionals `r` of (51) that are the values at a solution, so their entries are `q1² b_i` there.
//!
//! Section 7.1 multiplies by `q2 / q1` instead of `f / (q·q)`.

use nalgebra::{Complex, ComplexField, UnitQuaternion};

use crate::algebra::eigenvalues::Hessenberg;
use crate::algebra::elimination;
use crate::algebra::monomials::{homogeneous, position, sum};
use crate::quaternion::monomials::{MONOMIALS, QUADRATIC, Quadratic, Quartic};
use crate::solver::quaternions::twenty_zeros::TwentySolutions;

/// The monomials of degree 4 without `q1`, as exponents.
const WITHOUT_Q1: [[u8; 4]; 15] = select(&MONOMIALS, false);

/// The monomials of degree 4 with `q1`, the basis `b_i`.
const BASIS: [[u8; 4]; 20] = select(&MONOMIALS, true);

/// The monomials of degree 5 without `q1`.
const QUINTIC: [[u8; 4]; 21] = select(&homogeneous::<56>(5), false);

/// The monomials of a list that contain `q1`, or those that do not.
const fn select<const M: usize, const N: usize>(list: &[[u8; 4]; M], with_q1: bool) -> [[u8; 4]; N] {
    let mut selected = [[0; 4]; N];
    let (mut n, mut k) = (0, 0);
    while k < M {
        if (list[k][0] > 0) == with_q1 {
            selected[n] = list[k];
            n += 1;
        }
        k += 1;
    }
    assert!(n == N);
    selected
}

/// Where the value of a monomial of degree 6 that contains `q1` stands in [`Moments`].
const fn place([a, b, c, d]: [u8; 4]) -> usize {
    match a {
        0 => panic!("a monomial without q1"),
        1 => position(&QUINTIC, [0, b, c, d]),
        2 => 21 + position(&WITHOUT_Q1, [0, b, c, d]),
        _ => 36 + position(&BASIS, [a - 2, b, c, d]),
    }
}

/// `PRODUCT[i][m]`: the place of `b_i` times the quadratic monomial `m`.
const PRODUCT: [[usize; 10]; 20] = {
    let mut table = [[0; 10]; 20];
    let mut i = 0;
    while i < 20 {
        let mut m = 0;
        while m < 10 {
            table[i][m] = place(sum(BASIS[i], QUADRATIC[m]));
            m += 1;
        }
        i += 1;
    }
    table
};

/// For each quintic monomial `q_k m`, `m` without `q1`: the place of `m`, and those of `q1 q_k b_j` for all `j`.
const FACTORS: [(usize, [usize; 20]); 21] = {
    let mut table = [(0, [0; 20]); 21];
    let mut n = 0;
    while n < 21 {
        let mut k = 1;
        while QUINTIC[n][k] == 0 {
            k += 1;
        }
        let mut factor = QUINTIC[n];
        factor[k] -= 1;
        table[n].0 = position(&WITHOUT_Q1, factor);
        let mut j = 0;
        while j < 20 {
            let mut product = sum(BASIS[j], [1, 0, 0, 0]);
            product[k] += 1;
            table[n].1[j] = place(product);
            j += 1;
        }
        n += 1;
    }
    table
};

/// The values of the monomials of degree 6 that contain `q1` under the twenty functionals: those of the quintic ones times
/// `q1`, then of the quartic ones without `q1` and of the basis times `q1²`.
struct Moments([[f64; 20]; 56]);

impl Moments {
    /// `None` where the quartics are dependent.
    fn new(with_q: &[Quartic; 10], without_q: &[Quartic; 5]) -> Option<Self> {
        const COLUMNS: [usize; 35] = {
            let mut columns = [0; 35];
            let mut k = 0;
            while k < 35 {
                columns[k] = position(&MONOMIALS, if k < 15 { WITHOUT_Q1[k] } else { BASIS[k - 15] });
                k += 1;
            }
            columns
        };
        let mut a = [[0.0; 35]; 15];
        for (row, quartic) in a.iter_mut().zip(with_q.iter().chain(without_q)) {
            *row = COLUMNS.map(|k| quartic[k]);
        }
        if elimination::reduce(&mut a, 0) == 0.0 {
            return None;
        }
        let mut values = [[0.0; 20]; 56];
        for k in 0..20 {
            values[36 + k][k] = 1.0;
        }
        for (row, reduced) in values[21..36].iter_mut().zip(&a) {
            *row = std::array::from_fn(|j| -reduced[15 + j]);
        }
        for (n, (factor, products)) in FACTORS.iter().enumerate() {
            let coefficients = values[21 + factor];
            let mut row = [0.0; 20];
            for (j, &product) in products.iter().enumerate() {
                for (x, value) in row.iter_mut().zip(&values[product]) {
                    *x += coefficients[j] * value;
                }
            }
            values[n] = row;
        }
        Some(Self(values))
    }

    /// The values of `(q·q) b_i` and of [`FORM`] times `b_i`: a row of `W_0`, beside it one of `W_l`.
    fn row(&self, i: usize) -> [f64; 40] {
        let mut row = [0.0; 40];
        let (norm, form) = row.split_at_mut(20);
        for (m, &place) in PRODUCT[i].iter().enumerate() {
            for (x, value) in form.iter_mut().zip(&self.0[place]) {
                *x += FORM[m] * value;
            }
            if NORM[m] != 0.0 {
                for (x, value) in norm.iter_mut().zip(&self.0[place]) {
                    *x += value;
                }
            }
        }
        row
    }
}

/// `q·q` of the norm constraint (40).
const NORM: Quadratic = {
    let mut form = [0.0; 10];
    let mut k = 0;
    while k < 10 {
        let e = QUADRATIC[k];
        if e[0] == 2 || e[1] == 2 || e[2] == 2 || e[3] == 2 {
            form[k] = 1.0;
        }
        k += 1;
    }
    form
};

/// `f`: a form without symmetry.
const FORM: Quadratic = [0.31, 0.57, -0.73, 0.44, -0.62, 0.83, 0.39, 0.75, -0.51, -0.44];

/// `RATIOS[k][j]`: the place of `q1 q_k² q_j` in the basis.
const RATIOS: [[usize; 4]; 4] = {
    let mut table = [[0; 4]; 4];
    let mut k = 0;
    while k < 4 {
        let mut j = 0;
        while j < 4 {
            let mut monomial = [1, 0, 0, 0];
            monomial[k] += 2;
            monomial[j] += 1;
            table[k][j] = position(&BASIS, monomial);
            j += 1;
        }
        k += 1;
    }
    table
};

/// `W_0⁻¹ W_l` with its eigenvalues.
pub(crate) struct Pencil {
    matrix: Hessenberg<20>,
    values: [Complex<f64>; 20],
}

impl TwentySolutions for Pencil {
    fn new(with_q: &[Quartic; 10], without_q: &[Quartic; 5]) -> Option<Self> {
        let moments = Moments::new(with_q, without_q)?;
        let mut pencil: [[f64; 40]; 20] = std::array::from_fn(|i| moments.row(i));
        if elimination::reduce(&mut pencil, 0) == 0.0 {
            return None;
        }
        let matrix = Hessenberg::new(pencil.map(|row| std::array::from_fn(|j| row[20 + j])))?;
        let values = matrix.eigenvalues()?;
        Some(Self { matrix, values })
    }

    fn values(&self) -> &[Complex<f64>; 20] {
        &self.values
    }

    fn quaternion<T: ComplexField<RealField = f64> + Copy>(&self, value: T) -> Option<[T; 4]> {
        let b = self.matrix.eigenvector(value)?;
        let size = |k: usize| b[RATIOS[k][k]].norm1();
        let k = (1..4).fold(0, |best, k| if size(k) > size(best) { k } else { best });
        Some(RATIOS[k].map(|i| b[i]))
    }

    fn value_at(q: &UnitQuaternion<f64>) -> f64 {
        let q = [q.w, q.i, q.j, q.k];
        let mut sum = 0.0;
        for (e, c) in QUADRATIC.iter().zip(FORM) {
            sum += c * (0..4).map(|k| q[k].powi(e[k].into())).product::<f64>();
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Correspondence;
    use crate::quaternion::{bilinear, minors_without_q, ten_quartics};
    use crate::simulate::{Scene, SceneOptions};
    use crate::solver::quaternions::twenty_zeros::pre_rotations;

    #[test]
    fn eigenvectors_are_common_zeros_of_the_minors() {
        let options = SceneOptions { noise_px: 0.75, ..SceneOptions::default() };
        let (mut all, mut inaccurate) = (0, 0);
        for index in 0..200 {
            let scene = Scene::generate(&options, 111, index).unwrap();
            let turned = scene.matches.iter().map(|m| m.with_view2_rotated(&pre_rotations()[0]));
            let five: [_; 5] = turned.collect::<Vec<_>>().try_into().unwrap();
            let m = five.map(|c: Correspondence| bilinear(&(c.bearing2() * c.bearing1().transpose())));
            let (with_q, without_q) = (ten_quartics(&five), minors_without_q(&m));
            let pencil = Pencil::new(&with_q, &without_q).unwrap();
            for &value in pencil.values() {
                let q = pencil.quaternion(value).unwrap();
                let norm = q.iter().map(Complex::norm_sqr).sum::<f64>().sqrt();
                let q = q.map(|x| x / norm);
                let monomial = |e: [u8; 4]| (0..4).map(|k| q[k].powu(e[k].into())).product::<Complex<f64>>();
                let form = |coefficients: &[f64], list: &[[u8; 4]]| -> Complex<f64> {
                    list.iter().zip(coefficients).map(|(e, c)| monomial(*e) * *c).sum()
                };
                let ratio = form(&FORM, &QUADRATIC) / form(&NORM, &QUADRATIC);
                let largest = with_q.iter().chain(&without_q).map(|f| form(f, &MONOMIALS).norm());
                let error = largest.fold((ratio - value).norm() / (1.0 + value.norm()), f64::max);
                all += 1;
                inaccurate += usize::from(error > 1e-6);
            }
        }
        // Solutions that are near each other lose digits, by a factor of more than 1e9 seldom.
        assert!(inaccurate * 1_000 < all, "{inaccurate} of {all}");
    }

    #[test]
    fn the_monomials_with_q1_and_without_it_are_all() {
        let list = homogeneous::<35>(4);
        let (with, without) = (select::<35, 20>(&list, true), select::<35, 15>(&list, false));
        assert!(with.iter().all(|e| e[0] > 0) && without.iter().all(|e| e[0] == 0));
        assert!(list.iter().all(|e| with.contains(e) != without.contains(e)));
    }
}
