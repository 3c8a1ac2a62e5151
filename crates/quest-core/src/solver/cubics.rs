//! The five-point problem as ten cubics that survive a vanishing parallax.
//!
//! Five rows of [`Alignment`](super::aligned::Alignment) leave `(t, S) = x N1 + y N2 + z N3 + w N4`. With `K = [t]×`,
//! `E = K + p S` and `−K² = |t|² I − t tᵀ`,
//!
//! ```text
//! E Eᵀ              = |t|² I − t tᵀ + p (K S − S K) + p² S²
//! 2 E Eᵀ − tr(E Eᵀ) I = −2 t tᵀ + p Λ,      Λ = 2 (K S − S K) + p (2 S² − tr(S²) I)
//! ```
//!
//! and as `tᵀ K = 0`, every term of the trace constraint `(2 E Eᵀ − tr(E Eᵀ) I) E = 0` carries the factor `p`. Divided:
//!
//! ```text
//! C = −2 t (tᵀ S) + Λ E = 0                                       nine cubics
//! det(tr(S) I − 2 S) = 0                                          the tenth
//! ```
//!
//! The tenth stands in place of `det E = 0`. The adjugate of `K` is `t tᵀ`, and the trace of a symmetric times an antisymmetric
//! matrix vanishes:
//!
//! ```text
//! det E = p tᵀ S t + p³ det S
//! tr C  = −2 tᵀ S t + p² (2 tr S³ − tr S tr S²)
//! det(tr(S) I − 2 S) = tr S tr S² − 2 tr S³ − 2 det S             by the eigenvalues of S
//! tr C + 2 det(E) / p = −p² det(tr(S) I − 2 S)
//! ```
//!
//! As `p → 0` the ten become the equations of the differential five-point problem, and nothing degenerates.
//!
//! `resultant.rs` reduces them to a polynomial in `z`.

use super::aligned::Coordinates;
use crate::algebra::monomials::{homogeneous, position, sum};
use crate::algebra::number::Number;
use crate::algebra::two::Two;

/// Exponents of `(x, y, z, w)` of the ten quadratic monomials.
const QUADRATIC: [[u8; 4]; 10] = homogeneous::<10>(2);

/// Exponents of the twenty cubic monomials: ten to eliminate, the rest with `x`, with `y` and with neither, by falling
/// powers of `z`.
pub(crate) const CUBIC: [[u8; 4]; 20] = [
    [3, 0, 0, 0],
    [0, 3, 0, 0],
    [2, 1, 0, 0],
    [1, 2, 0, 0],
    [2, 0, 1, 0],
    [2, 0, 0, 1],
    [0, 2, 1, 0],
    [0, 2, 0, 1],
    [1, 1, 1, 0],
    [1, 1, 0, 1],
    [1, 0, 2, 0],
    [1, 0, 1, 1],
    [1, 0, 0, 2],
    [0, 1, 2, 0],
    [0, 1, 1, 1],
    [0, 1, 0, 2],
    [0, 0, 3, 0],
    [0, 0, 2, 1],
    [0, 0, 1, 2],
    [0, 0, 0, 3],
];

const VARIABLES: [[u8; 4]; 4] = homogeneous::<4>(1);

/// The quadratic monomial of two variables.
pub(crate) const SQUARE: [[usize; 4]; 4] = {
    let mut table = [[0; 4]; 4];
    let mut a = 0;
    while a < 16 {
        table[a / 4][a % 4] = position(&QUADRATIC, sum(VARIABLES[a / 4], VARIABLES[a % 4]));
        a += 1;
    }
    table
};

/// The cubic monomial of a quadratic one and a variable.
pub(crate) const PRODUCT: [[usize; 4]; 10] = {
    let mut table = [[0; 4]; 10];
    let mut a = 0;
    while a < 40 {
        table[a / 4][a % 4] = position(&CUBIC, sum(QUADRATIC[a / 4], VARIABLES[a % 4]));
        a += 1;
    }
    table
};

pub(crate) type Linear = [f64; 4];
pub(crate) type Quadratic = [f64; 10];
pub(crate) type Cubic = [f64; 20];

#[inline]
pub(crate) fn add_linear_product(out: &mut Quadratic, a: &Linear, b: &Linear) {
    for i in 0..4 {
        for j in 0..4 {
            out[SQUARE[i][j]] += a[i] * b[j];
        }
    }
}

/// The sum of products of linear forms.
#[inline]
fn sum_of_products<const N: usize>(terms: [(&Linear, &Linear); N]) -> Quadratic {
    let mut out = [0.0; 10];
    for (a, b) in terms {
        add_linear_product(&mut out, a, b);
    }
    out
}

#[inline]
fn square(a: &Linear) -> Quadratic {
    let mut out = [0.0; 10];
    for i in 0..4 {
        out[SQUARE[i][i]] = a[i] * a[i];
        for j in 0..i {
            out[SQUARE[i][j]] = 2.0 * a[i] * a[j];
        }
    }
    out
}

#[inline]
pub(crate) fn add_product<T: Number>(out: &mut [T; 20], a: &[T; 10], b: &[T; 4]) {
    for i in 0..10 {
        for j in 0..4 {
            let place = &mut out[PRODUCT[i][j]];
            *place = *place + a[i] * b[j];
        }
    }
}

#[inline]
pub(crate) fn scaled(a: &Linear, factor: f64) -> Linear {
    a.map(|x| factor * x)
}

/// The entries of `t`, `S` and `E` as linear forms in `(x, y, z, w)`.
struct Forms {
    t: [Linear; 3],
    s: [[Linear; 3]; 3],
    e: [[Linear; 3]; 3],
}

impl Forms {
    #[inline]
    fn new(basis: &[Coordinates; 4], p: f64) -> Self {
        let form = |row: usize| -> Linear { std::array::from_fn(|m| basis[m][row]) };
        let [t0, t1, t2, xx, yy, zz, xy, xz, yz]: [Linear; 9] = std::array::from_fn(form);
        // p S + K.
        let plus = |s: &Linear, k: &Linear| -> Linear { std::array::from_fn(|m| p * s[m] + k[m]) };
        let minus = |s: &Linear, k: &Linear| -> Linear { std::array::from_fn(|m| p * s[m] - k[m]) };
        let e = [
            [scaled(&xx, p), minus(&xy, &t2), plus(&xz, &t1)],
            [plus(&xy, &t2), scaled(&yy, p), minus(&yz, &t0)],
            [minus(&xz, &t1), plus(&yz, &t0), scaled(&zz, p)],
        ];
        Self { t: [t0, t1, t2], s: [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], e }
    }

    /// `S_xx, S_yy, S_zz, S_xy, S_xz, S_yz`.
    #[inline]
    fn upper_s(&self) -> [&Linear; 6] {
        let [[xx, xy, xz], [_, yy, yz], [.., zz]] = &self.s;
        [xx, yy, zz, xy, xz, yz]
    }

    /// `Λ`, by its upper triangle. With `E = K + p S`
    ///
    /// ```text
    /// Λ_xx = 4 (t_y S_xz − t_z S_xy) + p (S_xx² − S_yy² − S_zz² − 2 S_yz²)
    /// Λ_xy = 2 (S_xx E_yx + S_yy E_xy + S_yz E_xz − t_x S_xz)
    /// ```
    ///
    /// and so in turn.
    #[inline]
    fn lambda(&self, p: f64) -> [[Quadratic; 3]; 3] {
        let [xx, yy, zz, xy, xz, yz] = &self.upper_s().map(|a| scaled(a, 2.0));
        let [sxx, syy, szz, sxy, sxz, syz] = &self.upper_s().map(square);
        let (e, [t0, t1, t2]) = (&self.e, &self.t.each_ref().map(|t| scaled(t, 2.0)));
        let [m0, m1, m2] = &self.t.each_ref().map(|t| scaled(t, -1.0));
        let turned = [(t0, yz), (t1, xz), (t2, xy)].map(|pair| sum_of_products([pair]));
        let on = |i: usize, [a, b, c, d]: [&Quadratic; 4]| -> Quadratic {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            std::array::from_fn(|q| turned[j][q] - turned[k][q] + p * (a[q] - b[q] - c[q] - 2.0 * d[q]))
        };
        let off_xy = sum_of_products([(xx, &e[1][0]), (yy, &e[0][1]), (yz, &e[0][2]), (xz, m0)]);
        let off_xz = sum_of_products([(zz, &e[0][2]), (xx, &e[2][0]), (xy, &e[2][1]), (yz, m2)]);
        let off_yz = sum_of_products([(yy, &e[2][1]), (zz, &e[1][2]), (xz, &e[1][0]), (xy, m1)]);
        [
            [on(0, [sxx, syy, szz, syz]), off_xy, off_xz],
            [off_xy, on(1, [syy, szz, sxx, sxz]), off_yz],
            [off_xz, off_yz, on(2, [szz, sxx, syy, sxy])],
        ]
    }

    /// `det(tr(S) I − 2 S)`, as products whose sum it is; the last one is zero.
    #[inline]
    fn tenth(&self) -> [(Quadratic, Linear); 4] {
        let mut d = self.s.each_ref().map(|row| row.each_ref().map(|a| scaled(a, -2.0)));
        for i in 0..3 {
            for m in 0..4 {
                d[i][i][m] += self.s[0][0][m] + self.s[1][1][m] + self.s[2][2][m];
            }
        }
        let product = |j: usize| {
            let (a, b) = ((j + 1) % 3, (j + 2) % 3);
            (sum_of_products([(&d[1][a], &d[2][b]), (&scaled(&d[1][b], -1.0), &d[2][a])]), d[0][j])
        };
        [product(0), product(1), product(2), ([0.0; 10], [0.0; 4])]
    }
}

/// The ten divided cubics over [`CUBIC`].
pub(crate) fn ten_cubics(basis: &[Coordinates; 4], p: f64) -> [Cubic; 10] {
    let forms = Forms::new(basis, p);
    let Forms { t, s, e, .. } = &forms;
    let lambda = forms.lambda(p);
    // −2 tᵀ S.
    let [m0, m1, m2] = &t.each_ref().map(|t| scaled(t, -2.0));
    let row = s.each_ref().map(|[s0, s1, s2]| sum_of_products([(m0, s0), (m1, s1), (m2, s2)]));
    let rows = upper_rows(&lambda);
    matrix_of_cubics(
        |i, j| [(&row[j], &t[i]), (rows[i][0], &e[0][j]), (rows[i][1], &e[1][j]), (rows[i][2], &e[2][j])],
        &forms.tenth(),
    )
}

/// The rows of a symmetric matrix that is given by its upper triangle.
#[inline]
pub(crate) fn upper_rows(m: &[[Quadratic; 3]; 3]) -> [[&Quadratic; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| &m[i.min(j)][i.max(j)]))
}

/// Entries of a 3 × 3 matrix that are computed side by side; beside the last one stands the tenth cubic.
const SIDE_BY_SIDE: [[(usize, usize); 2]; 4] =
    [[(0, 0), (0, 1)], [(1, 0), (1, 1)], [(2, 0), (2, 1)], [(0, 2), (1, 2)]];

/// The cubics of a 3 × 3 matrix row by row and a tenth behind them, each a sum of products.
#[inline]
pub(crate) fn matrix_of_cubics<'a, const N: usize>(
    terms: impl Fn(usize, usize) -> [(&'a Quadratic, &'a Linear); N],
    tenth: &'a [(Quadratic, Linear); N],
) -> [Cubic; 10] {
    let mut out = [[0.0; 20]; 10];
    for [(i, j), (k, l)] in SIDE_BY_SIDE {
        let mut two = [Two::ZERO; 20];
        for ((a, b), (c, d)) in terms(i, j).into_iter().zip(terms(k, l)) {
            add_product(&mut two, &interleaved(a, c), &interleaved(b, d));
        }
        for (n, two) in two.into_iter().enumerate() {
            [out[3 * i + j][n], out[3 * k + l][n]] = two.to_array();
        }
    }
    let mut two = [Two::ZERO; 20];
    for ((a, b), (c, d)) in terms(2, 2).into_iter().zip(tenth) {
        add_product(&mut two, &interleaved(a, c), &interleaved(b, d));
    }
    for (n, two) in two.into_iter().enumerate() {
        [out[8][n], out[9][n]] = two.to_array();
    }
    out
}

#[inline]
fn interleaved<const N: usize>(x: &[f64; N], y: &[f64; N]) -> [Two; N] {
    std::array::from_fn(|k| Two::new([x[k], y[k]]))
}

/// `x N1 + y N2 + z N3 + w N4`.
#[inline]
pub(crate) fn combine<T: Number>(basis: &[Coordinates; 4], point: &[T; 4]) -> [T; 9] {
    std::array::from_fn(|k| {
        (1..4).fold(point[0].times(basis[0][k]), |sum, m| sum + point[m].times(basis[m][k]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::monomials::evaluate;
    use nalgebra::Matrix3;

    #[test]
    fn cubics_are_the_trace_constraint_divided_by_p() {
        let basis: [Coordinates; 4] =
            std::array::from_fn(|m| std::array::from_fn(|k| ((3 * m + 7 * k) as f64 * 1.3 + 0.2).sin()));
        let v = [0.3, -0.8, 0.5, 1.0];
        let p = 0.37;
        let [tx, ty, tz, xx, yy, zz, xy, xz, yz] = combine(&basis, &v);
        let t = nalgebra::Vector3::new(tx, ty, tz);
        let s = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let e = t.cross_matrix() + s * p;
        let eet = e * e.transpose();
        let expected = (eet * 2.0 - Matrix3::from_diagonal_element(eet.trace())) * e / p;
        let cubics = ten_cubics(&basis, p);
        let value = |c: &Cubic| evaluate(&CUBIC, c, v);
        for i in 0..3 {
            for j in 0..3 {
                assert!((value(&cubics[3 * i + j]) - expected[(i, j)]).abs() < 1e-13);
            }
        }
        let trace: f64 = (0..3).map(|i| value(&cubics[4 * i])).sum();
        assert!((trace + 2.0 * e.determinant() / p + p * p * value(&cubics[9])).abs() < 1e-13);
    }
}
