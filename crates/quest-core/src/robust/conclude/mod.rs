//! From the best pose of the search to the estimate: the last refinement, the other pose of a plane, the model, the length of
//! the translation, the covariance.

mod alternatives;
mod by_chance;
mod chance_inliers;
mod covariance;
mod depth_field;
mod evidence;
pub(crate) mod false_alarms;
mod final_refinement;
mod inverse_depth;
mod length;
mod minima;
mod mixture;
mod model;
mod plane;
mod report;
mod rotation_alone;
mod small_motion;

use rand_chacha::ChaCha8Rng;

#[cfg(test)]
pub(crate) use covariance::says_something;
pub(crate) use report::Answer;

use crate::robust::conclude::alternatives::{alternatives, better_of};
use crate::robust::conclude::chance_inliers::refine_without_chance;
use crate::robust::conclude::false_alarms::Chance;
use crate::robust::conclude::final_refinement::{Polished, polish};
use crate::robust::conclude::model::choose;
use crate::robust::conclude::report::{Conclusion, report};
use crate::robust::conclude::small_motion::SmallMotion;
use crate::robust::data::columns::Columns;
use crate::robust::data::observations::Observations;
use crate::robust::estimate::{Estimate, Model};
use crate::robust::options::{EstimateError, UNUSUAL};
use crate::robust::search::SearchResult;
use crate::robust::search::pose_score::PoseScorer;
use crate::robust::search::search_score::MANY;
use crate::robust::{DIAGNOSED, MIN_MATCHES, degenerate, no_pose};
use crate::solver::shared::motion::Motion;
use crate::{Degeneracy, InputError};

/// Steps 3 to 6: the estimate that the result of the search leads to. `blind` are the matches of the search where they are others:
/// those of which none was chosen because it agrees, by which chance is judged.
pub(crate) fn conclude(
    poses: &mut PoseScorer,
    found: &SearchResult,
    blind: Option<&Observations>,
    answer: Answer,
    max_false_alarms: f64,
    rng: &mut ChaCha8Rng,
) -> Result<Estimate, EstimateError> {
    let observations = poses.observations;
    let polished = polish(poses, found.best.motion);
    let polished = minima::likeliest(poses, polished, found);
    let plane = plane::fit(observations, &polished, rng);
    let others = plane.map_or_else(Vec::new, |plane| alternatives(poses, &plane, &polished));
    let polished = better_of(poses, polished, &others);
    let polished = turn_as_known(poses, polished, found, others.iter().map(|other| *other.motion()));
    let false_matches = false_alarms::false_matches(observations);
    let polished = refine_without_chance(poses, polished, &false_matches);
    let false_share = Chance::new(&false_matches, polished.motion()).share(poses.threshold());
    let log_alarms = log_false_alarms(poses, &polished, found.tries, blind, &false_matches);
    let inliers = polished.pose.inliers.len();
    if inliers < MIN_MATCHES || log_alarms > max_false_alarms.log10() {
        return Err(no_pose(observations, inliers, false_share));
    }
    let (polished, mut small) = small_motion::look(poses, polished, &others);
    if let Some(small) = &mut small {
        small.modes.retain(|mode| found.allows(&mode.at.q_21));
    }
    let likeliest = small.as_ref().and_then(SmallMotion::likeliest);
    let polished = turn_as_known(poses, polished, found, likeliest);
    let verdict = choose(observations, &polished, plane.as_ref(), small.as_ref());
    let over_all = plane
        .filter(|_| verdict.model == Model::Planar)
        .and_then(|plane| plane.over_all(observations, &polished.pose.inliers, polished.sigma));
    let others = match over_all {
        Some(plane) if verdict.is_exact_plane => alternatives(poses, &plane, &polished),
        _ => others,
    };
    let plane = over_all.or(plane);
    refuse_line(observations, &polished, verdict.model, false_share)?;
    let conclusion = Conclusion {
        polished,
        small,
        plane,
        others: &others,
        verdict,
        false_matches: &false_matches,
        false_share,
    };
    // A whole family of poses is no pose, and none is known where the rotation may be any.
    let estimate = report(poses, found, conclusion, answer)
        .ok_or_else(|| degenerate(observations, InputError::Degenerate(Degeneracy::RankDeficient).into()))?;
    match found.direction {
        Some(direction) if !direction.allows(&estimate.pose.q_21) => {
            Err(direction.refuse(Some(&estimate.pose.q_21)))
        }
        _ => Ok(estimate),
    }
}

/// The pose, or the best of the others that turn the known direction as told, where the pose does not. Of a plane the refinement may
/// lead from one motion to the other, so they count as they are too.
fn turn_as_known(
    poses: &mut PoseScorer,
    polished: Polished,
    found: &SearchResult,
    others: impl IntoIterator<Item = Motion>,
) -> Polished {
    if found.allows(&polished.motion().q_21) {
        return polished;
    }
    let mut best: Option<Polished> = None;
    for other in others {
        let itself = poses.score(other, poses.threshold());
        for other in [polish(poses, other), polished.clone().with_pose(itself, poses.threshold())] {
            let is_better = best.as_ref().is_none_or(|best| other.pose.scored.cost < best.pose.scored.cost);
            if is_better && found.allows(&other.motion().q_21) {
                best = Some(other);
            }
        }
    }
    best.unwrap_or(polished)
}

/// The base ten logarithm of the number of false alarms. With few matches chance cannot be told from truth: the best pose is taken
/// where a sample's worth of them agree with it.
fn log_false_alarms(
    poses: &PoseScorer,
    polished: &Polished,
    tries: usize,
    blind: Option<&Observations>,
    false_matches: &Columns,
) -> f64 {
    let Some(blind) = blind else {
        if poses.observations.len() < MANY {
            return f64::NEG_INFINITY;
        }
        return false_alarms::log_false_alarms(&polished.pose, tries, false_matches);
    };
    if blind.len() < MANY {
        return f64::NEG_INFINITY;
    }
    let pose = poses.of(blind).score(*polished.motion(), poses.threshold());
    false_alarms::log_false_alarms(&pose, tries, &false_alarms::false_matches(blind))
}

/// Refuses inliers on a line, which determine a rotation and no translation. Within a threshold as wide as the image all are.
fn refuse_line(
    observations: &Observations,
    polished: &Polished,
    model: Model,
    false_share: f64,
) -> Result<(), EstimateError> {
    let inliers = &polished.pose.inliers;
    let some = observations.some(&inliers[..inliers.len().min(DIAGNOSED)]);
    if model == Model::PureRotation || !observations.is_line(&some) {
        return Ok(());
    }
    if false_share >= UNUSUAL && !observations.is_long(&some) {
        return Err(no_pose(observations, inliers.len(), false_share));
    }
    Err(degenerate(observations, InputError::Degenerate(Degeneracy::Collinear).into()))
}
