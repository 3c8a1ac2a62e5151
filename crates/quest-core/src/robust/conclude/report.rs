//! The answers of a model, their length and covariance: an estimate.

use nalgebra::UnitQuaternion;

use crate::RelativePose;
use crate::robust::MIN_MATCHES;

use crate::robust::conclude::alternatives::{
    Alternative, as_likely, both_of_plane, distance, is_same, second_of_few,
};
use crate::robust::conclude::by_chance::ByChance;
use crate::robust::conclude::covariance;
use crate::robust::conclude::final_refinement::Polished;
use crate::robust::conclude::length::{Length, Noise, length};
use crate::robust::conclude::mixture::{Distribution, held, mixture, of_length};
use crate::robust::conclude::model::Verdict;
use crate::robust::conclude::plane::Plane;
use crate::robust::conclude::small_motion::SmallMotion;
use crate::robust::data::columns::Columns;
use crate::robust::data::observations::Observations;
use crate::robust::estimate::{Estimate, Model, RunnerUp};
use crate::robust::search::SearchResult;
use crate::robust::search::pose_score::{PoseScorer, Scored};
use crate::robust::search::search_score::MANY;
use crate::solver::shared::motion::Motion;
use crate::structure::translation_direction;

/// Which of two poses that explain the matches is given as the answer, the other being the runner-up.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Answer {
    /// The one that explains them better.
    Best,
    /// The other, because something else is known.
    Other,
    /// One that was found elsewhere, the best being the runner-up.
    Given(Motion),
}

/// The inliers of a pure rotation are also within this multiple of the threshold of the point they are taken to.
const NEAR_POINT: f64 = 3.0;

/// What is known of the matches when the answers are chosen.
pub(crate) struct Conclusion<'a> {
    pub(crate) polished: Polished,
    /// Where a rotation alone leaves little.
    pub(crate) small: Option<SmallMotion>,
    pub(crate) plane: Option<Plane>,
    pub(crate) others: &'a [Alternative],
    pub(crate) verdict: Verdict,
    pub(crate) false_matches: &'a Columns,
    /// The share of false matches that the threshold accepts.
    pub(crate) false_share: f64,
}

/// The estimate; `None` where the answer is left with too few inliers or without a covariance.
pub(crate) fn report(
    poses: &mut PoseScorer,
    found: &SearchResult,
    conclusion: Conclusion,
    answer: Answer,
) -> Option<Estimate> {
    let observations = poses.observations;
    let (motion, second) = chosen(answer, allowed(found, answers(poses, found, &conclusion)));
    let Conclusion { mut polished, small, plane, verdict, false_matches, false_share, .. } = conclusion;
    let (model, sigma, is_best) = (verdict.model, polished.sigma, matches!(answer, Answer::Best));
    polished.pose = poses.score(motion, poses.threshold());
    // Of a small motion the likelihood says which they are.
    if small.is_some() || !is_best {
        polished.by_chance = ByChance::unknown();
    }
    polished.pose.inliers.retain(|i| !polished.by_chance.matches.contains(i));
    // The motions of an exact plane have a covariance of their own.
    let is_of_plane = model == Model::Planar && verdict.is_exact_plane;
    let small = small.filter(|_| !is_of_plane && is_best).map(|small| match model {
        Model::Planar => small.without_twins(),
        _ => small,
    });
    if let Some(small) = &small {
        polished.pose.inliers.retain(|&i| small.is_likely[i as usize]);
    } else if model == Model::PureRotation {
        retain_near_points(observations, &verdict.q_21, &mut polished.pose.inliers);
    }
    let inliers = &polished.pose.inliers;
    // A plane, a rotation, or one of the poses of few matches may be left with less than it takes.
    if inliers.len() < MIN_MATCHES {
        return None;
    }
    let noise = Noise { sigma, false_matches, by_chance: &polished.by_chance };
    let size = length(observations, &motion, inliers, &noise);
    let pose = with_length(&motion, size);
    let (pose, covariance) = if let Some(small) = &small {
        let general = || Some((pose, covariance::of_pose(observations, &polished, size, false_matches)?));
        of_small_motion(observations, small, general, model, inliers, &noise)?
    } else if model == Model::PureRotation {
        (pose, covariance::of_rotation(observations, &motion.q_21, inliers, sigma, size)?)
    } else {
        let known = covariance::of_pose(observations, &polished, size, false_matches);
        // What chose a given pose knows more than these matches do.
        let open = || matches!(answer, Answer::Given(_)).then(|| covariance::of_nothing(&pose));
        (pose, known.or_else(open)?)
    };
    let second = match (&small, model) {
        (Some(small), Model::General) => small.other_mode(&pose.t_21).or(second),
        // The likelihood may have chosen the other motion of the plane.
        (Some(_), Model::Planar) => farther(&pose, [Some(motion), second]),
        _ => second,
    };
    let second = second.filter(|second| found.allows(&second.q_21));
    Some(Estimate {
        model,
        pose,
        // Rounding differs on the two sides of the diagonal.
        covariance: covariance.symmetric_part(),
        inlier_count: inliers.len(),
        inliers: mask(observations, inliers),
        score: share(&polished.pose.scored, observations),
        iterations: found.iterations,
        runner_up: second.map(|motion| runner_up(poses, motion, &noise)),
        evidence: verdict.evidence,
        noise_px: sigma,
        normal: plane.filter(|_| model == Model::Planar).and_then(|plane| normal(&plane, &pose)),
        false_share,
        unmoved: 0,
    })
}

/// Whether each match that was given is an inlier.
fn mask(observations: &Observations, inliers: &[u32]) -> Vec<bool> {
    let mut mask = vec![false; observations.given.len()];
    for &i in inliers {
        mask[observations.order[i as usize] as usize] = true;
    }
    mask
}

/// Leaves only the matches near the point that a rotation takes them to.
fn retain_near_points(observations: &Observations, q_21: &UnitQuaternion<f64>, inliers: &mut Vec<u32>) {
    let limit = NEAR_POINT * observations.columns.threshold();
    let r_21 = q_21.to_rotation_matrix().into_inner();
    let mut squares = observations.framed(inliers).square_errors(&r_21).into_iter();
    inliers.retain(|_| squares.next().is_some_and(|square| square < limit * limit));
}

/// Of two motions the one that is farther from a pose, where that is another.
fn farther(pose: &RelativePose, motions: [Option<Motion>; 2]) -> Option<Motion> {
    let direction = pose.t_21.try_normalize(f64::MIN_POSITIVE)?;
    let own = Motion { q_21: pose.q_21, direction };
    let [first, second] = motions;
    let farthest = match (first, second) {
        (Some(a), Some(b)) if distance(&a, &own) < distance(&b, &own) => b,
        (first, second) => first.or(second)?,
    };
    (!is_same(&farthest, &own)).then_some(farthest)
}

/// The motion that is the answer, and the runner-up.
fn chosen(answer: Answer, (motion, second): (Motion, Option<Motion>)) -> (Motion, Option<Motion>) {
    match (answer, second) {
        (Answer::Other, Some(second)) => (second, Some(motion)),
        (Answer::Given(given), _) => (given, Some(motion)),
        (_, second) => (motion, second),
    }
}

/// The pose of a small motion and its covariance.
fn of_small_motion(
    observations: &Observations,
    small: &SmallMotion,
    general: impl FnOnce() -> Option<Distribution>,
    model: Model,
    inliers: &[u32],
    noise: &Noise,
) -> Option<Distribution> {
    let mut all = mixture(observations, small, noise.sigma, general)?;
    if model == Model::PureRotation {
        all = held(&small.q_21, all);
    }
    if let Some(length) = length_in_mean_depths(observations, &all.0, inliers, noise) {
        all = of_length(all, &length);
    }
    covariance::says_something(&all.1).then_some(all)
}

/// The length of a translation in units of the mean depth, where the depths of the inliers stand clear of their noise.
fn length_in_mean_depths(
    observations: &Observations,
    pose: &RelativePose,
    inliers: &[u32],
    noise: &Noise,
) -> Option<Length> {
    let direction = pose.t_21.try_normalize(f64::MIN_POSITIVE)?;
    let size = length(observations, &Motion { q_21: pose.q_21, direction }, inliers, noise);
    size.is_clear.then_some(size)
}

/// The motion that the model makes of the pose, and another that explains the matches nearly as well.
fn answers(
    poses: &mut PoseScorer,
    found: &SearchResult,
    conclusion: &Conclusion,
) -> (Motion, Option<Motion>) {
    let Conclusion { polished, others, verdict, .. } = conclusion;
    let observations = poses.observations;
    let is_few = observations.len() < MANY;
    let (motion, mut second) = match verdict.model {
        Model::Planar => {
            let likeliest = conclusion.small.as_ref().and_then(SmallMotion::likeliest);
            let best = likeliest.filter(|_| verdict.is_exact_plane).unwrap_or(*polished.motion());
            both_of_plane(poses, others, &best, verdict.is_exact_plane)
        }
        Model::PureRotation if conclusion.small.is_some() => (*polished.motion(), None),
        Model::PureRotation => (still(observations, &polished.pose.inliers, verdict.q_21), None),
        Model::General if is_few => (*polished.motion(), None),
        Model::General => (*polished.motion(), as_likely(poses, others, polished)),
    };
    if verdict.model != Model::PureRotation && is_few {
        second = second_of_few(&found.refined, &motion);
    }
    (motion, second)
}

/// Of the answers those that turn the known direction as told; the first also where neither does.
fn allowed(found: &SearchResult, (motion, second): (Motion, Option<Motion>)) -> (Motion, Option<Motion>) {
    match second.filter(|second| found.allows(&second.q_21)) {
        Some(second) if !found.allows(&motion.q_21) => (second, None),
        second => (motion, second),
    }
}

/// The motion of a camera that only turns: the direction of what translation is left.
fn still(observations: &Observations, inliers: &[u32], q_21: UnitQuaternion<f64>) -> Motion {
    let matches = observations.some(inliers);
    Motion { q_21, direction: translation_direction(&q_21, &matches) }
}

/// The `n` for which `R + t nᵀ` is nearest to the homography of a plane: `H = s (R + t nᵀ)` has the scale that makes its middle
/// singular value one, and the sign that keeps points in front.
fn normal(plane: &Plane, pose: &RelativePose) -> Option<[f64; 3]> {
    let h = plane.homography;
    let mut values: [f64; 3] = h.singular_values().into();
    values.sort_unstable_by(f64::total_cmp);
    let scale = h.determinant().signum() / values[1];
    let square = pose.t_21.norm_squared();
    let rest = h * scale - pose.r_21();
    let normal: [f64; 3] = (rest.tr_mul(&pose.t_21) / square).into();
    normal.iter().all(|x| x.is_finite()).then_some(normal)
}

fn with_length(motion: &Motion, size: Length) -> RelativePose {
    RelativePose::new(motion.q_21, motion.direction * size.value)
}

fn share(scored: &Scored, observations: &Observations) -> f64 {
    (1.0 - scored.cost / observations.len() as f64).clamp(0.0, 1.0)
}

fn runner_up(poses: &mut PoseScorer, motion: Motion, noise: &Noise) -> RunnerUp {
    let pose = poses.score(motion, poses.threshold());
    let size = length(poses.observations, &motion, &pose.inliers, noise);
    RunnerUp {
        pose: with_length(&motion, size),
        score: share(&pose.scored, poses.observations),
        inlier_count: pose.inliers.len(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn motion(direction: [f64; 3]) -> Motion {
        Motion {
            q_21: UnitQuaternion::new(Vector3::new(0.1, 0.2, 0.0)),
            direction: Vector3::from(direction).normalize(),
        }
    }

    #[test]
    fn the_answer_and_the_runner_up() {
        let [best, other, given] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(motion);
        let directions =
            |(first, second): (Motion, Option<Motion>)| (first.direction, second.map(|m| m.direction));
        let of = |answer, second| directions(chosen(answer, (best, second)));
        assert_eq!(of(Answer::Best, Some(other)), (best.direction, Some(other.direction)));
        assert_eq!(of(Answer::Other, Some(other)), (other.direction, Some(best.direction)));
        assert_eq!(of(Answer::Other, None), (best.direction, None));
        assert_eq!(of(Answer::Given(given), Some(other)), (given.direction, Some(best.direction)));
        // Of two motions the farther one, where it is another.
        let pose = RelativePose::new(best.q_21, best.direction * 0.3);
        let far = |motions: [Option<Motion>; 2]| farther(&pose, motions).map(|m| m.direction);
        let near = motion([1.0, 0.3, 0.0]);
        for motions in [[Some(near), Some(other)], [Some(other), Some(near)], [Some(other), None]] {
            assert_eq!(far(motions), Some(other.direction));
        }
        assert_eq!(
            (far([None, Some(near)]), far([Some(best), None]), far([None, None])),
            (Some(near.direction), None, None)
        );
    }

    #[test]
    fn the_normal_of_a_plane_is_that_of_its_homography() {
        let pose = RelativePose::new(
            UnitQuaternion::new(Vector3::new(0.1, -0.3, 0.2)),
            Vector3::new(0.3, 0.1, -0.2),
        );
        let expected = Vector3::new(0.1, -0.2, 0.25);
        for scale in [1.0, -2.5] {
            let homography: Matrix3<f64> = (pose.r_21() + pose.t_21 * expected.transpose()) * scale;
            let found = normal(&Plane { homography, motions: [None; 2] }, &pose).unwrap();
            assert!((Vector3::from(found) - expected).amax() < 1e-12, "{found:?}");
        }
    }
}
