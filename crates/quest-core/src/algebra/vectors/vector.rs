//! Lanes in the vector registers of the processor, by pulp.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use crate::algebra::vectors::lane::{Float, Lanes, Mask, WordLanes};

/// Three halves of the exponent of one, less a little: what the bits of `1/√x` and half of those of `x` sum up to, to 3.5 %.
const HALF_EXPONENT: u32 = 0x5f37_59df;

/// The instructions of `S`, in registers that go to memory at multiples of the size of `A`.
///
/// The compiler would be content with multiples of eight bytes, and most of the wide registers would lie across two lines of the
/// cache.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vector<S, A>(S, [A; 0]);

impl<S: Simd, A: Copy> Vector<S, A> {
    #[inline(always)]
    pub(crate) fn new(simd: S) -> Self {
        Self(simd, [])
    }
}

/// As wide as a register of AVX2.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(crate) struct Align32;

/// As wide as a register of AVX-512.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Align64;

macro_rules! lanes {
    ($real:ty, $Float:ident, $Mask:ident, $floats:ident, $masks:ident, $lanes:ident: [
        $splat:ident $add:ident $sub:ident $mul:ident $div:ident $neg:ident $mul_add:ident $neg_mul_add:ident $sqrt:ident
        $abs:ident $less:ident $select:ident $and:ident $or:ident $sum:ident $first:ident $view:ident $view_mut:ident
    ] $($inverse_sqrt:tt)*) => {
        /// A register, with the proof that it exists.
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $Float<S: Simd, A>(S::$floats, S, [A; 0]);

        /// A register of truth values.
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $Mask<S: Simd>(S::$masks, S);

        impl<S: Simd, A: Copy> Lanes<$real> for Vector<S, A> {
            const COUNT: usize = S::$lanes;
            type Float = $Float<S, A>;

            #[inline(always)]
            fn splat(self, x: $real) -> $Float<S, A> {
                $Float(self.0.$splat(x), self.0, [])
            }

            #[inline(always)]
            fn load(self, x: &[$real]) -> $Float<S, A> {
                $Float(S::$view(x).0[0], self.0, [])
            }
        }

        lanes!(@binary $Float Add add $add, Sub sub $sub, Mul mul $mul, Div div $div);

        impl<S: Simd, A: Copy> Neg for $Float<S, A> {
            type Output = Self;

            #[inline(always)]
            fn neg(self) -> Self {
                Self(self.1.$neg(self.0), self.1, [])
            }
        }

        impl<S: Simd, A: Copy> Float<$real> for $Float<S, A> {
            type Mask = $Mask<S>;

            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                Self(self.1.$mul_add(self.0, b.0, c.0), self.1, [])
            }

            #[inline(always)]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                Self(self.1.$neg_mul_add(self.0, b.0, c.0), self.1, [])
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(self.1.$sqrt(self.0), self.1, [])
            }

            $($inverse_sqrt)*

            #[inline(always)]
            fn abs(self) -> Self {
                Self(self.1.$abs(self.0), self.1, [])
            }

            #[inline(always)]
            fn less(self, other: Self) -> $Mask<S> {
                $Mask(self.1.$less(self.0, other.0), self.1)
            }

            #[inline(always)]
            fn select(self, mask: $Mask<S>, other: Self) -> Self {
                Self(self.1.$select(mask.0, self.0, other.0), self.1, [])
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
        impl<S: Simd, A: Copy> $Op for $Float<S, A> {
            type Output = Self;

            #[inline(always)]
            fn $op(self, other: Self) -> Self {
                Self(self.1.$method(self.0, other.0), self.1, [])
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
]
    /// For sixteen lanes, whose dividers and square roots take four times as long as those of eight. It starts from half the
    /// exponent and takes two of Newton's steps.
    #[inline(always)]
    fn inverse_sqrt(self) -> Self {
        let Self(x, simd, _) = self;
        if S::F32_LANES < 16 {
            return self.sqrt() / self;
        }
        let halved = simd.wrapping_dyn_shr_u32s(simd.transmute_u32s_f32s(x), simd.splat_u32s(1));
        let mut root = simd.transmute_f32s_u32s(simd.sub_u32s(simd.splat_u32s(HALF_EXPONENT), halved));
        let minus_half = simd.mul_f32s(simd.splat_f32s(-0.5), x);
        for _ in 0..2 {
            let square = simd.mul_f32s(root, root);
            root = simd.mul_f32s(root, simd.mul_add_e_f32s(minus_half, square, simd.splat_f32s(1.5)));
        }
        Self(root, simd, [])
    }
);

impl<S: Simd, A: Copy> WordLanes for Vector<S, A> {
    type Words = S::u64s;

    #[inline(always)]
    fn no_bits(self) -> S::u64s {
        self.0.splat_u64s(0)
    }

    #[inline(always)]
    fn with_bit(self, words: S::u64s, mask: DoubleMask<S>, bit: u64) -> S::u64s {
        self.0.select_u64s(mask.0, self.0.or_u64s(words, self.0.splat_u64s(bit)), words)
    }

    #[inline(always)]
    fn store_words(self, words: S::u64s, out: &mut [u64]) {
        S::as_mut_simd_u64s(out).0[0] = words;
    }
}
