//! Refinement of a motion on its manifold: Levenberg–Marquardt on the Sampson errors, with analytic derivatives.
//!
//! With `r = e / √g`, `e = x2ᵀ F x1` and `g` its squared gradient (see [`observations`](crate::robust::data::observations)), the derivative
//! of `r` by the entries of `F` is one 3 × 3 matrix a match, and that of `F` by each of the five parameters of
//! [`Motion`] one 3 × 3 matrix for all: a row of the Jacobian is five products of the two.

use nalgebra::{Matrix3, Matrix5, Vector5};

use crate::algebra::descent::{Descent, Outcome, Schedule, Singular, descend};
use crate::algebra::symmetric::symmetric;
use crate::algebra::vectors::widest::{Simd, Work, widest};
use crate::epipolar_frame::tangent_basis;
use crate::robust::data::columns::Columns;
use crate::robust::refine::loss::{LEAST_SQUARES, RobustLoss};
use crate::solver::shared::motion::{Motion, damped_step};

/// Matches that are worked on at once.
const WIDTH: usize = 8;

/// A descent is at its end when the next step gains no more than this, in units of the mean cost of a match, which is about
/// half the variance of what noise leaves undetermined. That step is made, and needs no check.
pub(crate) const FINE: f64 = 1e-4;
/// Near enough to a minimum to begin another descent there.
pub(crate) const COARSE: f64 = 1e-2;

/// A step shorter than this (radians) moves nothing that can be measured.
const SHORT: f64 = 1e-8;

/// Some of the matches, in columns of their own.
#[derive(Clone, Debug)]
pub(crate) struct Subset {
    /// The columns of a few matches, then those of the next few: [`PLANE`] or [`SPHERE`] columns each. The last match is repeated where
    /// there are fewer.
    columns: Vec<[f64; WIDTH]>,
    len: usize,
    inverse_scales: [[f64; 3]; 2],
    curvature: f64,
    is_sphere: bool,
}

/// The columns of a match on two planes, where `z` is one, and on two spheres.
const PLANE: usize = 4;
const SPHERE: usize = 6;

/// The normal equations of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Equations {
    pub(crate) cost: f64,
    pub(crate) hessian: Matrix5<f64>,
    pub(crate) gradient: Vector5<f64>,
}

/// What one match says of a motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct One {
    /// `r²`.
    pub(crate) square: f64,
    /// `J r`.
    pub(crate) gradient: Vector5<f64>,
    /// `ψ/r` under the loss.
    pub(crate) weight: f64,
    /// `ψ/r Jᵀ H⁻¹ J`.
    pub(crate) leverage: f64,
}

impl One {
    /// `inverse` is `H⁻¹` of the matches that the motion was fitted to.
    pub(crate) fn new(
        all: &Columns,
        index: u32,
        motion: &Motion,
        loss: &impl RobustLoss,
        inverse: &Matrix5<f64>,
    ) -> Self {
        let Equations { cost: square, hessian, gradient } =
            Subset::new(all, &[index]).equations(motion, &LEAST_SQUARES);
        let weight = loss.cost_and_weight(square).1;
        Self { square, gradient, weight, leverage: weight * (inverse * hessian).trace() }
    }
}

impl Subset {
    pub(crate) fn new(all: &Columns, indices: &[u32]) -> Self {
        let kept: &[usize] = if all.is_sphere() { &[0, 1, 2, 3, 4, 5] } else { &[0, 1, 3, 4] };
        let mut columns = Vec::with_capacity(indices.len().div_ceil(WIDTH) * kept.len());
        for some in indices.chunks(WIDTH) {
            let index = |j: usize| some[j.min(some.len() - 1)] as usize;
            columns.extend(
                kept.iter().map(|&k| -> [f64; WIDTH] { std::array::from_fn(|j| all.at(k, index(j))) }),
            );
        }
        Self {
            columns,
            len: indices.len(),
            inverse_scales: all.inverse_scales(),
            curvature: all.curvature(),
            is_sphere: all.is_sphere(),
        }
    }

    /// The cost of a motion and the normal equations of a step from it.
    pub(crate) fn equations(&self, motion: &Motion, loss: &impl RobustLoss) -> Equations {
        let derivatives = motion.essential_derivatives(&tangent_basis(&motion.direction));
        let [d1, d2] = &self.inverse_scales;
        let f = fundamental(&motion.essential(), d1, d2);
        let df = derivatives.map(|de| fundamental(&de, d1, d2));
        widest(Accumulation { subset: self, f, df, loss: *loss })
    }

    #[inline(always)]
    fn accumulate<const COLUMNS: usize>(
        &self,
        f: &[f64; 9],
        df: &[[f64; 9]; 5],
        loss: &impl RobustLoss,
    ) -> Equations {
        let mut cost = [0.0; WIDTH];
        let mut upper = [[0.0; WIDTH]; 15];
        let mut gradient = [[0.0; WIDTH]; 5];
        for (before, columns) in (0..).step_by(WIDTH).zip(self.columns.as_chunks::<COLUMNS>().0) {
            // One for a match, zero for a repeated one.
            let live: [f64; WIDTH] = std::array::from_fn(|j| if before + j < self.len { 1.0 } else { 0.0 });
            let (residual, slope) = linearised(f, columns, self.curvature);
            let mut weight = [0.0; WIDTH];
            for j in 0..WIDTH {
                let (c, w) = loss.cost_and_weight(residual[j] * residual[j]);
                cost[j] += live[j] * c;
                weight[j] = live[j] * w;
            }
            let mut jacobian = [[0.0; WIDTH]; 5];
            for (row, df) in jacobian.iter_mut().zip(df) {
                for k in 0..9 {
                    for j in 0..WIDTH {
                        row[j] += df[k] * slope[k][j];
                    }
                }
            }
            let mut entry = 0;
            for a in 0..5 {
                let mut weighted = [0.0; WIDTH];
                for j in 0..WIDTH {
                    weighted[j] = weight[j] * jacobian[a][j];
                    gradient[a][j] += weighted[j] * residual[j];
                }
                for b in a..5 {
                    for j in 0..WIDTH {
                        upper[entry][j] += weighted[j] * jacobian[b][j];
                    }
                    entry += 1;
                }
            }
        }
        Equations {
            cost: cost.iter().sum(),
            hessian: symmetric(&upper.map(|lanes| lanes.iter().sum())),
            gradient: Vector5::from_fn(|a, _| gradient[a].iter().sum()),
        }
    }
}

/// The sums of the normal equations.
struct Accumulation<'a, L> {
    subset: &'a Subset,
    f: [f64; 9],
    df: [[f64; 9]; 5],
    loss: L,
}

impl<L: RobustLoss> Work for Accumulation<'_, L> {
    type Output = Equations;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Equations {
        let Self { subset, f, df, loss } = self;
        if subset.is_sphere {
            subset.accumulate::<SPHERE>(&f, &df, &loss)
        } else {
            subset.accumulate::<PLANE>(&f, &df, &loss)
        }
    }
}

/// The residuals of a few matches, and their derivatives by the entries of `F`, row by row.
#[inline(always)]
fn linearised<const COLUMNS: usize>(
    f: &[f64; 9],
    columns: &[[f64; WIDTH]; COLUMNS],
    curvature: f64,
) -> ([f64; WIDTH], [[f64; WIDTH]; 9]) {
    let is_sphere = COLUMNS == SPHERE;
    let (view1, view2) = columns.split_at(COLUMNS / 2);
    let mut residual = [0.0; WIDTH];
    let mut slope = [[0.0; WIDTH]; 9];
    for j in 0..WIDTH {
        let (z1, z2) = if is_sphere { (view1[2][j], view2[2][j]) } else { (1.0, 1.0) };
        let (x1, y1, x2, y2) = (view1[0][j], view1[1][j], view2[0][j], view2[1][j]);
        let l0 = f[0] * x1 + f[1] * y1 + f[2] * z1;
        let l1 = f[3] * x1 + f[4] * y1 + f[5] * z1;
        let l2 = f[6] * x1 + f[7] * y1 + f[8] * z1;
        let m0 = f[0] * x2 + f[3] * y2 + f[6] * z2;
        let m1 = f[1] * x2 + f[4] * y2 + f[7] * z2;
        let m2 = if is_sphere { f[2] * x2 + f[5] * y2 + f[8] * z2 } else { 0.0 };
        let e = x2 * l0 + y2 * l1 + z2 * l2;
        let mut square = l0 * l0 + l1 * l1 + m0 * m0 + m1 * m1;
        if is_sphere {
            square += l2 * l2 + m2 * m2 - e * e * curvature;
        }
        let inverse = 1.0 / square.max(f64::MIN_POSITIVE).sqrt();
        let r = e * inverse;
        // dr = de/√g − r/(2g) dg, where dg = 2 (l · dl + m · dm − κ e de).
        let q = r * inverse * inverse;
        let along = if is_sphere { inverse + q * e * curvature } else { inverse };
        let (p0, p1, p2) = (q * l0, q * l1, if is_sphere { q * l2 } else { 0.0 });
        let (s0, s1, s2) = (q * m0, q * m1, if is_sphere { q * m2 } else { 0.0 });
        residual[j] = r;
        slope[0][j] = along * x2 * x1 - p0 * x1 - s0 * x2;
        slope[1][j] = along * x2 * y1 - p0 * y1 - s1 * x2;
        slope[2][j] = along * x2 * z1 - p0 * z1 - s2 * x2;
        slope[3][j] = along * y2 * x1 - p1 * x1 - s0 * y2;
        slope[4][j] = along * y2 * y1 - p1 * y1 - s1 * y2;
        slope[5][j] = along * y2 * z1 - p1 * z1 - s2 * y2;
        slope[6][j] = along * z2 * x1 - p2 * x1 - s0 * z2;
        slope[7][j] = along * z2 * y1 - p2 * y1 - s1 * z2;
        slope[8][j] = along * z2 * z1 - p2 * z1 - s2 * z2;
    }
    (residual, slope)
}

/// `D2 E D1`, row by row.
#[inline]
pub(crate) fn fundamental(e: &Matrix3<f64>, d1: &[f64; 3], d2: &[f64; 3]) -> [f64; 9] {
    std::array::from_fn(|k| d2[k / 3] * e[(k / 3, k % 3)] * d1[k % 3])
}

/// A start comes from a sample or from an earlier descent, so that nearly all of a Gauss–Newton step is wanted.
const SCHEDULE: Schedule = Schedule {
    first: 1e-4,
    least: 1e-10,
    negligible: 1e-10,
    refused: 0.0,
    most: 1e4,
    singular: Singular::IsDamped,
};

/// Brings a motion to a local minimum of the summed loss over the subset, as near as `until` says, by at most `max_steps` steps.
pub(crate) fn refine(
    subset: &Subset,
    motion: &mut Motion,
    loss: &impl RobustLoss,
    until: f64,
    max_steps: usize,
) {
    let current = subset.equations(motion, loss);
    descend(&mut Refinement { subset, loss, until, motion, current }, &SCHEDULE, max_steps);
}

/// A motion on its way.
struct Refinement<'a, L> {
    subset: &'a Subset,
    loss: &'a L,
    until: f64,
    motion: &'a mut Motion,
    /// At the motion.
    current: Equations,
}

impl<L: RobustLoss> Descent for Refinement<'_, L> {
    type Step = Vector5<f64>;

    fn step(&mut self, damping: f64) -> Option<Vector5<f64>> {
        damped_step(&self.current.hessian, &self.current.gradient, damping)
    }

    fn attempt(&mut self, step: &Vector5<f64>) -> Outcome {
        let Self { subset, loss, until, .. } = *self;
        let trial = self.motion.stepped(&tangent_basis(&self.motion.direction), &(*step).into());
        let expected = -self.current.gradient.dot(step);
        if expected * subset.len as f64 <= until * self.current.cost || step.norm_squared() < SHORT * SHORT {
            *self.motion = trial;
            return Outcome::Over;
        }
        let next = subset.equations(&trial, loss);
        if next.cost < self.current.cost {
            (*self.motion, self.current) = (trial, next);
            Outcome::Lower
        } else {
            Outcome::Refused
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;
    use crate::robust::data::image::Image;
    use crate::robust::refine::loss::HeavyTailed;

    #[test]
    fn the_gradient_is_half_of_the_derivative_of_the_cost() {
        let motion = Motion {
            q_21: UnitQuaternion::new(Vector3::new(0.2, -0.1, 0.3)),
            direction: Vector3::new(0.5, 0.3, 0.8).normalize(),
        };
        // Eleven matches, some pixels off, leave a block that is not full.
        let points = |of: fn(Vector3<f64>) -> Vector3<f64>| {
            (0..11).map(move |k| {
                let k = f64::from(k);
                let x1 = Vector3::new(0.5 * (2.1 * k).sin(), 0.4 * (3.7 * k).cos(), 1.0);
                let x2 = motion.q_21 * x1 * (3.0 + (1.3 * k).sin()) + motion.direction;
                let off = Vector3::new(0.02 * (5.0 * k).sin(), 0.03 * k.cos(), 0.0);
                [of(x1), of(x2 / x2.z + off)]
            })
        };
        let plane = Columns::of_points([Image::Plane([500.0, 400.0]); 2], 1.0, points(|x| x));
        let sphere = Columns::of_points([Image::Sphere(500.0); 2], 1.0, points(|x| x.normalize()));
        let all: Vec<u32> = (0..11).collect();
        for columns in [plane, sphere] {
            let subset = Subset::new(&columns, &all);
            let loss = HeavyTailed::new(5.0);
            let gradient = subset.equations(&motion, &loss).gradient;
            for k in 0..5 {
                let cost = |by: f64| {
                    let mut step = [0.0; 5];
                    step[k] = by;
                    subset.equations(&motion.stepped(&tangent_basis(&motion.direction), &step), &loss).cost
                };
                // Rounding of a thousand over the step.
                let derivative = (cost(1e-6) - cost(-1e-6)) / 2e-6;
                let error = derivative - 2.0 * gradient[k];
                assert!(error.abs() < 1e-5 * gradient.norm(), "{k}: {derivative} {}", gradient[k]);
            }
        }
    }
}
