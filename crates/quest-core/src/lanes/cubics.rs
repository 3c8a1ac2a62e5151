//! The ten cubics of the parallax-safe form, over twenty monomials, as the scalar solver's module derives them: with
//! `h = tr S`, `Z = h I − 2 S` and `A = adj Z`
//!
//! ```text
//! (Z t) tᵀ + t (Z t)ᵀ − |t|² Z − h (t tᵀ + ¼ p² (tr(A) I − A)) = 0        six cubics
//! A t = 0                                                                three
//! det Z = 0                                                              one
//! ```

use super::lane::{F, Float, Lanes};
use super::null_space::Basis;
use crate::solver::forms::{PRODUCT, SQUARE};

type Linear<L> = [F<L>; 4];
type Quadratic<L> = [F<L>; 10];
/// The coefficients of one monomial in all cubics.
pub(super) type Column<L> = [F<L>; 10];
/// One for each monomial of [`CUBIC`](crate::solver::forms::CUBIC).
pub(super) type Cubics<L> = [Column<L>; 20];

/// The places of `xx, yy, zz, xy, xz, yz` in a matrix.
const PLACES: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// The cubics' coefficients, ready to be written to.
#[inline(always)]
pub(super) fn empty<L: Lanes<f64>>(lanes: L) -> Cubics<L> {
    [[lanes.splat(0.0); 10]; 20]
}

/// Fills the cubics.
#[inline(always)]
pub(super) fn fill<L: Lanes<f64>>(lanes: L, basis: &Basis<L>, p: F<L>, out: &mut Cubics<L>) {
    let [t0, t1, t2, xx, yy, zz, xy, xz, yz] = basis;
    let t = [t0, t1, t2];
    let (plus, minus) = (lanes.splat(1.0), lanes.splat(-1.0));
    let minus_two = minus + minus;
    let minus_trace = combined::<L, 3, 4>([(xx, minus), (yy, minus), (zz, minus)]);
    let z = [
        combined::<L, 2, 4>([(&minus_trace, minus), (xx, minus_two)]),
        combined::<L, 2, 4>([(&minus_trace, minus), (yy, minus_two)]),
        combined::<L, 2, 4>([(&minus_trace, minus), (zz, minus_two)]),
        combined::<L, 1, 4>([(xy, minus_two)]),
        combined::<L, 1, 4>([(xz, minus_two)]),
        combined::<L, 1, 4>([(yz, minus_two)]),
    ];
    let [z_xx, z_yy, z_zz, z_xy, z_xz, z_yz] = &z;
    let minus_xy = &combined::<L, 1, 4>([(z_xy, minus)]);
    let minus_xz = &combined::<L, 1, 4>([(z_xz, minus)]);
    let minus_yz = &combined::<L, 1, 4>([(z_yz, minus)]);

    let turned = [
        products::<L, 3>(lanes, [(z_xx, t0), (z_xy, t1), (z_xz, t2)]),
        products::<L, 3>(lanes, [(z_xy, t0), (z_yy, t1), (z_yz, t2)]),
        products::<L, 3>(lanes, [(z_xz, t0), (z_yz, t1), (z_zz, t2)]),
    ];
    let a = [
        products::<L, 2>(lanes, [(z_yy, z_zz), (minus_yz, z_yz)]),
        products::<L, 2>(lanes, [(z_xx, z_zz), (minus_xz, z_xz)]),
        products::<L, 2>(lanes, [(z_xx, z_yy), (minus_xy, z_xy)]),
        products::<L, 2>(lanes, [(z_xz, z_yz), (minus_xy, z_zz)]),
        products::<L, 2>(lanes, [(z_xy, z_yz), (minus_xz, z_yy)]),
        products::<L, 2>(lanes, [(z_xy, z_xz), (minus_yz, z_xx)]),
    ];
    let mut squares = [turned[0]; 6];
    for (square, (i, j)) in squares.iter_mut().zip(PLACES) {
        *square = products::<L, 1>(lanes, [(t[i], t[j])]);
    }
    let minus_square =
        combined::<L, 3, 10>([(&squares[0], minus), (&squares[1], minus), (&squares[2], minus)]);
    // What is beside the trace.
    let quarter = lanes.splat(0.25) * p * p;
    let mut beside = squares;
    for k in 0..3 {
        let (b, c) = (&a[(k + 1) % 3], &a[(k + 2) % 3]);
        beside[k] = combined::<L, 3, 10>([(&squares[k], plus), (b, quarter), (c, quarter)]);
        beside[k + 3] = combined::<L, 2, 10>([(&squares[k + 3], plus), (&a[k + 3], -quarter)]);
    }

    for (k, (i, j)) in PLACES.into_iter().enumerate() {
        let symmetric = [(&turned[i], t[j]), (&turned[j], t[i])];
        let [first, second] = symmetric;
        set::<L, 4>(lanes, out, k, [first, second, (&minus_square, &z[k]), (&beside[k], &minus_trace)]);
    }
    set::<L, 3>(lanes, out, 6, [(&a[0], t0), (&a[3], t1), (&a[4], t2)]);
    set::<L, 3>(lanes, out, 7, [(&a[3], t0), (&a[1], t1), (&a[5], t2)]);
    set::<L, 3>(lanes, out, 8, [(&a[4], t0), (&a[5], t1), (&a[2], t2)]);
    set::<L, 3>(lanes, out, 9, [(&a[0], z_xx), (&a[3], z_xy), (&a[4], z_xz)]);
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

/// Sets a cubic to the sum of three or four products of a quadratic and a linear form.
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
    add_product::<L, HALF>(&mut sums, terms[0]);
    add_product::<L, HALF>(&mut sums, terms[1]);
    add_product::<L, HALF>(&mut sums, terms[2]);
    if T > 3 {
        add_product::<L, HALF>(&mut sums, terms[3 % T]);
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
