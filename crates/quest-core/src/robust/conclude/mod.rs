//! From the best pose of the search to the estimate: the last refinement, the other pose of a plane, the model, the length of
//! the translation, the covariance.

mod alternatives;
mod chance_inliers;
mod covariance;
pub(crate) mod false_alarms;
mod final_refinement;
mod inverse_depth;
mod length;
mod model;
mod plane;
mod report;

use rand_chacha::ChaCha8Rng;

use crate::robust::conclude::alternatives::{Alternative, alternatives, better_of};
use crate::robust::conclude::chance_inliers::refine_without_chance;
use crate::robust::conclude::final_refinement::{Polished, polish};
use crate::robust::conclude::model::{Verdict, choose};
use crate::robust::conclude::plane::Plane;
use crate::robust::conclude::report::{Conclusion, report};
use crate::robust::data::columns::Columns;
use crate::robust::data::observations::Observations;
use crate::robust::estimate::{Estimate, Model};
use crate::robust::options::EstimateError;
use crate::robust::search::SearchResult;
use crate::robust::search::pose_score::PoseScorer;
use crate::robust::search::search_score::MANY;
use crate::robust::{DIAGNOSED, MIN_MATCHES, degenerate, no_pose};
use crate::{Degeneracy, InputError};

/// Which of two poses that explain the matches is given as the answer, the other being the runner-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    /// The one that explains them better.
    Best,
    /// The other, because something else is known.
    Other,
}

/// Steps 3 to 6: the estimate that the result of the search leads to.
pub(crate) fn conclude(
    poses: &mut PoseScorer,
    found: &SearchResult,
    answer: Answer,
    max_false_alarms: f64,
    rng: &mut ChaCha8Rng,
) -> Result<Estimate, EstimateError> {
    let observations = poses.observations;
    let polished = polish(poses, found.best.motion);
    let plane = plane::fit(observations, &polished, rng);
    let others = plane.map_or_else(Vec::new, |plane| alternatives(poses, &plane, &polished));
    let polished = better_of(poses, polished, &others);
    let polished = refine_without_chance(poses, polished);
    let false_matches = false_alarms::false_matches(observations);
    refuse_chance(observations, &polished, found.iterations, &false_matches, max_false_alarms)?;
    let verdict = choose(observations, &polished, plane.as_ref());
    let others = of_exact_plane(poses, plane, &verdict, &polished).unwrap_or(others);
    refuse_line(observations, &polished, verdict.model)?;
    let conclusion = Conclusion { polished, others: &others, verdict, false_matches: &false_matches };
    // A whole family of poses is no pose, and none is known where the rotation may be any.
    report(poses, found, conclusion, answer)
        .ok_or_else(|| degenerate(observations, InputError::Degenerate(Degeneracy::RankDeficient).into()))
}

/// Refuses a pose that agrees with no more matches than chance explains. With few matches chance cannot be told from truth: the best
/// pose is returned where a sample's worth of them agree with it.
fn refuse_chance(
    observations: &Observations,
    polished: &Polished,
    iterations: usize,
    false_matches: &Columns,
    max_false_alarms: f64,
) -> Result<(), EstimateError> {
    let inliers = polished.pose.inliers.len();
    let is_chance = observations.len() >= MANY
        && false_alarms::log_false_alarms(&polished.pose, iterations, false_matches)
            > max_false_alarms.log10();
    if inliers < MIN_MATCHES || is_chance {
        return Err(no_pose(observations, inliers));
    }
    Ok(())
}

/// Where the plane is exact, its motions once it is refined over more of the inliers.
fn of_exact_plane(
    poses: &mut PoseScorer,
    plane: Option<Plane>,
    verdict: &Verdict,
    polished: &Polished,
) -> Option<Vec<Alternative>> {
    let plane = plane.filter(|_| verdict.model == Model::Planar && verdict.is_exact_plane)?;
    let plane = plane.over_all(poses.observations, &polished.pose.inliers, polished.sigma)?;
    Some(alternatives(poses, &plane, polished))
}

/// Refuses inliers on a line, which determine a rotation and no translation.
fn refuse_line(observations: &Observations, polished: &Polished, model: Model) -> Result<(), EstimateError> {
    let inliers = &polished.pose.inliers;
    let some = &inliers[..inliers.len().min(DIAGNOSED)];
    let some: Vec<_> = some.iter().map(|&i| observations.matches[i as usize]).collect();
    if model != Model::PureRotation && observations.is_line(&some) {
        return Err(degenerate(observations, InputError::Degenerate(Degeneracy::Collinear).into()));
    }
    Ok(())
}
