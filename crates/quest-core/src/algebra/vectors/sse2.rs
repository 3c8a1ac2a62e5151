//! Lanes in the registers that every x86-64 has, by pulp.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::x86::V1;
use pulp::{cast, f32x4, f64x2, m32x4, m64x2, u64x2};

use crate::algebra::vectors::lane::{Float, Lanes, Mask, WordLanes};

/// The instructions of SSE2.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sse2(pub(crate) V1);

macro_rules! lanes {
    ($real:ty, $count:literal, $Float:ident: $floats:ty, $Mask:ident: $masks:ty, [
        $splat:ident $add:ident $sub:ident $mul:ident $div:ident $sqrt:ident $abs:ident $less:ident
        $and:ident $andnot:ident $or:ident $and_masks:ident $or_masks:ident
    ]) => {
        /// A register, with the proof that it exists.
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $Float($floats, V1);

        /// A register of truth values.
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $Mask($masks, V1);

        impl Lanes<$real> for Sse2 {
            const COUNT: usize = $count;
            type Float = $Float;

            #[inline(always)]
            fn splat(self, x: $real) -> $Float {
                $Float(self.0.$splat(x), self.0)
            }

            #[inline(always)]
            fn load(self, x: &[$real]) -> $Float {
                let mut first = [0.0; $count];
                first.copy_from_slice(&x[..$count]);
                $Float(cast(first), self.0)
            }
        }

        lanes!(@binary $Float Add add $add, Sub sub $sub, Mul mul $mul, Div div $div);

        impl Neg for $Float {
            type Output = Self;

            #[inline(always)]
            fn neg(self) -> Self {
                Self(self.1.$sub(self.1.$splat(-0.0), self.0), self.1)
            }
        }

        impl Float<$real> for $Float {
            type Mask = $Mask;

            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(self.1.$sqrt(self.0), self.1)
            }

            #[inline(always)]
            fn abs(self) -> Self {
                Self(self.1.$abs(self.0), self.1)
            }

            #[inline(always)]
            fn less(self, other: Self) -> $Mask {
                $Mask(self.1.$less(self.0, other.0), self.1)
            }

            #[inline(always)]
            fn select(self, mask: $Mask, other: Self) -> Self {
                let (simd, bits) = (self.1, cast(mask.0));
                Self(simd.$or(simd.$and(bits, self.0), simd.$andnot(bits, other.0)), simd)
            }

            #[inline(always)]
            fn sum(self) -> $real {
                cast::<_, [$real; $count]>(self.0).into_iter().sum()
            }

            #[inline(always)]
            fn store(self, out: &mut [$real]) {
                out[..$count].copy_from_slice(&cast::<_, [$real; $count]>(self.0));
            }
        }

        impl Mask for $Mask {
            #[inline(always)]
            fn and(self, other: Self) -> Self {
                Self(self.1.$and_masks(self.0, other.0), self.1)
            }

            #[inline(always)]
            fn or(self, other: Self) -> Self {
                Self(self.1.$or_masks(self.0, other.0), self.1)
            }

            #[inline(always)]
            fn any(self) -> bool {
                cast::<_, u128>(self.0) != 0
            }
        }
    };
    (@binary $Float:ident $($Op:ident $op:ident $method:ident),*) => {$(
        impl $Op for $Float {
            type Output = Self;

            #[inline(always)]
            fn $op(self, other: Self) -> Self {
                Self(self.1.$method(self.0, other.0), self.1)
            }
        }
    )*};
}

lanes!(f64, 2, Double: f64x2, DoubleMask: m64x2, [
    splat_f64x2 add_f64x2 sub_f64x2 mul_f64x2 div_f64x2 sqrt_f64x2 abs_f64x2 cmp_lt_f64x2
    and_f64x2 andnot_f64x2 or_f64x2 and_m64x2 or_m64x2
]);

lanes!(f32, 4, Single: f32x4, SingleMask: m32x4, [
    splat_f32x4 add_f32x4 sub_f32x4 mul_f32x4 div_f32x4 sqrt_f32x4 abs_f32x4 cmp_lt_f32x4
    and_f32x4 andnot_f32x4 or_f32x4 and_m32x4 or_m32x4
]);

impl WordLanes for Sse2 {
    type Words = u64x2;

    #[inline(always)]
    fn no_bits(self) -> u64x2 {
        self.0.splat_u64x2(0)
    }

    #[inline(always)]
    fn with_bit(self, words: u64x2, mask: DoubleMask, bit: u64) -> u64x2 {
        self.0.or_u64x2(words, self.0.and_u64x2(cast(mask.0), self.0.splat_u64x2(bit)))
    }

    #[inline(always)]
    fn store_words(self, words: u64x2, out: &mut [u64]) {
        out[..2].copy_from_slice(&cast::<_, [u64; 2]>(words));
    }
}
