//! The other poses that matches may mean: the motions of a plane, the second minimum of a small parallax, and the poses that few
//! matches have.

use crate::robust::conclude::final_refinement::{FEWEST, Polished, polish};
use crate::robust::conclude::plane::Plane;
use crate::robust::refine::epipolar::{FINE, Subset, refine};
use crate::robust::refine::loss::{CAP, GemanMcClure, SCALE};
use crate::robust::search::pose_score::{PoseScorer, Scored};
use crate::robust::search::search_score::MANY;
use crate::solver::shared::motion::Motion;

/// Poses closer than this in rotation and in the direction of translation (radians) are the same answer.
const SAME: f64 = 0.02;
const SAME_DIRECTION: f64 = 0.1;

/// Minima whose directions of translation are closer than this (radians) are covered by the covariance.
const ELSEWHERE: f64 = 0.5;

/// The runner-up has at least this share of the inliers of the best, and the best of the runner-up's.
const NEARLY_AS_WELL: f64 = 0.8;

/// A pose that is no refinement of another replaces it only if its cost is lower by this.
const CLEARLY: f64 = 1e-4;

/// Inliers that an alternative is first refined over, steps, and how far it looks in units of the threshold.
const MATCHES: usize = 200;
const STEPS: usize = 8;
const WIDE: f64 = 2.0;

/// One of the motions of a plane: as its homography has it, and refined as any other motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Alternative {
    of_plane: Scored,
    refined: Scored,
}

impl Alternative {
    pub(crate) fn motion(&self) -> &Motion {
        &self.of_plane.motion
    }
}

/// The two motions of a plane.
pub(crate) fn alternatives(poses: &mut PoseScorer, plane: &Plane, polished: &Polished) -> Vec<Alternative> {
    let wide = WIDE * poses.threshold();
    let loss = GemanMcClure::new(SCALE * polished.sigma);
    let mut all = Vec::new();
    for motion in plane.motions.iter().flatten() {
        let Some(pose) = poses.best_pose(&motion.essential(), wide) else { continue };
        let of_plane = pose.scored;
        let mut refined = of_plane;
        let count = pose.inliers.len().min(MATCHES);
        // Refining one beside the pose would only find the pose again.
        let is_refined = count >= FEWEST && !is_same(&of_plane.motion, polished.motion());
        let subset = is_refined.then(|| Subset::new(&poses.observations.columns, &pose.inliers[..count]));
        poses.recycle(pose);
        if let Some(subset) = subset {
            let mut motion = of_plane.motion;
            refine(&subset, &mut motion, &loss, FINE, STEPS);
            if let Some(found) = poses.best_pose(&motion.essential(), wide) {
                refined = found.scored;
                poses.recycle(found);
            }
        }
        all.push(Alternative { of_plane, refined });
    }
    all
}

/// The pose, or that alternative which explains the matches better.
pub(crate) fn better_of(poses: &mut PoseScorer, polished: Polished, others: &[Alternative]) -> Polished {
    let better = |a: &&Alternative| {
        a.refined.cost < polished.pose.scored.cost - CLEARLY && !is_same(&a.refined.motion, polished.motion())
    };
    let best = others.iter().filter(better).min_by(|a, b| a.refined.cost.total_cmp(&b.refined.cost));
    match best {
        Some(best) => polish(poses, best.refined.motion),
        None => polished,
    }
}

/// The two motions of a plane, that of the best pose first.
///
/// The pose itself is one of the two only as far as the essential matrix determines it. A plane leaves the matrix partly open, and a
/// few false matches close that gap and lead the pose far from both. Where the plane is exact, and there are more matches than
/// any plane explains, the plane's two motions are the answers. Where it is not, the answers are the pose and the motion of the
/// plane that is further from it. A motion that leaves many of the points behind a camera is no answer.
pub(crate) fn both_of_plane(
    poses: &mut PoseScorer,
    others: &[Alternative],
    best: &Motion,
    is_exact: bool,
) -> (Motion, Option<Motion>) {
    let far = |a: &Alternative| distance(&a.refined.motion, best);
    let (own, other) = match others {
        [] => return (*best, None),
        [only] => (only, None),
        [a, b, ..] if far(a) <= far(b) => (a, Some(b)),
        [a, b, ..] => (b, Some(a)),
    };
    let is_answer = poses.observations.len() >= MANY || is_same(&own.refined.motion, best);
    let first = if is_exact && is_answer { own.of_plane.motion } else { *best };
    let other =
        other.map(|other| other.of_plane.motion).filter(|other| !is_same(other, &own.of_plane.motion));
    let Some(other) = other else { return (first, None) };
    let [in_first, in_other] = [first, other].map(|motion| {
        let pose = poses.score(motion, poses.threshold());
        let count = pose.inliers.len() as f64;
        poses.recycle(pose);
        count
    });
    if in_other < NEARLY_AS_WELL * in_first {
        (first, None)
    } else if in_first < NEARLY_AS_WELL * in_other {
        (other, None)
    } else {
        (first, Some(other))
    }
}

/// Another motion, which only noise may have made the worse one. Where the parallax is small, the cost has a minimum on either side
/// of the plane that the points are nearest to.
pub(crate) fn as_likely(
    poses: &mut PoseScorer,
    others: &[Alternative],
    polished: &Polished,
) -> Option<Motion> {
    let best = polished.motion();
    let is_elsewhere = |other: &Motion| other.direction.angle(&best.direction) > ELSEWHERE;
    let mut refined =
        others.iter().map(|a| a.refined.motion).filter(|motion| !is_same(motion, best)).peekable();
    refined.peek()?;
    let limit = poses.score(*best, polished.limit).misfit(polished.sigma) + CAP;
    let mut second: Option<Scored> = None;
    for mut motion in refined {
        let pose = poses.score(motion, polished.limit);
        if pose.misfit(polished.sigma) > limit {
            continue;
        }
        // It was refined over some of its inliers, and may have been on the way to the same minimum.
        let subset = Subset::new(&poses.observations.columns, &pose.inliers);
        refine(&subset, &mut motion, &polished.loss, FINE, STEPS);
        let other = poses.best_pose(&motion.essential(), poses.threshold()).map(|pose| pose.scored);
        let least = second.map_or(f64::INFINITY, |second| second.cost);
        second = other.filter(|other| is_elsewhere(&other.motion) && other.cost < least).or(second);
    }
    second.map(|second| second.motion)
}

/// The next best of the poses that few matches have.
pub(crate) fn second_of_few(all: &[Scored], best: &Motion) -> Option<Motion> {
    let different = all.iter().filter(|s| !is_same(&s.motion, best));
    different.min_by(|a, b| a.cost.total_cmp(&b.cost)).map(|s| s.motion)
}

pub(crate) fn is_same(a: &Motion, b: &Motion) -> bool {
    a.q_21.angle_to(&b.q_21) < SAME && a.direction.dot(&b.direction) > SAME_DIRECTION.cos()
}

/// How far one motion is from another, in radians of rotation and of direction together.
pub(crate) fn distance(a: &Motion, b: &Motion) -> f64 {
    a.q_21.angle_to(&b.q_21) + a.direction.angle(&b.direction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::SearchScore;
    use crate::robust::conclude::plane;
    use crate::robust::data::observations::Observations;
    use crate::robust::search::sampling;
    use crate::simulate::{FOCAL_LENGTH, Layout, Scene, SceneOptions};

    #[test]
    fn a_pose_is_replaced_by_one_that_is_clearly_better() {
        let options = SceneOptions { points: 100, noise_px: 0.5, ..SceneOptions::realistic() };
        let scene = Scene::generate(&options, 0xa17, 0).unwrap();
        let order = (0..).take(scene.matches.len()).collect();
        let observations = Observations::new(&scene.matches, order, [[FOCAL_LENGTH; 2]; 2], 1.5);
        let mut poses = PoseScorer::new(&observations, SearchScore::default());
        let truth = Motion { q_21: scene.truth.q_21, direction: scene.truth.t_21.normalize() };
        let polished = polish(&mut poses, truth);
        // Behind its cameras the points of the opposite motion refine nothing, so that it is known again.
        let opposite = Motion { direction: -truth.direction, ..truth };
        let mut taken = |lower: f64| {
            let of_plane = Scored { motion: opposite, cost: polished.pose.scored.cost - lower };
            let other = Alternative { of_plane, refined: of_plane };
            let found = better_of(&mut poses, polished.clone(), &[other]);
            is_same(found.motion(), &opposite)
        };
        assert!(!taken(-0.5 * CLEARLY) && !taken(0.5 * CLEARLY) && taken(2.0 * CLEARLY));
    }

    #[test]
    fn of_a_plane_the_other_motion_is_as_likely() {
        let options = SceneOptions {
            points: 100,
            noise_px: 0.5,
            layout: Layout::Coplanar,
            ..SceneOptions::realistic()
        };
        let mut count = 0;
        for index in 0..20 {
            let scene = Scene::generate(&options, 0xa17, 100 + index).unwrap();
            let order = (0..).take(scene.matches.len()).collect();
            let observations = Observations::new(&scene.matches, order, [[FOCAL_LENGTH; 2]; 2], 1.5);
            let mut poses = PoseScorer::new(&observations, SearchScore::default());
            let truth = Motion { q_21: scene.truth.q_21, direction: scene.truth.t_21.normalize() };
            let polished = polish(&mut poses, truth);
            let plane = plane::fit(&observations, &polished, &mut sampling::generator(0xa17, index));
            let others = alternatives(&mut poses, &plane.unwrap(), &polished);
            if let Some(second) = as_likely(&mut poses, &others, &polished) {
                assert!(second.direction.angle(&polished.motion().direction) > ELSEWHERE, "{index}");
                count += 1;
            }
        }
        assert!(count >= 5, "{count}");
    }
}
