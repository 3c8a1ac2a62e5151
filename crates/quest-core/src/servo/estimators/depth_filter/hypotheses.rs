//! The answers to the first image, and what becomes of them.

use crate::RelativePose;
use crate::servo::estimators::depth_filter::fit::{Fitted, MAX_STEPS, Workspace};
use crate::servo::estimators::depth_filter::reference::DepthReference;
use crate::servo::estimators::depth_filter::setting::{Image, Setting};
use crate::servo::estimators::estimate::HoldReason;

/// How many answers to the first image are kept apart. Every one is fitted to every image, so this number bounds an image's time.
pub(super) const MAX_HYPOTHESES: usize = 8;
/// A hypothesis with so much more χ² than the best is dropped: odds of 1 to 3e6.
const HOPELESS: f64 = 30.0;
/// No single image counts for more than this: the odds of 1 to 300,000 that a false one may cost the truth.
const MOST_OF_ONE_IMAGE: f64 = 25.0;
/// Steps of a fit that serves only for comparison: a fit of a rival of the best hypothesis, or one with a feature left out. The
/// last pose is one image's motion away. Where depths and features are right, two or three steps lead from there to the minimum.
const FEW_STEPS: usize = 5;
/// Answers closer than this in rotation (radians) and in translation (units of length) are the same.
const SAME: f64 = 1e-3;
/// Two images that show the same features were taken in about the same direction: one standard deviation, in radians. It orders
/// the answers to the first image where nothing else tells them apart.
const LIKELY_TURN: f64 = 1.0;

/// One answer to the first image, and what has become of it.
#[derive(Clone, Debug)]
pub(super) struct Hypothesis {
    pub(super) reference: DepthReference,
    pub(super) pose: RelativePose,
    /// The sum of its costs.
    score: f64,
    workspace: Workspace,
    /// Its fit of the current image, which is still in its workspace.
    fitted: Option<Fitted>,
}

/// The answers that are left, the best first.
#[derive(Clone, Debug)]
pub(super) struct Hypotheses {
    /// The first `count` are alive.
    all: Vec<Hypothesis>,
    count: usize,
    /// Where a new one is made.
    spare: Hypothesis,
}

impl Hypotheses {
    /// None yet.
    pub(super) fn new(features: usize, spread: f64) -> Self {
        let empty = Hypothesis {
            reference: DepthReference::flat(features, spread),
            pose: RelativePose::identity(),
            score: 0.0,
            workspace: Workspace::new(features),
            fitted: None,
        };
        Self { all: vec![empty.clone(); MAX_HYPOTHESES], count: 0, spare: empty }
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    pub(super) fn best(&self) -> Option<&Hypothesis> {
        self.all[..self.count].first()
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    /// Leaves one hypothesis, with the goal's depths as they were given; NaN where a depth is not known. Whether there is any.
    pub(super) fn set_depths(&mut self, depths: &[f64], precisions: &[f64], spread: f64) -> bool {
        let reference = &mut self.all[0].reference;
        reference.set_flat(spread);
        let known = || depths.iter().filter(|z| !z.is_nan());
        let mean = known().map(|z| 1.0 / z).sum::<f64>() / known().count().max(1) as f64;
        if !(mean > 0.0 && mean.is_finite()) {
            return false;
        }
        let n = reference.len();
        for (i, (z, precision)) in depths.iter().zip(precisions).enumerate().take(n) {
            if !z.is_nan() {
                reference.inverse_depths[i] = 1.0 / (z * mean);
                reference.information[i * n + i] = precision.powi(-2);
            }
        }
        reference.normalise();
        (self.all[0].score, self.count) = (0.0, 1);
        true
    }

    /// Leaves the best hypothesis alone, at this pose.
    pub(super) fn leave_best(&mut self, pose: Option<RelativePose>) {
        self.count = 1;
        if let Some(pose) = pose {
            self.all[0].pose = pose;
        }
    }

    /// Fits the image by every hypothesis, and puts the best first. Features that disturb its fit are taken from the image.
    pub(super) fn follow(&mut self, setting: &Setting, image: &mut Image) -> Result<Fitted, HoldReason> {
        for k in 0..self.count {
            let fitted = self.fit(k, setting, image, if k == 0 { MAX_STEPS } else { FEW_STEPS });
            self.all[k].fitted = fitted;
            if self.count > 1 {
                let cost = fitted.map_or(f64::INFINITY, |fitted| fitted.cost);
                self.all[k].score += cost.min(MOST_OF_ONE_IMAGE);
            }
        }
        self.all[..self.count].sort_by(|a, b| a.score.total_cmp(&b.score));
        let last = self.all[0].score + HOPELESS;
        self.count = self.all[..self.count].iter().take_while(|h| h.score <= last).count();
        let fitted = self.all[0].fitted.filter(|fitted| setting.passes(fitted.cost, image.seen()));
        let fitted = fitted.or_else(|| self.leave_out(setting, image)).ok_or(HoldReason::Inconsistent)?;
        self.all[0].fitted = Some(fitted);
        Ok(fitted)
    }

    /// Fits the image by one hypothesis, from its last pose.
    fn fit(&mut self, k: usize, setting: &Setting, image: &Image, steps: usize) -> Option<Fitted> {
        let Hypothesis { reference, pose, workspace, .. } = &mut self.all[k];
        workspace.fit(&setting.problem(image, reference), *pose, &reference.inverse_depths, steps)
    }

    /// Leaves out the feature that disturbs most, until the rest passes or too little is left.
    fn leave_out(&mut self, setting: &Setting, image: &mut Image) -> Option<Fitted> {
        while image.seen() > setting.options.min_features.saturating_sub(1).max(4) {
            let mut best: Option<(f64, usize)> = None;
            for i in 0..image.frame.len() {
                let Some(feature) = image.frame[i].take() else { continue };
                if let Some(fitted) = self.fit(0, setting, image, FEW_STEPS)
                    && best.is_none_or(|(cost, _)| fitted.cost < cost)
                {
                    best = Some((fitted.cost, i));
                }
                image.frame[i] = Some(feature);
            }
            image.frame[best?.1] = None;
            let fitted = self.fit(0, setting, image, MAX_STEPS);
            if let Some(fitted) = fitted.filter(|f| setting.passes(f.cost, image.seen())) {
                for k in 1..self.count {
                    self.all[k].fitted = self.fit(k, setting, image, FEW_STEPS);
                }
                return Some(fitted);
            }
        }
        None
    }

    /// The covariance of the best hypothesis's last fit.
    pub(super) fn covariance(&mut self) -> Option<nalgebra::Matrix6<f64>> {
        let Hypothesis { workspace, reference, .. } = &mut self.all[0];
        workspace.covariance(reference)
    }

    /// The sum of the squared residuals of the best hypothesis's last fit, by the noise.
    pub(super) fn squares(&self) -> f64 {
        self.all[0].workspace.squares.iter().filter(|s| s.is_finite()).sum()
    }

    /// Takes over the poses of an image that is followed, and lets it add to the depths of every hypothesis that it fits.
    pub(super) fn learn(&mut self, setting: &Setting, image: &Image) {
        for (k, h) in self.all[..self.count].iter_mut().enumerate() {
            let Some(fitted) = h.fitted else { continue };
            h.pose = fitted.pose;
            if k == 0 || setting.passes(fitted.cost, image.seen()) {
                h.workspace.update(&mut h.reference, setting.options.frame_weight);
            }
        }
    }

    /// Fits the depths of the best hypothesis from another pose; the number of steps that took.
    pub(super) fn fit_from(
        &mut self,
        pose: RelativePose,
        setting: &Setting,
        image: &Image,
    ) -> (Option<Fitted>, usize) {
        let reference = &self.all[0].reference;
        let problem = setting.problem(image, reference);
        let workspace = &mut self.spare.workspace;
        let fitted = workspace.fit(&problem, pose, &reference.inverse_depths, MAX_STEPS);
        (fitted, workspace.steps)
    }

    /// Adds the hypothesis that is found from this pose and these inverse depths, unless it explains nothing or is there already;
    /// the number of steps that took.
    pub(super) fn adopt(
        &mut self,
        pose: RelativePose,
        inverse_depths: &[f64],
        setting: &Setting,
        image: &Image,
    ) -> usize {
        let Hypothesis { reference, workspace, .. } = &mut self.spare;
        reference.set_flat(setting.options.spread);
        let fitted = workspace.fit(&setting.problem(image, reference), pose, inverse_depths, MAX_STEPS);
        let steps = workspace.steps;
        let Some(fitted) = fitted else { return steps };
        let same = |h: &Hypothesis| {
            h.pose.rotation_error(&fitted.pose) < SAME && (h.pose.t_21 - fitted.pose.t_21).norm() < SAME
        };
        let is_known = self.all[..self.count].iter().any(same);
        // The depths are not known yet: each may be off by its spread.
        let depths = setting.goal.len() as f64;
        if is_known || !setting.passes(fitted.cost - depths, image.seen()) || self.count == MAX_HYPOTHESES {
            return steps;
        }
        workspace.update(reference, 1.0);
        let turn = fitted.pose.q_21.angle() / LIKELY_TURN;
        (self.spare.score, self.spare.pose) = (fitted.cost + turn * turn, fitted.pose);
        std::mem::swap(&mut self.spare, &mut self.all[self.count]);
        self.count += 1;
        steps
    }

    /// The first image of a search counts for no more than any other.
    pub(super) fn bound_scores(&mut self) {
        for h in &mut self.all[..self.count] {
            h.score = h.score.min(MOST_OF_ONE_IMAGE);
        }
    }
}
