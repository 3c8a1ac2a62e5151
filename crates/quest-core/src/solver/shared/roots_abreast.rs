//! From the real roots of five matches to their motions, a root in each lane of a register.
//!
//! The formulas are those of the lanes (`newton_lanes.rs`), and the steps those of the pairs of `five_matches.rs` and of
//! [`TwoMotions::solutions`](crate::solver::shared::newton_pair::TwoMotions::solutions), with which a test compares them.
#![expect(clippy::inline_always, reason = "a call would leave the instructions of the lanes")]

use nalgebra::UnitQuaternion;

use crate::Correspondence;
use crate::algebra::vectors::abreast::Work;
use crate::algebra::vectors::columns::{Column, MotionColumns};
use crate::algebra::vectors::geometry::{Vector3, cross, longest, normalized, splat};
use crate::algebra::vectors::lane::{F, Float, Lanes, MAX_F64_LANES, Mask};
use crate::solver::shared::double_residual::SplitEssential;
use crate::solver::shared::motion::Motion;
use crate::solver::shared::newton_lanes;
use crate::solver::shared::newton_pair::{Convergence, MAX_NEWTON_STEPS};
use crate::solver::shared::parallax_frame::{Alignment, Coordinates};
use crate::solver::shared::resultant::Resultant;

/// The motions that some roots stand for, and where Newton's iteration leads from there.
pub(crate) struct Solved {
    starts: MotionColumns,
    ends: MotionColumns,
    /// Above zero where it converges.
    converged: Column,
}

impl Solved {
    pub(crate) fn new() -> Self {
        let none = MotionColumns::new();
        Self { starts: none, ends: none, converged: [0.0; MAX_F64_LANES] }
    }

    /// The motion of root `k`; `None` for one that is not finite.
    pub(crate) fn start(&self, k: usize) -> Option<Motion> {
        finite(self.starts.get(k))
    }

    /// The solution of root `k`; `None` where the iteration does not converge.
    pub(crate) fn solution(&self, k: usize) -> Option<Motion> {
        finite(self.ends.get(k)).filter(|_| self.converged[k] > 0.0)
    }
}

fn finite((q_21, direction): (UnitQuaternion<f64>, nalgebra::Vector3<f64>)) -> Option<Motion> {
    (q_21.coords.sum() + direction.sum()).is_finite().then_some(Motion { q_21, direction })
}

/// The work for the roots `z`, at most as many as the widest register holds.
pub(crate) struct SolveRoots<'a> {
    pub(crate) basis: &'a [Coordinates; 4],
    pub(crate) alignment: &'a Alignment,
    pub(crate) equations: &'a Resultant,
    pub(crate) z: &'a [f64],
    pub(crate) matches: &'a [Correspondence; 5],
    pub(crate) out: &'a mut Solved,
}

impl SolveRoots<'_> {
    /// The essential matrices of roots, row by row and of norm one, between the turned view 1 and view 2.
    #[inline(always)]
    fn essential<L: Lanes<f64>>(&self, lanes: L, z: F<L>) -> [F<L>; 9] {
        let Self { equations, basis, .. } = self;
        let mut m = [[z; 3]; 3];
        for r in 0..3 {
            m[r] = [
                horner(lanes, &equations.x[r], z),
                horner(lanes, &equations.y[r], z),
                horner(lanes, &equations.w[r], z),
            ];
        }
        let across = cross::<L>;
        let ([x, y, w], _) =
            longest::<L>(&[across(&m[0], &m[1]), across(&m[1], &m[2]), across(&m[2], &m[0])]);
        let point = [x, y, z * w, w];
        let mut form = [z; 9];
        for k in 0..9 {
            form[k] = point[0] * lanes.splat(basis[0][k]);
            for i in 1..4 {
                form[k] = point[i].mul_add(lanes.splat(basis[i][k]), form[k]);
            }
        }
        let p = lanes.splat(self.alignment.parallax);
        let [tx, ty, tz, xx, yy, zz, xy, xz, yz] = form;
        normalized::<L, 9>(
            lanes,
            [
                p * xx,
                p.mul_add(xy, -tz),
                p.mul_add(xz, ty),
                p.mul_add(xy, tz),
                p * yy,
                p.mul_add(yz, -tx),
                p.mul_add(xz, -ty),
                p.mul_add(yz, tx),
                p * zz,
            ],
        )
    }
}

impl Work for SolveRoots<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<f64>>(self, lanes: L) {
        let q0_21 = self.alignment.q0_21.coords;
        let q0_21 = [q0_21.w, q0_21.x, q0_21.y, q0_21.z].map(|x| lanes.splat(x));
        for first in (0..self.z.len()).step_by(L::COUNT) {
            // What is left of the lanes repeats the first.
            let mut z = [self.z[first]; MAX_F64_LANES];
            for (z, root) in z[..L::COUNT].iter_mut().zip(&self.z[first..]) {
                *z = *root;
            }
            let start = newton_lanes::Motion::new(lanes, &self.essential(lanes, lanes.load(&z)));
            let start = start.after(&q0_21);
            self.out.starts.store::<L>(first, &start.q_21, &start.t);
            let (end, converged) = solution(lanes, start, self.alignment, self.matches);
            self.out.ends.store::<L>(first, &end.q_21, &end.t);
            converged.store(&mut self.out.converged[first..]);
        }
    }
}

#[inline(always)]
fn horner<L: Lanes<f64>, const N: usize>(lanes: L, p: &[f64; N], z: F<L>) -> F<L> {
    let mut value = lanes.splat(p[N - 1]);
    for k in (0..N - 1).rev() {
        value = value.mul_add(z, lanes.splat(p[k]));
    }
    value
}

/// The solutions that Newton's iteration leads to, and above zero where it converges.
#[inline(always)]
fn solution<L: Lanes<f64>>(
    lanes: L,
    start: newton_lanes::Motion<L>,
    alignment: &Alignment,
    matches: &[Correspondence; 5],
) -> (newton_lanes::Motion<L>, F<L>) {
    let Convergence { limit, per_parallax, rounding } = Convergence::new(alignment);
    let (zero, one) = (lanes.splat(0.0), lanes.splat(1.0));
    let limit = lanes.splat(limit);
    let bearings = |i: usize| -> [Vector3<L>; 2] {
        [splat(lanes, matches[i].bearing1()), splat(lanes, matches[i].bearing2())]
    };
    let (mut motion, mut active, mut converged) = (start, zero.less(one), zero);
    let mut rest = one;
    for count in 0..MAX_NEWTON_STEPS {
        let essential = SplitEssential::new(lanes, &rows::<L>(&motion.essential(lanes)));
        let step = motion.step(lanes, bearings, |i, _| {
            let [a, b] = bearings(i);
            essential.form(lanes, &b, &a)
        });
        // Not a number is no step either.
        let taken = active.and((step.turn + step.moved).less(one));
        motion = step.next.select(taken, motion);
        let weight = if count == 0 { lanes.splat(per_parallax) } else { one };
        let size = step.turn.mul_add(weight, step.moved);
        converged = one.select(active.and(size.less(limit)), converged);
        rest = step.square;
        active = taken.and(limit.less(size));
        if !active.any() {
            break;
        }
    }
    // Near another solution the steps of rounding are longer, and come to no end.
    converged = one.select(active.and(rest.less(lanes.splat(rounding))), converged);
    (motion, converged)
}

#[inline(always)]
fn rows<L: Lanes<f64>>(e: &[F<L>; 9]) -> [Vector3<L>; 3] {
    [[e[0], e[1], e[2]], [e[3], e[4], e[5]], [e[6], e[7], e[8]]]
}
