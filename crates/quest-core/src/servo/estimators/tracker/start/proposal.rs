//! What an adjustment of the start begins with: a pose, and where the depths come from.

use nalgebra::{Matrix3, Vector3};

use super::Terms;
use crate::RelativePose;
use crate::servo::estimators::tracker::consensus::Consensus;
use crate::servo::estimators::tracker::hypothesis::Hypothesis;
use crate::servo::estimators::tracker::map::PLANE_RELIEF;
use crate::servo::estimators::tracker::resection::Point;

/// A pose to begin an adjustment with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Proposal {
    pub(crate) pose: RelativePose,
    /// With the relief of the scene that it is adjusted to.
    pub(crate) relief: f64,
    pub(crate) depths: Depths,
}

/// Where a proposal's inverse depths come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Depths {
    /// All one.
    Flat,
    /// Of the pose.
    Triangulated,
    /// Those of the best answer, reversed about one.
    Reversed,
}

/// Sets a hypothesis to a proposal; `false` where the proposal is absurd.
pub(crate) fn prepare(
    new: &mut Hypothesis,
    proposal: &Proposal,
    consensus: &Consensus,
    best: Option<&[Point]>,
    terms: &Terms<'_>,
) -> bool {
    new.map.forget(terms.goal, terms.known, proposal.relief);
    new.map.damping = 1e-3;
    (new.is_relief, new.off_map) = (false, 0.0);
    new.track.clear();
    let mut pose = proposal.pose;
    match proposal.depths {
        Depths::Flat => {}
        Depths::Triangulated => {
            let Some(scale) = triangulate(new, &pose, consensus, terms) else { return false };
            pose.t_21 *= scale;
        }
        Depths::Reversed => {
            let Some(best) = best else { return false };
            for ((point, best), known) in new.map.points.iter_mut().zip(best).zip(terms.known) {
                if known.is_none() {
                    point.rho = (2.0 - best.rho).clamp(0.1, 4.0);
                }
            }
        }
    }
    if proposal.relief <= PLANE_RELIEF {
        pose.t_21 *= fit_plane(new, terms);
    }
    new.map.keys.push(pose);
    true
}

/// The inverse depths of a pose, in the unit of their median; what the pose is to be multiplied with. `None` where it is absurd.
fn triangulate(
    new: &mut Hypothesis,
    pose: &RelativePose,
    consensus: &Consensus,
    terms: &Terms<'_>,
) -> Option<f64> {
    if pose.t_21.amax() <= 0.0 {
        return Some(1.0);
    }
    let (mut sum, mut count, mut behind) = (0.0, 0.0, 0);
    for (m, &i) in consensus.matches.iter().zip(&consensus.features) {
        let Some((z1, z2)) = pose.depths(m) else { continue };
        behind += usize::from(z1 <= 0.0 || z2 <= 0.0);
        let rho = 1.0 / z1;
        new.map.points[i].rho = rho;
        // The unit is that of the known depths where there are some.
        let (rho, weight) = match terms.known[i] {
            Some(known) => (rho / known.rho.max(1e-3), 100.0),
            None => (rho, 1.0),
        };
        if z1 > 0.0 {
            // A wrong match may be anywhere: it counts as at most four times as near as the others.
            sum += weight * rho;
            count += weight;
        }
    }
    if count <= 0.0 || behind * 2 > consensus.matches.len() {
        return None;
    }
    let mut mean = sum / count;
    // Once more without those that are far from the mean.
    let (mut sum, mut count) = (0.0, 0.0);
    for &i in &consensus.features {
        let rho = new.map.points[i].rho / mean;
        if (0.1..3.0).contains(&rho) {
            (sum, count) = (sum + rho, count + 1.0);
        }
    }
    if count > 0.0 && terms.known.iter().all(Option::is_none) {
        mean *= sum / count;
    }
    if !(mean > 0.0 && mean.is_finite()) {
        return None;
    }
    for &i in &consensus.features {
        let point = &mut new.map.points[i];
        point.rho = match terms.known[i] {
            Some(known) => known.rho,
            None => (point.rho / mean).clamp(0.02, 4.0),
        };
        if !point.rho.is_finite() {
            point.rho = 1.0;
        }
    }
    Some(mean)
}

/// The plane through the inverse depths, robustly, and the inverse depths on it, in the unit that makes it one in the middle; what the
/// translation is to be multiplied with.
fn fit_plane(new: &mut Hypothesis, terms: &Terms<'_>) -> f64 {
    let mut normal = Vector3::z();
    for _ in 0..4 {
        let (mut a, mut b) = (Matrix3::identity() * 1e-3, Vector3::z() * 1e-3);
        for (point, goal) in new.map.points.iter().zip(terms.goal) {
            let m = Vector3::new(goal[0], goal[1], 1.0);
            // Those off by a tenth count less and less.
            let weight = 1.0 / (1.0 + ((point.rho - normal.dot(&m)) / 0.1).powi(2));
            a += m * m.transpose() * weight;
            b += m * (weight * point.rho);
        }
        let Some(solved) = a.cholesky().map(|factor| factor.solve(&b)) else { return 1.0 };
        normal = solved;
    }
    let unit = if normal.z > 0.2 && terms.known.iter().all(Option::is_none) { normal.z } else { 1.0 };
    normal /= unit;
    new.map.normal = normal;
    for ((point, goal), known) in new.map.points.iter_mut().zip(terms.goal).zip(terms.known) {
        if known.is_none() {
            point.rho = normal.dot(&Vector3::new(goal[0], goal[1], 1.0)).clamp(0.05, 5.0);
        }
    }
    unit
}
