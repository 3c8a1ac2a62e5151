//! Where the filter's hypotheses come from: the candidates of one image, over several images.
//!
//! An image has up to 25 candidates, and a fit from one of them takes as long as several steps of the loop. The camera stands still
//! meanwhile, so that the image is as good as a later one.

use nalgebra::Vector3;

use crate::servo::estimators::depth_filter::fit::{Fitted, MAX_STEPS, Problem};
use crate::servo::estimators::depth_filter::{DepthFilter, Hypothesis, MAX_HYPOTHESES, MOST_OF_ONE_IMAGE};
use crate::servo::estimators::estimate::HoldReason;
use crate::servo::estimators::source::PoseSource;
use crate::{Candidate, CandidateKind, Correspondence, RelativePose};

/// With so many steps of fits in an image no further fit is begun.
const STEPS_AN_IMAGE: usize = 16;
/// The candidates take as long as about so many steps.
const STEPS_OF_A_SOLVE: usize = 10;
/// Two images that show the same features were taken in about the same direction: one standard deviation, in radians. It orders
/// the answers to the first image where nothing else tells them apart.
const LIKELY_TURN: f64 = 1.0;

/// A search among the candidates of one image.
#[derive(Clone, Debug)]
pub(crate) struct Search {
    stage: Stage,
    /// The candidate that is next.
    next: usize,
    /// The image, and the noise of its difference from the goal.
    frame: Vec<Option<[f64; 2]>>,
    sigma: f64,
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
    pub(crate) fn new(features: usize) -> Self {
        Self {
            stage: Stage::Idle,
            next: 0,
            frame: vec![None; features],
            sigma: 0.0,
            best: None,
            proposed: vec![1.0; features],
        }
    }

    pub(crate) fn is_running(&self) -> bool {
        self.stage != Stage::Idle
    }
}

impl<S: PoseSource> DepthFilter<S> {
    /// Begins a search or goes on with it, for as long as one image may take.
    pub(crate) fn go_on_searching(&mut self) -> Result<(), HoldReason> {
        let mut steps = 0;
        if self.search.is_running() {
            self.frame.copy_from_slice(&self.search.frame);
            self.sigma = self.search.sigma;
        } else {
            self.begin_search()?;
            steps = STEPS_OF_A_SOLVE;
        }
        while self.search.is_running() && steps < STEPS_AN_IMAGE {
            let next = self.search.next;
            self.search.next += 1;
            match (self.search.stage, next < self.candidates.len()) {
                (Stage::OldDepths, true) => steps += self.try_old_depths(next),
                (Stage::OldDepths, false) => self.end_with_old_depths(),
                (_, true) => steps += self.try_own_depths(next),
                (_, false) => return self.end_with_own_depths(),
            }
        }
        Ok(())
    }

    /// The first search takes the mean of the first images, a later one the current image.
    fn begin_search(&mut self) -> Result<(), HoldReason> {
        let mut images = 1;
        if self.count == 0 {
            images = self.options.first_images;
            let reach = self.options.gate * self.options.noise;
            if !self.first_images.average(&mut self.frame, reach) {
                return Err(HoldReason::Starting);
            }
            if self.seen() < self.options.min_features {
                return Err(HoldReason::TooFewFeatures);
            }
        }
        self.sigma = self.sigma_of_mean(images);
        self.solve()?;
        self.search.frame.copy_from_slice(&self.frame);
        (self.search.sigma, self.search.next, self.search.best) = (self.sigma, 0, None);
        self.search.stage = if self.count == 0 { Stage::OwnDepths } else { Stage::OldDepths };
        Ok(())
    }

    /// The candidates of this image.
    fn solve(&mut self) -> Result<(), HoldReason> {
        self.matches.clear();
        for (goal, image) in self.goal.iter().zip(&self.frame) {
            let Some(image) = image else { continue };
            if let Ok(m) = Correspondence::from_image_points(*goal, *image) {
                self.matches.push(m);
            }
        }
        if self.matches.len() < self.source.min_matches() {
            return Err(HoldReason::TooFewFeatures);
        }
        self.source.candidates(&self.matches, &mut self.candidates);
        if self.candidates.is_empty() { Err(HoldReason::Degenerate) } else { Ok(()) }
    }

    /// Fits the old depths from a candidate's pose; the number of steps that took.
    fn try_old_depths(&mut self, candidate: usize) -> usize {
        let reference = &self.hypotheses[0].reference;
        let problem = Problem {
            goal: &self.goal,
            frame: &self.frame,
            reference,
            sigma: self.sigma,
            plane: self.options.plane,
        };
        let workspace = &mut self.spare.workspace;
        let pose = self.candidates[candidate].pose;
        let fitted = workspace.fit(&problem, pose, &reference.inverse_depths, MAX_STEPS);
        if let Some(fitted) = fitted
            && self.search.best.is_none_or(|best| fitted.cost < best.cost)
        {
            self.search.best = Some(fitted);
        }
        workspace.steps
    }

    /// The pose that explains the image best with the old depths, if one does. Otherwise the candidates have to bring their own.
    fn end_with_old_depths(&mut self) {
        self.count = 1;
        self.search.stage = Stage::Idle;
        let Some(fitted) = self.search.best else { return };
        self.hypotheses[0].pose = fitted.pose;
        if !self.passes(fitted.cost, self.seen()) {
            (self.search.stage, self.search.next) = (Stage::OwnDepths, 0);
        }
    }

    /// Makes a hypothesis of a candidate; the number of steps that took.
    fn try_own_depths(&mut self, candidate: usize) -> usize {
        let Candidate { kind, pose, .. } = self.candidates[candidate];
        match self.propose(&pose, kind == CandidateKind::RotationOnly) {
            Some(pose) => self.adopt(pose),
            None => 0,
        }
    }

    fn end_with_own_depths(&mut self) -> Result<(), HoldReason> {
        self.search.stage = Stage::Idle;
        for h in &mut self.hypotheses[..self.count] {
            h.score = h.score.min(MOST_OF_ONE_IMAGE);
        }
        if self.count == 0 { Err(HoldReason::Inconsistent) } else { Ok(()) }
    }

    /// The inverse depths of a candidate, left in `search.proposed`, and its pose in their unit, where it is not absurd.
    fn propose(&mut self, candidate: &RelativePose, is_rotation: bool) -> Option<RelativePose> {
        if is_rotation {
            self.search.proposed.fill(1.0);
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
        for (rho, image) in self.search.proposed.iter_mut().zip(&self.frame) {
            // A feature that is not seen is as far as the others.
            let depths = image.and_then(|_| matches.next()).map(|m| candidate.depths(m));
            *rho = depths.map_or(1.0, |depths| depths.map_or(0.0, |(z1, _)| 1.0 / (z1 * mean)));
        }
        Some(RelativePose::new(candidate.q_21, candidate.t_21 * mean))
    }

    /// Adds the hypothesis that is found from this pose and the proposed inverse depths, unless it explains nothing or is
    /// there already; the number of steps that took.
    fn adopt(&mut self, pose: RelativePose) -> usize {
        let Hypothesis { reference, workspace, .. } = &mut self.spare;
        reference.set_flat(self.options.spread);
        let problem = Problem {
            goal: &self.goal,
            frame: &self.frame,
            reference,
            sigma: self.sigma,
            plane: self.options.plane,
        };
        let fitted = workspace.fit(&problem, pose, &self.search.proposed, MAX_STEPS);
        let steps = workspace.steps;
        let Some(fitted) = fitted else { return steps };
        let same = |h: &Hypothesis| {
            h.pose.rotation_error(&fitted.pose) < 1e-3 && (h.pose.t_21 - fitted.pose.t_21).norm() < 1e-3
        };
        let is_known = self.hypotheses[..self.count].iter().any(same);
        // The depths are not known yet: each may be off by its spread.
        let depths = self.goal.len() as f64;
        if is_known || !self.passes(fitted.cost - depths, self.seen()) || self.count == MAX_HYPOTHESES {
            return steps;
        }
        let Hypothesis { reference, workspace, .. } = &mut self.spare;
        workspace.update(reference, 1.0);
        let turn = fitted.pose.q_21.angle() / LIKELY_TURN;
        (self.spare.score, self.spare.pose) = (fitted.cost + turn * turn, fitted.pose);
        std::mem::swap(&mut self.spare, &mut self.hypotheses[self.count]);
        self.count += 1;
        steps
    }
}
