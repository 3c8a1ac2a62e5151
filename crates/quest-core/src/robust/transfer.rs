//! Models that take a point to a point, not to a line: a homography, and the rotation alone.
//!
//! The residual is the difference of the transferred point and the point of view 2, in pixels, divided by the noise of
//! both: `S = I + A Aᵀ` with `A` the derivative of the transfer by the point of view 1 (both with unit noise), whitened by its
//! Cholesky factor. Two numbers a match, where an essential matrix leaves one.

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::loss::Loss;
use super::observations::{Frame, FramedMatch};

/// A residual and its derivatives by `y = H x1`.
struct Whitened {
    residual: [f64; 2],
    slope: [Vector3<f64>; 2],
    x1: Vector3<f64>,
    y: Vector3<f64>,
}

/// `None` where the point is taken behind the camera.
fn whitened(h: &Matrix3<f64>, m: &FramedMatch) -> Option<Whitened> {
    let FramedMatch { x1, x2, frame1, frame2 } = *m;
    let y = h * x1;
    let Frame { e, n, .. } = frame2;
    let depth = y.dot(&n);
    if depth <= 0.0 {
        return None;
    }
    let at = e.map(|e| y.dot(&e) / depth);
    let mut residual: [f64; 2] = std::array::from_fn(|k| at[k] - x2.dot(&e[k]) / x2.dot(&n));
    let mut slope: [Vector3<f64>; 2] = std::array::from_fn(|k| (e[k] - n * at[k]) / depth);
    let moved = frame1.d.map(|d| h * d);
    let a: [[f64; 2]; 2] = slope.map(|s| moved.map(|m| s.dot(&m)));
    // The Cholesky factor [k0 0; k1 k2] of S.
    let k0 = (1.0 + a[0][0] * a[0][0] + a[0][1] * a[0][1]).sqrt();
    let k1 = (a[0][0] * a[1][0] + a[0][1] * a[1][1]) / k0;
    let k2 = (1.0 + a[1][0] * a[1][0] + a[1][1] * a[1][1] - k1 * k1).max(f64::MIN_POSITIVE).sqrt();
    residual[0] /= k0;
    residual[1] = (residual[1] - k1 * residual[0]) / k2;
    slope[0] /= k0;
    slope[1] = (slope[1] - slope[0] * k1) / k2;
    Some(Whitened { residual, slope, x1, y })
}

/// The squared whitened residual of a match, infinite where its point is taken behind the camera.
pub(super) fn square_error(h: &Matrix3<f64>, m: &FramedMatch) -> f64 {
    whitened(h, m).map_or(f64::INFINITY, |w| w.residual[0] * w.residual[0] + w.residual[1] * w.residual[1])
}

/// The normal equations in `P` parameters.
struct Equations<const P: usize> {
    cost: f64,
    hessian: SMatrix<f64, P, P>,
    gradient: SVector<f64, P>,
}

fn equations<const P: usize>(
    matches: &[FramedMatch],
    h: &Matrix3<f64>,
    loss: &impl Loss,
    row: impl Fn(&Vector3<f64>, &Whitened) -> SVector<f64, P>,
) -> Equations<P> {
    let (mut cost, mut hessian, mut gradient) = (0.0, SMatrix::zeros(), SVector::zeros());
    for m in matches {
        let Some(w) = whitened(h, m) else {
            cost += loss.cost_and_weight(f64::MAX.sqrt()).0;
            continue;
        };
        let (c, weight) = loss.cost_and_weight(w.residual[0].powi(2) + w.residual[1].powi(2));
        cost += c;
        for k in 0..2 {
            let jacobian = row(&w.slope[k], &w);
            gradient += jacobian * (weight * w.residual[k]);
            let weighted = jacobian * weight;
            for b in 0..P {
                for a in 0..=b {
                    hessian[(a, b)] += weighted[a] * jacobian[b];
                }
            }
        }
    }
    for b in 0..P {
        for a in 0..b {
            hessian[(b, a)] = hessian[(a, b)];
        }
    }
    Equations { cost, hessian, gradient }
}

/// Levenberg–Marquardt; `row` gives the derivatives by the parameters, `moved` makes a step. The cost that is reached.
fn minimise<const P: usize, M: Clone>(
    model: &mut M,
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
        let trial = moved(model, &-factor.solve(&current.gradient));
        let next = at(&trial);
        let gain = current.cost - next.cost;
        if gain > 0.0 {
            (*model, current) = (trial, next);
            damping = (0.1_f64 * damping).max(1e-9);
            if gain < 1e-5 * current.cost {
                break;
            }
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
    matches: &[FramedMatch],
    h: &mut Matrix3<f64>,
    loss: &impl Loss,
    max_steps: usize,
) -> f64 {
    let row =
        |slope: &Vector3<f64>, w: &Whitened| SVector::<f64, 9>::from_fn(|k, _| slope[k / 3] * w.x1[k % 3]);
    *h /= h.norm();
    minimise(
        h,
        max_steps,
        |h| equations(matches, h, loss, row),
        |h, step| (h + Matrix3::from_fn(|i, j| step[3 * i + j])).normalize(),
    )
}

/// Refines a rotation over some of the matches.
pub(super) fn refine_rotation(
    matches: &[FramedMatch],
    q_21: &mut UnitQuaternion<f64>,
    loss: &impl Loss,
    max_steps: usize,
) -> f64 {
    let row = |slope: &Vector3<f64>, w: &Whitened| w.y.cross(slope);
    minimise(
        q_21,
        max_steps,
        |q| equations(matches, &q.to_rotation_matrix().into_inner(), loss, row),
        |q, step| UnitQuaternion::new_normalize((UnitQuaternion::new(*step) * q).into_inner()),
    )
}

/// `Σ Jᵀ J` of a rotation, without weights.
pub(super) fn rotation_hessian(matches: &[FramedMatch], q_21: &UnitQuaternion<f64>) -> Matrix3<f64> {
    let row = |slope: &Vector3<f64>, w: &Whitened| w.y.cross(slope);
    let r_21 = q_21.to_rotation_matrix().into_inner();
    equations(matches, &r_21, &super::loss::Truncated::new(f64::INFINITY), row).hessian
}
