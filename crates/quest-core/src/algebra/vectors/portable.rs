//! Lanes in arrays, for the compiler to put into whatever registers there are.

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
    ($real:ty, $count:literal) => {
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

        lanes!(@binary $real, Add add +, Sub sub -, Mul mul *, Div div /);

        impl<const N: usize> Neg for Array<$real, N> {
            type Output = Self;

            #[inline(always)]
            fn neg(mut self) -> Self {
                for x in &mut self.0 {
                    *x = -*x;
                }
                self
            }
        }

        impl<const N: usize> Float<$real> for Array<$real, N> {
            type Mask = [bool; N];

            #[inline(always)]
            fn mul_add(self, b: Self, mut c: Self) -> Self {
                for i in 0..N {
                    c.0[i] = if FUSED { self.0[i].mul_add(b.0[i], c.0[i]) } else { self.0[i] * b.0[i] + c.0[i] };
                }
                c
            }

            #[inline(always)]
            fn neg_mul_add(self, b: Self, mut c: Self) -> Self {
                for i in 0..N {
                    c.0[i] = if FUSED { (-self.0[i]).mul_add(b.0[i], c.0[i]) } else { c.0[i] - self.0[i] * b.0[i] };
                }
                c
            }

            #[inline(always)]
            fn sqrt(mut self) -> Self {
                for x in &mut self.0 {
                    *x = x.sqrt();
                }
                self
            }

            #[inline(always)]
            fn abs(mut self) -> Self {
                for x in &mut self.0 {
                    *x = x.abs();
                }
                self
            }

            #[inline(always)]
            fn less(self, other: Self) -> [bool; N] {
                let mut mask = [false; N];
                for i in 0..N {
                    mask[i] = self.0[i] < other.0[i];
                }
                mask
            }

            #[inline(always)]
            fn select(mut self, mask: [bool; N], other: Self) -> Self {
                for i in 0..N {
                    self.0[i] = if mask[i] { self.0[i] } else { other.0[i] };
                }
                self
            }

            #[inline(always)]
            fn sum(self) -> $real {
                self.0.into_iter().sum()
            }

            #[inline(always)]
            fn store(self, out: &mut [$real]) {
                out[..N].copy_from_slice(&self.0);
            }
        }
    };
    (@binary $real:ty, $($Op:ident $op:ident $symbol:tt),*) => {$(
        #[expect(clippy::assign_op_pattern, reason = "the symbol comes from outside")]
        impl<const N: usize> $Op for Array<$real, N> {
            type Output = Self;

            #[inline(always)]
            fn $op(mut self, other: Self) -> Self {
                for i in 0..N {
                    self.0[i] = self.0[i] $symbol other.0[i];
                }
                self
            }
        }
    )*};
}

lanes!(f64, 2);
lanes!(f32, 4);

impl<const N: usize> Mask for [bool; N] {
    #[inline(always)]
    fn and(mut self, other: Self) -> Self {
        for i in 0..N {
            self[i] &= other[i];
        }
        self
    }

    #[inline(always)]
    fn or(mut self, other: Self) -> Self {
        for i in 0..N {
            self[i] |= other[i];
        }
        self
    }

    #[inline(always)]
    fn any(self) -> bool {
        self.contains(&true)
    }
}

impl WordLanes for Portable {
    type Words = [u64; 2];

    #[inline(always)]
    fn no_bits(self) -> [u64; 2] {
        [0; 2]
    }

    #[inline(always)]
    fn with_bit(self, mut words: [u64; 2], mask: [bool; 2], bit: u64) -> [u64; 2] {
        for i in 0..2 {
            words[i] |= if mask[i] { bit } else { 0 };
        }
        words
    }

    #[inline(always)]
    fn store_words(self, words: [u64; 2], out: &mut [u64]) {
        out[..2].copy_from_slice(&words);
    }
}
