//! The ten cubics of the parallax-safe form, over twenty monomials, as the scalar solver's module derives them: with
//! `h = tr S`, `Z = h I − 2 S`, `Y = Z − ½ h I` and `A = adj Z`
//!
//! ```text
//! (Y t) tᵀ + t (Y t)ᵀ − |t|² Z + ¼ p² h (A − tr(A) I) = 0        six cubics
//! A t = 0                                                       three
//! det Z = 0                                                     one
//! ```

use crate::algebra::vectors::lane::{F, Float, Lanes};
use crate::lanes::stages::null_space::Basis;
use crate::solver::shared::forms::{PRODUCT, SQUARE};

type Linear<L> = [F<L>; 4];
type Quadratic<L> = [F<L>; 10];
/// The coefficients of one monomial in all cubics.
pub(crate) type Column<L> = [F<L>; 10];
/// One for each monomial of [`CUBIC`](crate::solver::shared::forms::CUBIC).
pub(crate) type Cubics<L> = [Column<L>; 20];

/// The six different entries of a symmetric matrix: `xx, yy, zz, xy, xz, yz`.
type Entries<Q> = [Q; 6];

/// Their places.
const PLACES: Entries<(usize, usize)> = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// The cubics' coefficients, ready to be written to.
#[inline(always)]
pub(crate) fn empty<L: Lanes<f64>>(lanes: L) -> Cubics<L> {
    [[lanes.splat(0.0); 10]; 20]
}

/// Fills the cubics.
#[inline(always)]
pub(crate) fn fill<L: Lanes<f64>>(lanes: L, basis: &Basis<L>, p: F<L>, out: &mut Cubics<L>) {
    let [t0, t1, t2, s00, s11, s22, s01, s02, s12] = basis;
    let [one, minus, minus_two] = [1.0, -1.0, -2.0].map(|x| lanes.splat(x));
    let t = [t0, t1, t2];
    let minus_t = t.map(|t| combined::<L, 1, 4>([(t, minus)]));
    let h = combined::<L, 3, 4>([(s00, one), (s11, one), (s22, one)]);
    let less = |weight: f64, s| combined::<L, 2, 4>([(&h, lanes.splat(weight)), (s, minus_two)]);
    let [xy, xz, yz] = [s01, s02, s12].map(|s| combined::<L, 1, 4>([(s, minus_two)]));
    let [z_xx, z_yy, z_zz] = [s00, s11, s22].map(|s| less(1.0, s));
    let [y_xx, y_yy, y_zz] = [s00, s11, s22].map(|s| less(0.5, s));
    let z = [z_xx, z_yy, z_zz, xy, xz, yz];
    let turned = [
        products::<L, 3>(lanes, [(&y_xx, t0), (&xy, t1), (&xz, t2)]),
        products::<L, 3>(lanes, [(&xy, t0), (&y_yy, t1), (&yz, t2)]),
        products::<L, 3>(lanes, [(&xz, t0), (&yz, t1), (&y_zz, t2)]),
    ];
    let minus_square = products::<L, 3>(lanes, [(&minus_t[0], t0), (&minus_t[1], t1), (&minus_t[2], t2)]);
    let a = adjugate(lanes, &z);
    let quarter_h = combined::<L, 1, 4>([(&h, lanes.splat(0.25) * p * p)]);
    for (k, (i, j)) in PLACES.into_iter().enumerate() {
        let third = (&minus_square, &z[k]);
        if i == j {
            let twice_t = combined::<L, 1, 4>([(t[i], lanes.splat(2.0))]);
            let less_trace = combined::<L, 2, 10>([(&a[(i + 1) % 3], minus), (&a[(i + 2) % 3], minus)]);
            set::<L, 3>(lanes, out, k, [(&turned[i], &twice_t), third, (&less_trace, &quarter_h)]);
        } else {
            set::<L, 4>(lanes, out, k, [(&turned[i], t[j]), (&turned[j], t[i]), third, (&a[k], &quarter_h)]);
        }
    }
    set::<L, 3>(lanes, out, 6, [(&a[0], t0), (&a[3], t1), (&a[4], t2)]);
    set::<L, 3>(lanes, out, 7, [(&a[3], t0), (&a[1], t1), (&a[5], t2)]);
    set::<L, 3>(lanes, out, 8, [(&a[4], t0), (&a[5], t1), (&a[2], t2)]);
    set::<L, 3>(lanes, out, 9, [(&a[0], &z[0]), (&a[3], &z[3]), (&a[4], &z[4])]);
}

/// `A = adj Z`.
#[inline(always)]
fn adjugate<L: Lanes<f64>>(lanes: L, z: &Entries<Linear<L>>) -> Entries<Quadratic<L>> {
    let minus = lanes.splat(-1.0);
    let [xx, yy, zz, xy, xz, yz] = z;
    let minus_xy = &combined::<L, 1, 4>([(xy, minus)]);
    let minus_xz = &combined::<L, 1, 4>([(xz, minus)]);
    let minus_yz = &combined::<L, 1, 4>([(yz, minus)]);
    [
        products::<L, 2>(lanes, [(yy, zz), (minus_yz, yz)]),
        products::<L, 2>(lanes, [(xx, zz), (minus_xz, xz)]),
        products::<L, 2>(lanes, [(xx, yy), (minus_xy, xy)]),
        products::<L, 2>(lanes, [(xz, yz), (minus_xy, zz)]),
        products::<L, 2>(lanes, [(xy, yz), (minus_xz, yy)]),
        products::<L, 2>(lanes, [(xy, xz), (minus_yz, xx)]),
    ]
}

/// The sum of some forms with weights.
#[inline(always)]
fn combined<L: Lanes<f64>, const T: usize, const N: usize>(terms: [(&[F<L>; N], F<L>); T]) -> [F<L>; N] {
    let mut out = *terms[0].0;
    for i in 0..N {
        out[i] = out[i] * terms[0].1;
        for term in 1..T {
            let (form, weight) = terms[term];
            out[i] = form[i].mul_add(weight, out[i]);
        }
    }
    out
}

/// The sum of some products of linear forms.
#[inline(always)]
fn products<L: Lanes<f64>, const T: usize>(lanes: L, terms: [(&Linear<L>, &Linear<L>); T]) -> Quadratic<L> {
    let mut out = [lanes.splat(0.0); 10];
    for (a, b) in terms {
        for i in 0..4 {
            for j in 0..4 {
                let sum = &mut out[SQUARE[i][j]];
                *sum = a[i].mul_add(b[j], *sum);
            }
        }
    }
    out
}

/// Sets a cubic to the sum of some products of a quadratic and a linear form.
#[inline(always)]
fn set<L: Lanes<f64>, const T: usize>(
    lanes: L,
    out: &mut Cubics<L>,
    row: usize,
    terms: [(&Quadratic<L>, &Linear<L>); T],
) {
    half::<L, T, 0>(lanes, out, row, terms);
    half::<L, T, 1>(lanes, out, row, terms);
}

/// Sets half of the coefficients: ten sums and a linear form fit into the registers.
#[inline(always)]
fn half<L: Lanes<f64>, const T: usize, const HALF: usize>(
    lanes: L,
    out: &mut Cubics<L>,
    row: usize,
    terms: [(&Quadratic<L>, &Linear<L>); T],
) {
    let mut sums = [lanes.splat(0.0); 10];
    for term in 0..T {
        add_product::<L, HALF>(&mut sums, terms[term]);
    }
    for i in 0..10 {
        out[10 * HALF + i][row] = sums[i];
    }
}

#[inline(always)]
fn add_product<L: Lanes<f64>, const HALF: usize>(sums: &mut [F<L>; 10], (a, b): (&Quadratic<L>, &Linear<L>)) {
    for i in 0..10 {
        for v in 0..4 {
            let monomial = PRODUCT[i][v];
            if monomial / 10 == HALF {
                sums[monomial % 10] = a[i].mul_add(b[v], sums[monomial % 10]);
            }
        }
    }
}
