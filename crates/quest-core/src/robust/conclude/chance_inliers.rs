//! Matches that agree with a pose by chance.
//!
//! A false match that lies near its epipolar line by chance has no plausible depth: where the camera hardly moves, it is a point
//! just in front of the lens. So far from the others, it also has the longest lever on the pose and turns it until they agree, which
//! no loss can see. So every inlier of an unusual depth is predicted from the others, and dropped where it is more likely false
//! than true. The odds for it are
//!
//! ```text
//! inliers / (outliers + 1) · A p(r, ρ),   p(r, ρ) = √(1 − h) / (√(2π) σ (1 + r² / ((1 − h) c²))²) · p(ρ) / (2 √w)
//! ```
//!
//! `A` is the area over which the points of view 2, false ones too, are spread. `h` is the leverage `Jᵀ H⁻¹ J` of the match:
//! a pose fitted without it has the residual `r / (1 − h)`, with the variance `σ² / (1 − h)`; `c` is the scale of the loss. `ρ` is
//! the inverse depth, `w` its precision at unit noise; `2 √w dr dρ` is an element of the area. All that is known of the
//! inverse depths is where most of them are, `m ± γ`, and that few points are near ([`Usual`]). Whether any are is counted: where chance
//! explains all inliers of unusual depths, as false matches show, no point is near, however long the tail of `p(ρ)` is.

use std::f64::consts::PI;

use crate::robust::conclude::by_chance::{ByChance, USUAL};
use crate::robust::conclude::final_refinement::{FEWEST, Polished, best_of};
use crate::robust::conclude::inverse_depth::{InverseDepth, Usual};
use crate::robust::data::columns::Columns;
use crate::robust::data::observations::Observations;
use crate::robust::refine::epipolar::{FINE, One, Subset, refine};
use crate::robust::search::pose_score::PoseScorer;
use crate::robust::search::search_score::MANY;
use crate::solver::shared::motion::Motion;

/// Rounds of dropping and refining.
const ROUNDS: usize = 3;

/// Steps of a refinement.
const STEPS: usize = 10;

/// The share of `p(ρ)` beyond [`USUAL`]: `2 ∫ 3√3 / (4π (1 + u³)) du`.
const TAIL: f64 = 0.0452;

/// False matches are counted within so many times the threshold, where there are more of them to count.
const WIDE: f64 = 3.0;

/// Among more inliers than this one false match has no weight.
const ENOUGH: usize = 20_000;

/// Refines a pose without the inliers that agree with it by chance.
pub(crate) fn refine_without_chance(
    poses: &mut PoseScorer,
    polished: Polished,
    false_matches: &Columns,
) -> Polished {
    let observations = poses.observations;
    let mut motion = *polished.motion();
    // Where there are few matches none can be spared.
    if !(MANY..=ENOUGH).contains(&polished.pose.inliers.len()) {
        return polished;
    }
    let (usual, believed) = unusual_depths(observations, &polished, false_matches);
    let mut by_chance = ByChance { matches: Vec::new(), usual: Some(usual), believed };
    let mut chance = doubtful(observations, &polished.pose.inliers, &motion, &polished, believed);
    if chance.is_empty() {
        return Polished { by_chance, ..polished };
    }
    let mut kept = poses.score(motion, polished.limit).inliers;
    for _ in 0..ROUNDS {
        if chance.is_empty() || kept.len() < FEWEST + chance.len() {
            break;
        }
        kept.retain(|i| !chance.contains(i));
        by_chance.matches.append(&mut chance);
        refine(&Subset::new(&observations.columns, &kept), &mut motion, &polished.loss, FINE, STEPS);
        chance = doubtful(observations, &kept, &motion, &polished, believed);
    }
    let motion = best_of(poses, &motion).map_or(*polished.motion(), |best| best.motion);
    let pose = poses.score(motion, poses.threshold());
    // Hardly any of the matches may be left: then it was not chance that the others agreed.
    if pose.inliers.len() < FEWEST {
        return Polished { by_chance: ByChance { matches: Vec::new(), ..by_chance }, ..polished };
    }
    // Others agree with the refined pose.
    by_chance.matches.append(&mut doubtful(observations, &pose.inliers, &motion, &polished, believed));
    Polished { by_chance, ..polished.with_pose(pose, poses.threshold()) }
}

/// Where depths are usual, and how many points of unusual depths there are, as a share of what `p(ρ)` says: those that chance does
/// not explain.
fn unusual_depths(observations: &Observations, polished: &Polished, false_matches: &Columns) -> (Usual, f64) {
    let (motion, sigma) = (polished.motion(), polished.sigma);
    let inliers = &polished.pose.inliers;
    let depths = InverseDepth::all(&observations.columns, motion, inliers);
    let usual = Usual::new(&depths);
    let count = |depths: &[InverseDepth]| {
        depths.iter().filter(|depth| usual.distance(depth, sigma) > USUAL).count() as f64
    };
    let agreeing = false_matches.agreeing(motion, WIDE * false_matches.threshold());
    let each = (observations.len() - inliers.len()) as f64 / (WIDE * false_matches.len().max(1) as f64);
    let by_chance = count(&InverseDepth::all(false_matches, motion, &agreeing)) * each;
    let more = count(&depths) - by_chance;
    (usual, (more / (TAIL * inliers.len() as f64)).clamp(0.0, 1.0))
}

/// The inliers that are more likely false than true.
fn doubtful(
    observations: &Observations,
    inliers: &[u32],
    motion: &Motion,
    polished: &Polished,
    believed: f64,
) -> Vec<u32> {
    let depths = InverseDepth::all(&observations.columns, motion, inliers);
    let (sigma, loss) = (polished.sigma, polished.loss);
    let usual = Usual::new(&depths);
    let unusual = |depth: &InverseDepth| usual.distance(depth, sigma) > USUAL;
    let mut candidates = inliers.iter().zip(&depths).filter(|(_, depth)| unusual(depth)).peekable();
    if candidates.peek().is_none() {
        return Vec::new();
    }
    let hessian = Subset::new(&observations.columns, inliers).equations(motion, &loss).hessian;
    let Some(factor) = hessian.cholesky() else { return Vec::new() };
    let inverse = factor.inverse();
    let prior = inliers.len() as f64 / (observations.len() - inliers.len() + 1) as f64;
    let area = observations.area_of_view2();
    let is_doubtful = |candidate: &(&u32, &InverseDepth)| {
        let (&index, depth) = *candidate;
        let own = One::new(&observations.columns, index, motion, &loss, &inverse);
        let free = (1.0 - own.leverage).max(f64::EPSILON);
        let misfit = 1.0 + own.square / (free * loss.square_scale());
        let across = free.sqrt() / ((2.0 * PI).sqrt() * sigma * misfit * misfit);
        let along = usual.density(depth, sigma) / (2.0 * depth.precision.sqrt());
        believed * prior * area * across * along < 1.0
    };
    candidates.filter(is_doubtful).map(|(&index, _)| index).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Correspondence;
    use crate::lanes::SearchScore;
    use crate::robust::conclude::false_alarms;
    use crate::robust::conclude::final_refinement::polish;
    use crate::simulate::{self, FOCAL_LENGTH, Scene, SceneOptions};
    use nalgebra::Vector3;

    /// A camera that hardly moves, and its matches, a third of them false, with some more: points at these depths, as a share of the mean depth, seen by
    /// camera 1 where the first points of the scene are.
    fn scene_with(depths: &[f64], index: u64) -> (Scene, Motion) {
        let motion = simulate::Motion::Parallax(0.01);
        let options = SceneOptions { points: 60, noise_px: 0.5, motion, ..SceneOptions::realistic() };
        let mut scene = Scene::generate(&options, 76, index).unwrap();
        scene.add_outliers(0.3, 76, index).unwrap();
        let truth = Motion { q_21: scene.truth.q_21, direction: scene.truth.t_21.normalize() };
        for (k, depth) in depths.iter().enumerate() {
            let a = scene.points1[k];
            let x1 = a / a.z * *depth;
            let x2: Vector3<f64> = scene.truth.q_21 * x1 + scene.truth.t_21;
            let points = [[x1.x / x1.z, x1.y / x1.z], [x2.x / x2.z, x2.y / x2.z]];
            scene.matches.push(Correspondence::from_image_points(points[0], points[1]).unwrap());
        }
        (scene, truth)
    }

    /// The matches beside those of the scene that the refined pose keeps within the threshold, the pose as it was polished, and
    /// as it is without chance.
    fn refined(scene: &Scene, start: Motion) -> (Vec<u32>, [Motion; 2]) {
        let order = (0..).take(scene.matches.len()).collect();
        let observations = Observations::new(&scene.matches, order, [[FOCAL_LENGTH; 2]; 2], 1.5);
        let mut poses = PoseScorer::new(&observations, SearchScore::default());
        let polished = polish(&mut poses, start);
        let before = *polished.motion();
        let false_matches = false_alarms::false_matches(&observations);
        let after = *refine_without_chance(&mut poses, polished, &false_matches).motion();
        let inliers = poses.score(after, 1.5).inliers;
        let more = inliers.into_iter().filter(|&i| i as usize >= scene.points1.len());
        (more.collect(), [before, after])
    }

    #[test]
    fn one_point_before_the_lens_is_seldom_believed() {
        let (mut turned, mut cured) = (0, 0);
        for index in 0..20 {
            let (scene, truth) = scene_with(&[], index);
            let (_, [_, without]) = refined(&scene, truth);
            let (mut scene, truth) = scene_with(&[0.03], index);
            // Within the threshold of the truth's epipolar line, but with a lever: most poses turn until it agrees.
            let last = scene.matches.last_mut().unwrap();
            let [x1, x2] = [last.bearing1() / last.bearing1().z, last.bearing2() / last.bearing2().z];
            let line = truth.essential() * x1;
            let x2 = x2.xy() + line.xy().normalize() * (2.0 / FOCAL_LENGTH);
            *last = Correspondence::from_image_points([x1.x, x1.y], x2.into()).unwrap();
            let (_, with) = refined(&scene, truth);
            let [before, after] = with.map(|motion| motion.direction.angle(&without.direction));
            turned += usize::from(before > 1e-3);
            cured += usize::from(before > 1e-3 && after < 0.05 * before);
        }
        assert!(turned >= 10 && 3 * cured >= 2 * turned, "{turned} {cured}");
    }

    #[test]
    fn a_foreground_is_believed() {
        for index in 0..5 {
            let (scene, truth) = scene_with(&[0.2, 0.2, 0.21, 0.22, 0.23, 0.25], index);
            let (more, _) = refined(&scene, truth);
            assert_eq!(more.len(), 6, "{index}");
        }
    }
}
