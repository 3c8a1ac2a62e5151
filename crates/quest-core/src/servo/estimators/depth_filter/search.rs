//! Where the filter's hypotheses come from: the candidates of one image, over several images.
//!
//! An image has up to 25 candidates, and a fit from one of them takes as long as several steps of the loop. The camera stands still
//! meanwhile, so that the image is as good as a later one.

use nalgebra::Vector3;

use crate::servo::estimators::depth_filter::fit::Fitted;
use crate::servo::estimators::depth_filter::hypotheses::Hypotheses;
use crate::servo::estimators::depth_filter::setting::{Image, Setting};
use crate::servo::estimators::estimate::HoldReason;
use crate::servo::estimators::source::PoseSource;
use crate::{Candidate, CandidateKind, Candidates, Correspondence, RelativePose};

/// No further fit is begun once the fits of an image have taken this many steps: about two fits from candidates, of seven steps each.
const STEPS_AN_IMAGE: usize = 16;
/// The solve takes about as long as this many steps.
const STEPS_OF_A_SOLVE: usize = 10;

/// A search among the candidates of one image.
#[derive(Clone, Debug)]
pub(super) struct Search {
    stage: Stage,
    /// The candidate that is next.
    next: usize,
    image: Image,
    matches: Vec<Correspondence>,
    candidates: Candidates,
    /// The best fit with the old depths.
    best: Option<Fitted>,
    /// The inverse depths of a candidate.
    proposed: Vec<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// There is nothing to search.
    Idle,
    /// The candidates' poses with the depths of the best hypothesis.
    OldDepths,
    /// The candidates with their own depths.
    OwnDepths,
}

impl Search {
    pub(super) fn new(features: usize) -> Self {
        Self {
            stage: Stage::Idle,
            next: 0,
            image: Image::new(features),
            matches: Vec::with_capacity(features),
            candidates: Candidates::new(),
            best: None,
            proposed: vec![1.0; features],
        }
    }

    pub(super) fn is_running(&self) -> bool {
        self.stage != Stage::Idle
    }

    pub(super) fn stop(&mut self) {
        self.stage = Stage::Idle;
    }

    /// Begins with the candidates of an image. Where there is a hypothesis its depths are tried first.
    pub(super) fn begin(
        &mut self,
        image: &Image,
        source: &mut impl PoseSource,
        setting: &Setting,
        has_depths: bool,
    ) -> Result<(), HoldReason> {
        self.matches.clear();
        for (goal, image) in setting.goal.iter().zip(&image.frame) {
            let Some(image) = image else { continue };
            if let Ok(m) = Correspondence::from_image_points(*goal, *image) {
                self.matches.push(m);
            }
        }
        if self.matches.len() < source.min_matches() {
            return Err(HoldReason::TooFewFeatures);
        }
        source.candidates(&self.matches, &mut self.candidates);
        if self.candidates.is_empty() {
            return Err(HoldReason::Degenerate);
        }
        self.image.frame.copy_from_slice(&image.frame);
        self.image.sigma = image.sigma;
        (self.next, self.best) = (0, None);
        self.stage = if has_depths { Stage::OldDepths } else { Stage::OwnDepths };
        Ok(())
    }

    /// Goes on for as long as one image may take. A search that is new has taken the time of its solve already.
    pub(super) fn go_on(
        &mut self,
        hypotheses: &mut Hypotheses,
        setting: &Setting,
        is_new: bool,
    ) -> Result<(), HoldReason> {
        let mut steps = if is_new { STEPS_OF_A_SOLVE } else { 0 };
        while self.is_running() && steps < STEPS_AN_IMAGE {
            let next = self.next;
            self.next += 1;
            match (self.stage, next < self.candidates.len()) {
                (Stage::OldDepths, true) => steps += self.try_old_depths(next, hypotheses, setting),
                (Stage::OldDepths, false) => self.end_with_old_depths(hypotheses, setting),
                (_, true) => steps += self.try_own_depths(next, hypotheses, setting),
                (_, false) => {
                    self.stop();
                    hypotheses.bound_scores();
                    return if hypotheses.len() == 0 { Err(HoldReason::Inconsistent) } else { Ok(()) };
                }
            }
        }
        Ok(())
    }

    /// Fits the old depths from a candidate's pose; the number of steps that took.
    fn try_old_depths(&mut self, candidate: usize, hypotheses: &mut Hypotheses, setting: &Setting) -> usize {
        let (fitted, steps) = hypotheses.fit_from(self.candidates[candidate].pose, setting, &self.image);
        if let Some(fitted) = fitted
            && self.best.is_none_or(|best| fitted.cost < best.cost)
        {
            self.best = Some(fitted);
        }
        steps
    }

    /// The pose that explains the image best with the old depths, if one does. Otherwise the candidates have to bring their own.
    fn end_with_old_depths(&mut self, hypotheses: &mut Hypotheses, setting: &Setting) {
        hypotheses.leave_best(self.best.map(|fitted| fitted.pose));
        self.stop();
        let Some(fitted) = self.best else { return };
        if !setting.passes(fitted.cost, self.image.seen()) {
            (self.stage, self.next) = (Stage::OwnDepths, 0);
        }
    }

    /// Makes a hypothesis of a candidate; the number of steps that took.
    fn try_own_depths(&mut self, candidate: usize, hypotheses: &mut Hypotheses, setting: &Setting) -> usize {
        let Candidate { kind, pose, .. } = self.candidates[candidate];
        match self.propose(&pose, kind == CandidateKind::RotationOnly) {
            Some(pose) => hypotheses.adopt(pose, &self.proposed, setting, &self.image),
            None => 0,
        }
    }

    /// The inverse depths of a candidate, left in `proposed`, and its pose in their unit, where it is not absurd.
    fn propose(&mut self, candidate: &RelativePose, is_rotation: bool) -> Option<RelativePose> {
        if is_rotation {
            self.proposed.fill(1.0);
            return Some(RelativePose::new(candidate.q_21, Vector3::zeros()));
        }
        let (mut sum, mut behind) = (0.0, 0);
        for m in &self.matches {
            let depths = candidate.depths(m);
            sum += depths.map_or(0.0, |(z1, _)| 1.0 / z1);
            behind += usize::from(depths.is_some_and(|(z1, z2)| z1 <= 0.0 || z2 <= 0.0));
        }
        let mean = sum / self.matches.len() as f64;
        if behind * 4 > self.matches.len() || mean <= 0.0 || !mean.is_finite() {
            return None;
        }
        let mut matches = self.matches.iter();
        for (rho, image) in self.proposed.iter_mut().zip(&self.image.frame) {
            // A feature that is not seen is as far as the others.
            let depths = image.and_then(|_| matches.next()).map(|m| candidate.depths(m));
            *rho = depths.map_or(1.0, |depths| depths.map_or(0.0, |(z1, _)| 1.0 / (z1 * mean)));
        }
        Some(RelativePose::new(candidate.q_21, candidate.t_21 * mean))
    }
}
