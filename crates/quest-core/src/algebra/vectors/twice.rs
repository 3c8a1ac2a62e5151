//! Two numbers for each problem: two of its roots at once.
//!
//! Instructions wait for those before them. Two independent chains fill the time.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::algebra::vectors::lane::{F, Float, Lanes, Mask};

/// Twice the lanes of `L`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TwiceLanes<L>(pub(crate) L);

/// Two numbers, or two truth values.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twice<V>(pub(crate) V, pub(crate) V);

/// The same two times.
#[inline(always)]
pub(crate) fn twice<V: Copy, const N: usize>(values: &[V; N]) -> [Twice<V>; N] {
    let mut out = [Twice(values[0], values[0]); N];
    for i in 1..N {
        out[i] = Twice(values[i], values[i]);
    }
    out
}

impl<L: Lanes<f64>> Lanes<f64> for TwiceLanes<L> {
    const COUNT: usize = 2 * L::COUNT;
    type Float = Twice<F<L>>;

    #[inline(always)]
    fn splat(self, x: f64) -> Twice<F<L>> {
        Twice(self.0.splat(x), self.0.splat(x))
    }

    #[inline(always)]
    fn load(self, x: &[f64]) -> Twice<F<L>> {
        Twice(self.0.load(x), self.0.load(&x[L::COUNT..]))
    }
}

macro_rules! binary {
    ($($Op:ident $op:ident),*) => {$(
        impl<V: $Op<Output = V>> $Op for Twice<V> {
            type Output = Self;

            #[inline(always)]
            fn $op(self, other: Self) -> Self {
                Self(self.0.$op(other.0), self.1.$op(other.1))
            }
        }
    )*};
}

binary!(Add add, Sub sub, Mul mul, Div div);

impl<V: Neg<Output = V>> Neg for Twice<V> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl<V: Float<f64>> Float<f64> for Twice<V> {
    type Mask = Twice<V::Mask>;

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(self.0.mul_add(b.0, c.0), self.1.mul_add(b.1, c.1))
    }

    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Self(self.0.neg_mul_add(b.0, c.0), self.1.neg_mul_add(b.1, c.1))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt(), self.1.sqrt())
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs(), self.1.abs())
    }

    #[inline(always)]
    fn less(self, other: Self) -> Self::Mask {
        Twice(self.0.less(other.0), self.1.less(other.1))
    }

    #[inline(always)]
    fn select(self, mask: Self::Mask, other: Self) -> Self {
        Self(self.0.select(mask.0, other.0), self.1.select(mask.1, other.1))
    }

    #[inline(always)]
    fn sum(self) -> f64 {
        self.0.sum() + self.1.sum()
    }

    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        // As many as the other half of `out` begins behind.
        let (first, second) = out.split_at_mut(out.len() / 2);
        self.0.store(first);
        self.1.store(second);
    }
}

impl<V: Mask> Mask for Twice<V> {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(self.0.and(other.0), self.1.and(other.1))
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(self.0.or(other.0), self.1.or(other.1))
    }

    #[inline(always)]
    fn any(self) -> bool {
        self.0.or(self.1).any()
    }
}
