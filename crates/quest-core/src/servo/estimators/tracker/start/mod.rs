//! The start: hypotheses from the mean of the first images.
//!
//! 1. The mean of the first images (`first_images.rs`): a false match in some of them does not disturb it, one in all of them does.
//! 2. Consensus among its matches (`consensus.rs`), over as many images as that takes; a rotation by pairs of them (`rotation.rs`).
//! 3. Proposals (`proposal.rs`): the flat scene, the consensus's poses, the candidates of all that agree, planes, and at last the reversed scene of the
//!    best. Each is adjusted with the bounded cost (`adjust/`), as a scene with relief and as a plane.
//! 4. The judgement (`judgement.rs`): rotation, plane and relief on one scale, minus twice the log of the marginal likelihood. The determinant counts
//!    what so many free depths would fit by chance; without it free depths always win. Where the matches show less noise than was told, all answers are
//!    judged again by that.

mod judgement;
mod proposal;
mod rotation;

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::RelativePose;
use crate::servo::estimators::depth_filter::first_images::FirstImages;
use crate::servo::estimators::source::PoseSource;
use crate::servo::estimators::tracker::adjust::{Survey, Workspace};
use crate::servo::estimators::tracker::consensus::{Consensus, FEW};
use crate::servo::estimators::tracker::hypothesis::Hypothesis;
use crate::servo::estimators::tracker::map::{KeyImage, Known, PLANE_RELIEF};
use crate::servo::estimators::tracker::resection::{Fit, Task};
use judgement::{Bench, explained, judge, rank};
use proposal::{Depths, Proposal, prepare};

/// Answers that are compared in the end.
pub(crate) const POOL: usize = 12;
/// Features that take part in the start at most; the others join at its end.
const MOST_FEATURES: usize = 100;
/// What one image may cost: features times steps, about 0.3 µs each.
const WORK: usize = 3_000;
/// Steps of the adjustment of a proposal: eight are usual.
const STEPS: usize = 15;
/// The largest cost a feature of an answer: a wrong match costs 18, a right one 2, and at most half of them are wrong. More costs an
/// adjustment that has not come to its minimum.
const MOST_COST: f64 = 11.0;
/// A judgement of many features takes as long as so many steps.
const JUDGEMENT: usize = 4;
/// Answers that are judged again in an image: each takes a third of a millisecond.
const JUDGED: usize = 3;
/// Room for all of them: 25 candidates, as a scene and as a plane, and four planes.
const PROPOSALS: usize = 64;
/// What a translation costs, and a plane's normal: the logs of their priors over their precisions, in steps of two a number.
const TRANSLATION: f64 = 6.0;
const PLANE: f64 = 4.0;
/// Minus twice the log of the odds that a camera that was just moved to one side sees a scene that was moved to the other.
const WRONG_WAY: f64 = 30.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Averaging,
    Sampling,
    Proposing,
    Adjusting,
    /// By the noise that the matches show.
    Judging,
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
    /// Starts in a row that led to nothing.
    failures: usize,
    bench: Bench,
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
            failures: 0,
            bench: Bench::new(n),
            squares: vec![f64::NAN; n],
            scratch: Vec::with_capacity(n),
        }
    }

    /// The share of the variance that was told which the matches of the start show.
    pub(crate) fn noise_share(&self) -> f64 {
        self.bench.noise
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
                let size = source.min_matches().max(5);
                let samples = (WORK / (15 + n / 2)).max(1);
                let left = self.wanted(size).saturating_sub(self.consensus.drawn);
                self.consensus.draw(source, samples.min(left), sigma, &mut self.rng);
                if self.consensus.drawn < self.wanted(size) {
                    return Progress::Going;
                }
                self.stage = Stage::Proposing;
                // The candidates of many matches take as long as an image's samples.
                if n < FEW { self.advance(frame, source, workspace, terms) } else { Progress::Going }
            }
            Stage::Proposing => {
                self.propose(source, sigma, terms);
                self.stage = Stage::Adjusting;
                Progress::Going
            }
            Stage::Adjusting => self.adjust(workspace, terms),
            Stage::Judging => self.judge_again(terms),
        }
    }

    /// How many samples are drawn: more where the last ones led to nothing.
    fn wanted(&self, size: usize) -> usize {
        self.consensus.wanted(size) << self.failures.min(3)
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
        self.bench.noise = 1.0;
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
        for scored in self.consensus.best.into_iter().flatten() {
            self.add(scored.pose, Depths::Triangulated, &[terms.relief]);
        }
        if let Some(scored) = self.consensus.best[0] {
            self.add(scored.pose, Depths::Triangulated, &[PLANE_RELIEF]);
        }
        let planes = self.consensus.candidates_of_inliers(source, true, sigma).clone();
        for candidate in planes.iter().take(4) {
            self.add(candidate.pose, Depths::Triangulated, &[PLANE_RELIEF, terms.relief]);
        }
    }

    fn add(&mut self, pose: RelativePose, depths: Depths, reliefs: &[f64]) {
        for &relief in reliefs {
            // One more comes at last.
            if self.proposals.len() + 1 < PROPOSALS {
                self.proposals.push(Proposal { pose, relief, depths });
            }
        }
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
            noise: 1.0,
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
            let settled = workspace.settle(&mut new.map, &survey);
            left -= 1;
            self.steps += 1;
            if settled || self.steps >= STEPS || new.map.damping > 1e5 {
                self.is_adjusting = false;
                if n >= FEW {
                    left = left.saturating_sub(JUDGEMENT);
                }
                workspace.judge(&mut new.map, &survey);
                judge(new, &mut self.bench, &keys[0], &self.chosen, terms);
                let explained = explained(new, &keys[0], &self.chosen);
                let is_settled = new.start_cost <= MOST_COST * n as f64;
                if explained >= terms.least_inliers && 2 * explained >= n && is_settled {
                    rank(&mut self.pool, &mut self.count);
                }
            }
        }
        let [mean] = keys;
        self.mean = mean;
        if is_done { self.after_adjusting(terms) } else { Progress::Going }
    }

    /// What is left to do once all proposals are adjusted.
    fn after_adjusting(&mut self, terms: &Terms<'_>) -> Progress {
        self.failures = if self.count == 0 { self.failures + 1 } else { 0 };
        if self.count == 0 && self.rotation.is_none() {
            return Progress::Nothing;
        }
        self.bench.noise = self.noise(terms);
        if self.bench.noise >= 1.0 {
            return Progress::Done;
        }
        (self.stage, self.next) = (Stage::Judging, 0);
        Progress::Going
    }

    /// Judges the answers again by the noise that the matches show, where that is less than what was told.
    ///
    /// A detector is told as noisy as its worst matches are, several times as noisy as most of them. By so large a noise a scene with
    /// relief may as well be a plane, or a turn.
    fn judge_again(&mut self, terms: &Terms<'_>) -> Progress {
        for h in self.pool[..self.count].iter_mut().skip(self.next).take(JUDGED) {
            judge(h, &mut self.bench, &self.mean, &self.chosen, terms);
        }
        self.next += JUDGED;
        if self.next < self.count {
            return Progress::Going;
        }
        self.pool[..self.count].sort_by(|a, b| a.score.total_cmp(&b.score));
        self.rotation = self.rotation.and_then(|fit| self.fit_rotation(&fit.pose, terms));
        Progress::Done
    }

    /// The share of the variance that was told which the matches show by the answer that fits them best; at most one, and one of few
    /// matches.
    fn noise(&mut self, terms: &Terms<'_>) -> f64 {
        /// Seven in ten matches are right at least; the squares of that share of right ones are below this in units of their variance.
        const SHARE: (usize, usize) = (7, 10);
        const QUANTILE: f64 = 1.074;
        /// The errors of real matches have longer tails than normal ones: half as large again.
        const MARGIN: f64 = 1.5;
        /// A fifth of the standard deviation that was told, not less: nothing is known so well.
        const LEAST: f64 = 0.04;
        /// Of 25 matches with the noise that was told two starts in a thousand show less than this, of forty one in ten thousand.
        const CLEARLY: f64 = 0.5;
        let n = self.consensus.matches.len();
        if n < FEW {
            return 1.0;
        }
        let place = SHARE.0 * (n - 1) / SHARE.1;
        let mut least = f64::INFINITY;
        for h in &self.pool[..self.count] {
            self.scratch.clear();
            self.scratch
                .extend(self.consensus.matches.iter().map(|m| h.map.keys[0].sampson_error(m).powi(2)));
            let (_, &mut square, _) = self.scratch.select_nth_unstable_by(place, f64::total_cmp);
            least = least.min(square);
        }
        let seen = MARGIN * MARGIN * least / QUANTILE / (self.mean.variance + terms.task.place_variance);
        if seen < CLEARLY { seen.max(LEAST) } else { 1.0 }
    }

    /// Adds the reversed scene of the best answer, once: `t → −t`, `ρ → 2 − ρ` fits as well where the parallax is small.
    fn add_reversed(proposals: &mut Vec<Proposal>, pool: &[Hypothesis], count: usize) -> bool {
        if count == 0 || proposals.iter().any(|p| p.depths == Depths::Reversed) {
            return false;
        }
        let pose = RelativePose::new(pool[0].pose.q_21, -pool[0].pose.t_21);
        let relief = pool.iter().take(count).map(|h| h.map.relief).fold(0.0, f64::max);
        proposals.push(Proposal { pose, relief, depths: Depths::Reversed });
        true
    }
}
