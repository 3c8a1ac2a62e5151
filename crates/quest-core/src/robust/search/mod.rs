//! The search: samples, hypotheses, scores, local optimisation, until enough samples have been drawn.
//!
//! A random sample without outliers still has the noise of five matches. So hypotheses that beat the earlier ones, of each
//! block of samples the best, are refined over their inliers (O. Chum, J. Matas, J. Kittler, *Locally optimized RANSAC*, DAGM
//! 2003); what they have to beat is the best hypothesis as it was before its refinement, which leaves more starts for
//! refinement than the refined one would. To refine every one that is better than those before it in its block finds
//! poses no better.

pub(crate) mod pose_score;
pub(crate) mod sampling;
pub(crate) mod search_score;
pub(crate) mod stopping;

use nalgebra::{Matrix3, Vector3};

use crate::lanes::{BatchSolver, Essentials, Tolerance};
use crate::robust::data::observations::Observations;
use crate::robust::options::{KnownDirection, Options};
use crate::robust::refine::epipolar::{COARSE, Subset, refine};
use crate::robust::refine::loss::Biweight;
use crate::robust::search::pose_score::{PoseScorer, Scored, ScoredPose};
use crate::robust::search::sampling::{MAX_SAMPLE, Sampler};
use crate::robust::search::search_score::{MANY, REACH, Scorer};
use crate::solver::SolverName;
use crate::solver::shared::motion::Motion;
use crate::{Candidates, Correspondence, alignment::best_rotation, solver};

/// Samples that are solved together before their hypotheses are scored: a few at first, where a few may do.
const FIRST_BLOCK: usize = 8;
const BLOCK: usize = 32;

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

/// Bearings this close after a rotation are turned into each other to rounding.
const EXACT: f64 = 1e-12;

/// What stops the search.
#[derive(Clone, Copy)]
pub(crate) struct Limits<'a> {
    pub(crate) confidence: f64,
    pub(crate) min_iterations: usize,
    pub(crate) max_iterations: usize,
    /// Asked before each block of samples.
    pub(crate) is_cancelled: &'a (dyn Fn() -> bool + Sync),
}

/// What the search found.
#[derive(Clone, Debug)]
pub(crate) struct SearchResult {
    /// The best pose.
    pub(crate) best: Scored,
    /// With few matches, every pose that was found, refined.
    pub(crate) of_few: Vec<Scored>,
    /// Samples drawn.
    pub(crate) iterations: usize,
}

/// The search for the best pose.
#[derive(Debug)]
pub(crate) struct Search<'a> {
    observations: &'a Observations,
    solver: SolverName,
    lanes: BatchSolver,
    essentials: Essentials,
    samples: Vec<[usize; MAX_SAMPLE]>,
    direction: Option<KnownDirection>,
    scorer: Scorer<'a>,
    poses: PoseScorer<'a>,
    /// The best cost of a hypothesis before refinement.
    best_hypothesis: f64,
    /// The best pose.
    best: Option<Scored>,
    /// With few matches, every pose that was found, refined.
    all: Vec<Scored>,
    /// Samples drawn.
    iterations: usize,
    hypotheses: Vec<Matrix3<f64>>,
}

impl<'a> Search<'a> {
    pub(crate) fn new(
        observations: &'a Observations,
        options: &Options,
        direction: Option<KnownDirection>,
    ) -> Self {
        let Options { loss, solver, .. } = *options;
        Self {
            observations,
            solver,
            lanes: BatchSolver::new(Tolerance::Loop),
            essentials: Essentials::new(),
            samples: Vec::new(),
            direction,
            scorer: Scorer::new(observations, loss),
            poses: PoseScorer::new(observations, loss),
            best_hypothesis: observations.len() as f64,
            best: None,
            all: Vec::new(),
            iterations: 0,
            hypotheses: Vec::new(),
        }
    }

    /// Draws samples until the limits say that it is enough.
    pub(crate) fn run(&mut self, sampler: &mut Sampler, limits: &Limits) {
        // Where there are few samples it costs little to see them all.
        let min_iterations = if sampler.is_exhaustive() { usize::MAX } else { limits.min_iterations };
        let limits = &Limits { min_iterations, ..*limits };
        let mut enough = self.enough(limits);
        let mut block = FIRST_BLOCK;
        while self.iterations < enough && !(limits.is_cancelled)() {
            self.samples.clear();
            let mut sample = [0; MAX_SAMPLE];
            let wanted = (enough - self.iterations).next_multiple_of(LANES).min(block);
            let left = limits.max_iterations - self.iterations;
            while self.samples.len() < wanted.min(left) && sampler.draw(&mut sample).is_some() {
                self.samples.push(sample);
            }
            if self.samples.is_empty() {
                break;
            }
            self.iterations += self.samples.len();
            let mut hypotheses = std::mem::take(&mut self.hypotheses);
            hypotheses.clear();
            self.solve(&mut hypotheses);
            self.consider(&hypotheses);
            self.hypotheses = hypotheses;
            enough = self.enough(limits);
            block = BLOCK;
        }
    }

    /// What was found, `None` where there is no pose, and the scorer of poses for what follows.
    pub(crate) fn into_result(self) -> (PoseScorer<'a>, Option<SearchResult>) {
        let Self { poses, best, all, iterations, .. } = self;
        (poses, best.map(|best| SearchResult { best, of_few: all, iterations }))
    }

    /// How many samples are enough.
    fn enough(&self, limits: &Limits) -> usize {
        let size = self.solver.info().min_matches;
        let needed = self.best.map_or(f64::INFINITY, |best| {
            stopping::iterations(best.support, self.observations.len(), size, limits.confidence)
        });
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, and is positive"
        )]
        let needed = needed.ceil() as usize;
        needed.max(limits.min_iterations).min(limits.max_iterations)
    }

    /// The essential matrices of the samples.
    fn solve(&mut self, hypotheses: &mut Vec<Matrix3<f64>>) {
        let matches = &self.observations.matches;
        if self.solver == SolverName::Quest {
            #[expect(clippy::cast_possible_truncation, reason = "matches are counted by u32")]
            let five: Vec<[u32; 5]> =
                self.samples.iter().map(|sample| std::array::from_fn(|k| sample[k] as u32)).collect();
            // Every index is one of a match: there is no error.
            if self.lanes.solve(matches, &five, &mut self.essentials).is_ok() {
                hypotheses.extend(self.essentials.matrices().iter().map(|e| Matrix3::from_row_slice(e)));
            }
            let empty = (0..five.len()).filter(|&k| self.essentials.of(k).is_empty());
            for sample in empty.map(|k| &five[k]) {
                hypotheses.extend(turned_in_place(&sample.map(|i| matches[i as usize])));
            }
            return;
        }
        let size = self.solver.info().min_matches;
        for sample in &self.samples {
            let all = sample.map(|i| matches[i]);
            let mut candidates = Candidates::new();
            self.solver.solve(solver::Kinds::Exact, &all[..size], &mut candidates);
            let first = hypotheses.len();
            for candidate in candidates.iter() {
                let pose = &candidate.pose;
                let t = pose.t_21.try_normalize(0.0).unwrap_or_else(Vector3::x);
                let e = t.cross_matrix() * pose.r_21();
                // Twisted pairs have one essential matrix, of either sign.
                let is_new = |other: &Matrix3<f64>| e.dot(other).abs() < 2.0 - 1e-12;
                if e.iter().all(|x| x.is_finite()) && hypotheses[first..].iter().all(is_new) {
                    hypotheses.push(e);
                }
            }
        }
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
            if self.scorer.score(e, self.best_hypothesis).is_none() {
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

    /// Of few matches every hypothesis is refined and kept: the scores hardly tell them apart.
    fn consider_one_of_few(&mut self, e: &Matrix3<f64>) {
        let pose = self.poses.best_pose(e, self.width());
        let Some(pose) = pose.filter(|pose| self.allows(&pose.scored)) else { return };
        let optimised = self.optimise(pose);
        self.all.push(optimised);
        let order = |s: &Scored| ((s.cost / EQUAL).round(), s.motion.q_21.angle());
        if self.best.is_none_or(|best| order(&optimised) < order(&best)) {
            self.best = Some(optimised);
        }
    }

    /// Refines a pose, and keeps it where it is better.
    pub(crate) fn consider_pose(&mut self, motion: Motion) {
        let pose = self.poses.score(motion, self.width());
        let optimised = self.optimise(pose);
        self.keep(optimised);
    }

    /// Whether a pose agrees with the direction that is known.
    fn allows(&self, scored: &Scored) -> bool {
        self.direction.is_none_or(|direction| direction.allows(&scored.motion.q_21))
    }

    fn keep(&mut self, scored: Scored) {
        if self.best.is_none_or(|best| scored.cost < best.cost) {
            self.best = Some(scored);
        }
    }

    /// The limit of the inliers that local optimisation looks at, in pixels.
    fn width(&self) -> f64 {
        REACH * self.poses.threshold()
    }

    /// Refines a pose over its inliers.
    fn optimise(&mut self, start: ScoredPose) -> Scored {
        let loss = Biweight::new(WIDTH * self.poses.threshold());
        let mut best = start;
        for _ in 0..ROUNDS {
            let count = best.inliers.len().min(MATCHES);
            if count < MAX_SAMPLE.min(self.observations.len()) {
                break;
            }
            let subset = Subset::new(&self.observations.columns, &best.inliers[..count]);
            let mut motion = best.scored.motion;
            refine(&subset, &mut motion, &loss, COARSE, STEPS);
            let Some(pose) = self.poses.best_pose(&motion.essential(), self.width()) else { break };
            if pose.scored.cost < best.scored.cost && self.allows(&pose.scored) {
                self.poses.recycle(std::mem::replace(&mut best, pose));
            } else {
                self.poses.recycle(pose);
                break;
            }
        }
        let scored = best.scored;
        self.poses.recycle(best);
        scored
    }
}

/// The essential matrix of matches that a rotation alone explains to the last digit, with one of the translations that they
/// leave open.
fn turned_in_place(matches: &[Correspondence]) -> Option<Matrix3<f64>> {
    let q_21 = best_rotation(matches);
    let is_exact = matches.iter().all(|m| (q_21 * m.bearing1()).cross(m.bearing2()).norm() < EXACT);
    is_exact.then(|| Vector3::<f64>::x().cross_matrix() * q_21.to_rotation_matrix().into_inner())
}
