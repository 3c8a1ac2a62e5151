//! From an essential matrix to a rotation and a direction of translation, and Newton's iteration on these five parameters.
//!
//! As the scalar solver does it: the residual of a match is `r = t · (b × c)`, `c = R a`, and for a small rotation `ω` after
//! `R` and a move of the unit vector `t` by `δ1 e1 + δ2 e2` in its tangent plane
//!
//! ```text
//! dr = ω · (c × (t × b)) + δ1 n · e1 + δ2 n · e2,   n = b × c
//! ```
#![expect(clippy::inline_always, reason = "a call would leave the instructions of the lanes")]

use crate::algebra::vectors::geometry::{
    Matrix3, Quaternion, Vector3, composed, cross, dot, longest, normalized, product, quaternion, rotation,
    scaled,
};
use crate::algebra::vectors::lane::{F, Float, Lanes, M};

/// A relative pose without the length of its translation.
#[derive(Clone, Copy)]
pub(crate) struct Motion<L: Lanes<f64>> {
    pub(crate) q_21: Quaternion<L>,
    /// A unit vector of either sign.
    pub(crate) t: Vector3<L>,
}

impl<L: Lanes<f64>> Motion<L> {
    /// One of the two motions of an essential matrix of any scale, row by row: `R = cof E − [t]× E` where `|E|² = 2`, and the
    /// columns of `cof E` are multiples of `t`.
    #[inline(always)]
    pub(crate) fn new(lanes: L, e: &[F<L>; 9]) -> Self {
        let one = lanes.splat(1.0);
        let columns = [[e[0], e[3], e[6]], [e[1], e[4], e[7]], [e[2], e[5], e[8]]];
        let square = lanes.splat(2.0) / dot::<L, 9>(e, e);
        let scale = square.sqrt();
        let cofactors = [
            cross::<L>(&columns[1], &columns[2]),
            cross::<L>(&columns[2], &columns[0]),
            cross::<L>(&columns[0], &columns[1]),
        ];
        let (t, length) = longest::<L>(&cofactors);
        let t = scaled::<L, 3>(t, one / length.sqrt());
        let scaled_t = scaled::<L, 3>(t, scale);
        let mut r_21 = [[one; 3]; 3];
        for j in 0..3 {
            let turned = cross::<L>(&scaled_t, &columns[j]);
            for i in 0..3 {
                r_21[i][j] = square.mul_add(cofactors[j][i], -turned[i]);
            }
        }
        Self { q_21: quaternion(lanes, &r_21), t }
    }

    /// `self` where the mask is set, `other` elsewhere.
    #[inline(always)]
    pub(crate) fn select(mut self, mask: M<L>, other: Self) -> Self {
        for i in 0..4 {
            self.q_21[i] = self.q_21[i].select(mask, other.q_21[i]);
        }
        for i in 0..3 {
            self.t[i] = self.t[i].select(mask, other.t[i]);
        }
        self
    }

    /// After another rotation `q0_21`: `R ← R R0`.
    #[inline(always)]
    pub(crate) fn after(&self, q0_21: &Quaternion<L>) -> Self {
        Self { q_21: composed::<L>(&self.q_21, q0_21), ..*self }
    }

    /// One of Newton's steps to the solution of the constraints of five matches, given by their bearings in views 1 and 2.
    /// `refined` has a constraint to more digits, if it knows how; its value in plain ones is handed over.
    #[inline(always)]
    pub(crate) fn step(
        &self,
        lanes: L,
        bearings: impl Fn(usize) -> [Vector3<L>; 2],
        refined: impl Fn(usize, F<L>) -> F<L>,
    ) -> Step<L> {
        let (one, half) = (lanes.splat(1.0), lanes.splat(0.5));
        let t = &self.t;
        let [e1, e2] = tangent_basis(lanes, t);
        let r_21 = rotation(lanes, &self.q_21);
        let (mut equations, mut square) = ([[one; 6]; 5], lanes.splat(0.0));
        for i in 0..5 {
            let [a, b] = bearings(i);
            let c = product::<L>(&r_21, &a);
            let n = cross::<L>(&b, &c);
            let g = cross::<L>(&c, &cross::<L>(t, &b));
            let constraint = refined(i, -dot::<L, 3>(&n, t));
            square = constraint.mul_add(constraint, square);
            equations[i] = [g[0], g[1], g[2], dot::<L, 3>(&n, &e1), dot::<L, 3>(&n, &e2), constraint];
        }
        let step = solve(lanes, &mut equations);
        let turn = [one, half * step[0], half * step[1], half * step[2]];
        let mut moved = *t;
        for i in 0..3 {
            moved[i] = e2[i].mul_add(step[4], e1[i].mul_add(step[3], t[i]));
        }
        let q_21 = normalized::<L, 4>(lanes, composed::<L>(&turn, &self.q_21));
        Step {
            next: Self { q_21, t: normalized::<L, 3>(lanes, moved) },
            turn: dot::<L, 3>(&[step[0], step[1], step[2]], &[step[0], step[1], step[2]]),
            moved: step[4].mul_add(step[4], step[3] * step[3]),
            square,
        }
    }

    /// The essential matrix `[t]× R`, row by row.
    #[inline(always)]
    pub(crate) fn essential(&self, lanes: L) -> [F<L>; 9] {
        let r_21: Matrix3<L> = rotation(lanes, &self.q_21);
        let mut e = [self.t[0]; 9];
        for j in 0..3 {
            let column = cross::<L>(&self.t, &[r_21[0][j], r_21[1][j], r_21[2][j]]);
            for i in 0..3 {
                e[3 * i + j] = column[i];
            }
        }
        e
    }
}

/// A step of Newton's iteration.
pub(crate) struct Step<L: Lanes<f64>> {
    /// Where it leads.
    pub(crate) next: Motion<L>,
    /// Its squared length (radians), in rotation and in the direction of the translation.
    pub(crate) turn: F<L>,
    pub(crate) moved: F<L>,
    /// The sum of the squared constraints before it.
    pub(crate) square: F<L>,
}

/// Two unit vectors that complete `t` to a right-handed frame (Duff et al., JCGT 2017).
#[inline(always)]
fn tangent_basis<L: Lanes<f64>>(lanes: L, t: &Vector3<L>) -> [Vector3<L>; 2] {
    let one = lanes.splat(1.0);
    let sign = (-one).select(t[2].less(lanes.splat(0.0)), one);
    let a = -one / (sign + t[2]);
    let b = t[0] * t[1] * a;
    [
        [(sign * t[0]).mul_add(t[0] * a, one), sign * b, -(sign * t[0])],
        [b, t[1].mul_add(t[1] * a, sign), -t[1]],
    ]
}

/// The solution of five linear equations, the right-hand sides last, by Householder reflections.
#[inline(always)]
fn solve<L: Lanes<f64>>(lanes: L, m: &mut [[F<L>; 6]; 5]) -> [F<L>; 5] {
    let inverse = [
        eliminate::<L, 0>(lanes, m),
        eliminate::<L, 1>(lanes, m),
        eliminate::<L, 2>(lanes, m),
        eliminate::<L, 3>(lanes, m),
        lanes.splat(1.0) / m[4][4],
    ];
    let mut x = [lanes.splat(0.0); 5];
    for k in (0..5).rev() {
        let mut sum = m[k][5];
        for j in k + 1..5 {
            sum = m[k][j].neg_mul_add(x[j], sum);
        }
        x[k] = sum * inverse[k];
    }
    x
}

/// Makes zero what stands below the diagonal in column `K`, for the columns behind it, and returns the inverse of what is then on
/// the diagonal.
#[inline(always)]
fn eliminate<L: Lanes<f64>, const K: usize>(lanes: L, m: &mut [[F<L>; 6]; 5]) -> F<L> {
    let one = lanes.splat(1.0);
    let mut square = m[K][K] * m[K][K];
    for i in K + 1..5 {
        square = m[i][K].mul_add(m[i][K], square);
    }
    let length = square.sqrt();
    let image = (-length).select(lanes.splat(0.0).less(m[K][K]), length);
    m[K][K] = m[K][K] - image;
    let inverse = -one / (image * m[K][K]);
    for j in K + 1..6 {
        let mut dot = m[K][K] * m[K][j];
        for i in K + 1..5 {
            dot = m[i][K].mul_add(m[i][j], dot);
        }
        let dot = dot * inverse;
        for i in K..5 {
            m[i][j] = dot.neg_mul_add(m[i][K], m[i][j]);
        }
    }
    -inverse * m[K][K]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::vectors::two::{Two, TwoLanes};

    #[test]
    fn the_tangents_complete_a_right_handed_frame() {
        // One direction in each lane, on either side of the plane where the signs change.
        let t = [Two::new([0.6, -0.48]), Two::new([-0.48, 0.6]), Two::new([0.64, -0.64])];
        let [e1, e2] = tangent_basis(TwoLanes, &t);
        let frame = [t, e1, e2].map(|v| v.map(Two::to_array));
        for lane in 0..2 {
            let [t, e1, e2] = frame.map(|v| nalgebra::Vector3::from(v.map(|x| x[lane])));
            assert!((t.cross(&e1) - e2).amax() < 1e-15, "{e1} {e2}");
            assert!((e1.norm() - 1.0).abs() < 1e-15 && e1.dot(&t).abs() < 1e-15, "{e1}");
        }
    }
}
