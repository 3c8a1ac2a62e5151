//! Matches in structure of arrays, and their Sampson error.

use crate::algebra::vectors::instructions::{Task, Token};
use crate::algebra::vectors::lane::{F, Float, Lanes, WordLanes};

/// Work that can be done with any lanes of `T`.
pub trait Kernel<T> {
    /// What comes out.
    type Output;

    /// Does it.
    fn run<L: Lanes<T>>(self, lanes: L) -> Self::Output;
}

/// How many matches are looked at between two questions whether to stop.
pub(super) const BLOCK: usize = 64;

/// What only this crate may implement, and call.
pub(super) mod sealed {
    use super::{F, Kernel, Lanes, Token};

    pub trait Real: Sized {
        const NAN: Self;

        /// Runs a kernel with the instructions of a token.
        fn run<K: Kernel<Self>>(token: Token, kernel: K) -> K::Output;
    }

    pub trait Columns<T> {
        /// As many matches as are looked at together.
        type Block;

        /// All matches; NaN fill the last block.
        fn blocks(&self) -> &[Self::Block];

        /// `x2ᵀ E x1` and the square of its gradient for the matches of a block from `k` on, as many as there are lanes.
        fn constraint<L: Lanes<T>>(
            lanes: L,
            e: &[F<L, T>; 9],
            block: &Self::Block,
            k: usize,
        ) -> (F<L, T>, F<L, T>);
    }
}

/// `f32` or `f64`.
pub trait Real: sealed::Real + Copy + Into<f64> + 'static {
    /// The nearest number of this type.
    fn from_f64(x: f64) -> Self;
}

impl Real for f32 {
    #[expect(clippy::cast_possible_truncation, reason = "rounding is what it is for")]
    fn from_f64(x: f64) -> Self {
        x as f32
    }
}

impl Real for f64 {
    fn from_f64(x: f64) -> Self {
        x
    }
}

/// A kernel as a task.
struct Run<K, T>(K, std::marker::PhantomData<T>);

macro_rules! real {
    ($real:ty) => {
        impl sealed::Real for $real {
            const NAN: Self = <$real>::NAN;

            #[inline]
            fn run<K: Kernel<Self>>(token: Token, kernel: K) -> K::Output {
                token.run(Run(kernel, std::marker::PhantomData::<Self>))
            }
        }

        impl<K: Kernel<$real>> Task for Run<K, $real> {
            type Output = K::Output;

            #[inline(always)]
            fn run<L: WordLanes + Lanes<f32>>(self, lanes: L) -> K::Output {
                self.0.run(lanes)
            }
        }
    };
}

real!(f32);
real!(f64);

/// Matched points on two image planes, in structure of arrays.
#[derive(Clone, Debug, Default)]
pub struct ImageMatches<T> {
    columns: Columns<T, 4>,
}

/// Matched unit bearings, in structure of arrays.
#[derive(Clone, Debug, Default)]
pub struct BearingMatches<T> {
    columns: Columns<T, 6>,
}

/// [`ImageMatches`] or [`BearingMatches`].
pub trait MatchColumns<T: Real>: sealed::Columns<T> {
    /// How many matches there are.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

macro_rules! matches {
    ($name:ident, $dimension:literal, $constraint:ident, $what:literal) => {
        impl<T: Real> $name<T> {
            /// No matches.
            #[must_use]
            pub fn new() -> Self {
                Self { columns: Columns { blocks: Vec::new(), len: 0 } }
            }

            /// Drops all matches, and keeps the memory.
            pub fn clear(&mut self) {
                self.columns.clear();
            }

            #[doc = $what]
            ///
            /// One with a number that is not finite is never an inlier.
            pub fn push(&mut self, x1: [f64; $dimension], x2: [f64; $dimension]) {
                self.columns.push(x1.into_iter().chain(x2).map(T::from_f64));
            }
        }

        impl<T: Real> MatchColumns<T> for $name<T> {
            fn len(&self) -> usize {
                self.columns.len
            }
        }

        impl<T: Real> sealed::Columns<T> for $name<T> {
            type Block = Block<T, { 2 * $dimension }>;

            fn blocks(&self) -> &[Self::Block] {
                &self.columns.blocks
            }

            #[inline(always)]
            fn constraint<L: Lanes<T>>(
                lanes: L,
                e: &[F<L, T>; 9],
                block: &Self::Block,
                k: usize,
            ) -> (F<L, T>, F<L, T>) {
                let mut numbers = [e[0]; 2 * $dimension];
                for (number, column) in numbers.iter_mut().zip(&block.0) {
                    *number = lanes.load(&column[k..]);
                }
                $constraint::<T, L>(e, numbers)
            }
        }
    };
}

matches!(ImageMatches, 2, on_plane, "Appends a match of two points.");
matches!(BearingMatches, 3, on_sphere, "Appends a match of two unit bearings.");

/// The columns of [`BLOCK`] matches, aligned to the lines of the cache.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Block<T, const N: usize>([[T; BLOCK]; N]);

/// Columns of the same length in blocks, filled up with NaN.
#[derive(Clone, Debug)]
struct Columns<T, const N: usize> {
    blocks: Vec<Block<T, N>>,
    len: usize,
}

impl<T, const N: usize> Default for Columns<T, N> {
    fn default() -> Self {
        Self { blocks: Vec::new(), len: 0 }
    }
}

impl<T: Real, const N: usize> Columns<T, N> {
    fn clear(&mut self) {
        self.blocks.clear();
        self.len = 0;
    }

    fn push(&mut self, row: impl Iterator<Item = T>) {
        if self.len.is_multiple_of(BLOCK) {
            self.blocks.push(Block([[T::NAN; BLOCK]; N]));
        }
        for (column, x) in self.blocks[self.len / BLOCK].0.iter_mut().zip(row) {
            column[self.len % BLOCK] = x;
        }
        self.len += 1;
    }
}

/// The constraint of points `(x, y)` and `(u, v)`.
#[inline(always)]
fn on_plane<T, L: Lanes<T>>(e: &[F<L, T>; 9], [x, y, u, v]: [F<L, T>; 4]) -> (F<L, T>, F<L, T>) {
    let line2 = [
        e[0].mul_add(x, e[1].mul_add(y, e[2])),
        e[3].mul_add(x, e[4].mul_add(y, e[5])),
        e[6].mul_add(x, e[7].mul_add(y, e[8])),
    ];
    let line1 = [e[0].mul_add(u, e[3].mul_add(v, e[6])), e[1].mul_add(u, e[4].mul_add(v, e[7]))];
    let r = u.mul_add(line2[0], v.mul_add(line2[1], line2[2]));
    let gradient1 = line1[0].mul_add(line1[0], line1[1] * line1[1]);
    let gradient2 = line2[0].mul_add(line2[0], line2[1] * line2[1]);
    (r, gradient1 + gradient2)
}

/// The constraint of bearings `(x, y, z)` and `(u, v, w)`.
#[inline(always)]
fn on_sphere<T, L: Lanes<T>>(e: &[F<L, T>; 9], [x, y, z, u, v, w]: [F<L, T>; 6]) -> (F<L, T>, F<L, T>) {
    let plane2 = [
        e[0].mul_add(x, e[1].mul_add(y, e[2] * z)),
        e[3].mul_add(x, e[4].mul_add(y, e[5] * z)),
        e[6].mul_add(x, e[7].mul_add(y, e[8] * z)),
    ];
    let plane1 = [
        e[0].mul_add(u, e[3].mul_add(v, e[6] * w)),
        e[1].mul_add(u, e[4].mul_add(v, e[7] * w)),
        e[2].mul_add(u, e[5].mul_add(v, e[8] * w)),
    ];
    let r = u.mul_add(plane2[0], v.mul_add(plane2[1], w * plane2[2]));
    let square = r * r;
    let gradient1 = plane1[0].mul_add(plane1[0], plane1[1].mul_add(plane1[1], plane1[2] * plane1[2]));
    let gradient2 = plane2[0].mul_add(plane2[0], plane2[1].mul_add(plane2[1], plane2[2] * plane2[2]));
    (r, gradient1 + gradient2 - (square + square))
}
