//! The bearings in the frame of their best alignment, and the rows of the linear constraints.
//!
//! As the scalar solver derives it: with `c = R0 a`, `n = c × (b − c)`, `p = rms |n|` and `E R0ᵀ = [t]× + p S`, the
//! constraint `bᵀ E a = 0` is the row `[n/p, sym(b cᵀ)]` on `(t, S)`, of order one at any parallax.
//!
//! `R0` need not be the best alignment to the last digit: any rotation gives the same essential matrices, and one that leaves
//! little more than the least `p` keeps the rows well scaled.

use crate::algebra::vectors::geometry::{
    Matrix3, Quaternion, Vector3, cross, dot, normalized, product, rotation,
};
use crate::algebra::vectors::lane::{F, Float, Lanes};

/// Above the largest possible sum of the cosines of five matches by as much as keeps the factorisation regular where the
/// bearings are exactly aligned.
const SHIFT: f64 = 5.0 + 1e-9;

/// Inverse iterations. Each divides the error by about `gap / p²`: bearings with little parallax, where the frame matters, need
/// two.
const ITERATIONS: usize = 4;

/// The frame of the best alignment.
pub(crate) struct Frame<L: Lanes<f64>> {
    /// The alignment `R0` from camera 1 to camera 2.
    pub(crate) r0_21: Matrix3<L>,
    /// `p`, the root mean square of the sine of the angles that it leaves.
    pub(crate) parallax: F<L>,
}

/// The frame of five matches with bearings `a` in view 1 and `b` in view 2, and the rows of their constraints.
#[inline(always)]
pub(crate) fn frame<L: Lanes<f64>>(
    lanes: L,
    a: &[Vector3<L>; 5],
    b: &[Vector3<L>; 5],
) -> (Frame<L>, [[F<L>; 9]; 5]) {
    let zero = lanes.splat(0.0);
    let b = with_signs::<L>(lanes, a, b);
    let r0_21 = rotation(lanes, &alignment(lanes, &correlation::<L>(lanes, a, &b)));
    let mut square = zero;
    let mut rows = [[zero; 9]; 5];
    for i in 0..5 {
        let (b, c) = (&b[i], product::<L>(&r0_21, &a[i]));
        let n = cross::<L>(&c, &[b[0] - c[0], b[1] - c[1], b[2] - c[2]]);
        square = square + dot::<L, 3>(&n, &n);
        rows[i] = [
            n[0],
            n[1],
            n[2],
            b[0] * c[0],
            b[1] * c[1],
            b[2] * c[2],
            b[0].mul_add(c[1], b[1] * c[0]),
            b[0].mul_add(c[2], b[2] * c[0]),
            b[1].mul_add(c[2], b[2] * c[1]),
        ];
    }
    let parallax = (square * lanes.splat(0.2)).sqrt();
    let inverse = lanes.splat(1.0) / parallax;
    for row in &mut rows {
        for x in &mut row[..3] {
            *x = *x * inverse;
        }
    }
    (Frame { r0_21, parallax }, rows)
}

/// The bearings `b`, with the signs by which a rotation aligns them as lines. A point behind camera 2 has the opposite bearing.
///
/// A rotation preserves angles, so the angles to the first match tell all signs but a common one. The determinant of the
/// correlation tells that one, here as in the scalar solver.
#[inline(always)]
fn with_signs<L: Lanes<f64>>(lanes: L, a: &[Vector3<L>; 5], b: &[Vector3<L>; 5]) -> [Vector3<L>; 5] {
    let zero = lanes.splat(0.0);
    let mut signed = *b;
    for i in 1..5 {
        let turned = (dot::<L, 3>(&a[0], &a[i]) * dot::<L, 3>(&b[0], &b[i])).less(zero);
        for x in &mut signed[i] {
            *x = (-*x).select(turned, *x);
        }
    }
    let g = correlation::<L>(lanes, a, &signed);
    let turned = dot::<L, 3>(&g[0], &cross::<L>(&g[1], &g[2])).less(zero);
    for v in &mut signed {
        for x in v {
            *x = (-*x).select(turned, *x);
        }
    }
    signed
}

/// `Σ b aᵀ`.
#[inline(always)]
fn correlation<L: Lanes<f64>>(lanes: L, a: &[Vector3<L>; 5], b: &[Vector3<L>; 5]) -> Matrix3<L> {
    let mut sum = [[lanes.splat(0.0); 3]; 3];
    for i in 0..5 {
        for j in 0..3 {
            for k in 0..3 {
                sum[j][k] = b[i][j].mul_add(a[i][k], sum[j][k]);
            }
        }
    }
    sum
}

/// The quaternion that maximises `Σ b · R a`: of Davenport's matrix the eigenvector with the largest eigenvalue, by inverse
/// iteration from above.
#[inline(always)]
fn alignment<L: Lanes<f64>>(lanes: L, g: &Matrix3<L>) -> Quaternion<L> {
    let shift = lanes.splat(SHIFT);
    let (xx, yy, zz) = (g[0][0], g[1][1], g[2][2]);
    // The lower triangle of `SHIFT · I − K`.
    let mut m = [
        [shift - (xx + yy + zz), shift, shift, shift],
        [g[1][2] - g[2][1], shift - (xx - yy - zz), shift, shift],
        [g[2][0] - g[0][2], -(g[0][1] + g[1][0]), shift - (yy - xx - zz), shift],
        [g[0][1] - g[1][0], -(g[0][2] + g[2][0]), -(g[1][2] + g[2][1]), shift - (zz - xx - yy)],
    ];
    // L D Lᵀ: positive definite, so that no pivoting is needed.
    let one = lanes.splat(1.0);
    let mut inverse = [one; 4];
    for k in 0..4 {
        inverse[k] = one / m[k][k];
        for i in k + 1..4 {
            let factor = m[i][k] * inverse[k];
            for j in k + 1..=i {
                m[i][j] = factor.neg_mul_add(m[j][k], m[i][j]);
            }
        }
        for i in k + 1..4 {
            m[i][k] = m[i][k] * inverse[k];
        }
    }
    let mut q = [0.5, 0.51, 0.49, 0.5].map(|x| lanes.splat(x));
    for iteration in 0..ITERATIONS {
        for i in 1..4 {
            for j in 0..i {
                q[i] = m[i][j].neg_mul_add(q[j], q[i]);
            }
        }
        for i in (0..4).rev() {
            q[i] = q[i] * inverse[i];
            for j in i + 1..4 {
                q[i] = m[j][i].neg_mul_add(q[j], q[i]);
            }
        }
        if iteration % 2 == 1 {
            q = normalized::<L, 4>(lanes, q);
        }
    }
    q
}
