//! The matches that an estimate is made from, and what it says of the others: one match a keypoint, and a group that did not move
//! set aside.

use nalgebra::Vector3;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::{Estimate, EstimateError, MIN_MATCHES, Options, Priors, RunnerUp, no_pose};
use crate::robust::conclude::{self, Answer, false_alarms};
use crate::robust::data::columns::Residuals;
use crate::robust::data::keypoints::Keypoints;
use crate::robust::data::observations::Observations;
use crate::robust::search::crowds::{Crowds, explains_clearly_more};
use crate::robust::search::pose_score::PoseScorer;
use crate::robust::search::search_score::{MANY, REACH};
use crate::robust::search::{Draws, IsChance, Limits, Search, SearchResult, hypotheses, sampling};
use crate::solver::shared::motion::Motion;
use crate::{Correspondence, InputError, RelativePose};

/// Fewer matches than this that did not move are no group.
const LEAST_UNMOVED: usize = 8;

/// A bearing has not moved where it is the same to this: rounding.
const UNMOVED: f64 = 1e-12;

/// The confidence of the search beside a crowd, at most. With 0.9999 it takes twice as long, and as many planted scenes are right.
const CONFIDENCE: f64 = 0.99;

/// What an estimate is made of.
pub(crate) struct Task<'a> {
    pub(crate) matches: &'a [Correspondence],
    pub(crate) options: &'a Options,
    pub(crate) priors: &'a Priors<'a>,
    pub(crate) answer: Answer,
    pub(crate) is_cancelled: &'a (dyn Fn() -> bool + Sync),
}

impl Task<'_> {
    /// The estimate. Matches that did not move at all while the others did, as dirt on the lens, an overlay or hot pixels
    /// make them, fit a camera at rest without any error, and would win although they are fewer: the others are asked
    /// first, and are right where they agree with a pose at least as often.
    pub(crate) fn run(&self) -> Result<Estimate, EstimateError> {
        let mut rng = sampling::generator(self.options.seed, self.options.index);
        let mut order: Vec<u32> = (0..).take(self.matches.len()).collect();
        order.shuffle(&mut rng);
        let keypoints = Some(Keypoints::new(self.matches)).filter(Keypoints::are_shared);
        let needed = self.options.solver.info().min_matches.max(MIN_MATCHES);
        let is_unmoved = |m: &Correspondence| (m.bearing1() - m.bearing2()).norm() < UNMOVED;
        let unmoved = self.matches.iter().filter(|m| is_unmoved(m)).count();
        let mut second = None;
        if unmoved >= LEAST_UNMOVED && order.len() - unmoved >= needed {
            let is_moved = |&i: &u32| !is_unmoved(&self.matches[i as usize]);
            let moved = order.iter().copied().filter(is_moved).collect();
            let found = self.of(moved, keypoints.as_ref(), rng.clone());
            let found = found.ok().filter(|found| !self.explains_most(&found.pose, is_unmoved));
            match found {
                Some(found) if found.inlier_count >= unmoved => return Ok(Estimate { unmoved, ..found }),
                found => second = found,
            }
        }
        let mut found = self.of(order, keypoints.as_ref(), rng)?;
        if let Some(Estimate { pose, score, inlier_count, .. }) = second {
            found.runner_up = Some(RunnerUp { pose, score, inlier_count });
        }
        Ok(found)
    }

    /// The estimate from some of the matches, in random order; `keypoints` where some are shared.
    fn of(
        &self,
        order: Vec<u32>,
        keypoints: Option<&Keypoints>,
        mut rng: ChaCha8Rng,
    ) -> Result<Estimate, EstimateError> {
        let Self { matches, options, priors, answer, is_cancelled } = *self;
        let of = |order| Observations::new(matches, order, options.focal_lengths, options.threshold);
        let needed = options.solver.info().min_matches.max(MIN_MATCHES);
        if order.len() < needed {
            return Err(InputError::TooFewMatches { found: order.len(), needed }.into());
        }
        let score = |i: usize| priors.scores.map_or(0.0, |scores| -scores[i]);
        // Where each keypoint once leaves too little all are kept, and what is wrong with them is found as ever.
        let one_each = keypoints
            .map(|keypoints| (keypoints, keypoints.one_each(&order, score)))
            .filter(|(_, one_each)| one_each.len() >= needed && one_each.len() < order.len());
        let (searched, shared) = match one_each {
            Some((keypoints, one_each)) => (one_each, Some((keypoints, order))),
            None => (order, None),
        };
        let observations = of(searched);
        let (mut poses, found) = self.search(&observations, &rng);
        let found = found.map(|found| self.search_beside_crowds(&mut poses, found, &rng));
        if is_cancelled() {
            return Err(EstimateError::Cancelled);
        }
        let found = found.ok_or_else(|| match priors.direction {
            Some(direction) => direction.refuse(None),
            None => no_pose(&observations, 0, 0.0),
        })?;
        let Some((keypoints, order)) = shared else {
            return conclude::conclude(&mut poses, &found, None, answer, options.max_false_alarms, &mut rng);
        };
        // One of the matches that share a keypoint is kept: the one that agrees best.
        let all = of(order);
        let nearest = nearest(&all, &found.best.motion);
        let best_each = of(keypoints.one_each(&all.order, |i| nearest[i]));
        let mut poses = PoseScorer::new(&best_each, options.loss);
        let blind = Some(&observations);
        let mut found =
            conclude::conclude(&mut poses, &found, blind, answer, options.max_false_alarms, &mut rng)?;
        keypoints.mark_copies(&mut found.inliers);
        found.inlier_count = found.inliers.iter().filter(|is| **is).count();
        Ok(found)
    }

    /// Steps 1 and 2: the best pose that samples lead to.
    fn search<'b>(
        &self,
        observations: &'b Observations,
        rng: &ChaCha8Rng,
    ) -> (PoseScorer<'b>, Option<SearchResult>) {
        let Self { options, priors, .. } = *self;
        let mut search = Search::new(observations, options, priors.direction);
        if let Some(pose) = priors.pose
            && let Some(direction) = pose.t_21.try_normalize(0.0)
        {
            search.consider_pose(Motion { q_21: pose.q_21, direction });
        }
        let mut false_matches = None;
        let is_chance = &mut |pose: &_, tries| {
            let false_matches =
                false_matches.get_or_insert_with(|| false_alarms::false_matches(observations));
            false_alarms::log_false_alarms(pose, tries, false_matches) > 0.0
        };
        self.draw(&mut search, &self.limits(), rng, is_chance);
        search.into_result()
    }

    /// What was found, unless much of it is a crowd: then matches are left out until none crowd, and if another pose explains clearly
    /// more of those that are left, it is that pose.
    fn search_beside_crowds(
        &self,
        poses: &mut PoseScorer,
        found: SearchResult,
        rng: &ChaCha8Rng,
    ) -> SearchResult {
        let Self { matches, options, priors, .. } = *self;
        if poses.observations.len() < MANY {
            return found;
        }
        let crowds = Crowds::new(poses.observations);
        let pose = poses.score(found.best.motion, options.threshold);
        let is_crowd = crowds.hold(&pose.inliers);
        poses.recycle(pose);
        if !is_crowd {
            return found;
        }
        let others = crowds.others(poses.observations);
        if others.len() < MANY {
            return found;
        }
        let spread = Observations::new(matches, others, options.focal_lengths, options.threshold);
        let mut search = Search::new(&spread, options, priors.direction);
        search.know(found.best.motion);
        // There is a pose already: no sample has to be drawn, and chance is asked once the best is known.
        let limits = Limits {
            confidence: options.confidence.min(CONFIDENCE),
            min_iterations: 0,
            max_iterations: options.max_iterations.saturating_sub(found.iterations),
            ..self.limits()
        };
        self.draw(&mut search, &limits, rng, &mut |_, _| false);
        let (mut poses, Some(other)) = search.into_result() else { return found };
        let [pose, known] = [&other, &found].map(|found| poses.score(found.best.motion, options.threshold));
        let (iterations, tries) = (found.iterations + other.iterations, found.tries + other.tries);
        if explains_clearly_more(&pose, &known) {
            SearchResult { iterations, tries, ..other }
        } else {
            SearchResult { iterations, ..found }
        }
    }

    /// The limits of the search that the options set.
    fn limits(&self) -> Limits<'_> {
        let Options { confidence, min_iterations, max_iterations, .. } = *self.options;
        Limits { confidence, min_iterations, max_iterations, is_cancelled: self.is_cancelled }
    }

    /// Draws samples of the matches of a search.
    fn draw(&self, search: &mut Search, limits: &Limits, rng: &ChaCha8Rng, is_chance: &mut IsChance) {
        let solver = self.options.solver;
        let mut source = hypotheses::of_solver(solver, search.observations.len());
        let size = solver.info().min_matches;
        let draws = Draws { rng: rng.clone(), size, given: self.priors.ranked(search.observations) };
        search.run(source.as_mut(), draws, limits, is_chance);
    }

    /// Whether a pose has most of the matches that did not move within the threshold.
    fn explains_most(&self, pose: &RelativePose, is_unmoved: impl Fn(&Correspondence) -> bool) -> bool {
        let all = (0_u32..).zip(self.matches);
        let order: Vec<u32> = all.filter(|(_, m)| is_unmoved(m)).map(|(i, _)| i).collect();
        let count = order.len();
        let all = Observations::new(self.matches, order, self.options.focal_lengths, self.options.threshold);
        let direction = pose.t_21.try_normalize(0.0).unwrap_or_else(Vector3::x);
        let motion = Motion { q_21: pose.q_21, direction };
        2 * all.columns.agreeing(&motion, self.options.threshold).len() > count
    }
}

/// How far each match, by its number, is from a motion: infinitely where it is out of reach or behind a camera.
fn nearest(all: &Observations, motion: &Motion) -> Vec<f64> {
    let mut residuals = Residuals::default();
    all.columns.residuals(&motion.essential(), motion, &mut residuals);
    let reach = REACH * all.columns.threshold();
    let mut nearest = vec![f64::INFINITY; all.given.len()];
    for (place, (&index, r)) in all.order.iter().zip(&residuals.values).enumerate() {
        if r.abs() < reach && residuals.is_in_front(place, 0) {
            nearest[index as usize] = r.abs();
        }
    }
    nearest
}
