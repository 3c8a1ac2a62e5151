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
        let placed = terms.goal.iter().map(|goal| goal.iter().all(|c| c.is_finite()));
        for ((point, goal), _) in new.map.points.iter().zip(terms.goal).zip(placed).filter(|(_, is)| *is) {
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

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::servo::estimators::tracker::map::{Known, Map};
    use crate::servo::estimators::tracker::resection::Task;

    const RELIEF: f64 = 0.3;

    /// Places in the goal, and inverse depths with a mean of about one.
    fn scene() -> (Vec<[f64; 2]>, Vec<f64>) {
        let place = |k: f64| [0.5 * (1.7 * k).sin(), 0.5 * (2.9 * k + 1.0).cos()];
        let numbers = || (0..12).map(f64::from);
        (numbers().map(place).collect(), numbers().map(|k| 1.0 + 0.2 * (2.3 * k).sin()).collect())
    }

    fn terms<'a>(goal: &'a [[f64; 2]], known: &'a [Option<Known>]) -> Terms<'a> {
        let task = Task {
            variance: 1e-6,
            place_variance: 1e-6,
            ground: None,
            is_translation_fixed: false,
            mapped_only: false,
            depth_variance: None,
            iterations: 8,
        };
        Terms {
            goal,
            known,
            task,
            relief: RELIEF,
            first_images: 1,
            min_features: 5,
            least_inliers: 6,
            travel: Vector3::zeros(),
        }
    }

    /// What becomes of a proposal for the image from a pose: the inverse depths and the pose to begin with.
    fn prepared(
        pose: &RelativePose,
        proposal: &Proposal,
        known: &[Option<Known>],
        best: Option<&[Point]>,
    ) -> Option<(Vec<f64>, RelativePose)> {
        let (goal, rho) = scene();
        let seen = goal.iter().zip(&rho).map(|(m, rho)| {
            let x2 = pose.q_21 * Vector3::new(m[0], m[1], 1.0) + pose.t_21 * *rho;
            Some([x2.x / x2.z, x2.y / x2.z])
        });
        let mut consensus = Consensus::new(goal.len());
        consensus.begin(&goal, &seen.collect::<Vec<_>>(), |_| true);
        let mut new = Hypothesis::new(Map::new(&goal, 4, RELIEF));
        prepare(&mut new, proposal, &consensus, best, &terms(&goal, known))
            .then(|| (new.map.points.iter().map(|p| p.rho).collect(), new.map.keys[0]))
    }

    fn truth() -> RelativePose {
        RelativePose::new(UnitQuaternion::new(Vector3::new(0.05, -0.1, 0.2)), Vector3::new(0.1, -0.05, 0.2))
    }

    #[test]
    fn depths_of_a_pose_are_triangulated_whatever_its_length() {
        let (_, rho) = scene();
        for length in [1.0, 0.01, 50.0] {
            let pose = RelativePose::new(truth().q_21, truth().t_21 * length);
            let proposal = Proposal { pose, relief: RELIEF, depths: Depths::Triangulated };
            let (found, start) = prepared(&truth(), &proposal, &[None; 12], None).unwrap();
            let unit = found[0] / rho[0];
            assert!(found.iter().zip(&rho).all(|(found, rho)| (found / rho / unit - 1.0).abs() < 1e-9));
            // The unit of length is that of the mean depth.
            assert!((unit - 1.0).abs() < 0.1, "{unit}");
            assert!((start.t_21 * unit - truth().t_21).norm() < 1e-9, "{length}: {start:?}");
        }
        // One that goes the other way has everything behind it.
        let pose = RelativePose::new(truth().q_21, -truth().t_21);
        let proposal = Proposal { pose, relief: RELIEF, depths: Depths::Triangulated };
        assert_eq!(prepared(&truth(), &proposal, &[None; 12], None), None);
        // A rotation tells no depths, and is no error.
        let turn = RelativePose::new(truth().q_21, Vector3::zeros());
        let proposal = Proposal { pose: turn, relief: RELIEF, depths: Depths::Triangulated };
        let (found, start) = prepared(&turn, &proposal, &[None; 12], None).unwrap();
        assert!(found.iter().all(|rho| (rho - 1.0).abs() < 1e-15) && start.t_21.norm() <= 0.0);
    }

    #[test]
    fn depths_that_are_known_set_the_unit_and_stay() {
        let (_, rho) = scene();
        let known: Vec<_> =
            (0..12).map(|k| (k % 2 == 0).then_some(Known { rho: 0.5 * rho[k], variance: 1e-6 })).collect();
        let pose = RelativePose::new(truth().q_21, truth().t_21 * 7.0);
        let proposal = Proposal { pose, relief: RELIEF, depths: Depths::Triangulated };
        let (found, start) = prepared(&truth(), &proposal, &known, None).unwrap();
        // The others follow their unit, in which each of them has a hundredth of a say.
        for (k, (found, rho)) in found.iter().zip(&rho).enumerate() {
            let off = (found / rho - 0.5).abs();
            assert!(off < if k % 2 == 0 { 1e-12 } else { 1e-2 }, "{k}: {found}");
        }
        assert!((start.t_21 - truth().t_21 * 2.0).norm() < 1e-2, "{start:?}");
        // A scene that is reversed leaves them too.
        let best: Vec<Point> = rho
            .iter()
            .map(|rho| Point { place: [0.0; 2], rho: *rho, variance: 0.0, is_mapped: true, is_wrong: false })
            .collect();
        let proposal = Proposal { pose: truth(), relief: RELIEF, depths: Depths::Reversed };
        let (found, _) = prepared(&truth(), &proposal, &known, Some(&best)).unwrap();
        for (k, (found, rho)) in found.iter().zip(&rho).enumerate() {
            let expected = if k % 2 == 0 { 0.5 * rho } else { 2.0 - rho };
            assert!((found - expected).abs() < 1e-12, "{k}: {found}");
        }
        // Nothing can be reversed before there is an answer.
        assert_eq!(prepared(&truth(), &proposal, &known, None), None);
    }

    #[test]
    fn flat_scenes_and_planes_have_the_depths_of_a_plane() {
        let proposal = Proposal { pose: truth(), relief: RELIEF, depths: Depths::Flat };
        let (found, start) = prepared(&truth(), &proposal, &[None; 12], None).unwrap();
        assert!(found.iter().all(|rho| (rho - 1.0).abs() < 1e-15) && start == truth());
        let proposal = Proposal { pose: truth(), relief: PLANE_RELIEF, depths: Depths::Triangulated };
        let (found, _) = prepared(&truth(), &proposal, &[None; 12], None).unwrap();
        let (goal, _) = scene();
        let rows = nalgebra::DMatrix::from_fn(12, 4, |k, c| [goal[k][0], goal[k][1], 1.0, found[k]][c]);
        let singular = rows.singular_values();
        assert!(singular[3] < 1e-9 * singular[0], "{singular}");
    }
}
