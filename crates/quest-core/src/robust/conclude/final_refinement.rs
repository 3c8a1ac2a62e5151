//! The last refinement of a pose: over all of its inliers, with the noise that they show.

use crate::robust::conclude::by_chance::ByChance;
use crate::robust::refine::epipolar::{FINE, Subset, refine};
use crate::robust::refine::loss::{HeavyTailed, Truncated};
use crate::robust::refine::noise;
use crate::robust::search::pose_score::{PoseScorer, Scored, ScoredPose};
use crate::solver::shared::motion::Motion;

/// Steps of each refinement.
const STEPS: usize = 15;

/// The most inliers that the first refinement looks at: it is only where the second begins.
const ENOUGH: usize = 5_000;

/// The scale of the last loss, in standard deviations of the noise. Normal noise loses 7 % of its worth with the first, and 1 %
/// with the second, which is taken where the noise is recognised as normal.
const WIDTH: f64 = 2.8;
const WIDTH_OF_NORMAL: f64 = 5.0;

/// The inliers that it is fitted over, in standard deviations.
const WIDE: f64 = 9.0;

/// Fewer inliers than this do not determine a motion and its noise.
pub(crate) const FEWEST: usize = 6;

/// A refined pose and its noise.
#[derive(Clone, Debug)]
pub(crate) struct Polished {
    /// The pose, its inliers within the threshold.
    pub(crate) pose: ScoredPose,
    /// The standard deviation of the inliers' residuals, in pixels.
    pub(crate) sigma: f64,
    /// The loss of the last refinement, and how far away, in pixels, a match still had a say.
    pub(crate) loss: HeavyTailed,
    pub(crate) limit: f64,
    /// The matches that agree with it by chance.
    pub(crate) by_chance: ByChance,
}

impl Polished {
    pub(crate) fn motion(&self) -> &Motion {
        &self.pose.scored.motion
    }

    /// The same with another pose, and the noise of that.
    pub(crate) fn with_pose(self, pose: ScoredPose, threshold: f64) -> Self {
        let sigma = noise::estimate(pose.inlier_residuals(), threshold);
        Self { pose, sigma, ..self }
    }
}

/// Refines a pose by least squares over its inliers, measures the noise, and refines it with a loss of that scale.
pub(crate) fn polish(poses: &mut PoseScorer, start: Motion) -> Polished {
    let threshold = poses.threshold();
    let mut pose = poses.score(start, threshold);
    if pose.inliers.len() >= FEWEST {
        let mut motion = start;
        let some = pose.inliers.len().min(ENOUGH);
        let subset = Subset::new(&poses.observations.columns, &pose.inliers[..some]);
        refine(&subset, &mut motion, &Truncated::new(threshold), FINE, STEPS);
        drop(subset);
        if let Some(better) = best_of(poses, &motion).filter(|found| found.cost < pose.scored.cost) {
            poses.recycle(pose);
            pose = poses.score(better.motion, threshold);
        }
    }
    let shown = noise::estimate(pose.inlier_residuals(), threshold);
    let noise = noise::prudent(shown, pose.inliers.len(), threshold);
    let limit = WIDE * noise;
    let mut motion = pose.scored.motion;
    poses.recycle(pose);
    let mut wide = poses.score(motion, limit);
    let is_normal = noise::is_normal(wide.inlier_residuals(), shown);
    let loss = HeavyTailed::new(noise * if is_normal { WIDTH_OF_NORMAL } else { WIDTH });
    let inliers = std::mem::take(&mut wide.inliers);
    poses.recycle(wide);
    if inliers.len() >= FEWEST {
        let mut refined = motion;
        let subset = Subset::new(&poses.observations.columns, &inliers);
        refine(&subset, &mut refined, &loss, FINE, STEPS);
        drop(subset);
        motion = best_of(poses, &refined).map_or(motion, |best| best.motion);
    }
    let pose = poses.score(motion, threshold);
    let sigma = noise::estimate(pose.inlier_residuals(), threshold);
    Polished { pose, sigma, loss, limit, by_chance: ByChance::unknown() }
}

/// The best of the four poses with the essential matrix of a motion.
pub(crate) fn best_of(poses: &mut PoseScorer, motion: &Motion) -> Option<Scored> {
    let pose = poses.best_pose(&motion.essential(), poses.threshold())?;
    let scored = pose.scored;
    poses.recycle(pose);
    Some(scored)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::SearchScore;
    use crate::robust::data::observations::Observations;
    use crate::simulate::{FOCAL_LENGTH, Scene, SceneOptions};

    #[test]
    fn the_last_refinement_looks_as_far_as_the_noise_says() {
        for (noise_px, threshold) in [(0.2, 1.0), (0.5, 1.5), (3.0, 10.0)] {
            let options = SceneOptions { points: 300, noise_px, ..SceneOptions::realistic() };
            let mut scene = Scene::generate(&options, 0xf1_a1, 0).unwrap();
            scene.add_outliers(0.2, 0xf1_a1, 0).unwrap();
            let order = (0..).take(scene.matches.len()).collect();
            let observations = Observations::new(&scene.matches, order, [[FOCAL_LENGTH; 2]; 2], threshold);
            let mut poses = PoseScorer::new(&observations, SearchScore::default());
            let truth = Motion { q_21: scene.truth.q_21, direction: scene.truth.t_21.normalize() };
            let found = polish(&mut poses, truth);
            // The variance of 240 residuals, and what is added to it where a loss is scaled.
            assert!((found.sigma / noise_px - 1.0).abs() < 0.2, "{} {noise_px}", found.sigma);
            assert!((found.limit / (WIDE * noise_px) - 1.0).abs() < 0.3, "{} {noise_px}", found.limit);
        }
    }
}
