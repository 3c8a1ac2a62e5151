//! Models that take a point to a point, not to a line: a homography, and the rotation alone.
//!
//! The residual is the difference of the transferred point and the point of view 2, in pixels, divided by the noise of
//! both: `S = I + A Aᵀ` with `A` the derivative of the transfer by the point of view 1 (both with unit noise), whitened by its
//! Cholesky factor. Two numbers a match, where an essential matrix leaves one.

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::loss::{Loss, Truncated};
use super::observations::FramedMatch;
use super::widest::{Work, widest};

/// Matches that are worked on at once.
const WIDTH: usize = 8;
type Lanes = [f64; WIDTH];

/// A descent is at its end when the next step gains no more than this in units of the mean cost of a match.
const FINE: f64 = 1e-3;

/// Matches in columns, with the frames of both views around each of them.
#[derive(Clone, Debug)]
pub(super) struct Framed {
    blocks: Vec<Block>,
    len: usize,
}

/// A few matches, the last of all repeated where there are fewer.
#[derive(Clone, Copy, Debug)]
struct Block {
    x1: [Lanes; 3],
    /// The point of view 2 in pixels.
    u2: [Lanes; 2],
    /// What takes a vector to pixels in view 2, and what it is divided by.
    e: [[Lanes; 3]; 2],
    n: [Lanes; 3],
    /// What takes pixels back in view 1.
    d: [[Lanes; 3]; 2],
    is_live: [bool; WIDTH],
}

/// Residuals of a few matches and their derivatives by `y = H x1`.
struct Whitened {
    residual: [Lanes; 2],
    slope: [[Lanes; 3]; 2],
    y: [Lanes; 3],
    /// False where the point is taken behind the camera.
    is_in_front: [bool; WIDTH],
}

impl Framed {
    pub(super) fn new(matches: &[FramedMatch]) -> Self {
        let block = |some: &[FramedMatch]| {
            let at = |j: usize| &some[j.min(some.len() - 1)];
            let lanes = |f: &dyn Fn(&FramedMatch) -> f64| -> Lanes { std::array::from_fn(|j| f(at(j))) };
            let vector = |f: &dyn Fn(&FramedMatch) -> Vector3<f64>| -> [Lanes; 3] {
                std::array::from_fn(|k| lanes(&|m| f(m)[k]))
            };
            Block {
                x1: vector(&|m| m.x1),
                u2: [0, 1].map(|k| lanes(&|m| m.x2.dot(&m.frame2.e[k]) / m.x2.dot(&m.frame2.n))),
                e: [0, 1].map(|k| vector(&|m| m.frame2.e[k])),
                n: vector(&|m| m.frame2.n),
                d: [0, 1].map(|k| vector(&|m| m.frame1.d[k])),
                is_live: std::array::from_fn(|j| j < some.len()),
            }
        };
        Self { blocks: matches.chunks(WIDTH).map(block).collect(), len: matches.len() }
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// The squared whitened residual of each match, infinite where its point is taken behind the camera.
    pub(super) fn square_errors(&self, h: &Matrix3<f64>) -> Vec<f64> {
        let mut all = vec![[0.0; WIDTH]; self.blocks.len()];
        widest(SquareErrors { matches: self, h: rows(h), out: &mut all });
        let mut all = all.into_flattened();
        all.truncate(self.len);
        all
    }
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
    fn run(self) {
        for (block, out) in self.matches.blocks.iter().zip(self.out) {
            let Whitened { residual: [r, s], is_in_front, .. } = whitened(&self.h, block);
            for j in 0..WIDTH {
                out[j] = if is_in_front[j] { r[j] * r[j] + s[j] * s[j] } else { f64::INFINITY };
            }
        }
    }
}

fn rows(m: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|k| m[(k / 3, k % 3)])
}

#[inline(always)]
#[expect(clippy::inline_always, reason = "the loop around it is vectorised only as one")]
fn whitened(h: &[f64; 9], block: &Block) -> Whitened {
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
        [
            y[1] * slope[2] - y[2] * slope[1],
            y[2] * slope[0] - y[0] * slope[2],
            y[0] * slope[1] - y[1] * slope[0],
        ]
    }
}

fn equations<const P: usize, R: Parameters<P>>(
    matches: &Framed,
    h: &Matrix3<f64>,
    loss: &impl Loss,
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

impl<const P: usize, L: Loss, R: Parameters<P>> Work for Accumulation<'_, P, L, R> {
    type Output = Equations<P>;

    #[inline(always)]
    fn run(self) -> Equations<P> {
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

/// Levenberg–Marquardt; `at` gives the equations of a model, `moved` makes a step. The cost before the last step.
fn minimise<const P: usize, M: Clone>(
    model: &mut M,
    count: usize,
    max_steps: usize,
    at: impl Fn(&M) -> Equations<P>,
    moved: impl Fn(&M, &SVector<f64, P>) -> M,
) -> f64 {
    let (mut damping, mut current) = (1e-3, at(model));
    for _ in 0..max_steps {
        let mut damped = current.hessian;
        // The scale of a homography is free: a little of the trace holds it.
        let free = 1e-12 * current.hessian.trace();
        for k in 0..P {
            damped[(k, k)] += damping * damped[(k, k)] + free;
        }
        let Some(factor) = nalgebra::Cholesky::new(damped) else { break };
        let step = -factor.solve(&current.gradient);
        let trial = moved(model, &step);
        if -current.gradient.dot(&step) * count as f64 <= FINE * current.cost {
            *model = trial;
            break;
        }
        let next = at(&trial);
        if next.cost < current.cost {
            (*model, current) = (trial, next);
            damping = (0.1_f64 * damping).max(1e-9);
        } else {
            damping *= 10.0;
            if damping.is_nan() || damping > 1e5 {
                break;
            }
        }
    }
    current.cost
}

/// Refines a homography of any scale over some of the matches.
pub(super) fn refine_homography(
    matches: &Framed,
    h: &mut Matrix3<f64>,
    loss: &impl Loss,
    max_steps: usize,
) -> f64 {
    *h /= h.norm();
    minimise(
        h,
        matches.len,
        max_steps,
        |h| equations(matches, h, loss, Entries),
        |h, step| (h + Matrix3::from_fn(|i, j| step[3 * i + j])).normalize(),
    )
}

/// Refines a rotation over some of the matches.
pub(super) fn refine_rotation(
    matches: &Framed,
    q_21: &mut UnitQuaternion<f64>,
    loss: &impl Loss,
    max_steps: usize,
) -> f64 {
    minimise(
        q_21,
        matches.len,
        max_steps,
        |q| equations(matches, &q.to_rotation_matrix().into_inner(), loss, Turn),
        |q, step| UnitQuaternion::new_normalize((UnitQuaternion::new(*step) * q).into_inner()),
    )
}

/// `Σ Jᵀ J` of a rotation, without weights.
pub(super) fn rotation_hessian(matches: &Framed, q_21: &UnitQuaternion<f64>) -> Matrix3<f64> {
    let r_21 = q_21.to_rotation_matrix().into_inner();
    equations(matches, &r_21, &Truncated::new(f64::INFINITY), Turn).hessian
}
