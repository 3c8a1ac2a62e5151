//! The pose of section 10: one of the candidates of each image, chosen by a rule.
//!
//! It is here for comparison. Under noise the candidates of one image differ more from the truth than from one another, and near
//! the goal their depths are noise. [`DepthFilter`](crate::servo::DepthFilter) keeps what it has learnt from earlier images.

use nalgebra::{Matrix3, Vector3};

use crate::servo::estimators::estimate::{Estimate, HoldReason, PoseEstimator, Support};
use crate::servo::estimators::source::PoseSource;
use crate::{Candidate, Candidates, Correspondence, RelativePose};

/// Which of the candidates of an image is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Choice {
    /// The candidate whose depths at the goal, scaled to the same sum, are closest to the reference (section 10.1).
    ClosestDepths,
    /// The candidate whose rotation explains the image best with the reference's depths.
    Reprojection,
    /// The candidate that leaves the plane of a robot least (section 10.2).
    RotationAxis,
}

/// The length of the translation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Length {
    /// In the unit of the goal's depths: it goes to zero at the goal.
    #[default]
    GoalDepths,
    /// In the unit of the mean depth over both views, which changes as the camera moves.
    BothViews,
    /// Always one: what an essential matrix tells.
    Unit,
}

/// A candidate chosen anew in each image.
#[derive(Clone, Debug)]
pub struct PerFrame<S> {
    goal: Vec<[f64; 2]>,
    source: S,
    choice: Choice,
    length: Length,
    /// The goal's depths, their harmonic mean 1.
    reference: Option<Vec<f64>>,
    depths: Vec<f64>,
    seen: Vec<usize>,
    matches: Vec<Correspondence>,
    candidates: Candidates,
}

impl<S: PoseSource> PerFrame<S> {
    /// The estimator for this goal image, its features on the plane z = 1. Without depths given by
    /// [`set_depths`](Self::set_depths) the first image decides them.
    #[must_use]
    pub fn new(goal: &[[f64; 2]], source: S, choice: Choice, length: Length) -> Self {
        let n = goal.len();
        Self {
            goal: goal.to_vec(),
            source,
            choice,
            length,
            reference: None,
            depths: vec![0.0; n],
            seen: Vec::with_capacity(n),
            matches: Vec::with_capacity(n),
            candidates: Candidates::new(),
        }
    }

    /// The depths of the features at the goal, one each, in any unit.
    pub fn set_depths(&mut self, depths: &[f64]) {
        let mean = depths.iter().map(|z| 1.0 / z).sum::<f64>() / depths.len() as f64;
        self.reference = Some(depths.iter().map(|z| z * mean).collect());
    }

    /// How far a candidate is from what the rule asks for, and its pose in the unit asked for.
    fn judge(&mut self, candidate: &Candidate) -> Option<(f64, RelativePose)> {
        let pose = candidate.pose;
        for (z, m) in self.depths.iter_mut().zip(&self.matches) {
            *z = candidate.depths(m)?.0;
        }
        let depths = &self.depths[..self.matches.len()];
        let sum: f64 = depths.iter().sum();
        // Without a reference yet: the most even depths.
        let wanted = |k: usize| self.reference.as_ref().map_or(1.0, |reference| reference[self.seen[k]]);
        let wanted_sum: f64 = (0..depths.len()).map(wanted).sum();
        let scale = wanted_sum / sum;
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        let scaled = RelativePose::new(pose.q_21, pose.t_21 * scale);
        let off = match self.choice {
            Choice::ClosestDepths => {
                let off = |(k, z): (usize, &f64)| (z / sum - wanted(k) / wanted_sum).powi(2);
                depths.iter().enumerate().map(off).sum()
            }
            Choice::Reprojection => self.reprojection(&pose, &wanted),
            Choice::RotationAxis => {
                let behind = self.matches.len() - candidate.in_front;
                let height = pose.t_21.y / pose.t_21.norm();
                (pose.q_21 * Vector3::y() - Vector3::y()).norm_squared() + height * height + behind as f64
            }
        };
        let pose = match self.length {
            Length::GoalDepths => scaled,
            Length::BothViews => pose,
            Length::Unit => RelativePose::new(pose.q_21, pose.t_21.try_normalize(0.0)?),
        };
        Some((off, pose))
    }

    /// The sum of squared reprojection errors with the reference's depths and the translation that fits them best.
    fn reprojection(&self, pose: &RelativePose, wanted: &impl Fn(usize) -> f64) -> f64 {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let r_21 = pose.r_21();
        let point1 = |k: usize| {
            let m = &self.goal[self.seen[k]];
            r_21 * Vector3::new(m[0], m[1], 1.0)
        };
        for (k, m) in self.matches.iter().enumerate() {
            // b × (R m1 + t / z) = 0
            let (cross, rho) = (m.bearing2().cross_matrix(), 1.0 / wanted(k));
            normal += cross.transpose() * cross * (rho * rho);
            right -= cross.transpose() * m.bearing2().cross(&point1(k)) * rho;
        }
        let Some(t_21) = normal.cholesky().map(|l| l.solve(&right)) else { return f64::INFINITY };
        let error = |(k, m): (usize, &Correspondence)| {
            let x2 = point1(k) + t_21 / wanted(k);
            let b = m.bearing2() / m.bearing2().z;
            if x2.z > 0.0 { (x2 / x2.z - b).norm_squared() } else { f64::INFINITY }
        };
        self.matches.iter().enumerate().map(error).sum()
    }
}

impl<S: PoseSource> PoseEstimator for PerFrame<S> {
    fn estimate(&mut self, features: &[Option<[f64; 2]>]) -> Result<Estimate, HoldReason> {
        self.matches.clear();
        self.seen.clear();
        for (k, (goal, image)) in self.goal.iter().zip(features).enumerate() {
            let Some(image) = image else { continue };
            if let Ok(m) = Correspondence::from_image_points(*goal, *image) {
                self.matches.push(m);
                self.seen.push(k);
            }
        }
        if self.matches.len() < self.source.min_matches() {
            return Err(HoldReason::TooFewFeatures);
        }
        self.source.candidates(&self.matches, &mut self.candidates);
        let mut best: Option<(f64, RelativePose, Candidate)> = None;
        for k in 0..self.candidates.len() {
            let candidate = self.candidates[k];
            if let Some((off, pose)) = self.judge(&candidate)
                && best.is_none_or(|(smallest, ..)| off < smallest)
            {
                best = Some((off, pose, candidate));
            }
        }
        let (_, pose, candidate) = best.ok_or(HoldReason::Degenerate)?;
        if self.reference.is_none() && self.matches.len() == self.goal.len() {
            let depths: Option<Vec<f64>> =
                self.matches.iter().map(|m| candidate.depths(m).map(|(z1, _)| z1)).collect();
            if let Some(depths) = depths {
                self.set_depths(&depths);
            }
        }
        Ok(Estimate {
            pose,
            covariance: None,
            inliers: self.matches.len(),
            residual: candidate.residual,
            alternatives: 1,
            support: Support::Full,
        })
    }
}
