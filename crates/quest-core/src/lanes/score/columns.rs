//! Matches in structure of arrays, and their Sampson error.

use super::kernel::Kernel;
use crate::lanes::instructions::{Task, Token};
use crate::lanes::lane::{F, Float, Lanes, WordLanes};

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
        /// The columns of a block of matches.
        type Block<'a>: Copy
        where
            Self: 'a;

        /// A block of matches, filled up with NaN.
        fn block(&self, index: usize) -> Self::Block<'_>;

        /// The square of `x2ᵀ E x1` and that of its gradient for the matches from `k` on, as many as there are lanes.
        fn constraint<L: Lanes<T>>(
            lanes: L,
            e: &[F<L, T>; 9],
            block: Self::Block<'_>,
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
    ($name:ident, $dimension:literal, $what:literal) => {
        impl<T: Real> $name<T> {
            /// No matches.
            #[must_use]
            pub fn new() -> Self {
                Self { columns: Columns { columns: [const { Vec::new() }; 2 * $dimension], len: 0 } }
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
    };
}

matches!(ImageMatches, 2, "Appends a match of two points.");
matches!(BearingMatches, 3, "Appends a match of two unit bearings.");

/// Columns of the same length in blocks, filled up with NaN.
#[derive(Clone, Debug)]
struct Columns<T, const N: usize> {
    columns: [Vec<[T; BLOCK]>; N],
    len: usize,
}

impl<T, const N: usize> Default for Columns<T, N> {
    fn default() -> Self {
        Self { columns: [const { Vec::new() }; N], len: 0 }
    }
}

impl<T: Real, const N: usize> Columns<T, N> {
    fn clear(&mut self) {
        self.columns.iter_mut().for_each(Vec::clear);
        self.len = 0;
    }

    fn push(&mut self, row: impl Iterator<Item = T>) {
        for (column, x) in self.columns.iter_mut().zip(row) {
            if self.len.is_multiple_of(BLOCK) {
                column.push([T::NAN; BLOCK]);
            }
            column[self.len / BLOCK][self.len % BLOCK] = x;
        }
        self.len += 1;
    }

    #[inline(always)]
    fn block(&self, index: usize) -> [&[T; BLOCK]; N] {
        self.columns.each_ref().map(|column| &column[index])
    }
}

/// The numbers of a block from `k` on, as many as there are lanes.
#[inline(always)]
fn load<T: Real, L: Lanes<T>, const N: usize>(lanes: L, block: [&[T; BLOCK]; N], k: usize) -> [F<L, T>; N] {
    let mut out = [lanes.splat(T::NAN); N];
    for i in 0..N {
        out[i] = lanes.load(&block[i][k..]);
    }
    out
}

impl<T: Real> sealed::Columns<T> for ImageMatches<T> {
    type Block<'a> = [&'a [T; BLOCK]; 4];

    #[inline(always)]
    fn block(&self, index: usize) -> [&[T; BLOCK]; 4] {
        self.columns.block(index)
    }

    #[inline(always)]
    fn constraint<L: Lanes<T>>(
        lanes: L,
        e: &[F<L, T>; 9],
        block: [&[T; BLOCK]; 4],
        k: usize,
    ) -> (F<L, T>, F<L, T>) {
        let [x, y, u, v] = load(lanes, block, k);
        let line2 = [
            e[0].mul_add(x, e[1].mul_add(y, e[2])),
            e[3].mul_add(x, e[4].mul_add(y, e[5])),
            e[6].mul_add(x, e[7].mul_add(y, e[8])),
        ];
        let line1 = [e[0].mul_add(u, e[3].mul_add(v, e[6])), e[1].mul_add(u, e[4].mul_add(v, e[7]))];
        let r = u.mul_add(line2[0], v.mul_add(line2[1], line2[2]));
        let gradient1 = line1[0].mul_add(line1[0], line1[1] * line1[1]);
        let gradient2 = line2[0].mul_add(line2[0], line2[1] * line2[1]);
        (r * r, gradient1 + gradient2)
    }
}

impl<T: Real> sealed::Columns<T> for BearingMatches<T> {
    type Block<'a> = [&'a [T; BLOCK]; 6];

    #[inline(always)]
    fn block(&self, index: usize) -> [&[T; BLOCK]; 6] {
        self.columns.block(index)
    }

    #[inline(always)]
    fn constraint<L: Lanes<T>>(
        lanes: L,
        e: &[F<L, T>; 9],
        block: [&[T; BLOCK]; 6],
        k: usize,
    ) -> (F<L, T>, F<L, T>) {
        let [x, y, z, u, v, w] = load(lanes, block, k);
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
        (square, gradient1 + gradient2 - (square + square))
    }
}
