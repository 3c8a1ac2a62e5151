//! An image on the maps of all hypotheses: their poses, their scores, and whether the best may be acted on.

use nalgebra::{UnitQuaternion, Vector3};

use crate::RelativePose;
use crate::servo::estimators::estimate::{Estimate, HoldReason, Motion, PoseEstimator, Support};
use crate::servo::estimators::source::PoseSource;
use crate::servo::estimators::tracker::hypothesis::Hypothesis;
use crate::servo::estimators::tracker::resection::{INLIER, Task, resect, residuals};
use crate::servo::estimators::tracker::{
    DULL, NEXT_TO_GOAL, Phase, RISEN, Tracker, VERY_FEW, most_inadequate,
};

/// No image counts for more than this: the odds of 1 to 300,000 that a false one may cost the truth.
const MOST_OF_ONE_IMAGE: f64 = 25.0;
/// A hypothesis with so much more than the best is dropped: odds of 1 to 3e6.
const HOPELESS: f64 = 30.0;
/// At least this share of the features that are trusted has to agree.
const TRUSTED_SHARE: f64 = 2.0 / 3.0;
/// And this share of all that are seen.
const SEEN_SHARE: f64 = 0.5;
/// Features that are on the map count alone where there are so many of them.
const ENOUGH_MAPPED: usize = 12;
/// After so many images in which the lone hypothesis contradicts the commands the estimator begins anew.
const CONTRADICTED: usize = 5;
/// The mean squared residual of the inliers may rise to so many times its least, two at the lowest, for so many images in a row.
const WORSE: f64 = 2.2;
const WORSE_IMAGES: usize = 8;
/// A camera that was not told to go further than this since the last image stands still, and its image weighs so much.
const STANDING: f64 = 2e-4;
const STANDING_WEIGHT: f64 = 0.05;
/// A standing camera waits so many times longer before it begins anew: it would see the same again.
const PATIENT: usize = 5;
/// Closer to the goal than this no motion has to be confirmed: what is left is too short for that.
const CLOSE: f64 = 0.01;

impl<S: PoseSource> Tracker<S> {
    /// Fits the image by every hypothesis, adds up their costs, and puts the best first.
    pub(super) fn follow(&mut self) -> Result<(), HoldReason> {
        let task = self.task();
        for k in 0..self.count {
            self.fit(k, &task);
        }
        if self.count > 1 {
            self.score();
        }
        let fit = self.hypotheses[0].fit.ok_or(HoldReason::Degenerate)?;
        for (i, square) in self.hypotheses[0].squares.iter().enumerate() {
            self.inliers[i] = *square < INLIER;
            if !square.is_nan() {
                // About ten images.
                self.trust[i] += 0.1 * (f64::from(u8::from(self.inliers[i])) - self.trust[i]);
            }
        }
        self.compare_with_best();
        if fit.inliers < self.least_inliers() && fit.seen < self.least_inliers() {
            return Err(HoldReason::TooFewFeatures);
        }
        Ok(())
    }

    /// Whether the map explains the images worse than it once did: wrong depths fit where they were learnt, and nowhere else.
    fn compare_with_best(&mut self) {
        let inliers = self.hypotheses[0].squares.iter().filter(|s| **s < INLIER);
        let (sum, count) = inliers.fold((0.0, 0usize), |(sum, count), s| (sum + s, count + 1));
        if count < VERY_FEW || self.phase != Phase::Mapped {
            return;
        }
        let mean = (sum / count as f64).max(2.0);
        self.best_mean = self.best_mean.min(mean);
        self.worse = if mean > WORSE * self.best_mean { self.worse + 1 } else { 0 };
    }

    /// Fits the image on one map. The fit begins where the camera was or where it was sent, whichever explains the image better.
    fn fit(&mut self, k: usize, task: &Task) {
        let h = &mut self.hypotheses[k];
        let mapped = h.map.points.iter().zip(&self.frame).filter(|(p, f)| p.is_mapped && f.is_some()).count();
        let mut task = Task { mapped_only: mapped >= ENOUGH_MAPPED, ..*task };
        let predicted = advanced(&h.pose, &self.motion);
        let mut start = h.pose;
        if self.phase == Phase::Rotation {
            // Of a flat scene: no depths are known.
            task.is_translation_fixed = true;
            task.depth_variance = Some(0.0);
            task.mapped_only = false;
            start.t_21 = -(start.q_21 * self.travel);
        }
        let before = residuals(&h.map.points, &self.frame, &start, &task, &mut self.squares);
        let mut sent = predicted;
        if task.is_translation_fixed {
            sent.t_21 = -(sent.q_21 * self.travel);
        }
        let after = residuals(&h.map.points, &self.frame, &sent, &task, &mut h.squares);
        let from = if after < before { sent } else { start };
        if after >= before {
            h.squares.copy_from_slice(&self.squares);
        }
        h.fit = resect(&h.map.points, &self.frame, &from, &task, &mut h.squares, &mut self.scratch);
    }

    /// Adds the costs of this image; the best comes first, hopeless ones go.
    fn score(&mut self) {
        let cost = |h: &Hypothesis| h.fit.map_or(f64::INFINITY, |fit| fit.cost);
        let alive = &mut self.hypotheses[..self.count];
        let least = alive.iter().map(cost).fold(f64::INFINITY, f64::min);
        // Images from one place share the errors of the goal image and of the map: they are no evidence that adds up.
        let moves = self.motion.linear.norm() > STANDING;
        for h in alive.iter_mut() {
            let more = cost(h) - least;
            let more = if more.is_nan() { MOST_OF_ONE_IMAGE } else { more.min(MOST_OF_ONE_IMAGE) };
            h.score += if moves { more } else { STANDING_WEIGHT * more };
        }
        alive.sort_by(|a, b| a.score.total_cmp(&b.score));
        drop_twice(alive);
        let best = alive[0].score;
        self.count = alive.iter().take_while(|h| h.score - best < HOPELESS).count();
        self.hypotheses[..self.count].iter_mut().for_each(|h| h.score -= best);
        if self.count == 1 {
            self.hypotheses[0].score = 0.0;
        }
    }

    /// Whether the best fit may be acted on; the hypotheses then take over their poses.
    pub(super) fn gate(&mut self) -> Result<(), HoldReason> {
        let Some(fit) = self.hypotheses[0].fit else { return Err(HoldReason::Degenerate) };
        if fit.inliers < self.least_inliers() {
            return Err(HoldReason::Inconsistent);
        }
        let squares = &self.hypotheses[0].squares;
        let trusted = squares
            .iter()
            .zip(&self.trust)
            .filter(|(s, t)| !s.is_nan() && (**s < INLIER || **t > 0.2))
            .count();
        let agree = fit.inliers as f64;
        if agree < TRUSTED_SHARE * trusted as f64 || agree < SEEN_SHARE * fit.seen as f64 {
            return Err(HoldReason::Inconsistent);
        }
        let covariance = fit.covariance().ok_or(HoldReason::Degenerate)?;
        let deviation = |first: usize| (0..3).map(|k| covariance[(first + k, first + k)]).sum::<f64>().sqrt();
        let from = &self.hypotheses[0].pose;
        let images = (self.missed + 1) as f64;
        let (turn, way) = (from.rotation_error(&fit.pose), (from.t_21 - fit.pose.t_21).norm());
        let gate = self.options.gate;
        // A pixel or so of noise on top of what the camera may do.
        let reaches = turn <= images * self.options.largest_turn + 0.02 + gate * deviation(0)
            && (self.phase == Phase::Rotation
                || way <= images * self.options.largest_move + 0.02 + gate * deviation(3));
        if !reaches && self.missed < 2 * self.options.patience {
            return Err(HoldReason::Jump);
        }
        let (turn, way) = (deviation(0), deviation(3));
        for h in &mut self.hypotheses[..self.count] {
            if let Some(fit) = h.fit {
                h.pose = fit.pose;
            }
        }
        self.hold_against_commands(turn, way);
        Ok(())
    }

    /// What the commanded motion says of the hypotheses.
    fn hold_against_commands(&mut self, turn: f64, way: f64) {
        if self.phase != Phase::Mapped {
            return;
        }
        let is_alone = self.count == 1;
        let mut reversed = 0;
        for h in &mut self.hypotheses[..self.count] {
            let odometry = h.track.judge(&h.pose, turn, way);
            reversed += usize::from(odometry.is_reversed);
            if is_alone {
                self.contradicted = if odometry.contradicts { self.contradicted + 1 } else { 0 };
            } else {
                h.score += if odometry.is_reversed { HOPELESS } else { odometry.score };
            }
        }
        if reversed == self.count {
            self.contradicted = CONTRADICTED;
        }
    }

    /// The estimate of an accepted image, by how much of it can be acted on.
    pub(super) fn judge(&mut self) -> Result<Estimate, HoldReason> {
        if self.contradicted >= CONTRADICTED || self.worse >= WORSE_IMAGES {
            self.restart();
            return Err(HoldReason::Inconsistent);
        }
        let first = &self.hypotheses[0];
        let Some(fit) = first.fit else { return Err(HoldReason::Degenerate) };
        let mut support = Support::Full;
        let mut pose = first.pose;
        if self.phase == Phase::Rotation {
            self.leave_rotation(fit.cost, fit.seen)?;
            support = Support::RotationOnly;
            pose.t_21 = Vector3::zeros();
        } else {
            self.has_been_far |= first.pose.t_21.norm() > NEXT_TO_GOAL || self.goal.len() < VERY_FEW;
            let is_adequate = first.map.adequacy < most_inadequate(first) && !self.is_unsure_beside_goal();
            self.dull = if is_adequate { 0 } else { self.dull + 1 };
            let patience = if self.hypotheses[0].track.has_moved() { DULL } else { PATIENT * DULL };
            if self.dull > patience {
                self.restart();
                return Err(HoldReason::Starting);
            }
            let disagree = self.hypotheses[1..self.count].iter().any(|h| h.disagrees(first));
            if !is_adequate || (disagree && !self.has_been_far) {
                support = Support::RotationOnly;
            } else if disagree {
                support = Support::Several;
            } else if !first.track.is_confirmed && first.pose.t_21.norm() > CLOSE {
                support = Support::Unconfirmed;
            }
        }
        self.is_turning_only = support == Support::RotationOnly;
        if !self.is_turning_only {
            self.travel = Vector3::zeros();
        }
        Ok(Estimate {
            pose,
            covariance: fit.covariance(),
            inliers: fit.inliers,
            residual: (fit.square / (2 * fit.inliers).max(1) as f64).sqrt(),
            alternatives: self.count,
            support,
        })
    }

    /// Whether the hypotheses of a start beside the goal differ by half of the way, or do not all know the depths. There the choice
    /// of a hypothesis decides whether the camera comes nearer.
    fn is_unsure_beside_goal(&self) -> bool {
        if self.has_been_far || self.options.plane.is_some() || self.goal.len() < VERY_FEW {
            return false;
        }
        let first = &self.hypotheses[0];
        self.hypotheses[1..self.count].iter().any(|h| {
            let (a, b) = (&first.pose.t_21, &h.pose.t_21);
            let differs = (a - b).norm() > 0.5 * a.norm().max(b.norm());
            differs || h.map.adequacy > most_inadequate(h)
        })
    }

    /// Begins anew where a rotation explains the images worse than it did: parallax came.
    fn leave_rotation(&mut self, cost: f64, seen: usize) -> Result<(), HoldReason> {
        let n = seen as f64;
        // Of the features' squared residuals, two each, the sum varies by √(4 n).
        let least = if self.rotation_level.is_nan() { cost / n } else { self.rotation_level };
        self.rotation_level = least.min(cost / n).max(2.0);
        let explains = cost < self.rotation_level * n + 5.0 * (4.0 * n).sqrt() + RISEN;
        let explores = self.travel.norm() > 1e-3;
        self.unexplained = if explains || explores { 0 } else { self.unexplained + 1 };
        if self.unexplained >= 3 {
            self.unexplained = 0;
            self.restart();
            return Err(HoldReason::Starting);
        }
        Ok(())
    }
}

/// Sends to the end every hypothesis that has become the same as a better one.
fn drop_twice(alive: &mut [Hypothesis]) {
    let mut count = alive.len();
    let mut k = 1;
    while k < count {
        let is_twice = alive[..k].iter().any(|h| h.is_one_with(&alive[k]));
        if is_twice {
            alive[k].score = f64::INFINITY;
            alive[k..count].rotate_left(1);
            count -= 1;
        } else {
            k += 1;
        }
    }
}

/// A pose after a motion of the camera, to first order in the way.
fn advanced(pose: &RelativePose, motion: &Motion) -> RelativePose {
    let turn = UnitQuaternion::new(-motion.angular);
    let q_21 = UnitQuaternion::new_normalize((turn * pose.q_21).into_inner());
    RelativePose::new(q_21, turn * pose.t_21 - motion.linear)
}
