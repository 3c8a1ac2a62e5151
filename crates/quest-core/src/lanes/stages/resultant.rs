//! Three equations `X(z) x + Y(z) y + W(z) = 0`, their determinant of degree ten, and the number of its real roots.

use crate::algebra::vectors::geometry::{cross, longest};
use crate::algebra::vectors::lane::{F, Float, Lanes};
use crate::algebra::vectors::twice::{Twice, TwiceLanes, twice};
use crate::lanes::stages::elimination::ROWS;

/// A polynomial of degree ten, coefficients from the constant up.
pub(crate) type Polynomial<L> = [F<L>; 11];

/// The three equations, coefficients from the constant up.
#[derive(Clone, Copy)]
pub(crate) struct Resultant<L: Lanes<f64>> {
    x: [[F<L>; 4]; 3],
    y: [[F<L>; 4]; 3],
    w: [[F<L>; 5]; 3],
}

impl<L: Lanes<f64>> Resultant<L> {
    /// The equations of the six reduced rows.
    #[inline(always)]
    pub(crate) fn new(lanes: L, rows: &[[F<L>; 10]; ROWS]) -> Self {
        let zero = lanes.splat(0.0);
        let mut out = Self { x: [[zero; 4]; 3], y: [[zero; 4]; 3], w: [[zero; 5]; 3] };
        for r in 0..3 {
            // The row led by a monomial times z, less z times the row led by the monomial: no leader is left.
            let (a, b) = (&rows[2 * r], &rows[2 * r + 1]);
            out.x[r] = [a[2], a[1] - b[2], a[0] - b[1], -b[0]];
            out.y[r] = [a[5], a[4] - b[5], a[3] - b[4], -b[3]];
            out.w[r] = [a[9], a[8] - b[9], a[7] - b[8], a[6] - b[7], -b[6]];
        }
        out
    }

    /// The determinant, whose roots are the values of `z`.
    #[inline(always)]
    pub(crate) fn polynomial(&self, lanes: L) -> Polynomial<L> {
        let zero = lanes.splat(0.0);
        let mut out = [zero; 11];
        for r in 0..3 {
            let (i, j) = ((r + 1) % 3, (r + 2) % 3);
            let mut minor = [zero; 7];
            for a in 0..4 {
                for b in 0..4 {
                    let sum = self.x[i][a].mul_add(self.y[j][b], minor[a + b]);
                    minor[a + b] = self.y[i][a].neg_mul_add(self.x[j][b], sum);
                }
            }
            for a in 0..7 {
                for b in 0..5 {
                    out[a + b] = minor[a].mul_add(self.w[r][b], out[a + b]);
                }
            }
        }
        out
    }

    /// `(x, y, z, w)` at two roots `z/w`, up to scale: the null vectors of the three equations.
    #[inline(always)]
    pub(crate) fn points(&self, z: Twice<F<L>>, w: Twice<F<L>>) -> [Twice<F<L>>; 4] {
        let w2 = w * w;
        let powers = [w2 * w2, w2 * w, w2, w];
        let mut m = [[z; 3]; 3];
        for r in 0..3 {
            m[r] = [
                homogeneous::<TwiceLanes<L>>(&twice(&self.x[r]), z, [powers[1], powers[2], powers[3]]),
                homogeneous::<TwiceLanes<L>>(&twice(&self.y[r]), z, [powers[1], powers[2], powers[3]]),
                homogeneous5::<TwiceLanes<L>>(&twice(&self.w[r]), z, powers),
            ];
        }
        let across = cross::<TwiceLanes<L>>;
        let ([x, y, one], _) =
            longest::<TwiceLanes<L>>(&[across(&m[0], &m[1]), across(&m[1], &m[2]), across(&m[2], &m[0])]);
        [x, y, z * one, w * one]
    }
}

/// `Σ p_k z^k w^(3−k)`, given `w³, w², w`.
#[inline(always)]
fn homogeneous<L: Lanes<f64>>(p: &[F<L>; 4], z: F<L>, w: [F<L>; 3]) -> F<L> {
    let value = p[3].mul_add(z, p[2] * w[2]);
    let value = value.mul_add(z, p[1] * w[1]);
    value.mul_add(z, p[0] * w[0])
}

/// `Σ p_k z^k w^(4−k)`, given `w⁴, w³, w², w`.
#[inline(always)]
fn homogeneous5<L: Lanes<f64>>(p: &[F<L>; 5], z: F<L>, w: [F<L>; 4]) -> F<L> {
    let value = p[4].mul_add(z, p[3] * w[3]);
    let value = value.mul_add(z, p[2] * w[2]);
    let value = value.mul_add(z, p[1] * w[1]);
    value.mul_add(z, p[0] * w[0])
}
