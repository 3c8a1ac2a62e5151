//! The null space of the five rows by Householder reflections.

use super::lane::{F, Float, Lanes};

/// Nine rows of the four basis vectors' entries: the entries of `(t, S)` as linear forms.
pub(super) type Basis<L> = [[F<L>; 4]; 9];

/// An orthonormal basis of the vectors orthogonal to the rows, which are overwritten, and the smallest pivot.
///
/// Without pivoting: the rows are of the same length, and the order of matches in a sample is as good as any other.
#[inline(always)]
pub(super) fn null_space<L: Lanes<f64>>(lanes: L, rows: &mut [[F<L>; 9]; 5]) -> (Basis<L>, F<L>) {
    let (zero, minus_one) = (lanes.splat(0.0), lanes.splat(-1.0));
    let mut factor = [zero; 5];
    let mut smallest = lanes.splat(f64::MAX);
    for k in 0..5 {
        let (head, tail) = rows.split_at_mut(k + 1);
        let v = &mut head[k];
        let mut square = v[k] * v[k];
        for j in k + 1..9 {
            square = v[j].mul_add(v[j], square);
        }
        let length = square.sqrt();
        smallest = length.select(length.less(smallest), smallest);
        let image = (-length).select(zero.less(v[k]), length);
        v[k] = v[k] - image;
        factor[k] = minus_one / (image * v[k]);
        for row in tail {
            reflect::<L>(row, v, factor[k], k, k);
        }
    }
    let mut basis = [[zero; 4]; 9];
    for m in 0..4 {
        let mut e = [zero; 9];
        e[5 + m] = lanes.splat(1.0);
        for k in (0..5).rev() {
            // Ahead of the first entry that is not zero nothing is to be summed.
            reflect::<L>(&mut e, &rows[k], factor[k], k, if k == 4 { 5 } else { k + 1 });
        }
        for j in 0..9 {
            basis[j][m] = e[j];
        }
    }
    (basis, smallest)
}

/// Applies `I − v vᵀ · factor` to entries `from` and on; those ahead of `sum_from` are zero.
#[inline(always)]
fn reflect<L: Lanes<f64>>(x: &mut [F<L>; 9], v: &[F<L>; 9], factor: F<L>, from: usize, sum_from: usize) {
    let mut dot = v[sum_from] * x[sum_from];
    for j in sum_from + 1..9 {
        dot = v[j].mul_add(x[j], dot);
    }
    let dot = dot * factor;
    for j in from..9 {
        x[j] = dot.neg_mul_add(v[j], x[j]);
    }
}
