//! From the best pose of the search to the estimate: the last refinement, the other pose of a plane, the model, the length of
//! the translation, the covariance.

mod chance_inliers;
mod covariance;
mod false_alarms;
mod final_refinement;
mod inverse_depth;
mod length;
mod model;
mod plane;

use nalgebra::UnitQuaternion;
use rand_chacha::ChaCha8Rng;

use crate::robust::conclude::chance_inliers::refine_without_chance;
use crate::robust::conclude::false_alarms::log_false_alarms;
use crate::robust::conclude::final_refinement::{FEWEST, Polished, polish};
use crate::robust::conclude::length::{Length, Noise, length};
use crate::robust::conclude::model::{Verdict, choose};
use crate::robust::conclude::plane::Plane;
use crate::robust::data::columns::Columns;
use crate::robust::data::observations::Observations;
use crate::robust::estimate::{Estimate, Model, RunnerUp};
use crate::robust::options::EstimateError;
use crate::robust::refine::epipolar::{FINE, Subset, refine};
use crate::robust::refine::loss::{CAP, GemanMcClure, SCALE};
use crate::robust::search::Search;
use crate::robust::search::pose_score::{PoseScorer, Scored};
use crate::robust::search::search_score::MANY;
use crate::robust::{DIAGNOSED, MIN_MATCHES, degenerate, no_pose};
use crate::solver::shared::motion::Motion;
use crate::structure::translation_direction;
use crate::{Degeneracy, InputError, RelativePose};

/// Poses closer than this in rotation and in the direction of translation (radians) are the same answer.
const SAME: f64 = 0.02;
const SAME_DIRECTION: f64 = 0.1;

/// Another minimum whose translation is nearer than this (radians) is one that the covariance speaks of.
const ELSEWHERE: f64 = 0.5;

/// The runner-up has at least this share of the inliers of the best, and the best of the runner-up's.
const NEARLY_AS_WELL: f64 = 0.8;

/// A pose replaces another of which it is not a refinement only if its cost is lower by this.
const CLEARLY: f64 = 1e-4;

/// Inliers that an alternative is first refined over, steps, and how far it looks in units of the threshold.
const MATCHES: usize = 200;
const STEPS: usize = 8;
const WIDE: f64 = 2.0;

/// The inliers of a pure rotation are also within this multiple of the threshold of the point they are taken to.
const NEAR_POINT: f64 = 3.0;

/// Which of two poses that explain the matches is given as the answer, the other being the runner-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    /// The one that explains them better.
    Best,
    /// The other, because something else is known.
    Other,
}

/// Steps 3 to 6.
pub(crate) fn conclude(
    search: &mut Search,
    best: Scored,
    answer: Answer,
    max_false_alarms: f64,
    rng: &mut ChaCha8Rng,
) -> Result<Estimate, EstimateError> {
    let iterations = search.iterations;
    let of_few = std::mem::take(&mut search.all);
    let poses = &mut search.poses;
    let mut polished = polish(poses, best.motion);
    let plane = plane::fit(poses.observations, &polished.scored.motion, &poses.inliers, polished.sigma, rng);
    let mut others = plane.map_or_else(Vec::new, |plane| alternatives(poses, &plane, &polished));
    replace(poses, &mut polished, &mut others);
    poses.score(polished.scored.motion, poses.threshold());
    refine_without_chance(poses, &mut polished);
    let (observations, inliers) = (poses.observations, poses.inliers.len());
    // Of few matches chance cannot be told from truth: the best pose is returned, if a sample's worth of them agree with it.
    let false_matches = false_alarms::false_matches(observations);
    let is_chance = observations.len() >= MANY
        && log_false_alarms(poses, &polished.scored.motion, iterations, &false_matches)
            > max_false_alarms.log10();
    if inliers < MIN_MATCHES || is_chance {
        return Err(no_pose(observations, inliers));
    }
    let verdict = choose(poses, &polished.scored.motion.q_21, plane.as_ref(), polished.sigma);
    let is_plane = verdict.model == Model::Planar && verdict.is_exact_plane;
    if let Some(plane) = plane.filter(|_| is_plane)
        && let Some(plane) = plane.over_all(observations, &poses.inliers, polished.sigma)
    {
        others = alternatives(poses, &plane, &polished);
        poses.score(polished.scored.motion, poses.threshold());
    }
    // A rotation alone is determined by the points of a line, a translation is not.
    let some = &poses.inliers[..inliers.min(DIAGNOSED)];
    let some: Vec<_> = some.iter().map(|&i| observations.matches[i as usize]).collect();
    if verdict.model != Model::PureRotation && observations.is_line(&some) {
        return Err(degenerate(observations, InputError::Degenerate(Degeneracy::Collinear).into()));
    }
    let found = Found {
        polished,
        others: &others,
        of_few: &of_few,
        verdict,
        false_matches: &false_matches,
        iterations,
        answer,
    };
    let estimate = assemble(poses, &found);
    // A whole family of poses is no pose, and none is known where the rotation may be any.
    estimate.ok_or_else(|| degenerate(observations, InputError::Degenerate(Degeneracy::RankDeficient).into()))
}

/// All that an estimate is made of.
struct Found<'a> {
    polished: Polished,
    others: &'a [Alternative],
    of_few: &'a [Scored],
    verdict: Verdict,
    false_matches: &'a Columns,
    iterations: usize,
    answer: Answer,
}

/// One of the motions of a plane: as its homography has it, and refined as any other motion.
#[derive(Clone, Copy, Debug)]
struct Alternative {
    of_plane: Scored,
    refined: Scored,
}

fn alternatives(poses: &mut PoseScorer, plane: &Plane, polished: &Polished) -> Vec<Alternative> {
    let wide = WIDE * poses.threshold();
    let loss = GemanMcClure::new(SCALE * polished.sigma);
    let mut all = Vec::new();
    for motion in plane.motions.iter().flatten() {
        let Some(of_plane) = poses.best_pose(&motion.essential(), wide) else { continue };
        let mut refined = of_plane;
        let count = poses.inliers.len().min(MATCHES);
        // Beside the pose it would only be found again.
        if count >= FEWEST && !is_same(&of_plane.motion, &polished.scored.motion) {
            let subset = Subset::new(&poses.observations.columns, &poses.inliers[..count]);
            let mut motion = of_plane.motion;
            refine(&subset, &mut motion, &loss, FINE, STEPS);
            refined = poses.best_pose(&motion.essential(), wide).unwrap_or(refined);
        }
        all.push(Alternative { of_plane, refined });
    }
    all
}

fn is_same(a: &Motion, b: &Motion) -> bool {
    a.q_21.angle_to(&b.q_21) < SAME && a.direction.dot(&b.direction) > SAME_DIRECTION.cos()
}

/// Puts an alternative that explains the matches better in the place of the pose, which becomes an alternative itself.
fn replace(poses: &mut PoseScorer, polished: &mut Polished, others: &mut [Alternative]) {
    let better = |a: &&mut Alternative| {
        a.refined.cost < polished.scored.cost - CLEARLY
            && !is_same(&a.refined.motion, &polished.scored.motion)
    };
    let best = others.iter_mut().filter(better).min_by(|a, b| a.refined.cost.total_cmp(&b.refined.cost));
    if let Some(best) = best {
        *polished = polish(poses, best.refined.motion);
    }
}

fn assemble(poses: &mut PoseScorer, found: &Found) -> Option<Estimate> {
    let Found { polished, others, of_few, verdict, false_matches, iterations, answer } = *found;
    let observations = poses.observations;
    let sigma = polished.sigma;
    let (model, is_few) = (verdict.model, observations.len() < MANY);
    let mut motion = polished.scored.motion;
    let mut second = None;
    match model {
        Model::Planar => (motion, second) = both_of_plane(poses, others, &motion, verdict.is_exact_plane),
        Model::PureRotation => motion = still(observations, &poses.inliers, verdict.q_21),
        Model::General if !is_few => second = as_likely(poses, others, &polished),
        Model::General => {}
    }
    if model != Model::PureRotation && is_few {
        second = second_of_few(of_few, &motion);
    }
    if let (Answer::Other, Some(second)) = (answer, &mut second) {
        std::mem::swap(&mut motion, second);
    }
    let scored = poses.score(motion, poses.threshold());
    let polished = Polished { scored, ..polished };
    if model == Model::PureRotation {
        let r_21 = verdict.q_21.to_rotation_matrix().into_inner();
        let limit = (NEAR_POINT * poses.threshold()).powi(2);
        let mut squares = observations.framed(&poses.inliers).square_errors(&r_21).into_iter();
        poses.inliers.retain(|_| squares.next().is_some_and(|square| square < limit));
    }
    // A plane, a rotation, or one of the poses of few matches may be left with less than it takes.
    if poses.inliers.len() < MIN_MATCHES {
        return None;
    }
    let inliers = poses.inliers.clone();
    let noise = Noise { sigma, false_matches };
    let size = length(observations, &motion, &inliers, &noise);
    let covariance = match model {
        Model::PureRotation => covariance::of_rotation(observations, &motion.q_21, &inliers, sigma, size),
        _ => covariance::of_pose(observations, &inliers, &polished, size, false_matches),
    }?;
    let mut mask = vec![false; observations.len()];
    for &i in &inliers {
        mask[observations.order[i as usize]] = true;
    }
    Some(Estimate {
        model,
        pose: with_length(&motion, size),
        covariance,
        inlier_count: inliers.len(),
        inliers: mask,
        score: share(&scored, observations),
        iterations,
        runner_up: second.map(|motion| runner_up(poses, motion, &noise)),
        evidence: verdict.evidence,
        noise_px: sigma,
    })
}

/// The two motions of a plane, that of the best pose first.
///
/// The pose itself is one of the two only as far as the essential matrix determines it: a few false matches, each of
/// which adds a line to what the plane leaves open, lead it far from both. Where the plane is exact its own motions are the
/// answers, if there are more matches than any plane explains; where it is not, the pose and that motion of the plane from
/// which it is further away. One that leaves many of the points behind a camera is no answer.
fn both_of_plane(
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
        poses.score(motion, poses.threshold());
        poses.inliers.len() as f64
    });
    if in_other < NEARLY_AS_WELL * in_first {
        (first, None)
    } else if in_first < NEARLY_AS_WELL * in_other {
        (other, None)
    } else {
        (first, Some(other))
    }
}

/// Another motion that noise may have made the worse one: where the parallax is small the cost has a minimum on either side of
/// the plane that the points are nearest to.
fn as_likely(poses: &mut PoseScorer, others: &[Alternative], polished: &Polished) -> Option<Motion> {
    let best = &polished.scored.motion;
    let is_elsewhere = |other: &Motion| other.direction.angle(&best.direction) > ELSEWHERE;
    let mut refined =
        others.iter().map(|a| a.refined.motion).filter(|motion| !is_same(motion, best)).peekable();
    refined.peek()?;
    poses.score(*best, polished.limit);
    let limit = poses.misfit(polished.sigma) + CAP;
    let mut second: Option<Scored> = None;
    for mut motion in refined {
        poses.score(motion, polished.limit);
        if poses.misfit(polished.sigma) > limit {
            continue;
        }
        // It was refined over some of its inliers, and may have been on the way to the same minimum.
        let subset = Subset::new(&poses.observations.columns, &poses.inliers);
        refine(&subset, &mut motion, &polished.loss, FINE, STEPS);
        let other = poses.best_pose(&motion.essential(), poses.threshold());
        let least = second.map_or(f64::INFINITY, |second| second.cost);
        second = other.filter(|other| is_elsewhere(&other.motion) && other.cost < least).or(second);
    }
    second.map(|second| second.motion)
}

/// How far one motion is from another, in radians of rotation and of direction together.
fn distance(a: &Motion, b: &Motion) -> f64 {
    a.q_21.angle_to(&b.q_21) + a.direction.angle(&b.direction)
}

/// The motion of a camera that only turns: the direction of what translation is left.
fn still(observations: &Observations, inliers: &[u32], q_21: UnitQuaternion<f64>) -> Motion {
    let matches: Vec<_> = inliers.iter().map(|&i| observations.matches[i as usize]).collect();
    Motion { q_21, direction: translation_direction(&q_21, &matches) }
}

fn with_length(motion: &Motion, size: Length) -> RelativePose {
    RelativePose::new(motion.q_21, motion.direction * size.value)
}

fn share(scored: &Scored, observations: &Observations) -> f64 {
    (1.0 - scored.cost / observations.len() as f64).clamp(0.0, 1.0)
}

/// The next best of the poses that few matches have.
fn second_of_few(all: &[Scored], best: &Motion) -> Option<Motion> {
    let different = all.iter().filter(|s| !is_same(&s.motion, best));
    different.min_by(|a, b| a.cost.total_cmp(&b.cost)).map(|s| s.motion)
}

fn runner_up(poses: &mut PoseScorer, motion: Motion, noise: &Noise) -> RunnerUp {
    let scored = poses.score(motion, poses.threshold());
    let size = length(poses.observations, &scored.motion, &poses.inliers, noise);
    RunnerUp {
        pose: with_length(&scored.motion, size),
        score: share(&scored, poses.observations),
        inlier_count: poses.inliers.len(),
    }
}
