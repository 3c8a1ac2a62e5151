//! Refinement of models that take a point to a point, not to a line: a homography, and the rotation alone. Their residuals are
//! those of [`data::point_transfer`](crate::robust::data::point_transfer).

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion};

use crate::algebra::descent::{Descent, Outcome, Schedule, Singular, descend};
use crate::algebra::number::cross;
use crate::algebra::vectors::widest::{Simd, Work, widest};
use crate::robust::data::point_transfer::{Framed, Lanes, WIDTH, rows, whitened};
use crate::robust::refine::loss::{LEAST_SQUARES, RobustLoss};

/// A descent is at its end when the next step gains no more than this in units of the mean cost of a match.
const FINE: f64 = 1e-3;

/// The normal equations in `P` parameters.
struct Equations<const P: usize> {
    cost: f64,
    hessian: SMatrix<f64, P, P>,
    gradient: SVector<f64, P>,
}

/// What the parameters of a model are.
trait Parameters<const P: usize>: Copy {
    /// The derivatives by the parameters, from those by `y`, from `x1` and from `y`.
    fn row(self, slope: &[f64; 3], x1: &[f64; 3], y: &[f64; 3]) -> [f64; P];
}

/// The nine entries of a homography.
#[derive(Clone, Copy)]
struct Entries;

impl Parameters<9> for Entries {
    #[inline(always)]
    fn row(self, slope: &[f64; 3], x1: &[f64; 3], _: &[f64; 3]) -> [f64; 9] {
        std::array::from_fn(|k| slope[k / 3] * x1[k % 3])
    }
}

/// A small rotation after another.
#[derive(Clone, Copy)]
struct Turn;

impl Parameters<3> for Turn {
    /// `y × slope`.
    #[inline(always)]
    fn row(self, slope: &[f64; 3], _: &[f64; 3], y: &[f64; 3]) -> [f64; 3] {
        cross(y, slope)
    }
}

fn equations<const P: usize, R: Parameters<P>>(
    matches: &Framed,
    h: &Matrix3<f64>,
    loss: &impl RobustLoss,
    parameters: R,
) -> Equations<P> {
    widest(Accumulation { matches, h: rows(h), loss: *loss, parameters })
}

/// The sums of the normal equations.
struct Accumulation<'a, const P: usize, L, R: Parameters<P>> {
    matches: &'a Framed,
    h: [f64; 9],
    loss: L,
    parameters: R,
}

impl<const P: usize, L: RobustLoss, R: Parameters<P>> Work for Accumulation<'_, P, L, R> {
    type Output = Equations<P>;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Equations<P> {
        let Self { matches, h, loss, parameters } = self;
        let behind = loss.cost_and_weight(f64::MAX.sqrt()).0;
        let mut cost = [0.0; WIDTH];
        let mut upper = [[[0.0; WIDTH]; P]; P];
        let mut gradient = [[0.0; WIDTH]; P];
        for block in &matches.blocks {
            let w = whitened(&h, block);
            let mut weight = [0.0; WIDTH];
            for j in 0..WIDTH {
                let [r, s] = [w.residual[0][j], w.residual[1][j]];
                let (c, live) = loss.cost_and_weight(r * r + s * s);
                let c = if w.is_in_front[j] { c } else { behind };
                cost[j] += if block.is_live[j] { c } else { 0.0 };
                weight[j] = if block.is_live[j] & w.is_in_front[j] { live } else { 0.0 };
            }
            for k in 0..2 {
                let mut jacobian = [[0.0; WIDTH]; P];
                for j in 0..WIDTH {
                    let of = |v: &[Lanes; 3]| [v[0][j], v[1][j], v[2][j]];
                    let row = parameters.row(&of(&w.slope[k]), &of(&block.x1), &of(&w.y));
                    for a in 0..P {
                        jacobian[a][j] = row[a];
                    }
                }
                for a in 0..P {
                    let mut weighted = [0.0; WIDTH];
                    for j in 0..WIDTH {
                        weighted[j] = weight[j] * jacobian[a][j];
                        gradient[a][j] += weighted[j] * w.residual[k][j];
                    }
                    for b in a..P {
                        for j in 0..WIDTH {
                            upper[a][b][j] += weighted[j] * jacobian[b][j];
                        }
                    }
                }
            }
        }
        Equations {
            cost: cost.iter().sum(),
            hessian: SMatrix::from_fn(|a, b| upper[a.min(b)][a.max(b)].iter().sum()),
            gradient: SVector::from_fn(|a, _| gradient[a].iter().sum()),
        }
    }
}

/// A start comes from a sample or from the pose, so that nearly all of a Gauss–Newton step is wanted.
const SCHEDULE: Schedule = Schedule {
    first: 1e-3,
    least: 1e-9,
    negligible: 1e-9,
    refused: 0.0,
    most: 1e5,
    singular: Singular::Ends,
};

/// A model on its way: `at` gives its equations, `moved` makes a step.
struct Refinement<'a, const P: usize, M, A, S> {
    model: &'a mut M,
    count: usize,
    at: A,
    moved: S,
    /// At the model.
    current: Equations<P>,
}

impl<const P: usize, M, A, S> Descent for Refinement<'_, P, M, A, S>
where
    A: Fn(&M) -> Equations<P>,
    S: Fn(&M, &SVector<f64, P>) -> M,
{
    type Step = SVector<f64, P>;

    fn step(&mut self, damping: f64) -> Option<SVector<f64, P>> {
        let mut damped = self.current.hessian;
        // The scale of a homography is free: a little of the trace holds it.
        let free = 1e-12 * self.current.hessian.trace();
        for k in 0..P {
            damped[(k, k)] += damping * damped[(k, k)] + free;
        }
        Some(-nalgebra::Cholesky::new(damped)?.solve(&self.current.gradient))
    }

    fn attempt(&mut self, step: &SVector<f64, P>) -> Outcome {
        let trial = (self.moved)(self.model, step);
        if -self.current.gradient.dot(step) * self.count as f64 <= FINE * self.current.cost {
            *self.model = trial;
            return Outcome::Over;
        }
        let next = (self.at)(&trial);
        if next.cost < self.current.cost {
            (*self.model, self.current) = (trial, next);
            Outcome::Lower
        } else {
            Outcome::Refused
        }
    }
}

/// Descends by at most `max_steps` steps. Returns the cost before the last of them.
fn minimise<const P: usize, M>(
    model: &mut M,
    count: usize,
    max_steps: usize,
    at: impl Fn(&M) -> Equations<P>,
    moved: impl Fn(&M, &SVector<f64, P>) -> M,
) -> f64 {
    let current = at(model);
    let mut refinement = Refinement { model, count, at, moved, current };
    descend(&mut refinement, &SCHEDULE, max_steps);
    refinement.current.cost
}

/// Refines a homography of any scale over some of the matches.
pub(crate) fn refine_homography(
    matches: &Framed,
    h: &mut Matrix3<f64>,
    loss: &impl RobustLoss,
    max_steps: usize,
) -> f64 {
    *h /= h.norm();
    minimise(
        h,
        matches.len(),
        max_steps,
        |h| equations(matches, h, loss, Entries),
        |h, step| (h + Matrix3::from_fn(|i, j| step[3 * i + j])).normalize(),
    )
}

/// Refines a rotation over some of the matches.
pub(crate) fn refine_rotation(
    matches: &Framed,
    q_21: &mut UnitQuaternion<f64>,
    loss: &impl RobustLoss,
    max_steps: usize,
) -> f64 {
    minimise(
        q_21,
        matches.len(),
        max_steps,
        |q| equations(matches, &q.to_rotation_matrix().into_inner(), loss, Turn),
        |q, step| UnitQuaternion::new_normalize((UnitQuaternion::new(*step) * q).into_inner()),
    )
}

/// `Σ Jᵀ J` of a rotation, without weights.
pub(crate) fn rotation_hessian(matches: &Framed, q_21: &UnitQuaternion<f64>) -> Matrix3<f64> {
    let r_21 = q_21.to_rotation_matrix().into_inner();
    equations(matches, &r_21, &LEAST_SQUARES, Turn).hessian
}
