//! The ten cubics reduced to six rows by Householder reflections.
//!
//! Gauss–Jordan elimination with pivoting would choose other rows in every lane; reflections need no choice and are more
//! accurate. Of the reduced matrix only the rows led by `x²z, x²w, y²z, y²w, xyz, xyw` are used, so that back substitution
//! stops there.

use super::lane::{F, Float, Lanes};

/// The first of the reduced rows that are used.
const FIRST: usize = 4;
/// How many rows are used.
pub(super) const ROWS: usize = 10 - FIRST;

/// The six rows' coefficients of the ten monomials that are left, and the smallest pivot over the largest.
#[inline(always)]
pub(super) fn reduce<L: Lanes<f64>>(lanes: L, m: &mut [[F<L>; 20]; 10]) -> ([[F<L>; 10]; ROWS], F<L>) {
    let zero = lanes.splat(0.0);
    let (mut smallest, mut largest) = (lanes.splat(f64::MAX), zero);
    for k in 0..9 {
        let mut v = [zero; 10];
        let mut square = zero;
        for i in k..10 {
            v[i] = m[i][k];
            square = v[i].mul_add(v[i], square);
        }
        let length = square.sqrt();
        smallest = length.select(length.less(smallest), smallest);
        largest = length.select(largest.less(length), largest);
        let image = (-length).select(zero.less(v[k]), length);
        v[k] = v[k] - image;
        m[k][k] = image;
        let factor = lanes.splat(-1.0) / (image * v[k]);
        for j in k + 1..20 {
            let mut dot = zero;
            for i in k..10 {
                dot = v[i].mul_add(m[i][j], dot);
            }
            let dot = dot * factor;
            for i in k..10 {
                m[i][j] = dot.neg_mul_add(v[i], m[i][j]);
            }
        }
    }
    let last = m[9][9].abs();
    smallest = last.select(last.less(smallest), smallest);
    let mut inverse = [zero; 10];
    for k in FIRST..10 {
        inverse[k] = lanes.splat(1.0) / m[k][k];
    }
    let mut out = [[zero; 10]; ROWS];
    for j in 0..10 {
        for k in (FIRST..10).rev() {
            let mut x = m[k][10 + j];
            for i in k + 1..10 {
                x = m[k][i].neg_mul_add(out[i - FIRST][j], x);
            }
            out[k - FIRST][j] = x * inverse[k];
        }
    }
    (out, smallest / largest)
}
