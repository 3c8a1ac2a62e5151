//! The null space of the five rows by Householder reflections.

use crate::algebra::vectors::lane::{F, Float, Lanes};

/// Nine rows of the four basis vectors' entries: the entries of `(t, S)` as linear forms.
pub(crate) type Basis<L> = [[F<L>; 4]; 9];

/// An orthonormal basis of the vectors orthogonal to the rows, which are overwritten, and the smallest pivot.
///
/// Without pivoting: the rows are of the same length, and the order of matches in a sample is as good as any other.
#[inline(always)]
pub(crate) fn null_space<L: Lanes<f64>>(lanes: L, rows: &mut [[F<L>; 9]; 5]) -> (Basis<L>, F<L>) {
    let mut smallest = lanes.splat(f64::MAX);
    let factors = [
        eliminate::<L, 0>(lanes, rows, &mut smallest),
        eliminate::<L, 1>(lanes, rows, &mut smallest),
        eliminate::<L, 2>(lanes, rows, &mut smallest),
        eliminate::<L, 3>(lanes, rows, &mut smallest),
        eliminate::<L, 4>(lanes, rows, &mut smallest),
    ];
    let mut basis = [[lanes.splat(0.0); 4]; 9];
    for m in 0..4 {
        // The last reflection of a unit vector, whose other entries are zero.
        let dot = rows[4][5 + m] * factors[4];
        let mut e = rows[4].map(|x| -(dot * x));
        e[5 + m] = e[5 + m] + lanes.splat(1.0);
        for x in &mut e[..4] {
            *x = lanes.splat(0.0);
        }
        reflect::<L, 3>(&mut e, &rows[3], factors[3]);
        reflect::<L, 2>(&mut e, &rows[2], factors[2]);
        reflect::<L, 1>(&mut e, &rows[1], factors[1]);
        reflect::<L, 0>(&mut e, &rows[0], factors[0]);
        for j in 0..9 {
            basis[j][m] = e[j];
        }
    }
    (basis, smallest)
}

/// Puts the vector of the reflection that leaves of row `K` nothing behind entry `K` in its place, reflects the rows behind,
/// and returns the factor.
#[inline(always)]
fn eliminate<L: Lanes<f64>, const K: usize>(
    lanes: L,
    rows: &mut [[F<L>; 9]; 5],
    smallest: &mut F<L>,
) -> F<L> {
    let (head, tail) = rows.split_at_mut(K + 1);
    let v = &mut head[K];
    let mut square = v[K] * v[K];
    for j in K + 1..9 {
        square = v[j].mul_add(v[j], square);
    }
    let length = square.sqrt();
    *smallest = length.select(length.less(*smallest), *smallest);
    let image = (-length).select(lanes.splat(0.0).less(v[K]), length);
    v[K] = v[K] - image;
    let factor = lanes.splat(-1.0) / (image * v[K]);
    for row in tail {
        reflect::<L, K>(row, v, factor);
    }
    factor
}

/// Applies `I − v vᵀ · factor`, with `v` zero ahead of entry `K`.
#[inline(always)]
fn reflect<L: Lanes<f64>, const K: usize>(x: &mut [F<L>; 9], v: &[F<L>; 9], factor: F<L>) {
    let mut dot = v[K] * x[K];
    for j in K + 1..9 {
        dot = v[j].mul_add(x[j], dot);
    }
    let dot = dot * factor;
    for j in K..9 {
        x[j] = dot.neg_mul_add(v[j], x[j]);
    }
}
