//! What the kernels are written in: numbers for several problems at once.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// The largest number of lanes, of `f32` with AVX-512.
pub(crate) const MAX_LANES: usize = 16;
/// The largest number of lanes of `f64`.
pub(crate) const MAX_F64_LANES: usize = 8;

/// Instructions for `COUNT` numbers of type `T` at once. A value of this type proves that the processor has them.
pub trait Lanes<T>: Copy {
    /// How many problems are solved at once; at most [`MAX_LANES`].
    const COUNT: usize;
    /// A number for each of the problems.
    type Float: Float<T>;

    /// The same number for all.
    fn splat(self, x: T) -> Self::Float;
    /// The first `COUNT` numbers of a slice that has as many.
    fn load(self, x: &[T]) -> Self::Float;
}

/// 64 bits for each problem, beside its `f64`.
pub(crate) trait WordLanes: Lanes<f64> {
    /// The bits.
    type Words: Copy;

    /// No bit.
    fn no_bits(self) -> Self::Words;
    /// `words` with `bit` added where the mask is set.
    fn with_bit(self, words: Self::Words, mask: M<Self>, bit: u64) -> Self::Words;
    /// Writes words to the beginning of a slice of at least `COUNT`.
    fn store_words(self, words: Self::Words, out: &mut [u64]);
}

/// A number for each problem. Arithmetic stays in its lane, so that no problem can disturb another.
#[allow(unreachable_pub, reason = "Rust 1.89 does not see that it is reachable by `Lanes`")]
pub trait Float<T>:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// A truth value for each problem.
    type Mask: Mask;

    /// `self · b + c`, rounded once where the instructions have that.
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        self * b + c
    }
    /// `c − self · b`, likewise.
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        c - self * b
    }
    /// The square root.
    fn sqrt(self) -> Self;
    /// `1/√` of a positive number, to rounding, which in `f32` may be 5e-6 of it; of others anything.
    #[inline(always)]
    fn inverse_sqrt(self) -> Self {
        self.sqrt() / self
    }
    /// The absolute value.
    fn abs(self) -> Self;
    /// `self < other`: false where one of them is not a number.
    fn less(self, other: Self) -> Self::Mask;
    /// `self` where the mask is set, `other` elsewhere.
    fn select(self, mask: Self::Mask, other: Self) -> Self;
    /// The sum over all problems.
    fn sum(self) -> T;
    /// Writes to the beginning of a slice of at least `COUNT` numbers.
    fn store(self, out: &mut [T]);
}

/// A truth value for each problem.
#[allow(unreachable_pub, reason = "as `Float`")]
pub trait Mask: Copy {
    /// Both.
    fn and(self, other: Self) -> Self;
    /// At least one of the two.
    fn or(self, other: Self) -> Self;
    /// Whether it is set for any problem.
    fn any(self) -> bool;
}

/// The numbers of some instructions.
pub(crate) type F<L, T = f64> = <L as Lanes<T>>::Float;
/// The truth values of some instructions.
pub(crate) type M<L, T = f64> = <F<L, T> as Float<T>>::Mask;
