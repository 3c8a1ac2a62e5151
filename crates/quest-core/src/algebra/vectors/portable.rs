//! Lanes in arrays, for the compiler to put into whatever registers there are.
//!
//! Each lane is written out. The solver of samples is one function of thousands of these operations; where they were loops, they took
//! a quarter of the time that the whole crate compiles in.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::algebra::vectors::lane::{Float, Lanes, Mask, WordLanes};

/// Whether a product and a sum are one instruction of the target; where they are not, `mul_add` is a slow function.
const FUSED: bool = cfg!(any(target_feature = "fma", target_arch = "aarch64"));

/// Arrays of 16 bytes: the registers that nearly every processor has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

/// `N` numbers.
#[derive(Clone, Copy, Debug)]
#[repr(align(16))]
pub(crate) struct Array<T, const N: usize>([T; N]);

macro_rules! lanes {
    ($real:ty, $count:literal, [$($i:literal)*]) => {
        impl Lanes<$real> for Portable {
            const COUNT: usize = $count;
            type Float = Array<$real, $count>;

            #[inline(always)]
            fn splat(self, x: $real) -> Array<$real, $count> {
                Array([x; $count])
            }

            #[inline(always)]
            fn load(self, x: &[$real]) -> Array<$real, $count> {
                Array(*x.first_chunk().expect("as many numbers as lanes"))
            }
        }

        lanes!(@binary $real, $count, Add add +, Sub sub -, Mul mul *, Div div /; [$($i)*]);

        impl Neg for Array<$real, $count> {
            type Output = Self;

            #[inline(always)]
            fn neg(self) -> Self {
                Self([$(-self.0[$i]),*])
            }
        }

        impl Float<$real> for Array<$real, $count> {
            type Mask = [bool; $count];

            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                if FUSED {
                    Self([$(self.0[$i].mul_add(b.0[$i], c.0[$i])),*])
                } else {
                    self * b + c
                }
            }

            #[inline(always)]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                if FUSED {
                    Self([$((-self.0[$i]).mul_add(b.0[$i], c.0[$i])),*])
                } else {
                    c - self * b
                }
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                Self([$(self.0[$i].sqrt()),*])
            }

            #[inline(always)]
            fn abs(self) -> Self {
                Self([$(self.0[$i].abs()),*])
            }

            #[inline(always)]
            fn less(self, other: Self) -> [bool; $count] {
                [$(self.0[$i] < other.0[$i]),*]
            }

            #[inline(always)]
            fn select(self, mask: [bool; $count], other: Self) -> Self {
                Self([$(if mask[$i] { self.0[$i] } else { other.0[$i] }),*])
            }

            #[inline(always)]
            fn sum(self) -> $real {
                self.0.into_iter().sum()
            }

            #[inline(always)]
            fn store(self, out: &mut [$real]) {
                out[..$count].copy_from_slice(&self.0);
            }
        }

        impl Mask for [bool; $count] {
            #[inline(always)]
            fn and(self, other: Self) -> Self {
                [$(self[$i] & other[$i]),*]
            }

            #[inline(always)]
            fn or(self, other: Self) -> Self {
                [$(self[$i] | other[$i]),*]
            }

            #[inline(always)]
            fn any(self) -> bool {
                false $(| self[$i])*
            }
        }
    };
    (@binary $real:ty, $count:literal, $($Op:ident $op:ident $symbol:tt),*; $lanes:tt) => {$(
        lanes!(@operator $real, $count, $Op $op $symbol, $lanes);
    )*};
    (@operator $real:ty, $count:literal, $Op:ident $op:ident $symbol:tt, [$($i:literal)*]) => {
        impl $Op for Array<$real, $count> {
            type Output = Self;

            #[inline(always)]
            fn $op(self, other: Self) -> Self {
                Self([$(self.0[$i] $symbol other.0[$i]),*])
            }
        }
    };
}

lanes!(f64, 2, [0 1]);
lanes!(f32, 4, [0 1 2 3]);

impl WordLanes for Portable {
    type Words = [u64; 2];

    #[inline(always)]
    fn no_bits(self) -> [u64; 2] {
        [0; 2]
    }

    #[inline(always)]
    fn with_bit(self, words: [u64; 2], mask: [bool; 2], bit: u64) -> [u64; 2] {
        let bits = |i: usize| if mask[i] { bit } else { 0 };
        [words[0] | bits(0), words[1] | bits(1)]
    }

    #[inline(always)]
    fn store_words(self, words: [u64; 2], out: &mut [u64]) {
        out[..2].copy_from_slice(&words);
    }
}
