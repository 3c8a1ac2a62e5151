//! One frame against the reference: the pose and the inverse depths that explain it best.
//!
//! Minimises, over the pose and all inverse depths ρ,
//!
//! ```text
//! Σ |π(R m1 + ρ t) − m2|² / σ²  +  (ρ − ρ̂)ᵀ Λ (ρ − ρ̂)  +  γ (Σ (ρ − 1))²  (+ the plane's)
//! ```
//!
//! where the first sum is over the features seen, `m1`, `m2` their images on the planes z = 1 of the goal and the current
//! camera. The third term keeps the unit of length. Gauss–Newton with Levenberg's damping; the inverse depths are
//! eliminated first, what is left for the pose is 6 × 6.

use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};

use crate::RelativePose;
use crate::algebra::cholesky;
use crate::algebra::descent::{Descent, Outcome, Schedule, Singular, descend};
use crate::servo::estimators::depth_filter::reference::DepthReference;

/// The weight γ of the unit: a thousand times the information that one frame may have.
const UNIT_WEIGHT: f64 = 1e10;
/// Points nearer than this to the plane z = 0 of the current camera, in the unit of length, count as not seen.
const NEAREST: f64 = 1e-3;
/// Steps of a fit from a candidate: seven are usual.
pub(crate) const MAX_STEPS: usize = 20;
/// A fit is at its minimum once a step lowers χ² by no more than this share of it, or by no more than this.
const SETTLED: f64 = 1e-4;
const SETTLED_AT_ALL: f64 = 1e-9;
/// A refused step shorter than this (radians, units of length) is at the minimum, to rounding.
const SHORT: f64 = 1e-12;

/// A fit begins at the last image's pose, or at a candidate: the first step is Gauss–Newton's own.
const SCHEDULE: Schedule = Schedule {
    first: 0.0,
    least: 0.0,
    negligible: 1e-6,
    refused: 1e-4,
    most: 1e6,
    singular: Singular::IsDamped,
};

/// How exactly a robot keeps to the plane x–z: the standard deviations of tilt and height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// That of the tilt, in radians.
    pub tilt: f64,
    /// That of the height, in the unit of `t`.
    pub height: f64,
}

/// One frame, and what is known before it is looked at.
pub(crate) struct Problem<'a> {
    /// The goal's features on the plane z = 1.
    pub(crate) goal: &'a [[f64; 2]],
    /// The current camera's; `None` for features that are not seen.
    pub(crate) frame: &'a [Option<[f64; 2]>],
    /// The inverse depths at the goal.
    pub(crate) reference: &'a DepthReference,
    /// Standard deviation of a coordinate of `m2 − π(…)`.
    pub(crate) sigma: f64,
    pub(crate) plane: Option<Plane>,
}

/// Where a fit ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fitted {
    pub(crate) pose: RelativePose,
    /// The whole cost: χ² of the images and of the reference.
    pub(crate) cost: f64,
}

/// The working memory of fits, for a number of features fixed at the start.
#[derive(Clone, Debug)]
pub(crate) struct Workspace {
    /// The inverse depths of the last fit.
    pub(crate) inverse_depths: Vec<f64>,
    trial: Vec<f64>,
    /// The squared residuals of the features in the last fit, by the noise; infinite where not seen.
    pub(crate) squares: Vec<f64>,
    /// How many steps the last fit took.
    pub(crate) steps: usize,
    hessian: Vec<f64>,
    /// The mixed block, a row a feature: six columns of the pose, and the gradient.
    mixed: Vec<[f64; 7]>,
    solved: Vec<[f64; 7]>,
    step: Vec<f64>,
    /// `Λ (ρ − ρ̂)`, the pull of the reference.
    pulls: Vec<f64>,
    /// The diagonal block of the inverse depths, from the images alone.
    diagonal: Vec<f64>,
    /// The pose's block.
    pose_block: Matrix6<f64>,
    gradient: Vector6<f64>,
}

impl Workspace {
    pub(crate) fn new(features: usize) -> Self {
        Self {
            inverse_depths: vec![1.0; features],
            trial: vec![1.0; features],
            squares: vec![0.0; features],
            steps: 0,
            hessian: vec![0.0; features * features],
            mixed: vec![[0.0; 7]; features],
            solved: vec![[0.0; 7]; features],
            step: vec![0.0; features],
            pulls: vec![0.0; features],
            diagonal: vec![0.0; features],
            pose_block: Matrix6::zeros(),
            gradient: Vector6::zeros(),
        }
    }

    /// Fits from this pose and these inverse depths, by at most `most_steps` steps.
    pub(crate) fn fit(
        &mut self,
        problem: &Problem<'_>,
        start: RelativePose,
        inverse_depths: &[f64],
        most_steps: usize,
    ) -> Option<Fitted> {
        self.steps = 0;
        self.inverse_depths.copy_from_slice(inverse_depths);
        let cost = self.cost(problem, &start)?;
        self.linearise(problem, &start);
        let fitted = Fitted { pose: start, cost };
        let mut fitting = Fitting { workspace: self, problem, fitted, is_refused: false };
        descend(&mut fitting, &SCHEDULE, most_steps);
        let Fitting { fitted, is_refused, .. } = fitting;
        if is_refused {
            // The residuals must be those of the pose that is returned.
            self.cost(problem, &fitted.pose)?;
        }
        Some(fitted)
    }

    /// The residuals and the cost, at the workspace's inverse depths; `None` where a seen point is behind the camera.
    fn cost(&mut self, problem: &Problem<'_>, pose: &RelativePose) -> Option<f64> {
        let Problem { goal, frame, reference, sigma, plane } = *problem;
        let r_21 = pose.r_21();
        let mut cost = plane.map_or(0.0, |plane| plane_residuals(&plane, pose).0.norm_squared());
        for (i, (m1, image)) in goal.iter().zip(frame).enumerate() {
            let rho = self.inverse_depths[i];
            self.pulls[i] = reference.pull(i, &self.inverse_depths);
            cost += self.pulls[i] * (rho - reference.inverse_depths[i]);
            self.squares[i] = f64::INFINITY;
            let Some(image) = image else { continue };
            let x2 = r_21 * Vector3::new(m1[0], m1[1], 1.0) + pose.t_21 * rho;
            if x2.z < NEAREST {
                return None;
            }
            let off = [x2.x / x2.z - image[0], x2.y / x2.z - image[1]].map(|e| e / sigma);
            self.squares[i] = off[0] * off[0] + off[1] * off[1];
            cost += self.squares[i];
        }
        let drift: f64 = self.inverse_depths.iter().map(|rho| rho - 1.0).sum();
        cost += UNIT_WEIGHT * drift * drift;
        cost.is_finite().then_some(cost)
    }

    /// The normal equations at this pose and the workspace's inverse depths, where the cost was the last time.
    fn linearise(&mut self, problem: &Problem<'_>, pose: &RelativePose) {
        let Problem { goal, frame, sigma, plane, .. } = *problem;
        let r_21 = pose.r_21();
        let drift: f64 = self.inverse_depths.iter().map(|rho| rho - 1.0).sum();
        (self.pose_block, self.gradient) = (Matrix6::zeros(), Vector6::zeros());
        if let Some(plane) = &plane {
            let (residuals, jacobian) = plane_residuals(plane, pose);
            self.pose_block += jacobian.transpose() * jacobian;
            self.gradient += jacobian.transpose() * residuals;
        }
        for (i, (m1, image)) in goal.iter().zip(frame).enumerate() {
            let rho = self.inverse_depths[i];
            let pull = self.pulls[i] + UNIT_WEIGHT * drift;
            (self.mixed[i], self.diagonal[i]) = ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, pull], 0.0);
            let Some(image) = image else { continue };
            let c = r_21 * Vector3::new(m1[0], m1[1], 1.0);
            let x2 = c + pose.t_21 * rho;
            let weight = 1.0 / (x2.z * sigma);
            let u = [x2.x / x2.z, x2.y / x2.z];
            let rows = [Vector3::new(weight, 0.0, -u[0] * weight), Vector3::new(0.0, weight, -u[1] * weight)];
            for (row, off) in rows.iter().zip([u[0] - image[0], u[1] - image[1]]) {
                let off = off / sigma;
                let (by_turn, by_t, by_rho) = (c.cross(row), row * rho, row.dot(&pose.t_21));
                let j = Vector6::new(by_turn.x, by_turn.y, by_turn.z, by_t.x, by_t.y, by_t.z);
                self.pose_block.ger(1.0, &j, &j, 1.0);
                self.gradient += j * off;
                self.diagonal[i] += by_rho * by_rho;
                self.mixed[i][6] += by_rho * off;
                for (m, j) in self.mixed[i].iter_mut().zip(&j) {
                    *m += by_rho * j;
                }
            }
        }
    }

    /// The step of the pose; that of the inverse depths is left in `step`.
    fn solve(&mut self, reference: &DepthReference, damping: f64) -> Option<Vector6<f64>> {
        let (schur, gradient) = self.eliminate(reference, damping)?;
        let step = schur.cholesky()?.solve(&-gradient);
        for (out, row) in self.step.iter_mut().zip(&self.solved) {
            *out = -(row[6] + row[..6].iter().zip(&step).map(|(y, s)| y * s).sum::<f64>());
        }
        cholesky::solve_upper(&self.hessian, &mut self.step);
        step.iter().chain(&self.step).all(|s| s.is_finite()).then_some(step)
    }

    /// The covariance of the last fit's pose, the inverse depths being as uncertain as they are: of a small rotation from the
    /// left, then of t.
    pub(crate) fn covariance(&mut self, reference: &DepthReference) -> Option<Matrix6<f64>> {
        self.eliminate(reference, 0.0)?.0.cholesky().map(|schur| schur.inverse())
    }

    /// The equations of the pose once the inverse depths are eliminated.
    fn eliminate(
        &mut self,
        reference: &DepthReference,
        damping: f64,
    ) -> Option<(Matrix6<f64>, Vector6<f64>)> {
        let n = self.diagonal.len();
        for (h, w) in self.hessian.iter_mut().zip(&reference.information) {
            *h = w + UNIT_WEIGHT;
        }
        for i in 0..n {
            self.hessian[i * n + i] += self.diagonal[i] * (1.0 + damping);
        }
        if !cholesky::factor(&mut self.hessian, n) {
            return None;
        }
        self.solved.copy_from_slice(&self.mixed);
        cholesky::solve_lower(&self.hessian, &mut self.solved);
        let (mut schur, mut gradient) = (self.pose_block, self.gradient);
        for k in 0..6 {
            schur[(k, k)] += damping * self.pose_block[(k, k)];
        }
        for row in &self.solved {
            let y = Vector6::from_row_slice(&row[..6]);
            schur.ger(-1.0, &y, &y, 1.0);
            gradient -= y * row[6];
        }
        Some((schur, gradient))
    }

    /// Adds to the reference what the last fit has to say of the inverse depths, as `weight` frames.
    ///
    /// With `S` the information of the images, the pose being unknown, the fit is the minimum ρ* of
    /// `(ρ − ρ̂)ᵀ Λ (ρ − ρ̂)` and a parabola of curvature S; its gradient at ρ̂ is `(Λ + S) (ρ* − ρ̂)`. Weighted, both enter the
    /// reference: `Λ' = Λ + w S`, `ρ̂' = ρ̂ + Λ'⁻¹ w (Λ + S) (ρ* − ρ̂)`.
    pub(crate) fn update(&mut self, reference: &mut DepthReference, weight: f64) {
        let n = reference.len();
        let Some(pose_block) = self.pose_block.cholesky() else { return };
        for i in 0..n {
            self.step[i] = weight * reference.pull(i, &self.inverse_depths);
        }
        for i in 0..n {
            let row = pose_block.solve(&Vector6::from_row_slice(&self.mixed[i][..6]));
            for k in 0..n {
                let through_pose: f64 = row.iter().zip(&self.mixed[k][..6]).map(|(a, b)| a * b).sum();
                let s = weight * (if i == k { self.diagonal[i] } else { 0.0 } - through_pose);
                self.step[i] += s * (self.inverse_depths[k] - reference.inverse_depths[k]);
                self.hessian[i * n + k] = reference.information[i * n + k] + s;
            }
        }
        reference.information.copy_from_slice(&self.hessian);
        self.hessian.iter_mut().for_each(|h| *h += UNIT_WEIGHT);
        if !cholesky::factor(&mut self.hessian, n) {
            return;
        }
        for (solved, step) in self.solved.iter_mut().zip(&self.step) {
            *solved = [*step, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        }
        cholesky::solve_lower(&self.hessian, &mut self.solved);
        for (step, solved) in self.step.iter_mut().zip(&self.solved) {
            *step = solved[0];
        }
        cholesky::solve_upper(&self.hessian, &mut self.step);
        for (rho, step) in reference.inverse_depths.iter_mut().zip(&self.step) {
            *rho += step;
        }
    }
}

/// A fit on its way: a pose, and the inverse depths of the workspace.
struct Fitting<'a, 'p> {
    workspace: &'a mut Workspace,
    problem: &'a Problem<'p>,
    fitted: Fitted,
    /// Whether the last step was refused, so that the workspace's residuals are of another pose.
    is_refused: bool,
}

impl Descent for Fitting<'_, '_> {
    type Step = Vector6<f64>;

    fn step(&mut self, damping: f64) -> Option<Vector6<f64>> {
        self.workspace.steps += 1;
        self.workspace.solve(self.problem.reference, damping)
    }

    fn attempt(&mut self, step: &Vector6<f64>) -> Outcome {
        let Self { workspace, problem, fitted, .. } = self;
        let pose = moved(&fitted.pose, step);
        let kept = std::mem::take(&mut workspace.inverse_depths);
        workspace.inverse_depths = std::mem::take(&mut workspace.trial);
        for ((new, old), by) in workspace.inverse_depths.iter_mut().zip(&kept).zip(&workspace.step) {
            *new = old + by;
        }
        let new = workspace.cost(problem, &pose).filter(|new| *new <= fitted.cost);
        self.is_refused = new.is_none();
        let Some(cost) = new else {
            workspace.trial = std::mem::replace(&mut workspace.inverse_depths, kept);
            return if step.norm() < SHORT { Outcome::Over } else { Outcome::Refused };
        };
        workspace.trial = kept;
        workspace.linearise(problem, &pose);
        let change = fitted.cost - cost;
        *fitted = Fitted { pose, cost };
        if change <= SETTLED * cost + SETTLED_AT_ALL { Outcome::Over } else { Outcome::Lower }
    }
}

/// The pose after a small rotation from the left and a change of t.
fn moved(pose: &RelativePose, step: &Vector6<f64>) -> RelativePose {
    let turn = UnitQuaternion::new(Vector3::new(step[0], step[1], step[2]));
    let q_21 = UnitQuaternion::new_normalize((turn * pose.q_21).into_inner());
    RelativePose::new(q_21, pose.t_21 + Vector3::new(step[3], step[4], step[5]))
}

/// How far a pose leaves the plane, by its deviations: the tilt of the vertical to the side and ahead, the height; and their
/// derivatives.
fn plane_residuals(plane: &Plane, pose: &RelativePose) -> (Vector3<f64>, nalgebra::Matrix3x6<f64>) {
    let vertical = pose.q_21 * Vector3::y();
    let residuals =
        Vector3::new(vertical.x / plane.tilt, vertical.z / plane.tilt, pose.t_21.y / plane.height);
    // The vertical changes by turn × vertical.
    let by_turn = -vertical.cross_matrix() / plane.tilt;
    let mut jacobian = nalgebra::Matrix3x6::zeros();
    for k in 0..3 {
        jacobian[(0, k)] = by_turn[(0, k)];
        jacobian[(1, k)] = by_turn[(2, k)];
    }
    jacobian[(2, 4)] = 1.0 / plane.height;
    (residuals, jacobian)
}
