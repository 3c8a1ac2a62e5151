//! Matches with the frames of both views around them, and their residuals under a model that takes a point to a point.
//!
//! The residual is the difference of the transferred point and the point of view 2, in pixels, divided by the noise of
//! both: `S = I + A Aᵀ` with `A` the derivative of the transfer by the point of view 1 (both with unit noise), whitened by its
//! Cholesky factor. Two numbers a match, where an essential matrix leaves one.

use nalgebra::{Matrix3, Vector3};

use crate::algebra::vectors::widest::{Simd, Work, widest};
use crate::robust::data::image::FramedMatch;

/// Matches that are worked on at once.
pub(crate) const WIDTH: usize = 8;
pub(crate) type Lanes = [f64; WIDTH];

/// Matches in columns, with the frames of both views around each of them.
#[derive(Clone, Debug)]
pub(crate) struct Framed {
    pub(crate) blocks: Vec<Block>,
    len: usize,
}

/// A few matches, the last of all repeated where there are fewer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    pub(crate) x1: [Lanes; 3],
    /// The point of view 2 in pixels.
    u2: [Lanes; 2],
    /// What takes a vector to pixels in view 2, and what it is divided by.
    e: [[Lanes; 3]; 2],
    n: [Lanes; 3],
    /// What takes pixels back in view 1.
    d: [[Lanes; 3]; 2],
    /// False for a repeated one.
    pub(crate) is_live: [bool; WIDTH],
}

/// Residuals of a few matches and their derivatives by `y = H x1`.
pub(crate) struct Whitened {
    pub(crate) residual: [Lanes; 2],
    pub(crate) slope: [[Lanes; 3]; 2],
    pub(crate) y: [Lanes; 3],
    /// False where the point is taken behind the camera.
    pub(crate) is_in_front: [bool; WIDTH],
}

impl Framed {
    pub(crate) fn new(matches: &[FramedMatch]) -> Self {
        Self { blocks: matches.chunks(WIDTH).map(Block::new).collect(), len: matches.len() }
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The squared whitened residual of each match, infinite where its point is taken behind the camera.
    pub(crate) fn square_errors(&self, h: &Matrix3<f64>) -> Vec<f64> {
        let mut all = vec![[0.0; WIDTH]; self.blocks.len()];
        widest(SquareErrors { matches: self, h: rows(h), out: &mut all });
        let mut all = all.into_flattened();
        all.truncate(self.len);
        all
    }
}

/// How far one match is from where a rotation takes it, whitened, and how that changes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Displacement {
    /// Two numbers of unit noise for noise of one pixel.
    pub(crate) residual: [f64; 2],
    /// Their derivatives by the point of view 1 after the rotation.
    pub(crate) slope: [Vector3<f64>; 2],
    pub(crate) is_in_front: bool,
}

impl Framed {
    /// The displacements of all matches from where a rotation takes them.
    pub(crate) fn displacements(&self, r_21: &Matrix3<f64>) -> Vec<Displacement> {
        let r_21 = rows(r_21);
        let of_block = |block: &Block| {
            let w = whitened(&r_21, block);
            let vector = |v: &[Lanes; 3], j: usize| Vector3::new(v[0][j], v[1][j], v[2][j]);
            (0..WIDTH).map(move |j| Displacement {
                residual: [w.residual[0][j], w.residual[1][j]],
                slope: [vector(&w.slope[0], j), vector(&w.slope[1], j)],
                is_in_front: w.is_in_front[j],
            })
        };
        self.blocks.iter().flat_map(of_block).take(self.len).collect()
    }
}

impl Block {
    /// A block of one to [`WIDTH`] matches.
    fn new(some: &[FramedMatch]) -> Self {
        let each: [&FramedMatch; WIDTH] = std::array::from_fn(|j| &some[j.min(some.len() - 1)]);
        Self {
            x1: columns(each.map(|m| m.x1)),
            u2: [0, 1].map(|k| each.map(|m| m.x2.dot(&m.frame2.e[k]) / m.x2.dot(&m.frame2.n))),
            e: [0, 1].map(|k| columns(each.map(|m| m.frame2.e[k]))),
            n: columns(each.map(|m| m.frame2.n)),
            d: [0, 1].map(|k| columns(each.map(|m| m.frame1.d[k]))),
            is_live: std::array::from_fn(|j| j < some.len()),
        }
    }
}

fn columns(vectors: [Vector3<f64>; WIDTH]) -> [Lanes; 3] {
    [0, 1, 2].map(|k| vectors.map(|v| v[k]))
}

/// The squared residuals of all blocks.
struct SquareErrors<'a> {
    matches: &'a Framed,
    h: [f64; 9],
    out: &'a mut [Lanes],
}

impl Work for SquareErrors<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        for (block, out) in self.matches.blocks.iter().zip(self.out) {
            let Whitened { residual: [r, s], is_in_front, .. } = whitened(&self.h, block);
            for j in 0..WIDTH {
                out[j] = if is_in_front[j] { r[j] * r[j] + s[j] * s[j] } else { f64::INFINITY };
            }
        }
    }
}

/// The entries row by row, as the kernels take them.
pub(crate) fn rows(m: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|k| m[(k / 3, k % 3)])
}

#[inline(always)]
pub(crate) fn whitened(h: &[f64; 9], block: &Block) -> Whitened {
    let mut out = Whitened {
        residual: [[0.0; WIDTH]; 2],
        slope: [[[0.0; WIDTH]; 3]; 2],
        y: [[0.0; WIDTH]; 3],
        is_in_front: [false; WIDTH],
    };
    let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let transfer = |x: &[f64; 3]| {
        [
            h[0] * x[0] + h[1] * x[1] + h[2] * x[2],
            h[3] * x[0] + h[4] * x[1] + h[5] * x[2],
            h[6] * x[0] + h[7] * x[1] + h[8] * x[2],
        ]
    };
    for j in 0..WIDTH {
        let of = |v: &[Lanes; 3]| [v[0][j], v[1][j], v[2][j]];
        let (e, d, n) =
            ([of(&block.e[0]), of(&block.e[1])], [of(&block.d[0]), of(&block.d[1])], of(&block.n));
        let y = transfer(&of(&block.x1));
        let depth = dot(&y, &n);
        let is_in_front = depth > 0.0;
        let inverse = 1.0 / if is_in_front { depth } else { 1.0 };
        let at = [dot(&y, &e[0]) * inverse, dot(&y, &e[1]) * inverse];
        let residual = [at[0] - block.u2[0][j], at[1] - block.u2[1][j]];
        let slope = |k: usize| [0, 1, 2].map(|i| (e[k][i] - n[i] * at[k]) * inverse);
        let slope = [slope(0), slope(1)];
        let moved = [transfer(&d[0]), transfer(&d[1])];
        let a = [0, 1].map(|k| [dot(&slope[k], &moved[0]), dot(&slope[k], &moved[1])]);
        // The Cholesky factor [k0 0; k1 k2] of S.
        let inverse0 = 1.0 / (1.0 + a[0][0] * a[0][0] + a[0][1] * a[0][1]).sqrt();
        let k1 = (a[0][0] * a[1][0] + a[0][1] * a[1][1]) * inverse0;
        let rest = 1.0 + a[1][0] * a[1][0] + a[1][1] * a[1][1] - k1 * k1;
        let inverse2 = 1.0 / rest.max(f64::MIN_POSITIVE).sqrt();
        let first = residual[0] * inverse0;
        out.residual[0][j] = first;
        out.residual[1][j] = (residual[1] - k1 * first) * inverse2;
        for i in 0..3 {
            let first = slope[0][i] * inverse0;
            out.slope[0][i][j] = first;
            out.slope[1][i][j] = (slope[1][i] - k1 * first) * inverse2;
            out.y[i][j] = y[i];
        }
        out.is_in_front[j] = is_in_front;
    }
    out
}
