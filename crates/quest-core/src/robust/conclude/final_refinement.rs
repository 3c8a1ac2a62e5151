//! The last refinement of a pose: over all of its inliers, with the noise that they show.

use crate::robust::refine::epipolar::{FINE, Subset, refine};
use crate::robust::refine::loss::{HeavyTailed, Truncated};
use crate::robust::refine::noise;
use crate::robust::search::pose_score::{PoseScorer, Scored};
use crate::solver::shared::motion::Motion;

/// Steps of each refinement.
const STEPS: usize = 15;

/// Inliers, at most, that the first of them looks at: it is where the second begins.
const ENOUGH: usize = 5_000;

/// The scale of the last loss, in standard deviations of the noise: normal noise loses 7 % of its worth, and 1 %
/// where it is recognised.
const WIDTH: f64 = 2.8;
const WIDTH_OF_NORMAL: f64 = 5.0;

/// The inliers that it is fitted over, in standard deviations.
const WIDE: f64 = 9.0;

/// Fewer inliers than this do not determine a motion and its noise.
pub(crate) const FEWEST: usize = 6;

/// A refined pose and its noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Polished {
    pub(crate) scored: Scored,
    /// The standard deviation of the inliers' residuals, in pixels.
    pub(crate) sigma: f64,
    /// The loss of the last refinement, and how far away, in pixels, a match still had a say.
    pub(crate) loss: HeavyTailed,
    pub(crate) limit: f64,
}

/// Refines a pose by least squares over its inliers, measures the noise, and refines it with a loss of that scale. The
/// inliers that [`PoseScorer`] holds afterwards are those of the result.
pub(crate) fn polish(poses: &mut PoseScorer, start: Motion) -> Polished {
    let threshold = poses.threshold();
    let mut best = poses.score(start, threshold);
    let mut motion = start;
    if poses.inliers.len() >= FEWEST {
        let some = poses.inliers.len().min(ENOUGH);
        let subset = Subset::new(&poses.observations.columns, &poses.inliers[..some]);
        refine(&subset, &mut motion, &Truncated::new(threshold), FINE, STEPS);
        take_better(poses, &mut best, motion);
    }
    let shown = sigma(poses, &best.motion);
    let noise = noise::prudent(shown, poses.inliers.len(), threshold);
    let limit = WIDE * noise;
    poses.score(best.motion, limit);
    let residuals = poses.inliers.iter().map(|&i| poses.residuals()[i as usize]);
    let width = if noise::is_normal(residuals, shown) { WIDTH_OF_NORMAL } else { WIDTH };
    let loss = HeavyTailed::new(width * noise);
    if poses.inliers.len() >= FEWEST {
        let mut motion = best.motion;
        let subset = Subset::new(&poses.observations.columns, &poses.inliers);
        refine(&subset, &mut motion, &loss, FINE, STEPS);
        let scored = poses.best_pose(&motion.essential(), threshold);
        best = scored.unwrap_or(best);
    }
    let sigma = sigma(poses, &best.motion);
    Polished { scored: best, sigma, loss, limit }
}

fn take_better(poses: &mut PoseScorer, best: &mut Scored, motion: Motion) {
    if let Some(scored) = poses.best_pose(&motion.essential(), poses.threshold())
        && scored.cost < best.cost
    {
        *best = scored;
    }
}

/// The noise of the inliers of a pose; leaves its inliers in `poses`.
pub(crate) fn sigma(poses: &mut PoseScorer, motion: &Motion) -> f64 {
    poses.score(*motion, poses.threshold());
    noise::estimate(poses.inliers.iter().map(|&i| poses.residuals()[i as usize]), poses.threshold())
}
