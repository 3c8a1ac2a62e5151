//! The search: samples, hypotheses, scores, local optimisation, until enough samples have been drawn.
//!
//! A random sample without outliers still has the noise of five matches. So the best hypothesis of each block of samples is
//! refined over its inliers if it beats the earlier ones (O. Chum, J. Matas, J. Kittler, *Locally optimized RANSAC*, DAGM 2003).
//! It has to beat the best hypothesis as that was before its refinement: this leaves more starts for refinement than the refined one
//! would. Refining every hypothesis that is better than those before it in its block finds no better poses. At the end a few that score
//! nearly as well are refined (`contenders`): they may lead to other minima, among which `conclude::minima` chooses.

mod chart;
mod contenders;
pub(crate) mod crowds;
mod guide;
pub(crate) mod hypotheses;
mod pools;
pub(crate) mod pose_score;
mod ranking;
pub(crate) mod sampling;
pub(crate) mod search_score;
mod stopping;
mod useful;

#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, UnitQuaternion};
use rand_chacha::ChaCha8Rng;

use crate::robust::data::observations::Observations;
use crate::robust::options::{KnownDirection, Options};
use crate::robust::refine::epipolar::{COARSE, Subset, refine};
use crate::robust::refine::loss::Biweight;
use crate::robust::search::chart::chart;
use crate::robust::search::contenders::{CONTENDS, Contenders};
use crate::robust::search::guide::Guide;
use crate::robust::search::hypotheses::{Hypotheses, HypothesisSource};
use crate::robust::search::pose_score::{PoseScorer, Scored, ScoredPose};
use crate::robust::search::sampling::{Exhaustive, MAX_SAMPLE, Sample};
use crate::robust::search::search_score::{MANY, REACH, Scorer};
use crate::solver::shared::motion::Motion;

/// Samples that are solved together before their hypotheses are scored: a few at first, where a few may do.
const FIRST_BLOCK: usize = 8;
const BLOCK: usize = 32;

/// Samples that are drawn before the matches are ranked. They are ranked only where ranking takes less time than the samples that
/// are still needed: a match is ranked in about a seventh of the time of a sample.
const UNRANKED: usize = 40;
const RANKED_PER_SAMPLE: usize = 7;

/// So many samples are drawn without an order, however small it makes the number of those that are needed.
const WITHOUT_ORDER: usize = 300;

/// The stopping rule counts matches up to this multiple of the threshold. At the threshold itself, a pose that is not refined to the
/// end would look worse than it is, and the search would go on for nothing.
const SUPPORT: f64 = 1.5;

/// A sample has led to the best pose if one of its hypotheses explains this share of what the pose explains. Not sensitive
/// between 0.3 and 0.7.
const LED: f64 = 0.5;

/// A number of samples that is not a multiple of this would leave lanes of the solver unused.
const LANES: usize = 8;

/// Rounds of local optimisation, each with the inliers of the last.
const ROUNDS: usize = 3;

/// Steps of a round, and matches that it looks at.
const STEPS: usize = 8;
const MATCHES: usize = 200;

/// Where the loss of the local optimisation levels off, in units of the threshold.
const WIDTH: f64 = 4.0;

/// Costs closer than this are equal: five matches are fitted exactly by every solution. The smaller rotation then comes
/// first, as among candidates.
const EQUAL: f64 = 1e-3;

/// What stops the search.
#[derive(Clone, Copy)]
pub(crate) struct Limits<'a> {
    pub(crate) confidence: f64,
    pub(crate) min_iterations: usize,
    pub(crate) max_iterations: usize,
    /// Asked before each block of samples.
    pub(crate) is_cancelled: &'a (dyn Fn() -> bool + Sync),
}

/// A sample from a pool counts as so many where chance is judged: false matches that agree with each other by chance are near each
/// other in the order too. With one, 0.7 % of files of 300 false matches have a pose.
const GUIDED: usize = 2;

/// What the search found.
#[derive(Clone, Debug)]
pub(crate) struct SearchResult {
    /// The best pose.
    pub(crate) best: Scored,
    /// Every pose that was refined: of few matches every pose that was found.
    pub(crate) refined: Vec<Scored>,
    /// Samples drawn.
    pub(crate) iterations: usize,
    /// As how many uniform samples they count where chance is judged.
    pub(crate) tries: usize,
    /// The direction that both cameras know.
    pub(crate) direction: Option<KnownDirection>,
}

impl SearchResult {
    /// Whether a rotation takes the direction that both cameras know from one to the other.
    pub(crate) fn allows(&self, q_21: &UnitQuaternion<f64>) -> bool {
        self.direction.is_none_or(|direction| direction.allows(q_21))
    }
}

/// What decides which samples are drawn.
#[derive(Debug)]
pub(crate) struct Draws {
    pub(crate) rng: ChaCha8Rng,
    /// Matches of a sample.
    pub(crate) size: usize,
    /// The matches from the best to the worst, where it is known.
    pub(crate) given: Option<Vec<u32>>,
}

/// Whether chance explains a pose with its inliers within the threshold that was found among this many samples.
pub(crate) type IsChance<'a> = dyn FnMut(&ScoredPose, usize) -> bool + 'a;

/// Samples that are solved together.
#[derive(Debug, Default)]
struct Round {
    samples: Vec<Sample>,
    /// The same by the caller's numbers of the matches.
    given: Vec<Sample>,
    is_from_pool: Vec<bool>,
    hypotheses: Hypotheses,
}

impl Round {
    fn draw(&mut self, guide: &mut Guide, count: usize) {
        self.samples.clear();
        self.is_from_pool.clear();
        for _ in 0..count {
            let mut sample = [0; MAX_SAMPLE];
            self.is_from_pool.push(guide.draw(&mut sample));
            self.samples.push(sample);
        }
    }
}

/// The search for the best pose.
#[derive(Debug)]
pub(crate) struct Search<'a> {
    pub(crate) observations: &'a Observations<'a>,
    direction: Option<KnownDirection>,
    scorer: Scorer<'a>,
    poses: PoseScorer<'a>,
    /// The best cost of a hypothesis before refinement.
    best_hypothesis: f64,
    /// The best pose.
    best: Option<Scored>,
    /// A pose that was found before: the search is for another that explains clearly more.
    known: Option<Motion>,
    /// Every pose that was refined, and the hypotheses that might have been.
    refined: Vec<Scored>,
    contenders: Contenders,
    /// Samples drawn, and as how many uniform ones they count where chance is judged.
    iterations: usize,
    tries: usize,
    /// How many poses have been the best; which of them the guide knows; whether chance explains that one, once this was asked.
    bests: usize,
    guided: usize,
    is_chance: Option<bool>,
}

impl<'a> Search<'a> {
    pub(crate) fn new(
        observations: &'a Observations<'a>,
        options: &Options,
        direction: Option<KnownDirection>,
    ) -> Self {
        let loss = options.loss;
        Self {
            observations,
            direction,
            scorer: Scorer::new(observations, loss),
            poses: PoseScorer::new(observations, loss),
            best_hypothesis: observations.len() as f64,
            best: None,
            known: None,
            refined: Vec::new(),
            contenders: Contenders::default(),
            iterations: 0,
            tries: 0,
            bests: 0,
            guided: 0,
            is_chance: None,
        }
    }

    /// Draws samples until the limits say that they are enough: all that there are of few matches, else as many as the guide says.
    /// `given` are the matches from the best to the worst, where that is known. `is_chance` says whether as many samples as were
    /// drawn would find a motion as good among false matches.
    pub(crate) fn run(
        &mut self,
        source: &mut dyn HypothesisSource,
        draws: Draws,
        limits: &Limits,
        is_chance: &mut IsChance,
    ) {
        let matches = self.observations.len();
        if sampling::is_exhaustive(matches) {
            return self.run_all(source, Exhaustive::new(matches, draws.size), limits);
        }
        let mut guide = Guide::new(draws.rng, matches, draws.size, limits.confidence);
        if let Some(known) = self.known {
            let pose = self.poses.score(known, SUPPORT * self.poses.threshold());
            guide.set_known(pose.inliers.len());
            self.poses.recycle(pose);
        }
        let mut given = draws.given;
        // Scores guide from the first sample on.
        if given.is_some() && !guide.is_too_small() {
            guide.rank(chart(self.observations), given.take());
        }
        let mut round = Round::default();
        let mut enough = self.enough(&mut guide, limits, is_chance);
        let mut block = FIRST_BLOCK;
        while self.iterations < enough && !(limits.is_cancelled)() {
            let wanted = (enough - self.iterations).min(block).next_multiple_of(LANES);
            round.draw(&mut guide, wanted.min(limits.max_iterations - self.iterations));
            self.look_at(source, &mut round);
            self.learn(&mut guide, &round, draws.size);
            enough = self.enough(&mut guide, limits, is_chance);
            // What a few samples more would end is not worth an order.
            let is_long =
                enough - self.iterations.min(enough) > matches / RANKED_PER_SAMPLE && enough > WITHOUT_ORDER;
            if self.iterations >= UNRANKED && is_long && !guide.is_ranked() && !guide.is_too_small() {
                guide.rank(chart(self.observations), None);
                enough = self.enough(&mut guide, limits, is_chance);
            }
            block = BLOCK;
        }
        self.consider_contenders();
    }

    /// What was found, `None` where there is no pose, and the scorer of poses for what follows.
    pub(crate) fn into_result(self) -> (PoseScorer<'a>, Option<SearchResult>) {
        let Self { poses, best, refined, iterations, tries, direction, .. } = self;
        (poses, best.map(|best| SearchResult { best, refined, iterations, tries, direction }))
    }

    /// Looks at every sample, which costs little where there are few matches.
    fn run_all(&mut self, source: &mut dyn HypothesisSource, mut samples: Exhaustive, limits: &Limits) {
        let mut round = Round::default();
        while self.iterations < limits.max_iterations && !(limits.is_cancelled)() {
            round.samples.clear();
            round.samples.extend(samples.by_ref().take(BLOCK.min(limits.max_iterations - self.iterations)));
            if round.samples.is_empty() {
                break;
            }
            self.look_at(source, &mut round);
        }
    }

    /// Solves the samples of a round, and considers what they lead to.
    fn look_at(&mut self, source: &mut dyn HypothesisSource, round: &mut Round) {
        self.iterations += round.samples.len();
        let from_pools = round.is_from_pool.iter().filter(|is_from_pool| **is_from_pool).count();
        self.tries += round.samples.len() + (GUIDED - 1) * from_pools;
        round.hypotheses.clear();
        round.given.clear();
        let given = |place: usize| self.observations.order[place] as usize;
        round.given.extend(round.samples.iter().map(|sample| sample.map(given)));
        source.hypotheses(self.observations.given, &round.given, &mut round.hypotheses);
        self.consider(round.hypotheses.matrices());
    }

    /// Tells the guide which of the samples of inliers of its best pose led to it.
    fn learn(&self, guide: &mut Guide, round: &Round, size: usize) {
        let Some(best) = self.best.filter(|_| self.guided == self.bests) else { return };
        let count = self.observations.len() as f64;
        let limit = count - LED * (count - best.cost);
        for (k, (sample, is_from_pool)) in round.samples.iter().zip(&round.is_from_pool).enumerate() {
            if guide.tells(&sample[..size], *is_from_pool) {
                let mut own = round.hypotheses.of(k).iter();
                let is_useful = own.any(|e| self.scorer.score(e, limit).is_some());
                guide.learn(is_useful, *is_from_pool);
            }
        }
    }

    /// How many samples are enough.
    fn enough(&mut self, guide: &mut Guide, limits: &Limits, is_chance: &mut IsChance) -> usize {
        let Some(best) = self.best else { return limits.max_iterations };
        if self.guided != self.bests {
            let pose = self.poses.score(best.motion, SUPPORT * self.poses.threshold());
            guide.set_best(&pose.inliers);
            self.poses.recycle(pose);
            self.guided = self.bests;
            self.is_chance = None;
        }
        let mut needed = guide.needed();
        if needed <= 0.0 && self.iterations >= limits.min_iterations && self.observations.len() >= MANY {
            if self.is_chance.is_none() {
                let pose = self.poses.score(best.motion, self.poses.threshold());
                self.is_chance = Some(is_chance(&pose, self.tries));
                self.poses.recycle(pose);
            }
            if self.is_chance == Some(true) {
                needed = f64::INFINITY;
            }
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, and is positive"
        )]
        let needed = needed.ceil() as usize;
        self.iterations.saturating_add(needed).max(limits.min_iterations).min(limits.max_iterations)
    }

    /// Scores hypotheses, and refines the best of them where it is the best so far.
    fn consider(&mut self, hypotheses: &[Matrix3<f64>]) {
        if self.observations.len() < MANY {
            for e in hypotheses {
                self.consider_one_of_few(e);
            }
            return;
        }
        let mut best = None;
        for e in hypotheses {
            let Some(cost) = self.scorer.score(e, CONTENDS * self.best_hypothesis) else { continue };
            if cost >= self.best_hypothesis {
                self.contenders.offer(cost, e);
                continue;
            }
            let Some(pose) = self.poses.best_pose(e, self.width()) else { continue };
            let scored = pose.scored;
            self.poses.recycle(pose);
            if scored.cost < self.best_hypothesis && self.allows(&scored) {
                self.best_hypothesis = scored.cost;
                best = Some(scored.motion);
            }
        }
        if let Some(motion) = best {
            self.consider_pose(motion);
        }
    }

    /// With few matches the scores hardly differ, so every hypothesis is refined and kept.
    fn consider_one_of_few(&mut self, e: &Matrix3<f64>) {
        let pose = self.poses.best_pose(e, self.width());
        let Some(pose) = pose.filter(|pose| self.allows(&pose.scored)) else { return };
        let optimised = self.optimise(pose);
        self.refined.push(optimised);
        let order = |s: &Scored| ((s.cost / EQUAL).round(), s.motion.q_21.angle());
        if self.best.is_none_or(|best| order(&optimised) < order(&best)) {
            self.best = Some(optimised);
        }
    }

    /// Refines a pose, and keeps it where it is better and allowed.
    pub(crate) fn consider_pose(&mut self, motion: Motion) {
        let pose = self.poses.score(motion, self.width());
        let optimised = self.optimise(pose);
        if self.allows(&optimised) {
            self.refined.push(optimised);
            self.keep(optimised);
        }
    }

    /// Considers a pose that was found before, and looks only for another that explains clearly more.
    pub(crate) fn know(&mut self, motion: Motion) {
        self.known = Some(motion);
        self.consider_pose(motion);
    }

    /// Refines the best of the other hypotheses: they may lead to other minima.
    fn consider_contenders(&mut self) {
        let known = self.refined.iter().map(|scored| scored.motion.essential()).collect();
        let contenders = std::mem::take(&mut self.contenders);
        for e in contenders.distinct(CONTENDS * self.best_hypothesis, known) {
            let Some(pose) = self.poses.best_pose(&e, self.width()) else { continue };
            let motion = pose.scored.motion;
            self.poses.recycle(pose);
            self.consider_pose(motion);
        }
    }

    /// Whether a pose agrees with the direction that is known.
    fn allows(&self, scored: &Scored) -> bool {
        self.direction.is_none_or(|direction| direction.allows(&scored.motion.q_21))
    }

    fn keep(&mut self, scored: Scored) {
        if self.best.is_none_or(|best| scored.cost < best.cost) {
            self.best = Some(scored);
            self.bests += 1;
        }
    }

    /// The limit of the inliers that local optimisation looks at, in pixels.
    fn width(&self) -> f64 {
        REACH * self.poses.threshold()
    }

    /// Refines a pose over its inliers.
    fn optimise(&mut self, start: ScoredPose) -> Scored {
        let loss = Biweight::new(WIDTH * self.poses.threshold());
        let first = |inliers: &[u32]| inliers[..inliers.len().min(MATCHES)].to_vec();
        let (mut best, mut some) = (start.scored, first(&start.inliers));
        self.poses.recycle(start);
        for _ in 0..ROUNDS {
            if some.len() < MAX_SAMPLE.min(self.observations.len()) {
                break;
            }
            let mut motion = best.motion;
            refine(&Subset::new(&self.observations.columns, &some), &mut motion, &loss, COARSE, STEPS);
            let Some(pose) = self.poses.best_pose(&motion.essential(), self.width()) else { break };
            let is_better = pose.scored.cost < best.cost && self.allows(&pose.scored);
            if is_better {
                (best, some) = (pose.scored, first(&pose.inliers));
            }
            self.poses.recycle(pose);
            if !is_better {
                break;
            }
        }
        best
    }
}
