//! Vectors, rotations and quaternions, one for each lane.

use crate::algebra::vectors::lane::{F, Float, Lanes};

pub(crate) type Vector3<L> = [F<L>; 3];
/// Row by row.
pub(crate) type Matrix3<L> = [[F<L>; 3]; 3];
/// Scalar first.
pub(crate) type Quaternion<L> = [F<L>; 4];

#[inline(always)]
pub(crate) fn dot<L: Lanes<f64>, const N: usize>(a: &[F<L>; N], b: &[F<L>; N]) -> F<L> {
    let mut sum = a[0] * b[0];
    for i in 1..N {
        sum = a[i].mul_add(b[i], sum);
    }
    sum
}

#[inline(always)]
pub(crate) fn cross<L: Lanes<f64>>(a: &Vector3<L>, b: &Vector3<L>) -> Vector3<L> {
    [
        a[2].neg_mul_add(b[1], a[1] * b[2]),
        a[0].neg_mul_add(b[2], a[2] * b[0]),
        a[1].neg_mul_add(b[0], a[0] * b[1]),
    ]
}

#[inline(always)]
pub(crate) fn product<L: Lanes<f64>>(m: &Matrix3<L>, v: &Vector3<L>) -> Vector3<L> {
    [dot::<L, 3>(&m[0], v), dot::<L, 3>(&m[1], v), dot::<L, 3>(&m[2], v)]
}

#[inline(always)]
pub(crate) fn scaled<L: Lanes<f64>, const N: usize>(mut a: [F<L>; N], factor: F<L>) -> [F<L>; N] {
    for x in &mut a {
        *x = *x * factor;
    }
    a
}

#[inline(always)]
pub(crate) fn normalized<L: Lanes<f64>, const N: usize>(lanes: L, a: [F<L>; N]) -> [F<L>; N] {
    scaled::<L, N>(a, lanes.splat(1.0) / dot::<L, N>(&a, &a).sqrt())
}

/// The same vector for all.
#[inline(always)]
pub(crate) fn splat<L: Lanes<f64>>(lanes: L, v: &nalgebra::Vector3<f64>) -> Vector3<L> {
    [lanes.splat(v.x), lanes.splat(v.y), lanes.splat(v.z)]
}

/// The longest of three vectors, and its squared length.
#[inline(always)]
pub(crate) fn longest<L: Lanes<f64>>(vectors: &[Vector3<L>; 3]) -> (Vector3<L>, F<L>) {
    let mut best = vectors[0];
    let mut square = dot::<L, 3>(&best, &best);
    for v in &vectors[1..] {
        let other = dot::<L, 3>(v, v);
        let longer = square.less(other);
        for i in 0..3 {
            best[i] = v[i].select(longer, best[i]);
        }
        square = other.select(longer, square);
    }
    (best, square)
}

/// The rotation matrix of a unit quaternion, equation (3).
#[inline(always)]
pub(crate) fn rotation<L: Lanes<f64>>(lanes: L, q: &Quaternion<L>) -> Matrix3<L> {
    let [w, x, y, z] = *q;
    let (one, two) = (lanes.splat(1.0), lanes.splat(2.0));
    let (x2, y2, z2) = (x * two, y * two, z * two);
    let (xx, yy, zz) = (x * x2, y * y2, z * z2);
    let (xy, xz, yz) = (x * y2, x * z2, y * z2);
    [
        [one - (yy + zz), w.neg_mul_add(z2, xy), w.mul_add(y2, xz)],
        [w.mul_add(z2, xy), one - (xx + zz), w.neg_mul_add(x2, yz)],
        [w.neg_mul_add(y2, xz), w.mul_add(x2, yz), one - (xx + yy)],
    ]
}

/// The quaternion of a nearly orthogonal matrix: of the rows of `4 q qᵀ` the one with the largest diagonal entry.
#[inline(always)]
pub(crate) fn quaternion<L: Lanes<f64>>(lanes: L, r: &Matrix3<L>) -> Quaternion<L> {
    let one = lanes.splat(1.0);
    let (xx, yy, zz) = (r[0][0], r[1][1], r[2][2]);
    let (wx, wy, wz) = (r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]);
    let (xy, xz, yz) = (r[0][1] + r[1][0], r[0][2] + r[2][0], r[1][2] + r[2][1]);
    let rows = [
        [one + xx + yy + zz, wx, wy, wz],
        [wx, one + xx - yy - zz, xy, xz],
        [wy, xy, one - xx + yy - zz, yz],
        [wz, xz, yz, one - xx - yy + zz],
    ];
    let (mut best, mut largest) = (rows[0], rows[0][0]);
    for k in 1..4 {
        let larger = largest.less(rows[k][k]);
        for i in 0..4 {
            best[i] = rows[k][i].select(larger, best[i]);
        }
        largest = rows[k][k].select(larger, largest);
    }
    normalized::<L, 4>(lanes, best)
}

/// The product `p ⊗ q`.
#[inline(always)]
pub(crate) fn composed<L: Lanes<f64>>(p: &Quaternion<L>, q: &Quaternion<L>) -> Quaternion<L> {
    let [a, b, c, d] = *p;
    let [w, x, y, z] = *q;
    [
        d.neg_mul_add(z, c.neg_mul_add(y, b.neg_mul_add(x, a * w))),
        d.neg_mul_add(y, c.mul_add(z, b.mul_add(w, a * x))),
        d.mul_add(x, c.mul_add(w, b.neg_mul_add(z, a * y))),
        d.mul_add(w, c.neg_mul_add(x, b.mul_add(y, a * z))),
    ]
}
