//! Two numbers side by side, as the registers of every x86-64 and `AArch64` processor hold them: loops over matches take two at
//! a time. Arrays that the compiler could have put there it does not.

use std::array::from_fn;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
pub(crate) use wide::f64x2 as Two;

use crate::algebra::vectors::lane::{Float, Lanes, Mask};

/// Two lanes, in the registers that nearly every processor has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TwoLanes;

impl Lanes<f64> for TwoLanes {
    const COUNT: usize = 2;
    type Float = Two;

    #[inline(always)]
    fn splat(self, x: f64) -> Two {
        Two::splat(x)
    }

    #[inline(always)]
    fn load(self, x: &[f64]) -> Two {
        Two::new([x[0], x[1]])
    }
}

impl Float<f64> for Two {
    /// All bits of a number, or none.
    type Mask = Self;

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self::abs(self)
    }

    #[inline(always)]
    fn less(self, other: Self) -> Self {
        self.simd_lt(other)
    }

    #[inline(always)]
    fn select(self, mask: Self, other: Self) -> Self {
        Self::select(mask, self, other)
    }

    #[inline(always)]
    fn sum(self) -> f64 {
        self.reduce_add()
    }

    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        out[..2].copy_from_slice(&self.to_array());
    }
}

impl Mask for Two {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self & other
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self | other
    }

    #[inline(always)]
    fn any(self) -> bool {
        Self::any(self)
    }
}

/// Two vectors.
pub(crate) type TwoVectors = [Two; 3];

/// Two quaternions, scalar first.
pub(crate) type TwoQuaternions = [Two; 4];

/// Two vectors side by side; the second is zero where there is none.
#[inline]
pub(crate) fn side_by_side(first: &Vector3<f64>, second: Option<&Vector3<f64>>) -> TwoVectors {
    match second {
        Some(second) => from_fn(|k| Two::new([first[k], second[k]])),
        None => from_fn(|k| Two::new([first[k], 0.0])),
    }
}

/// The same vector twice.
#[inline]
pub(crate) fn both(v: &Vector3<f64>) -> TwoVectors {
    from_fn(|k| Two::splat(v[k]))
}

#[inline]
pub(crate) fn cross(x: &TwoVectors, y: &TwoVectors) -> TwoVectors {
    [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
}

#[inline]
pub(crate) fn dot(x: &TwoVectors, y: &TwoVectors) -> Two {
    x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
}

/// A matrix times two vectors.
#[inline]
pub(crate) fn times(m: &Matrix3<f64>, v: &TwoVectors) -> TwoVectors {
    from_fn(|i| Two::splat(m[(i, 0)]) * v[0] + Two::splat(m[(i, 1)]) * v[1] + Two::splat(m[(i, 2)]) * v[2])
}

#[inline]
pub(crate) fn scaled<const N: usize>(x: &[Two; N], factor: Two) -> [Two; N] {
    x.map(|x| x * factor)
}

/// Two unit quaternions side by side.
#[inline]
pub(crate) fn quaternions(first: &UnitQuaternion<f64>, second: &UnitQuaternion<f64>) -> TwoQuaternions {
    let (p, q) = (first.quaternion(), second.quaternion());
    [[p.w, q.w], [p.i, q.i], [p.j, q.j], [p.k, q.k]].map(Two::new)
}

/// Unit quaternions one by one.
#[inline]
pub(crate) fn unit_quaternions(q: &TwoQuaternions) -> [UnitQuaternion<f64>; 2] {
    let [w, x, y, z] = q.map(Two::to_array);
    from_fn(|k| UnitQuaternion::new_unchecked(Quaternion::new(w[k], x[k], y[k], z[k])))
}

/// `p ⊗ q`.
#[inline]
pub(crate) fn product(p: &TwoQuaternions, q: &TwoQuaternions) -> TwoQuaternions {
    let ([a, b, c, d], [w, x, y, z]) = (*p, *q);
    [
        a * w - (b * x + c * y + d * z),
        (a * x + b * w) + (c * z - d * y),
        (a * y + c * w) + (d * x - b * z),
        (a * z + d * w) + (b * y - c * x),
    ]
}

/// The rotation matrices of unit quaternions, row by row.
#[inline]
pub(crate) fn rotation(q: &TwoQuaternions) -> [TwoVectors; 3] {
    let [w, x, y, z] = *q;
    let (x2, y2, z2, one) = (x + x, y + y, z + z, Two::splat(1.0));
    let (xx, yy, zz) = (x * x2, y * y2, z * z2);
    let (xy, xz, yz) = (x * y2, x * z2, y * z2);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    [
        [one - (yy + zz), xy - wz, xz + wy],
        [xy + wz, one - (xx + zz), yz - wx],
        [xz - wy, yz + wx, one - (xx + yy)],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operations_act_on_each() {
        let (x, y) = (Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.25, 3.0, -1.0));
        let pair = side_by_side(&x, Some(&y));
        let m = Matrix3::from_fn(|i, j| (3 * i + j) as f64 - 3.5);
        let [product, crossed] = [times(&m, &pair), cross(&pair, &both(&y))];
        for (lane, v) in [x, y].iter().enumerate() {
            let at = |u: &TwoVectors| Vector3::from_fn(|k, _| u[k].to_array()[lane]);
            assert!((at(&product) - m * v).norm() < 1e-14);
            assert!((at(&crossed) - v.cross(&y)).norm() < 1e-15);
            assert!((dot(&pair, &product).to_array()[lane] - v.dot(&(m * v))).abs() < 1e-14);
        }
        assert!(side_by_side(&x, None)[0].to_array()[1].abs() < 1e-300);
    }
}
