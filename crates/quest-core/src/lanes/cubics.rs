//! The ten cubics of the parallax-safe form, over twenty monomials.
//!
//! As the scalar solver derives them: with `K = [t]×` and `E = K + p S`
//!
//! ```text
//! Λ = 2 (K S − S K) + p (2 S² − tr(S²) I)
//! −2 t (tᵀ S) + Λ E = 0                 nine cubics
//! det(tr(S) I − 2 S) = 0                the tenth
//! ```

use super::lane::{F, Float, Lanes};
use super::null_space::Basis;
use crate::algebra::monomials::{homogeneous, position, sum};

/// Exponents of `(x, y, z, w)` of the ten quadratic monomials.
const QUADRATIC: [[u8; 4]; 10] = homogeneous::<10>(2);

/// Exponents of the twenty cubic monomials: ten to eliminate, the rest with `x`, with `y` and with neither, by falling
/// powers of `z`.
pub(super) const CUBIC: [[u8; 4]; 20] = [
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
const SQUARE: [[usize; 4]; 4] = {
    let mut table = [[0; 4]; 4];
    let mut a = 0;
    while a < 16 {
        table[a / 4][a % 4] = position(&QUADRATIC, sum(VARIABLES[a / 4], VARIABLES[a % 4]));
        a += 1;
    }
    table
};

/// The cubic monomial of a quadratic one and a variable.
const PRODUCT: [[usize; 4]; 10] = {
    let mut table = [[0; 4]; 10];
    let mut a = 0;
    while a < 40 {
        table[a / 4][a % 4] = position(&CUBIC, sum(QUADRATIC[a / 4], VARIABLES[a % 4]));
        a += 1;
    }
    table
};

type Linear<L> = [F<L>; 4];
type Quadratic<L> = [F<L>; 10];
type Cubic<L> = [F<L>; 20];

/// Adds `a · b`.
#[inline(always)]
fn add_linear_product<L: Lanes<f64>>(out: &mut Quadratic<L>, a: &Linear<L>, b: &Linear<L>) {
    for i in 0..4 {
        for j in 0..4 {
            let sum = &mut out[SQUARE[i][j]];
            *sum = a[i].mul_add(b[j], *sum);
        }
    }
}

/// Subtracts `a · b`.
#[inline(always)]
fn subtract_linear_product<L: Lanes<f64>>(out: &mut Quadratic<L>, a: &Linear<L>, b: &Linear<L>) {
    for i in 0..4 {
        for j in 0..4 {
            let sum = &mut out[SQUARE[i][j]];
            *sum = a[i].neg_mul_add(b[j], *sum);
        }
    }
}

/// Adds `a · b`.
#[inline(always)]
fn add_product<L: Lanes<f64>>(out: &mut Cubic<L>, a: &Quadratic<L>, b: &Linear<L>) {
    for i in 0..10 {
        for j in 0..4 {
            let sum = &mut out[PRODUCT[i][j]];
            *sum = a[i].mul_add(b[j], *sum);
        }
    }
}

/// The position in a triangle of the entry of a symmetric matrix.
const SYMMETRIC: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// The ten divided cubics over [`CUBIC`].
#[inline(always)]
pub(super) fn cubics<L: Lanes<f64>>(lanes: L, basis: &Basis<L>, p: F<L>) -> [Cubic<L>; 10] {
    let zero = lanes.splat(0.0);
    let nothing = [zero; 4];
    let [t0, t1, t2, xx, yy, zz, xy, xz, yz] = *basis;
    let t = [t0, t1, t2];
    let s = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let mut k = [[nothing; 3]; 3];
    for m in 0..4 {
        (k[0][1][m], k[0][2][m], k[1][2][m]) = (-t2[m], t1[m], -t0[m]);
        (k[1][0][m], k[2][0][m], k[2][1][m]) = (t2[m], -t1[m], t0[m]);
    }
    let mut e = k;
    for i in 0..3 {
        for j in 0..3 {
            for m in 0..4 {
                e[i][j][m] = p.mul_add(s[i][j][m], k[i][j][m]);
            }
        }
    }
    let lambda = lambda::<L>(lanes, &k, &s, p);
    let mut out = [[zero; 20]; 10];
    for j in 0..3 {
        // Entry j of −2 tᵀ S.
        let mut row = [zero; 10];
        for m in 0..3 {
            add_linear_product::<L>(&mut row, &t[m], &s[m][j]);
        }
        for x in &mut row {
            *x = lanes.splat(-2.0) * *x;
        }
        for i in 0..3 {
            let mut cubic = [zero; 20];
            add_product::<L>(&mut cubic, &row, &t[i]);
            for m in 0..3 {
                add_product::<L>(&mut cubic, &lambda[SYMMETRIC[i][m]], &e[m][j]);
            }
            out[3 * i + j] = cubic;
        }
    }
    out[9] = tenth::<L>(lanes, &s);
    out
}

/// `Λ`, by its upper triangle.
#[inline(always)]
fn lambda<L: Lanes<f64>>(
    lanes: L,
    k: &[[Linear<L>; 3]; 3],
    s: &[[Linear<L>; 3]; 3],
    p: F<L>,
) -> [Quadratic<L>; 6] {
    let zero = lanes.splat(0.0);
    let mut lambda = [[zero; 10]; 6];
    let mut square = [[zero; 10]; 6];
    for i in 0..3 {
        for j in i..3 {
            let (entry, square) = (&mut lambda[SYMMETRIC[i][j]], &mut square[SYMMETRIC[i][j]]);
            for m in 0..3 {
                // K S − S K = K S + (K S)ᵀ, and the diagonal of K is zero.
                if m != i {
                    add_linear_product::<L>(entry, &k[i][m], &s[m][j]);
                }
                if m != j {
                    add_linear_product::<L>(entry, &k[j][m], &s[m][i]);
                }
                add_linear_product::<L>(square, &s[i][m], &s[m][j]);
            }
        }
    }
    let (half, two) = (lanes.splat(0.5), lanes.splat(2.0));
    for q in 0..10 {
        let half_trace = half * (square[0][q] + square[3][q] + square[5][q]);
        for i in [0, 3, 5] {
            square[i][q] = square[i][q] - half_trace;
        }
        for i in 0..6 {
            lambda[i][q] = two * p.mul_add(square[i][q], lambda[i][q]);
        }
    }
    lambda
}

/// `det(tr(S) I − 2 S)`.
#[inline(always)]
fn tenth<L: Lanes<f64>>(lanes: L, s: &[[Linear<L>; 3]; 3]) -> Cubic<L> {
    let zero = lanes.splat(0.0);
    let minus_two = lanes.splat(-2.0);
    let mut d = *s;
    for i in 0..3 {
        for j in 0..3 {
            for m in 0..4 {
                d[i][j][m] = minus_two * s[i][j][m];
            }
        }
        for m in 0..4 {
            d[i][i][m] = d[i][i][m] + s[0][0][m] + s[1][1][m] + s[2][2][m];
        }
    }
    let mut out = [zero; 20];
    for j in 0..3 {
        let (a, b) = ((j + 1) % 3, (j + 2) % 3);
        let mut minor = [zero; 10];
        add_linear_product::<L>(&mut minor, &d[1][a], &d[2][b]);
        subtract_linear_product::<L>(&mut minor, &d[1][b], &d[2][a]);
        add_product::<L>(&mut out, &minor, &d[0][j]);
    }
    out
}
