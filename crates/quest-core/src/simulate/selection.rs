//! Errors of candidates: the smallest there are, or those of one chosen without the truth.

use nalgebra::Vector3;

use super::{View, rotation_metric, translation_metric};
use crate::{Candidate, Correspondence, RelativePose};

/// The errors of one pose by the paper's metrics, in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseErrors {
    /// (61): half the angle of the rotation between the two.
    pub rotation: f64,
    /// (62): the angle between the translations, whatever their signs. Zero where the true one vanishes.
    pub translation: f64,
}

impl PoseErrors {
    /// The errors of this pose.
    #[must_use]
    pub fn of(truth: &RelativePose, found: &RelativePose) -> Self {
        Self {
            rotation: rotation_metric(&truth.q_21, &found.q_21),
            translation: translation_metric(&truth.t_21, &found.t_21),
        }
    }

    /// The smallest errors among candidates, each metric by itself; `None` where there is no candidate.
    ///
    /// Section 9 takes "the solution candidate that is closest to the ground truth". Rotation and translation are
    /// compared on their own there, so that the closest rotation and the closest translation may belong to two
    /// candidates.
    pub fn smallest<'a>(
        truth: &RelativePose,
        candidates: impl IntoIterator<Item = &'a Candidate>,
    ) -> Option<Self> {
        let errors = candidates.into_iter().map(|c| Self::of(truth, &c.pose));
        errors.reduce(|a, b| Self {
            rotation: a.rotation.min(b.rotation),
            translation: a.translation.min(b.translation),
        })
    }
}

/// The candidate that explains other matches of the scene best, chosen without the truth: the smallest mean Sampson
/// error.
///
/// The essential matrix alone cannot tell a pose from its twisted partner, but depths can. A point that the pose puts
/// behind a camera is taken to be infinitely far away, where its depth says nothing, and the angle between its rays
/// is its error. With [`View::Everywhere`] the candidate counts with t or −t, whichever is better: images of points
/// behind camera 2 gave the solver no reason for a sign.
pub fn choose<'a>(
    candidates: impl IntoIterator<Item = &'a Candidate>,
    others: &[Correspondence],
    view: View,
) -> Option<&'a Candidate> {
    let costs = candidates.into_iter().map(|c| (c, cost(&c.pose, others, view)));
    costs.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(c, _)| c)
}

fn cost(pose: &RelativePose, others: &[Correspondence], view: View) -> f64 {
    let rotation = RelativePose::new(pose.q_21, Vector3::zeros());
    // With t, and with −t.
    let mut sums = [0.0, 0.0];
    for m in others {
        let at_infinity = rotation.sampson_error(m);
        let at_depth = pose.sampson_error(m);
        let (z1, z2) = pose.depths(m).unwrap_or((-1.0, 1.0));
        sums[0] += if z1 > 0.0 && z2 > 0.0 { at_depth } else { at_infinity };
        sums[1] += if z1 < 0.0 && z2 < 0.0 { at_depth } else { at_infinity };
    }
    if view == View::Everywhere { sums[0].min(sums[1]) } else { sums[0] }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::CandidateKind;
    use crate::simulate::{Scene, SceneOptions};

    /// The truth, its twisted partner, both with either sign of t, and a pose nearby.
    fn poses(truth: &RelativePose) -> Vec<Candidate> {
        let RelativePose { q_21, t_21 } = *truth;
        let twist = UnitQuaternion::new(PI * t_21.normalize());
        let turn = UnitQuaternion::new(Vector3::new(0.01, 0.0, 0.0));
        [q_21, twist * q_21, turn * q_21]
            .into_iter()
            .flat_map(|q| [t_21, -t_21].map(|t| RelativePose::new(q, t)))
            .map(|pose| Candidate { kind: CandidateKind::Exact, pose, residual: 0.0, in_front: 0 })
            .collect()
    }

    #[test]
    fn the_truth_is_chosen() {
        for options in [SceneOptions::default(), SceneOptions::realistic()] {
            for index in 0..200 {
                let (scene, further) = Scene::with_further(&options, 30, 3, index).unwrap();
                let all = poses(&scene.truth);
                let found = choose(&all, &further, options.view).unwrap().pose;
                assert_eq!(found.q_21, scene.truth.q_21, "{index}");
                assert!(options.view == View::Everywhere || found == scene.truth);
                assert!(choose(&[], &further, options.view).is_none());
            }
        }
    }

    #[test]
    fn each_error_is_the_smallest_by_itself() {
        let truth = Scene::generate(&SceneOptions::default(), 3, 0).unwrap().truth;
        let turn = UnitQuaternion::new(Vector3::new(0.2, 0.0, 0.0));
        let candidates = [
            RelativePose::new(truth.q_21, turn * truth.t_21),
            RelativePose::new(turn * truth.q_21, truth.t_21),
        ];
        let candidates =
            candidates.map(|pose| Candidate { kind: CandidateKind::Exact, pose, residual: 0.0, in_front: 0 });
        // Half the angle of a rotation is what the metric sees.
        let errors = PoseErrors::smallest(&truth, &candidates[1..]).unwrap();
        assert!((errors.rotation - 0.1).abs() < 1e-12 && errors.translation < 1e-12);
        let errors = PoseErrors::smallest(&truth, &candidates).unwrap();
        assert!(errors.rotation < 1e-12 && errors.translation < 1e-12);
        assert!(PoseErrors::smallest(&truth, &[]).is_none());
    }
}
