//! Lanes in the vector registers of the processor, by pulp.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use super::lane::{Float, Lanes, Mask, WordLanes};

/// The instructions of `S`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vector<S>(pub(super) S);

macro_rules! lanes {
    ($real:ty, $Float:ident, $Mask:ident, $floats:ident, $masks:ident, $lanes:ident: [
        $splat:ident $add:ident $sub:ident $mul:ident $div:ident $neg:ident $mul_add:ident $neg_mul_add:ident $sqrt:ident
        $abs:ident $less:ident $select:ident $and:ident $or:ident $sum:ident $first:ident $view:ident $view_mut:ident
    ]) => {
        /// A register, with the proof that it exists.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct $Float<S: Simd>(S::$floats, S);

        /// A register of truth values.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct $Mask<S: Simd>(S::$masks, S);

        impl<S: Simd> Lanes<$real> for Vector<S> {
            const COUNT: usize = S::$lanes;
            type Float = $Float<S>;

            #[inline(always)]
            fn splat(self, x: $real) -> $Float<S> {
                $Float(self.0.$splat(x), self.0)
            }

            #[inline(always)]
            fn load(self, x: &[$real]) -> $Float<S> {
                $Float(S::$view(x).0[0], self.0)
            }
        }

        lanes!(@binary $Float Add add $add, Sub sub $sub, Mul mul $mul, Div div $div);

        impl<S: Simd> Neg for $Float<S> {
            type Output = Self;

            #[inline(always)]
            fn neg(self) -> Self {
                Self(self.1.$neg(self.0), self.1)
            }
        }

        impl<S: Simd> Float<$real> for $Float<S> {
            type Mask = $Mask<S>;

            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                Self(self.1.$mul_add(self.0, b.0, c.0), self.1)
            }

            #[inline(always)]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                Self(self.1.$neg_mul_add(self.0, b.0, c.0), self.1)
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(self.1.$sqrt(self.0), self.1)
            }

            #[inline(always)]
            fn abs(self) -> Self {
                Self(self.1.$abs(self.0), self.1)
            }

            #[inline(always)]
            fn less(self, other: Self) -> $Mask<S> {
                $Mask(self.1.$less(self.0, other.0), self.1)
            }

            #[inline(always)]
            fn select(self, mask: $Mask<S>, other: Self) -> Self {
                Self(self.1.$select(mask.0, self.0, other.0), self.1)
            }

            #[inline(always)]
            fn sum(self) -> $real {
                self.1.$sum(self.0)
            }

            #[inline(always)]
            fn store(self, out: &mut [$real]) {
                S::$view_mut(out).0[0] = self.0;
            }
        }

        impl<S: Simd> Mask for $Mask<S> {
            #[inline(always)]
            fn and(self, other: Self) -> Self {
                Self(self.1.$and(self.0, other.0), self.1)
            }

            #[inline(always)]
            fn or(self, other: Self) -> Self {
                Self(self.1.$or(self.0, other.0), self.1)
            }

            #[inline(always)]
            fn any(self) -> bool {
                self.1.$first(self.0) < S::$lanes
            }
        }
    };
    (@binary $Float:ident $($Op:ident $op:ident $method:ident),*) => {$(
        impl<S: Simd> $Op for $Float<S> {
            type Output = Self;

            #[inline(always)]
            fn $op(self, other: Self) -> Self {
                Self(self.1.$method(self.0, other.0), self.1)
            }
        }
    )*};
}

lanes!(f64, Double, DoubleMask, f64s, m64s, F64_LANES: [
    splat_f64s add_f64s sub_f64s mul_f64s div_f64s neg_f64s mul_add_e_f64s negate_mul_add_e_f64s sqrt_f64s
    abs_f64s less_than_f64s select_f64s and_m64s or_m64s reduce_sum_f64s first_true_m64s as_simd_f64s as_mut_simd_f64s
]);

lanes!(f32, Single, SingleMask, f32s, m32s, F32_LANES: [
    splat_f32s add_f32s sub_f32s mul_f32s div_f32s neg_f32s mul_add_e_f32s negate_mul_add_e_f32s sqrt_f32s
    abs_f32s less_than_f32s select_f32s and_m32s or_m32s reduce_sum_f32s first_true_m32s as_simd_f32s as_mut_simd_f32s
]);

impl<S: Simd> WordLanes for Vector<S> {
    type Words = S::u64s;

    #[inline(always)]
    fn no_bits(self) -> S::u64s {
        self.0.splat_u64s(0)
    }

    #[inline(always)]
    fn with_bit(self, words: S::u64s, mask: DoubleMask<S>, bit: u64) -> S::u64s {
        let bits = self.0.select_u64s(mask.0, self.0.splat_u64s(bit), self.0.splat_u64s(0));
        self.0.or_u64s(words, bits)
    }

    #[inline(always)]
    fn store_words(self, words: S::u64s, out: &mut [u64]) {
        S::as_mut_simd_u64s(out).0[0] = words;
    }
}
