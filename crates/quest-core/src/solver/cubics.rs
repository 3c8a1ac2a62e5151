//! The five-point problem as a polynomial of degree ten that survives a vanishing parallax.
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
//! The tenth stands in place of `det E = p tᵀ S t + p³ det S`, since `tr C + 2 det(E) / p = −p² det(tr(S) I − 2 S)`. As
//! `p → 0` the ten become the equations of the differential five-point problem, and nothing degenerates.
//!
//! From here as D. Nistér, *An efficient solution to the five-point relative pose problem*, PAMI 26 (2004), section 3.2: the
//! ten cubics in `x, y, z` with `w = 1` are reduced to the six leading monomials that matter; three combinations of
//! these are linear in `x` and `y`, with coefficients that are polynomials in `z`; their determinant has degree ten.

use super::aligned::Coordinates;
use crate::algebra::elimination;
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

/// The first of the eliminated rows that is used: `x²z, x²w, y²z, y²w, xyz, xyw`.
const FIRST_USED: usize = 4;

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
fn sum_of(a: &Quadratic, b: &Quadratic, c: &Quadratic) -> Quadratic {
    std::array::from_fn(|q| a[q] + b[q] + c[q])
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

/// The entries of `t`, `S`, `K` and `E` as linear forms in `(x, y, z, w)`.
struct Forms {
    t: [Linear; 3],
    s: [[Linear; 3]; 3],
    k: [[Linear; 3]; 3],
    e: [[Linear; 3]; 3],
}

impl Forms {
    #[inline]
    fn new(basis: &[Coordinates; 4], p: f64) -> Self {
        let form = |row: usize| -> Linear { std::array::from_fn(|m| basis[m][row]) };
        let [t0, t1, t2, xx, yy, zz, xy, xz, yz]: [Linear; 9] = std::array::from_fn(form);
        let negative = |a: &Linear| scaled(a, -1.0);
        let zero = [0.0; 4];
        let k = [[zero, negative(&t2), t1], [t2, zero, negative(&t0)], [negative(&t1), t0, zero]];
        let s = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let e = std::array::from_fn(|i| {
            std::array::from_fn(|j| std::array::from_fn(|m| k[i][j][m] + p * s[i][j][m]))
        });
        Self { t: [t0, t1, t2], s, k, e }
    }

    /// `Λ`, by its upper triangle.
    #[inline]
    fn lambda(&self, p: f64) -> [[Quadratic; 3]; 3] {
        let mut lambda = [[[0.0; 10]; 3]; 3];
        let twice = self.s.each_ref().map(|row| row.each_ref().map(|a| scaled(a, 2.0)));
        let [[xx, xy, xz], [_, yy, yz], [.., zz]] = self.s.each_ref().map(|row| row.each_ref().map(square));
        let diagonal: [Quadratic; 3] =
            [[&xx, &xy, &xz], [&xy, &yy, &yz], [&xz, &yz, &zz]].map(|[a, b, c]| sum_of(a, b, c));
        let trace = sum_of(&diagonal[0], &diagonal[1], &diagonal[2]);
        for i in 0..3 {
            // K S − S K = K S + (K S)ᵀ, and the diagonal of K is zero.
            let entry = &mut lambda[i][i];
            for m in (0..3).filter(|&m| m != i) {
                add_linear_product(entry, &self.k[i][m], &twice[m][i]);
            }
            for q in 0..10 {
                entry[q] = 2.0 * entry[q] + p * (2.0 * diagonal[i][q] - trace[q]);
            }
            for j in i + 1..3 {
                let (entry, mut square) = (&mut lambda[i][j], [0.0; 10]);
                for m in 0..3 {
                    if m != i {
                        add_linear_product(entry, &self.k[i][m], &twice[m][j]);
                    }
                    if m != j {
                        add_linear_product(entry, &self.k[j][m], &twice[m][i]);
                    }
                    add_linear_product(&mut square, &twice[i][m], &self.s[m][j]);
                }
                for q in 0..10 {
                    entry[q] += p * square[q];
                }
            }
        }
        lambda
    }

    /// `det(tr(S) I − 2 S)`.
    #[inline]
    fn tenth(&self) -> Cubic {
        let mut d = self.s.each_ref().map(|row| row.each_ref().map(|a| scaled(a, -2.0)));
        for i in 0..3 {
            for m in 0..4 {
                d[i][i][m] += self.s[0][0][m] + self.s[1][1][m] + self.s[2][2][m];
            }
        }
        let mut out = [0.0; 20];
        for j in 0..3 {
            let (a, b) = ((j + 1) % 3, (j + 2) % 3);
            let mut minor = [0.0; 10];
            add_linear_product(&mut minor, &d[1][a], &d[2][b]);
            add_linear_product(&mut minor, &scaled(&d[1][b], -1.0), &d[2][a]);
            add_product(&mut out, &minor, &d[0][j]);
        }
        out
    }
}

/// The ten divided cubics over [`CUBIC`].
pub(crate) fn ten_cubics(basis: &[Coordinates; 4], p: f64) -> [Cubic; 10] {
    let forms = Forms::new(basis, p);
    let Forms { t, s, e, .. } = &forms;
    let lambda = forms.lambda(p);
    // −2 tᵀ S.
    let row: [Quadratic; 3] = std::array::from_fn(|j| {
        let mut entry = [0.0; 10];
        for m in 0..3 {
            add_linear_product(&mut entry, &scaled(&t[m], -2.0), &s[m][j]);
        }
        entry
    });
    let rows = upper_rows(&lambda);
    matrix_of_cubics(
        |i, j| [(&row[j], &t[i]), (rows[i][0], &e[0][j]), (rows[i][1], &e[1][j]), (rows[i][2], &e[2][j])],
        forms.tenth(),
    )
}

/// The rows of a symmetric matrix that is given by its upper triangle.
#[inline]
pub(crate) fn upper_rows(m: &[[Quadratic; 3]; 3]) -> [[&Quadratic; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| &m[i.min(j)][i.max(j)]))
}

/// Entries of a 3 × 3 matrix that are computed side by side; the last one stands alone.
const SIDE_BY_SIDE: [[(usize, usize); 2]; 4] =
    [[(0, 0), (0, 1)], [(1, 0), (1, 1)], [(2, 0), (2, 1)], [(0, 2), (1, 2)]];

/// The cubics of a 3 × 3 matrix row by row, each entry a sum of products, and a tenth behind them.
#[inline]
pub(crate) fn matrix_of_cubics<'a, const N: usize>(
    terms: impl Fn(usize, usize) -> [(&'a Quadratic, &'a Linear); N],
    tenth: Cubic,
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
    for (a, b) in terms(2, 2) {
        add_product(&mut out[8], a, b);
    }
    out[9] = tenth;
    out
}

#[inline]
fn interleaved<const N: usize>(x: &[f64; N], y: &[f64; N]) -> [Two; N] {
    std::array::from_fn(|k| Two::new([x[k], y[k]]))
}

/// Three equations `X(z) x + Y(z) y + W(z) = 0`; coefficients from the constant up.
pub(crate) struct Resultant {
    x: [[f64; 4]; 3],
    y: [[f64; 4]; 3],
    w: [[f64; 5]; 3],
}

impl Resultant {
    /// The three equations, and how far the elimination was from singular.
    pub(crate) fn new(basis: &[Coordinates; 4], p: f64) -> (Self, f64) {
        Self::from_cubics(&mut ten_cubics(basis, p))
    }

    /// The same for any ten cubics over [`CUBIC`] of an essential matrix; they are overwritten.
    #[inline]
    pub(crate) fn from_cubics(cubics: &mut [Cubic; 10]) -> (Self, f64) {
        let pivot = elimination::reduce(cubics, FIRST_USED);
        let mut out = Self { x: [[0.0; 4]; 3], y: [[0.0; 4]; 3], w: [[0.0; 5]; 3] };
        for r in 0..3 {
            // The row led by a monomial times z, less z times the row led by the monomial: no leader is left.
            let tail = |row: usize| &cubics[FIRST_USED + 2 * r + row][10..];
            let (with_z, without) = (tail(0), tail(1));
            for k in 0..3 {
                out.x[r][k] += with_z[2 - k];
                out.x[r][k + 1] -= without[2 - k];
                out.y[r][k] += with_z[5 - k];
                out.y[r][k + 1] -= without[5 - k];
            }
            for k in 0..4 {
                out.w[r][k] += with_z[9 - k];
                out.w[r][k + 1] -= without[9 - k];
            }
        }
        (out, pivot)
    }

    /// The determinant, whose roots are the values of `z`.
    pub(crate) fn polynomial(&self) -> [f64; 11] {
        let mut out = [0.0; 11];
        for r in 0..3 {
            let (i, j) = ((r + 1) % 3, (r + 2) % 3);
            let mut minor = [0.0; 7];
            for a in 0..4 {
                for b in 0..4 {
                    minor[a + b] += self.x[i][a] * self.y[j][b] - self.y[i][a] * self.x[j][b];
                }
            }
            for a in 0..7 {
                for b in 0..5 {
                    out[a + b] += minor[a] * self.w[r][b];
                }
            }
        }
        out
    }

    /// `(x, y, z, w)` at a root, up to scale: the null vector of the three equations.
    #[inline]
    pub(crate) fn point<T: Number>(&self, z: T) -> [T; 4] {
        let m: [[T; 3]; 3] =
            std::array::from_fn(|r| [horner(&self.x[r], z), horner(&self.y[r], z), horner(&self.w[r], z)]);
        let cross = |a: &[T; 3], b: &[T; 3]| -> [T; 3] {
            std::array::from_fn(|k| {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                a[i] * b[j] - a[j] * b[i]
            })
        };
        let two_of = T::longer(&cross(&m[0], &m[1]), &cross(&m[1], &m[2]));
        let [x, y, w] = T::longer(&two_of, &cross(&m[2], &m[0]));
        [x, y, z * w, w]
    }
}

#[inline]
fn horner<T: Number, const N: usize>(p: &[f64; N], z: T) -> T {
    p[..N - 1].iter().rev().fold(T::real(p[N - 1]), |value, c| value * z + T::real(*c))
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
