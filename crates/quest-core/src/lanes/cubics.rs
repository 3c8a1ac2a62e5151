//! The ten cubics of the parallax-safe form, over twenty monomials.
//!
//! The trace constraint divided by `p` as the scalar solver's module derives it, halved, and not parted into its symmetric and
//! antisymmetric parts as there: with `K = [t]×` and `E = K + p S`
//!
//! ```text
//! Λ = 2 (K S − S K) + p (2 S² − tr(S²) I)
//! −t (tᵀ S) + Λ/2 E = 0                 nine cubics
//! det(tr(S) I − 2 S) / 2 = 0            the tenth
//! ```

use super::lane::{F, Float, Lanes};
use super::null_space::Basis;
use crate::solver::forms::{PRODUCT, SQUARE};

type Linear<L> = [F<L>; 4];
type Quadratic<L> = [F<L>; 10];
type Cubic<L> = [F<L>; 20];
/// The coefficients of one monomial in all cubics.
pub(super) type Column<L> = [F<L>; 10];

/// The position in a triangle of the entry of a symmetric matrix.
const SYMMETRIC: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// The ten cubics, and room to compute them in.
pub(super) struct Cubics<L: Lanes<f64>> {
    /// One for each monomial of [`CUBIC`](crate::solver::forms::CUBIC).
    pub(super) columns: [Column<L>; 20],
    /// Of three cubics the quadratic factors of the four variables.
    factors: [[Quadratic<L>; 4]; 3],
}

impl<L: Lanes<f64>> Cubics<L> {
    /// Cubics to be filled.
    #[inline(always)]
    pub(super) fn new(lanes: L) -> Self {
        let zero = lanes.splat(0.0);
        Self { columns: [[zero; 10]; 20], factors: [[[zero; 10]; 4]; 3] }
    }
}

/// Fills the cubics.
///
/// A cubic is a sum of products of quadratic and linear forms. It is summed variable by variable of the linear forms: the ten
/// coefficients of a quadratic form fit into the registers, the twenty of a cubic do not.
#[inline(always)]
pub(super) fn fill<L: Lanes<f64>>(lanes: L, basis: &Basis<L>, p: F<L>, out: &mut Cubics<L>) {
    let [t0, t1, t2, xx, yy, zz, xy, xz, yz] = basis;
    let forms = Forms::new(basis, p);
    let lambda = forms.half_lambda(lanes, basis);
    for (j, s) in [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]].iter().enumerate() {
        let row = sum_of_products::<L>(lanes, &[(t0, s[0]), (t1, s[1]), (t2, s[2])]);
        for v in 0..4 {
            for i in 0..3 {
                let [a, b, c] = SYMMETRIC[i].map(|k| &lambda[k]);
                let weights = [forms.minus_t[i][v], forms.e[0][j][v], forms.e[1][j][v], forms.e[2][j][v]];
                out.factors[i][v] = weighted_sum::<L, 4>([&row, a, b, c], weights);
            }
        }
        for i in 0..3 {
            let cubic = collected::<L>(lanes, &out.factors[i]);
            for k in 0..20 {
                out.columns[k][3 * i + j] = cubic[k];
            }
        }
    }
    let tenth = tenth::<L>(lanes, basis);
    for k in 0..20 {
        out.columns[k][9] = tenth[k];
    }
}

/// Linear forms that the cubics are made of.
struct Forms<L: Lanes<f64>> {
    minus_t: [Linear<L>; 3],
    /// `p S`: the entries `xx, yy, zz, xy, xz, yz`.
    ps: [Linear<L>; 6],
    e: [[Linear<L>; 3]; 3],
}

impl<L: Lanes<f64>> Forms<L> {
    #[inline(always)]
    fn new([t0, t1, t2, xx, yy, zz, xy, xz, yz]: &Basis<L>, p: F<L>) -> Self {
        let ps = [xx, yy, zz, xy, xz, yz].map(|form| form.map(|x| p * x));
        let [pxx, pyy, pzz, pxy, pxz, pyz] = &ps;
        let e = [
            [*pxx, difference::<L>(pxy, t2), add::<L>(pxz, t1)],
            [add::<L>(pxy, t2), *pyy, difference::<L>(pyz, t0)],
            [difference::<L>(pxz, t1), add::<L>(pyz, t0), *pzz],
        ];
        Self { minus_t: [t0, t1, t2].map(|form| form.map(|x| -x)), ps, e }
    }

    /// The six different entries of the symmetric `Λ/2 = K S − S K + p (S² − tr(S²)/2 I)`.
    ///
    /// Off the diagonal, as `E = K + p S`, the entry of `x` and `y` is `xx E_yx + yy E_xy + yz E_xz − t_x xz`, and so in turn.
    #[inline(always)]
    fn half_lambda(&self, lanes: L, basis: &Basis<L>) -> [Quadratic<L>; 6] {
        let [t0, t1, t2, xx, yy, zz, xy, xz, yz] = basis;
        let [pxx, pyy, pzz, pxy, pxz, pyz] = &self.ps;
        let ([m0, m1, m2], e) = (&self.minus_t, &self.e);
        let off = [
            sum_of_products::<L>(lanes, &[(xx, &e[1][0]), (yy, &e[0][1]), (yz, &e[0][2]), (xz, m0)]),
            sum_of_products::<L>(lanes, &[(zz, &e[0][2]), (xx, &e[2][0]), (xy, &e[2][1]), (yz, m2)]),
            sum_of_products::<L>(lanes, &[(yy, &e[2][1]), (zz, &e[1][2]), (xz, &e[1][0]), (xy, m1)]),
        ];
        // On the diagonal, for x: 2 (t_y xz − t_z xy) + p (xx² − yy² − zz² − 2 yz²) / 2.
        let turned = [(t0, yz), (t1, xz), (t2, xy)].map(|pair| sum_of_products::<L>(lanes, &[pair]));
        let square = [(pxx, xx), (pyy, yy), (pzz, zz)].map(|pair| sum_of_products::<L>(lanes, &[pair]));
        let across = [(pyz, yz), (pxz, xz), (pxy, xy)].map(|pair| sum_of_products::<L>(lanes, &[pair]));
        let (half, two) = (lanes.splat(0.5), lanes.splat(2.0));
        let mut on = off;
        for q in 0..10 {
            let half_trace = half * (square[0][q] + square[1][q] + square[2][q]);
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                let symmetric = square[i][q] - half_trace - across[i][q];
                on[i][q] = two.mul_add(turned[j][q] - turned[k][q], symmetric);
            }
        }
        [on[0], off[0], off[1], on[1], off[2], on[2]]
    }
}

/// `det(tr(S) I − 2 S) / 2`.
#[inline(always)]
fn tenth<L: Lanes<f64>>(lanes: L, [_, _, _, xx, yy, zz, xy, xz, yz]: &Basis<L>) -> Cubic<L> {
    let minus = |form: &Linear<L>| form.map(|x| -x);
    let double = |form: &Linear<L>| form.map(|x| x + x);
    let first = [add::<L>(yy, &difference::<L>(zz, xx)).map(|x| lanes.splat(0.5) * x), minus(xy), minus(xz)];
    let second = [minus(&double(xy)), add::<L>(zz, &difference::<L>(xx, yy)), minus(&double(yz))];
    let third = [minus(&double(xz)), second[2], add::<L>(xx, &difference::<L>(yy, zz))];
    let minors = [(1, 2), (2, 0), (0, 1)].map(|(a, b)| {
        let negative = minus(&second[b]);
        sum_of_products::<L>(lanes, &[(&second[a], &third[b]), (&negative, &third[a])])
    });
    let mut factors = [minors[0]; 4];
    for v in 0..4 {
        factors[v] = weighted_sum::<L, 3>(minors.each_ref(), [first[0][v], first[1][v], first[2][v]]);
    }
    collected::<L>(lanes, &factors)
}

#[inline(always)]
fn add<L: Lanes<f64>>(a: &Linear<L>, b: &Linear<L>) -> Linear<L> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

#[inline(always)]
fn difference<L: Lanes<f64>>(a: &Linear<L>, b: &Linear<L>) -> Linear<L> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
}

/// `Σ a b` of some linear forms.
#[inline(always)]
fn sum_of_products<L: Lanes<f64>>(lanes: L, pairs: &[(&Linear<L>, &Linear<L>)]) -> Quadratic<L> {
    let mut out = [lanes.splat(0.0); 10];
    for (a, b) in pairs {
        for i in 0..4 {
            for j in 0..4 {
                let sum = &mut out[SQUARE[i][j]];
                *sum = a[i].mul_add(b[j], *sum);
            }
        }
    }
    out
}

/// The sum of some quadratic forms with weights.
#[inline(always)]
fn weighted_sum<L: Lanes<f64>, const N: usize>(
    forms: [&Quadratic<L>; N],
    weights: [F<L>; N],
) -> Quadratic<L> {
    let mut out = [forms[0][0] * weights[0]; 10];
    for i in 1..10 {
        out[i] = forms[0][i] * weights[0];
    }
    for term in 1..N {
        for i in 0..10 {
            out[i] = forms[term][i].mul_add(weights[term], out[i]);
        }
    }
    out
}

/// The sum of the variables with their quadratic factors.
#[inline(always)]
fn collected<L: Lanes<f64>>(lanes: L, factors: &[Quadratic<L>; 4]) -> Cubic<L> {
    let mut out = [lanes.splat(0.0); 20];
    for v in 0..4 {
        for i in 0..10 {
            out[PRODUCT[i][v]] = out[PRODUCT[i][v]] + factors[v][i];
        }
    }
    out
}
