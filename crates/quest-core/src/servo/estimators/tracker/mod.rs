//! The estimator of the loop: the pose of each image on a map of the goal's features, whose depths are learnt.
//!
//! These are the steps for an image, as [`estimate`](PoseEstimator::estimate) takes them:
//!
//! 1. **Average** the first images; **search** hypotheses among their matches (`start/`): rotations, planes and scenes with relief.
//! 2. **Follow**: each hypothesis that is alive finds the pose of the image on its map (`resection.rs`). Its costs add up, with
//!    what the commanded motion says (`hypothesis.rs`). A hopeless hypothesis is dropped, and so is one that sees the camera go
//!    another way than it was sent. The pose is [`Unconfirmed`](crate::servo::Support::Unconfirmed) until the camera has been seen
//!    to go where it is sent.
//! 3. **Gate**: a pose counts if enough features agree with it, and if the camera can have come there since the last image.
//! 4. **Learn**: an image from somewhere new becomes a key image, and the map is adjusted by one damped step an image until it
//!    settles (`adjust/`). Of few features a settled map is tried without each, and goes on without a wrong match (`doubt.rs`).
//! 5. **Judge**: only the rotation counts where the depths are not known well enough for a translation to point the right way
//!    (`adequacy.rs`).
//!
//! Every step takes a time in proportion to the number of features. The steps of the map take a hundred times as long as the
//! others, and are few.

mod adequacy;
mod adjust;
mod consensus;
mod doubt;
mod follow;
mod hypothesis;
mod learn;
mod map;
mod relocate;
mod resection;
mod start;

use nalgebra::Vector3;

use crate::RelativePose;
use crate::servo::FilterOptions;
use crate::servo::estimators::estimate::{Estimate, HoldReason, Motion, PoseEstimator};
use crate::servo::estimators::source::PoseSource;
use adjust::{Survey, Workspace};
use consensus::FEW;
use doubt::Doubt;
use hypothesis::Hypothesis;
use map::{KeyImage, Known, Map};
use resection::{Ground, Task};
use start::{Progress, Start, Terms};

/// Hypotheses that are kept apart where there are few features, and where there are more.
const MOST_OF_FEW: usize = 8;
const MOST_OF_MANY: usize = 3;
/// Key images where there are few features and steps are cheap, and where there are more. Three are enough to adjust a plane's tilt;
/// eight were no better with twenty features.
const KEYS_OF_FEW: usize = 6;
const KEYS_OF_MANY: usize = 3;
/// The start's rotation is left where its cost has risen by so much, and more than chance: see [`Tracker::leave_rotation`].
const RISEN: f64 = 10.0;
/// A translation is commanded where the adequacy is below this. It may be up to three times as much where the goal is further than
/// `FAR`, for there is time to learn.
const ADEQUATE: f64 = 0.4;
const FAR: f64 = 0.06;
/// Fewer features than this never determine the depths well from one side.
const VERY_FEW: usize = 10;
/// A start nearer than this, in the unit of the depths, does not move while its hypotheses disagree: with the goal so near, following
/// the wrong one is worse than waiting.
const NEXT_TO_GOAL: f64 = 0.06;
/// After so many images without adequate depths the estimator begins anew.
const DULL: usize = 40;

/// The largest adequacy with which a hypothesis may translate. Few features never determine the depths well from one side: there the
/// hypotheses themselves are what tells.
fn most_inadequate(h: &Hypothesis) -> f64 {
    let way = h.pose.t_21.norm();
    if h.map.points.len() < VERY_FEW {
        return (way / 0.04).clamp(1.0, 3.0);
    }
    ADEQUATE * (way / FAR).clamp(1.0, 3.0)
}

/// What the estimator is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Looking for hypotheses.
    Starting,
    /// The images show no parallax.
    Rotation,
    /// There is a map.
    Mapped,
}

/// The estimator described at the head of the module.
#[derive(Clone, Debug)]
pub struct Tracker<S> {
    goal: Vec<[f64; 2]>,
    source: S,
    options: FilterOptions,
    /// The depths that were given, in the unit of the loop.
    known: Vec<Option<Known>>,
    phase: Phase,
    frame: Vec<Option<[f64; 2]>>,
    start: Start,
    /// The first `count` are alive, the best first.
    hypotheses: Vec<Hypothesis>,
    count: usize,
    keys: Vec<KeyImage>,
    key_count: usize,
    workspace: Workspace,
    /// The commanded motion since the last pose.
    motion: Motion,
    /// The commanded way since the images showed no parallax, in the goal's frame.
    travel: Vector3<f64>,
    /// How often each feature has agreed of late, from zero to one.
    trust: Vec<f64>,
    doubt: Doubt,
    inliers: Vec<bool>,
    squares: Vec<f64>,
    scratch: Vec<f64>,
    /// Images since the last accepted pose.
    missed: usize,
    /// The least cost a feature of a rotation so far; NaN before the first.
    rotation_level: f64,
    /// Three counts of images in a row: those that a rotation did not explain, those without an adequate map, those whose lone
    /// hypothesis contradicts the commands.
    unexplained: usize,
    dull: usize,
    contradicted: usize,
    /// The least mean squared residual of the inliers so far, and for how many images it has been far above.
    best_mean: f64,
    worse: usize,
    /// Whether the camera has been further from the goal than `NEXT_TO_GOAL` since the start.
    has_been_far: bool,
    /// Whether the last estimate was of the rotation alone.
    is_turning_only: bool,
    restarts: usize,
}

impl<S: PoseSource> Tracker<S> {
    /// The estimator for this goal image: its features on the plane z = 1. Takes all the memory that it will need.
    #[must_use]
    pub fn new(goal: &[[f64; 2]], source: S, options: FilterOptions) -> Self {
        let n = goal.len();
        let most_keys = if n < FEW { KEYS_OF_FEW } else { KEYS_OF_MANY };
        let empty = Hypothesis::new(Map::new(goal, most_keys, options.spread));
        let most = if n < FEW { MOST_OF_FEW } else { MOST_OF_MANY };
        let mut start = Start::new(&empty, options.first_images);
        let doubt = Doubt::new(&empty.map, most_keys);
        let mut hypotheses = vec![empty; most];
        // Copies of an empty list have no room.
        for h in hypotheses.iter_mut().chain(&mut start.pool) {
            h.map.keys.reserve_exact(most_keys);
        }
        Self {
            goal: goal.to_vec(),
            source,
            options,
            known: vec![None; n],
            phase: Phase::Starting,
            frame: vec![None; n],
            start,
            hypotheses,
            count: 0,
            keys: vec![KeyImage { frame: vec![None; n], variance: 1.0 }; most_keys],
            key_count: 0,
            workspace: Workspace::new(n, most_keys),
            motion: Motion { linear: Vector3::zeros(), angular: Vector3::zeros() },
            travel: Vector3::zeros(),
            trust: vec![1.0; n],
            doubt,
            inliers: vec![false; n],
            squares: vec![f64::NAN; n],
            scratch: Vec::with_capacity(n),
            missed: 0,
            rotation_level: f64::NAN,
            unexplained: 0,
            dull: 0,
            contradicted: 0,
            best_mean: f64::INFINITY,
            worse: 0,
            has_been_far: false,
            is_turning_only: false,
            restarts: 0,
        }
    }

    /// Starts with goal depths that are known, in any unit: from a depth camera or an earlier run. `precision` is their
    /// relative standard deviation. NaN for a depth that is not known; the loop's unit is the harmonic mean of the others.
    ///
    /// What is not a positive number counts as infinitely far.
    pub fn set_depths(&mut self, depths: &[f64], precision: f64) {
        let precisions = vec![precision; self.goal.len()];
        self.set_depths_each(depths, &precisions);
    }

    /// As [`set_depths`](Self::set_depths), with a precision for each depth.
    pub fn set_depths_each(&mut self, depths: &[f64], precisions: &[f64]) {
        let inverse = |z: f64| if z > 0.0 { 1.0 / z } else { 0.0 };
        let given = || depths.iter().filter(|z| !z.is_nan());
        let mean = given().map(|z| inverse(*z)).sum::<f64>() / given().count().max(1) as f64;
        if !(mean > 0.0 && mean.is_finite()) {
            return;
        }
        let places = self.goal.iter().map(|goal| goal.iter().all(|c| c.is_finite()));
        let given = depths.iter().zip(precisions).zip(places);
        for (known, ((z, precision), is_placed)) in self.known.iter_mut().zip(given) {
            let rho = inverse(*z) / mean;
            // An infinitely far feature is as certain as the mean one.
            let variance = (precision * rho.max(0.1)).powi(2);
            *known = (is_placed && !z.is_nan() && variance > 0.0).then_some(Known { rho, variance });
        }
        self.reset();
    }

    /// The goal's depths as they are known now, with a harmonic mean of about 1; infinite where a feature is infinitely far, NaN where
    /// nothing is known.
    pub fn depths(&self) -> impl Iterator<Item = f64> {
        self.points().map(|point| point.map_or(f64::NAN, |p| 1.0 / p.rho.max(0.0)))
    }

    /// The relative standard deviation of each depth; NaN where nothing is known.
    pub fn depth_precisions(&self) -> impl Iterator<Item = f64> {
        self.points().map(|point| point.map_or(f64::NAN, |p| p.variance.sqrt() / p.rho.abs().max(1e-3)))
    }

    fn points(&self) -> impl Iterator<Item = Option<&resection::Point>> {
        let known = (self.count > 0 && self.phase == Phase::Mapped).then(|| &self.hypotheses[0].map.points);
        (0..self.goal.len())
            .map(move |i| known.and_then(|points| points.get(i)).filter(|p| p.is_mapped && !p.is_wrong))
    }

    /// How an image is fitted.
    fn task(&self) -> Task {
        let ground = self.options.plane.map(|plane| Ground { plane, base: self.options.base });
        Task {
            variance: self.options.noise.powi(2),
            place_variance: self.options.goal_noise.powi(2),
            ground,
            is_translation_fixed: false,
            mapped_only: false,
            depth_variance: None,
            // One or two from where the camera was sent; more where it was not.
            iterations: 8,
        }
    }

    fn survey<'a>(
        goal: &'a [[f64; 2]],
        known: &'a [Option<Known>],
        keys: &'a [KeyImage],
        task: &Task,
    ) -> Survey<'a> {
        Survey {
            goal,
            known,
            keys,
            goal_variance: task.place_variance,
            ground: task.ground,
            chosen: &[],
            noise: 1.0,
        }
    }

    fn seen(&self) -> usize {
        self.frame.iter().flatten().count()
    }

    /// Fewer inliers than this are not acted on: six, or all that the goal has.
    fn least_inliers(&self) -> usize {
        self.options.min_features.max(if self.options.plane.is_some() { 4 } else { self.goal.len().min(6) })
    }

    /// Works on the start.
    fn search(&mut self) -> Result<(), HoldReason> {
        if self.start_from_known_depths() {
            return Ok(());
        }
        let terms = Terms {
            goal: &self.goal,
            known: &self.known,
            task: self.task(),
            relief: self.options.spread,
            first_images: self.options.first_images,
            min_features: self.options.min_features,
            least_inliers: self.least_inliers(),
            travel: self.travel,
        };
        match self.start.advance(&self.frame, &mut self.source, &mut self.workspace, &terms) {
            Progress::Going => Ok(()),
            Progress::TooFew => {
                self.start.begin();
                Err(HoldReason::TooFewFeatures)
            }
            Progress::Nothing => {
                self.start.begin();
                Err(HoldReason::Inconsistent)
            }
            Progress::Done => {
                let result = self.conclude();
                self.start.begin();
                result
            }
        }
    }

    /// Chooses between rotation and map, and takes over the hypotheses.
    fn conclude(&mut self) -> Result<(), HoldReason> {
        let pool = &self.start.pool[..self.start.count];
        let is_rotation = self.start.rotation.is_some_and(|r| self.prefers_rotation(&r, pool));
        if !is_rotation && pool.is_empty() {
            return Err(HoldReason::Inconsistent);
        }
        self.missed = 0;
        (self.unexplained, self.dull, self.contradicted) = (0, 0, 0);
        (self.best_mean, self.worse) = (f64::INFINITY, 0);
        self.has_been_far = false;
        self.trust.fill(1.0);
        self.doubt.begin();
        if is_rotation {
            let Some(fit) = self.start.rotation else { return Err(HoldReason::Inconsistent) };
            self.phase = Phase::Rotation;
            self.rotation_level = f64::NAN;
            let first = &mut self.hypotheses[0];
            first.map.forget(&self.goal, &self.known, self.options.spread);
            (first.pose, first.score, self.count) = (fit.pose, 0.0, 1);
            first.track.clear();
            return Ok(());
        }
        self.phase = Phase::Mapped;
        self.take_over();
        Ok(())
    }

    /// Whether the first images are explained by a rotation, or by nothing that a translation could rest on.
    fn prefers_rotation(&self, rotation: &resection::Fit, pool: &[Hypothesis]) -> bool {
        /// An answer whose score is this close to the best one's is as good as the best.
        const NEAR: f64 = 8.0;
        /// Next to the goal every answer counts that is not hopeless.
        const POSSIBLE: f64 = 15.0;
        /// Where the goal would be an unstable point of the loop with wrong depths, only strong evidence will do.
        const CAREFUL: f64 = 30.0;
        const CAREFUL_ADEQUACY: f64 = 0.3;
        let n = rotation.seen as f64;
        let score = rotation.cost + rotation.pose.q_21.angle().powi(2);
        let Some(best) = pool.first() else { return rotation.cost < 9.0 * n };
        let agree = rotation.inliers as f64 >= 0.6 * n && rotation.inliers >= rotation.seen.min(6);
        // The margin keeps a scene with parallax just above the noise from being called one: odds of 1 to 20.
        let least = pool.iter().map(|h| h.against_rotation).fold(f64::INFINITY, f64::min);
        if agree && score < least + 6.0 {
            return true;
        }
        let way = best.pose.t_21.norm();
        let is_close = way < NEXT_TO_GOAL;
        // A plane that the base keeps to, or few features, whose hypotheses are all kept, need less of it.
        let is_careful = is_close && self.options.plane.is_none() && self.goal.len() >= VERY_FEW;
        let (margin, cosine) = match (is_careful, is_close) {
            (true, _) => (CAREFUL, 0.8),
            (_, true) => (POSSIBLE, 0.3),
            _ => (NEAR, 0.3),
        };
        let near = || pool.iter().take_while(move |h| h.score < best.score + margin);
        if rotation.cost >= 9.0 * n || way >= 0.1 {
            return false;
        }
        let most = |h: &Hypothesis| if is_careful { CAREFUL_ADEQUACY } else { most_inadequate(h) };
        let inadequate = near().any(|h| h.map.adequacy > most(h));
        let apart = near().any(|h| h.pose.t_21.dot(&best.pose.t_21) < cosine * h.pose.t_21.norm() * way);
        inadequate || apart
    }

    /// The start's answers become hypotheses: the best, one of the other class, and different ones that are not hopeless.
    fn take_over(&mut self) {
        /// Odds of 1 to 300,000.
        const HOPELESS: f64 = 25.0;
        /// A plane with many wrong matches, and a scene with relief: the first motion tells them apart.
        const OTHER_CLASS: f64 = 40.0;
        let pool = &self.start.pool[..self.start.count];
        let best = pool[0].score;
        let class = pool[0].map.is_planar();
        let other = pool.iter().position(|h| h.map.is_planar() != class && h.score < best + OTHER_CLASS);
        self.count = 0;
        for k in std::iter::once(0).chain(other).chain(1..pool.len()) {
            let (ready, rest) = self.hypotheses.split_at_mut(self.count);
            let Some(new) = rest.first_mut() else { break };
            let from = &pool[k];
            let is_known = ready
                .iter()
                .any(|h| h.is_like(from) && (h.map.is_planar() == from.map.is_planar() || Some(k) != other));
            let is_hopeless = self.goal.len() >= FEW && from.score > best + HOPELESS && Some(k) != other;
            if is_known || is_hopeless {
                continue;
            }
            new.map.copy_from(&from.map);
            (new.pose, new.score) = (from.pose, (from.score - best).min(HOPELESS));
            (new.off_map, new.is_relief) = (0.0, false);
            new.track.clear();
            // The features that did not take part in the start join now.
            (new.map.steps_left, new.map.cost, new.map.damping) = (10, f64::NAN, 1e-4);
            self.count += 1;
        }
        self.keys[0].frame.copy_from_slice(&self.start.mean.frame);
        self.keys[0].variance = self.start.mean.variance;
        self.key_count = 1;
    }
}

impl<S: PoseSource> PoseEstimator for Tracker<S> {
    fn estimate(&mut self, features: &[Option<[f64; 2]>]) -> Result<Estimate, HoldReason> {
        self.frame.iter_mut().for_each(|f| *f = None);
        for ((kept, seen), goal) in self.frame.iter_mut().zip(features).zip(&self.goal) {
            // A feature without a place in the goal has none to be held against.
            let is_placed = goal.iter().all(|c| c.is_finite());
            *kept = seen.filter(|m| is_placed && m.iter().all(|c| c.is_finite() && c.abs() < 1e3));
        }
        self.inliers.fill(false);
        if self.seen() < self.options.min_features {
            return Err(HoldReason::TooFewFeatures);
        }
        if self.phase == Phase::Starting {
            self.search()?;
            return Err(HoldReason::Starting);
        }
        let accepted = self.follow().and_then(|()| self.gate());
        self.motion = Motion { linear: Vector3::zeros(), angular: Vector3::zeros() };
        if let Err(reason) = accepted {
            self.missed += 1;
            self.relocate();
            return Err(reason);
        }
        self.missed = 0;
        self.learn();
        self.judge()
    }

    fn moved(&mut self, motion: &Motion) {
        if self.count == 0 {
            return;
        }
        // To first order: the motion of one image, or of the few since the last pose.
        self.motion.linear += motion.linear;
        self.motion.angular += motion.angular;
        for h in &mut self.hypotheses[..self.count] {
            h.track.moved(motion, &h.pose);
        }
        if self.is_turning_only {
            self.travel += self.hypotheses[0].pose.q_21.inverse() * motion.linear;
        }
    }

    fn restart(&mut self) {
        self.restarts += 1;
        (self.count, self.key_count, self.missed) = (0, 0, 0);
        self.phase = Phase::Starting;
        self.start.begin();
    }

    fn reset(&mut self) {
        self.restart();
        (self.restarts, self.travel) = (0, Vector3::zeros());
    }

    fn inliers(&self) -> &[bool] {
        &self.inliers
    }

    fn begin(&self) -> Option<RelativePose> {
        self.hypotheses[..self.count].first()?.map.keys.first().copied()
    }

    fn hypotheses(&self) -> usize {
        self.count
    }

    fn restarts(&self) -> usize {
        self.restarts
    }
}
