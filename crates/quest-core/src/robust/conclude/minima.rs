//! Which of several local minima of the cost is the pose.
//!
//! Two minima that explain mostly the same matches may differ little in their cost, and noise decides which is the lower one: every
//! match brings a depth of its own, which fits a residual (J. Neyman, E. L. Scott, *Consistent estimates based on partially
//! consistent observations*, Econometrica 1948). So they are compared by the likelihoods of all matches, the depths integrated out. With
//! `r` the Sampson error of a match, `ρ` its inverse depth with the precision `w` at unit noise, `σ` the noise, `ε` the share of false
//! matches and `A` the area over which these are spread, the density of a match is
//!
//! ```text
//! p = (1 − ε) Σk ck N(r; k²σ²) p(ρ) / (2 √w) + ε/A
//! ```
//!
//! The noise has the tails of keypoints, and so reaches further than the threshold. `p(ρ)` is what [`Usual`] says of the pose's own
//! inliers; behind the cameras it falls off as the noise does. `2 √w dr dρ` is an element of the area of view 2.

use std::f64::consts::PI;

use crate::algebra::vectors::exponential::{exp, ln};
use crate::robust::conclude::evidence::TAILS;
use crate::robust::conclude::final_refinement::{Polished, polish};
use crate::robust::conclude::inverse_depth::{InverseDepth, Usual};
use crate::robust::data::columns::Columns;
use crate::robust::data::observations::Observations;
use crate::robust::refine::noise;
use crate::robust::search::SearchResult;
use crate::robust::search::pose_score::{PoseScorer, Scored, ScoredPose};
use crate::robust::search::search_score::MANY;
use crate::solver::shared::motion::Motion;

/// Another minimum is compared if its cost is at most this multiple of the best one's. With 1.4 poses that explain clearly less
/// win as well.
const NEARLY: f64 = 1.1;

/// It explains at least this share of the matches that the best one explains, and the other way round: another group of matches is no
/// other minimum. Measured: with 0.6 the AUC of the recorded pairs is 0.2 lower, between 0.7 and 0.8 it is the same.
const SHARED: f64 = 0.8;

/// It replaces the best if it is likelier by so many nats, e³ times. Not sensitive between two and four.
const BETTER: f64 = 3.0;

/// So many minima are compared, by so many matches. Both bound the time alone.
const MOST: usize = 12;
const COMPARED: usize = 500;

/// Motions closer than this, in radians, are the same minimum.
const SAME_MINIMUM: f64 = 2e-3;

/// The likeliest of the minima that the search has found: the best by its cost, or one of the others that it refined. They are
/// compared as the search left them first, and those that are likelier then refined to the end.
pub(crate) fn likeliest(poses: &mut PoseScorer, best: Polished, found: &SearchResult) -> Polished {
    if poses.observations.len() < MANY {
        return best;
    }
    let limit = NEARLY * found.best.cost;
    let mut others: Vec<&Scored> = found.refined.iter().filter(|other| other.cost <= limit).collect();
    others.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let likelihood = PoseLikelihood::new(poses.observations, &best);
    let mut known = vec![found.best.motion];
    let (mut of_search, mut of_best) = (None, None);
    let mut likeliest: Option<(f64, Polished)> = None;
    for other in others {
        if known.len() > MOST || known.iter().any(|known| is_same_minimum(known, &other.motion)) {
            continue;
        }
        known.push(other.motion);
        let least = *of_search.get_or_insert_with(|| likelihood.of_motion(poses, found.best.motion));
        if likelihood.of_motion(poses, other.motion) < least {
            continue;
        }
        let other = polish(poses, other.motion);
        let of_best = *of_best.get_or_insert_with(|| likelihood.of(&best.pose));
        let least = likeliest.as_ref().map_or(of_best + BETTER, |(nats, _)| *nats);
        let nats = likelihood.of(&other.pose);
        if nats > least && explain_the_same(&best, &other) {
            likeliest = Some((nats, other));
        }
    }
    likeliest.map_or(best, |(_, likeliest)| likeliest)
}

fn is_same_minimum(a: &Motion, b: &Motion) -> bool {
    a.q_21.angle_to(&b.q_21) < SAME_MINIMUM && a.direction.dot(&b.direction) > SAME_MINIMUM.cos()
}

/// Whether most of the matches that one of the two explains are explained by the other.
fn explain_the_same(a: &Polished, b: &Polished) -> bool {
    let (a, b) = (&a.pose, &b.pose);
    a.inliers_in_common(b) as f64 >= SHARED * a.inliers.len().max(b.inliers.len()) as f64
}

/// The likelihood of a pose, in nats.
struct PoseLikelihood<'a> {
    columns: &'a Columns,
    sigma: f64,
    /// `(1 − ε) / (2 √(2π) σ)` and `ε/A`.
    truth: f64,
    floor: f64,
}

impl<'a> PoseLikelihood<'a> {
    /// With the noise and the share of true matches of a pose.
    fn new(observations: &'a Observations, pose: &Polished) -> Self {
        let inliers = pose.pose.inliers.len();
        let sigma = noise::prudent(pose.sigma, inliers, observations.columns.threshold());
        let outliers = (1.0 - inliers as f64 / observations.len() as f64).clamp(0.01, 0.99);
        let area = observations.area_of_view2().max(sigma * sigma);
        let truth = (1.0 - outliers) / (2.0 * (2.0 * PI).sqrt() * sigma);
        Self { columns: &observations.columns, sigma, truth, floor: outliers / area }
    }

    fn of_motion(&self, poses: &mut PoseScorer, motion: Motion) -> f64 {
        let pose = poses.score(motion, poses.threshold());
        let nats = self.of(&pose);
        poses.recycle(pose);
        nats
    }

    fn of(&self, pose: &ScoredPose) -> f64 {
        let motion = &pose.scored.motion;
        let inliers = &pose.inliers[..pose.inliers.len().min(COMPARED)];
        if inliers.is_empty() {
            return f64::NEG_INFINITY;
        }
        let usual = Usual::new(&InverseDepth::all(self.columns, motion, inliers));
        let density = |(i, r): (usize, &f64)| {
            let depth = InverseDepth::new(self.columns, motion, i);
            let of_tail = |[share, width]: [f64; 2]| {
                let inverse = 1.0 / (width * self.sigma);
                share / width * exp(-0.5 * (r * inverse).powi(2))
            };
            let across: f64 = TAILS.into_iter().map(of_tail).sum();
            let behind = exp(-0.5 * depth.value.min(0.0).powi(2) / depth.variance(self.sigma));
            let along = usual.density(&depth, self.sigma) / depth.precision.sqrt();
            ln(self.truth * across * behind * along + self.floor)
        };
        pose.residuals().iter().enumerate().take(COMPARED).map(density).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robust::options::Options;
    use crate::robust::search::sampling::generator;
    use crate::robust::search::{Draws, Limits, Search, hypotheses};
    use crate::simulate::{self, FOCAL_LENGTH, Scene, SceneOptions};
    use crate::solver::SolverName;

    const SEED: u64 = 0x3_11a3;

    #[test]
    fn the_likelier_minimum_is_nearer_the_truth() {
        let (mut nearer, mut farther) = (0, 0);
        for index in 0..400 {
            let options = SceneOptions {
                points: 30,
                noise_px: 1.0,
                motion: simulate::Motion::Parallax(0.1),
                ..SceneOptions::realistic()
            };
            let mut scene = Scene::generate(&options, SEED, index).unwrap();
            scene.add_outliers(0.3, SEED, index).unwrap();
            let order = (0..).take(scene.matches.len()).collect();
            let observations = Observations::new(&scene.matches, order, [[FOCAL_LENGTH; 2]; 2], 2.0);
            let mut search = Search::new(&observations, &Options::default(), None);
            let limits = Limits {
                confidence: 0.999,
                min_iterations: 100,
                max_iterations: 1_000,
                is_cancelled: &|| false,
            };
            let draws = Draws { rng: generator(SEED, index), size: 5, given: None };
            let mut source = hypotheses::of_solver(SolverName::Quest, 30);
            search.run(&mut *source, draws, &limits, &mut |_, _| false);
            let (mut poses, found) = search.into_result();
            let found = found.unwrap();
            let best = polish(&mut poses, found.best.motion);
            let before = *best.motion();
            let after = *likeliest(&mut poses, best, &found).motion();
            let error = |motion: &Motion| motion.direction.angle(&scene.truth.t_21);
            if !is_same_minimum(&before, &after) {
                nearer += usize::from(error(&after) < error(&before));
                farther += usize::from(error(&after) > error(&before));
            }
        }
        assert!(nearer >= 5 && nearer >= 3 * farther, "{nearer} {farther}");
    }
}
