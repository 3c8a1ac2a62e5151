//! The start: hypotheses from the mean of the first images.
//!
//! 1. The mean of the first images (`first_images.rs`): a false match in some of them does not disturb it, one in all of them does.
//! 2. Consensus among its matches (`consensus.rs`), over as many images as that takes; a rotation by pairs of them.
//! 3. Proposals: the flat scene, the consensus's poses, the candidates of all that agree, planes, and at last the reversed scene of the
//!    best. Each is adjusted with the bounded cost (`adjust.rs`), as a scene with relief and as a plane.
//! 4. The judgement: rotation, plane and relief on one scale, minus twice the log of the marginal likelihood. The determinant counts
//!    what so many free depths would fit by chance; without it free depths always win.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::servo::estimators::depth_filter::first_images::FirstImages;
use crate::servo::estimators::source::PoseSource;
use crate::servo::estimators::tracker::adjust::{Survey, Workspace};
use crate::servo::estimators::tracker::consensus::{Consensus, SAMPLES};
use crate::servo::estimators::tracker::hypothesis::Hypothesis;
use crate::servo::estimators::tracker::map::{KeyImage, Known, PLANE_RELIEF};
use crate::servo::estimators::tracker::resection::{
    Fit, INLIER, KNEE, Point, Task, bounded, resect, residuals,
};
use crate::{Correspondence, RelativePose};

/// Answers that are compared in the end.
pub(crate) const POOL: usize = 12;
/// Features that take part in the start at most; the others join at its end.
const MOST_FEATURES: usize = 100;
/// What one image may cost: features times steps, about 0.3 µs each.
const WORK: usize = 3_000;
/// Steps of the adjustment of a proposal: eight are usual.
const STEPS: usize = 15;
/// Below so many features all candidates are tried, not those of the consensus alone.
pub(crate) const FEW: usize = 25;
/// Room for all of them: 25 candidates, as a scene and as a plane, and four planes.
const PROPOSALS: usize = 64;
/// What a translation costs, and a plane's normal: the logs of their priors over their precisions, in steps of two a number.
const TRANSLATION: f64 = 6.0;
const PLANE: f64 = 4.0;
/// Minus twice the log of the odds that a camera that was just moved to one side sees a scene that was moved to the other.
const WRONG_WAY: f64 = 30.0;

/// A pose to begin an adjustment with.
#[derive(Clone, Copy, Debug)]
struct Proposal {
    pose: RelativePose,
    /// With the relief of the scene that it is adjusted to.
    relief: f64,
    depths: Depths,
}

/// Where a proposal's inverse depths come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Depths {
    /// All one.
    Flat,
    /// Of the pose.
    Triangulated,
    /// Those of the best answer, reversed about one.
    Reversed,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Averaging,
    Sampling,
    Adjusting,
}

/// What the start has come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Progress {
    /// It needs more images.
    Going,
    /// The pool is ready to be judged.
    Done,
    /// The mean shows too few features.
    TooFew,
    /// No candidate explains the mean.
    Nothing,
}

/// What the start is told.
pub(crate) struct Terms<'a> {
    pub(crate) goal: &'a [[f64; 2]],
    pub(crate) known: &'a [Option<Known>],
    pub(crate) task: Task,
    /// The relief that a scene may have.
    pub(crate) relief: f64,
    pub(crate) first_images: usize,
    pub(crate) min_features: usize,
    /// An answer explains so many features at least: with a bounded cost and few features one that explains hardly any is cheap.
    pub(crate) least_inliers: usize,
    /// How far the camera was moved since it began anew, in the goal's frame.
    pub(crate) travel: Vector3<f64>,
}

#[derive(Clone, Debug)]
pub(crate) struct Start {
    stage: Stage,
    first_images: FirstImages,
    /// The mean image; the first key image if the start succeeds.
    pub(crate) mean: KeyImage,
    chosen: Vec<bool>,
    pub(crate) consensus: Consensus,
    proposals: Vec<Proposal>,
    next: usize,
    /// Whether `pool[count]` is being adjusted.
    is_adjusting: bool,
    steps: usize,
    /// The answers so far, the best first; one more is worked on.
    pub(crate) pool: Vec<Hypothesis>,
    pub(crate) count: usize,
    /// The best rotation.
    pub(crate) rotation: Option<Fit>,
    pub(crate) rng: ChaCha8Rng,
    squares: Vec<f64>,
    scratch: Vec<f64>,
}

impl Start {
    pub(crate) fn new(empty: &Hypothesis, first_images: usize) -> Self {
        let n = empty.map.points.len();
        Self {
            stage: Stage::Averaging,
            first_images: FirstImages::new(n, first_images),
            mean: KeyImage { frame: vec![None; n], variance: 0.0 },
            chosen: vec![false; n],
            consensus: Consensus::new(n),
            proposals: Vec::with_capacity(PROPOSALS),
            next: 0,
            is_adjusting: false,
            steps: 0,
            pool: vec![empty.clone(); POOL + 1],
            count: 0,
            rotation: None,
            rng: ChaCha8Rng::seed_from_u64(0x5e_41_10),
            squares: vec![f64::NAN; n],
            scratch: Vec::with_capacity(n),
        }
    }

    pub(crate) fn begin(&mut self) {
        self.stage = Stage::Averaging;
        self.first_images.clear();
    }

    /// Works on the start for as long as one image may take.
    pub(crate) fn advance(
        &mut self,
        frame: &[Option<[f64; 2]>],
        source: &mut impl PoseSource,
        workspace: &mut Workspace,
        terms: &Terms<'_>,
    ) -> Progress {
        let sigma = (terms.task.variance + terms.task.place_variance).sqrt();
        match self.stage {
            Stage::Averaging => {
                self.mean.frame.copy_from_slice(frame);
                let reach = 5.0 * terms.task.variance.sqrt();
                if !self.first_images.average(&mut self.mean.frame, reach) {
                    return Progress::Going;
                }
                self.mean.variance = terms.task.variance / terms.first_images.max(1) as f64;
                self.choose();
                self.consensus.begin(terms.goal, &self.mean.frame, |i| self.chosen[i]);
                if self.consensus.matches.len() < terms.min_features.max(source.min_matches()) {
                    return Progress::TooFew;
                }
                self.stage = Stage::Sampling;
                Progress::Going
            }
            Stage::Sampling => {
                let n = self.consensus.matches.len();
                let samples = (WORK / (15 + n / 2)).clamp(1, SAMPLES);
                self.consensus.draw(source, samples, sigma, &mut self.rng);
                // Of five or six features there are few samples.
                let wanted = match n {
                    0..=5 => 1,
                    6 => 24,
                    7 => 64,
                    _ => SAMPLES,
                };
                if self.consensus.drawn >= wanted {
                    self.propose(source, sigma, terms);
                    self.stage = Stage::Adjusting;
                }
                Progress::Going
            }
            Stage::Adjusting => self.adjust(workspace, terms),
        }
    }

    /// The features that take part: spread over all that the mean shows.
    fn choose(&mut self) {
        let seen = self.mean.frame.iter().flatten().count();
        let stride = seen.div_ceil(MOST_FEATURES).max(1);
        let mut k = 0;
        for (chosen, image) in self.chosen.iter_mut().zip(&self.mean.frame) {
            *chosen = image.is_some() && k % stride == 0;
            k += usize::from(image.is_some());
        }
    }

    fn propose(&mut self, source: &mut impl PoseSource, sigma: f64, terms: &Terms<'_>) {
        (self.count, self.next, self.is_adjusting) = (0, 0, false);
        self.proposals.clear();
        self.rotation = self.best_rotation(sigma, terms);
        let n = self.consensus.matches.len();
        let flat = self.rotation.map_or(RelativePose::identity(), |fit| fit.pose);
        self.add(flat, Depths::Flat, &[terms.relief, PLANE_RELIEF]);
        let candidates = self.consensus.candidates_of_inliers(source, false, sigma).clone();
        for candidate in candidates.iter() {
            if n < FEW {
                self.add(candidate.pose, Depths::Triangulated, &[terms.relief]);
            } else {
                self.consensus.offer(candidate.pose, sigma);
            }
        }
        for (_, pose) in self.consensus.best.into_iter().flatten() {
            self.add(pose, Depths::Triangulated, &[terms.relief]);
        }
        if let Some((_, pose)) = self.consensus.best[0] {
            self.add(pose, Depths::Triangulated, &[PLANE_RELIEF]);
        }
        let planes = self.consensus.candidates_of_inliers(source, true, sigma).clone();
        for candidate in planes.iter().take(4) {
            self.add(candidate.pose, Depths::Triangulated, &[PLANE_RELIEF, terms.relief]);
        }
    }

    fn add(&mut self, pose: RelativePose, depths: Depths, reliefs: &[f64]) {
        for &relief in reliefs {
            if self.proposals.len() < PROPOSALS {
                self.proposals.push(Proposal { pose, relief, depths });
            }
        }
    }

    /// The rotation that most pairs of matches agree on, fitted.
    fn best_rotation(&mut self, sigma: f64, terms: &Terms<'_>) -> Option<Fit> {
        const PAIRS: usize = 64;
        let matches = &self.consensus.matches;
        let mut best = (f64::INFINITY, RelativePose::identity());
        for _ in 0..PAIRS {
            let [a, b] = [0; 2].map(|_| self.rng.random_range(0..matches.len()));
            let Some(q_21) = rotation_of_pair(&matches[a], &matches[b]) else { continue };
            let cost = matches
                .iter()
                .map(|m| ((q_21 * m.bearing1() - m.bearing2()).norm_squared() / (sigma * sigma)).min(KNEE))
                .sum::<f64>();
            if cost < best.0 {
                best = (cost, RelativePose::new(q_21, Vector3::zeros()));
            }
        }
        let task = Task {
            variance: self.mean.variance,
            depth_variance: Some(0.0),
            is_translation_fixed: true,
            mapped_only: false,
            iterations: 8,
            ..terms.task
        };
        self.pool[POOL].map.forget(terms.goal, terms.known, terms.relief);
        let points = &self.pool[POOL].map.points;
        residuals(points, &self.mean.frame, &best.1, &task, &mut self.squares);
        let mut fit = resect(points, &self.mean.frame, &best.1, &task, &mut self.squares, &mut self.scratch)?;
        residuals(points, &self.mean.frame, &fit.pose, &task, &mut self.squares);
        // The start's features alone, so that all scores are of the same matches.
        let chosen = || self.squares.iter().zip(&self.chosen).filter(|(_, chosen)| **chosen).map(|(s, _)| *s);
        fit.cost = chosen().map(|s| bounded(s, KNEE)).sum();
        fit.inliers = chosen().filter(|s| *s < INLIER).count();
        fit.seen = chosen().count();
        Some(fit)
    }

    /// Adjusts proposals for as long as one image may take.
    fn adjust(&mut self, workspace: &mut Workspace, terms: &Terms<'_>) -> Progress {
        let n = self.consensus.matches.len().max(1);
        let mut left = WORK.div_ceil(n);
        let keys = [std::mem::replace(&mut self.mean, KeyImage { frame: Vec::new(), variance: 0.0 })];
        let survey = Survey {
            goal: terms.goal,
            known: terms.known,
            keys: &keys,
            goal_variance: terms.task.place_variance,
            ground: terms.task.ground,
            chosen: &self.chosen,
        };
        let mut is_done = false;
        while left > 0 {
            if !self.is_adjusting {
                if self.next == self.proposals.len()
                    && !Self::add_reversed(&mut self.proposals, &self.pool, self.count)
                {
                    is_done = true;
                    break;
                }
                let proposal = self.proposals[self.next];
                self.next += 1;
                let (ready, rest) = self.pool.split_at_mut(self.count);
                let best = ready.first().map(|h| h.map.points.as_slice());
                if !prepare(&mut rest[0], &proposal, &self.consensus, best, terms) {
                    continue;
                }
                (self.is_adjusting, self.steps) = (true, 0);
            }
            let new = &mut self.pool[self.count];
            let before = new.map.cost;
            let falls = workspace.step(&mut new.map, &survey);
            left -= 1;
            self.steps += 1;
            let settled = falls && before - new.map.cost < 1e-3 * new.map.cost + 1e-3;
            if settled || self.steps >= STEPS || new.map.damping > 1e5 {
                self.is_adjusting = false;
                let score = score(new, &keys[0], &self.chosen, terms);
                workspace.judge(&mut new.map, &survey);
                new.pose = new.map.keys[0];
                let plane = if new.map.is_planar() { PLANE } else { 0.0 };
                new.against_rotation = score + TRANSLATION + plane;
                // Of few features the widths of the minima differ by more than their depths.
                new.score = if terms.goal.len() < FEW {
                    score + new.map.log_information
                } else {
                    new.against_rotation
                };
                new.start_cost = new.map.cost;
                let explained = explained(new, &keys[0], &self.chosen);
                if explained >= terms.least_inliers && 2 * explained >= n {
                    Self::rank(&mut self.pool, &mut self.count);
                }
            }
        }
        let [mean] = keys;
        self.mean = mean;
        if !is_done {
            return Progress::Going;
        }
        if self.count == 0 && self.rotation.is_none() { Progress::Nothing } else { Progress::Done }
    }

    /// Adds the reversed scene of the best answer, once: `t → −t`, `ρ → 2 − ρ` fits as well where the parallax is small.
    fn add_reversed(proposals: &mut Vec<Proposal>, pool: &[Hypothesis], count: usize) -> bool {
        if count == 0 || proposals.iter().any(|p| p.depths == Depths::Reversed) {
            return false;
        }
        let pose = RelativePose::new(pool[0].pose.q_21, -pool[0].pose.t_21);
        if proposals.len() == proposals.capacity() {
            proposals.pop();
        }
        let relief = pool.iter().take(count).map(|h| h.map.relief).fold(0.0, f64::max);
        proposals.push(Proposal { pose, relief, depths: Depths::Reversed });
        true
    }

    /// Puts the answer at `count` in its place, unless a better one like it is there, or takes the place of a worse one.
    fn rank(pool: &mut [Hypothesis], count: &mut usize) {
        let (ready, rest) = pool.split_at_mut(*count);
        let new = &mut rest[0];
        if !(new.score.is_finite() && new.pose.t_21.iter().all(|x| x.is_finite())) {
            return;
        }
        let like = ready.iter().position(|h| h.is_like(new) && h.map.is_planar() == new.map.is_planar());
        let mut place = match like {
            Some(k) if ready[k].score <= new.score => return,
            Some(k) => {
                std::mem::swap(&mut ready[k], new);
                k
            }
            None if *count < POOL => {
                *count += 1;
                *count - 1
            }
            None if ready[POOL - 1].score > new.score => {
                std::mem::swap(&mut ready[POOL - 1], new);
                POOL - 1
            }
            None => return,
        };
        while place > 0 && pool[place].score < pool[place - 1].score {
            pool.swap(place, place - 1);
            place -= 1;
        }
    }
}

/// Sets a hypothesis to a proposal; `false` where the proposal is absurd.
fn prepare(
    new: &mut Hypothesis,
    proposal: &Proposal,
    consensus: &Consensus,
    best: Option<&[Point]>,
    terms: &Terms<'_>,
) -> bool {
    new.map.forget(terms.goal, terms.known, proposal.relief);
    new.map.damping = 1e-3;
    (new.is_relief, new.off_map) = (false, 0.0);
    new.track.clear();
    let mut pose = proposal.pose;
    match proposal.depths {
        Depths::Flat => {}
        Depths::Triangulated => {
            let Some(scale) = triangulate(new, &pose, consensus, terms) else { return false };
            pose.t_21 *= scale;
        }
        Depths::Reversed => {
            let Some(best) = best else { return false };
            for ((point, best), known) in new.map.points.iter_mut().zip(best).zip(terms.known) {
                if known.is_none() {
                    point.rho = (2.0 - best.rho).clamp(0.1, 4.0);
                }
            }
        }
    }
    if proposal.relief <= PLANE_RELIEF {
        pose.t_21 *= fit_plane(new, terms);
    }
    new.map.keys.push(pose);
    true
}

/// The inverse depths of a pose, in the unit of their median; what the pose is to be multiplied with. `None` where it is absurd.
fn triangulate(
    new: &mut Hypothesis,
    pose: &RelativePose,
    consensus: &Consensus,
    terms: &Terms<'_>,
) -> Option<f64> {
    if pose.t_21.amax() <= 0.0 {
        return Some(1.0);
    }
    let (mut sum, mut count, mut behind) = (0.0, 0.0, 0);
    for (m, &i) in consensus.matches.iter().zip(&consensus.features) {
        let Some((z1, z2)) = pose.depths(m) else { continue };
        behind += usize::from(z1 <= 0.0 || z2 <= 0.0);
        let rho = 1.0 / z1;
        new.map.points[i].rho = rho;
        // The unit is that of the known depths where there are some.
        let (rho, weight) = match terms.known[i] {
            Some(known) => (rho / known.rho.max(1e-3), 100.0),
            None => (rho, 1.0),
        };
        if z1 > 0.0 {
            // A wrong match may be anywhere: it counts as at most four times as near as the others.
            sum += weight * rho;
            count += weight;
        }
    }
    if count <= 0.0 || behind * 2 > consensus.matches.len() {
        return None;
    }
    let mut mean = sum / count;
    // Once more without those that are far from the mean.
    let (mut sum, mut count) = (0.0, 0.0);
    for &i in &consensus.features {
        let rho = new.map.points[i].rho / mean;
        if (0.1..3.0).contains(&rho) {
            (sum, count) = (sum + rho, count + 1.0);
        }
    }
    if count > 0.0 && terms.known.iter().all(Option::is_none) {
        mean *= sum / count;
    }
    if !(mean > 0.0 && mean.is_finite()) {
        return None;
    }
    for &i in &consensus.features {
        let point = &mut new.map.points[i];
        point.rho = match terms.known[i] {
            Some(known) => known.rho,
            None => (point.rho / mean).clamp(0.02, 4.0),
        };
        if !point.rho.is_finite() {
            point.rho = 1.0;
        }
    }
    Some(mean)
}

/// The plane through the inverse depths, robustly, and the inverse depths on it, in the unit that makes it one in the middle; what the
/// translation is to be multiplied with.
fn fit_plane(new: &mut Hypothesis, terms: &Terms<'_>) -> f64 {
    let mut normal = Vector3::z();
    for _ in 0..4 {
        let (mut a, mut b) = (Matrix3::identity() * 1e-3, Vector3::z() * 1e-3);
        for (point, goal) in new.map.points.iter().zip(terms.goal) {
            let m = Vector3::new(goal[0], goal[1], 1.0);
            // Those off by a tenth count less and less.
            let weight = 1.0 / (1.0 + ((point.rho - normal.dot(&m)) / 0.1).powi(2));
            a += m * m.transpose() * weight;
            b += m * (weight * point.rho);
        }
        let Some(solved) = a.cholesky().map(|factor| factor.solve(&b)) else { return 1.0 };
        normal = solved;
    }
    let unit = if normal.z > 0.2 && terms.known.iter().all(Option::is_none) { normal.z } else { 1.0 };
    normal /= unit;
    new.map.normal = normal;
    for ((point, goal), known) in new.map.points.iter_mut().zip(terms.goal).zip(terms.known) {
        if known.is_none() {
            point.rho = normal.dot(&Vector3::new(goal[0], goal[1], 1.0)).clamp(0.05, 5.0);
        }
    }
    unit
}

/// How many features of the mean image an answer explains.
fn explained(h: &Hypothesis, image: &KeyImage, chosen: &[bool]) -> usize {
    let pose = &h.map.keys[0];
    let explains = |i: usize, point: &Point| {
        let Some(z) = image.frame[i].filter(|_| chosen[i]) else { return false };
        let x2 = pose.q_21 * Vector3::new(point.place[0], point.place[1], 1.0) + pose.t_21 * point.rho;
        let off = [x2.x / x2.z - z[0], x2.y / x2.z - z[1]];
        x2.z > 0.0 && off[0] * off[0] + off[1] * off[1] < INLIER * image.variance
    };
    h.map.points.iter().enumerate().filter(|(i, point)| explains(*i, point)).count()
}

/// Minus twice the log of the marginal likelihood of the mean image, but for a constant.
fn score(h: &Hypothesis, image: &KeyImage, chosen: &[bool], terms: &Terms<'_>) -> f64 {
    let pose = &h.map.keys[0];
    let r_21 = pose.r_21();
    let sigma2 = image.variance + terms.task.place_variance;
    let mut chance = 0.0;
    for (i, point) in h.map.points.iter().enumerate() {
        if image.frame[i].is_none() || !chosen[i] {
            continue;
        }
        let x2 = r_21 * Vector3::new(point.place[0], point.place[1], 1.0) + pose.t_21 * point.rho;
        let z = x2.z.max(0.02);
        let a = [pose.t_21.x - x2.x / z * pose.t_21.z, pose.t_21.y - x2.y / z * pose.t_21.z];
        let prior = terms.known[i].map_or(h.map.relief * h.map.relief, |known| known.variance);
        chance += (prior * (a[0] * a[0] + a[1] * a[1]) / (z * z) / sigma2).ln_1p();
    }
    let turn = pose.q_21.angle();
    let c = pose.inverse().t_21;
    let wrong_way = terms.travel.norm() > 1e-3 && c.dot(&terms.travel) < 0.0;
    h.map.cost + chance + turn * turn + if wrong_way { WRONG_WAY } else { 0.0 }
}

/// The rotation that takes two bearings of view 1 to those of view 2; `None` where they are parallel.
fn rotation_of_pair(a: &Correspondence, b: &Correspondence) -> Option<UnitQuaternion<f64>> {
    let frame = |p: &Vector3<f64>, q: &Vector3<f64>| {
        let (along, across) = ((p + q).try_normalize(1e-6)?, p.cross(q).try_normalize(1e-4)?);
        Some(Matrix3::from_columns(&[along, across.cross(&along), across]))
    };
    let (f1, f2) = (frame(a.bearing1(), b.bearing1())?, frame(a.bearing2(), b.bearing2())?);
    let r = nalgebra::Rotation3::from_matrix_unchecked(f2 * f1.transpose());
    Some(UnitQuaternion::from_rotation_matrix(&r))
}
