//! Errors of candidates: the smallest errors, or those of a candidate that is chosen without the truth.

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::Vector3;

use super::{View, rotation_metric, translation_metric};
use crate::{Candidate, Correspondence, RelativePose, pose::sampson_square};

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
    /// compared separately there, so the closest rotation and the closest translation may belong to two candidates.
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
/// The essential matrix alone cannot distinguish a pose from its twisted partner, but depths can. A point that the pose puts
/// behind a camera is taken to be infinitely far away, and the angle between its rays is its error. With
/// [`View::Everywhere`] the better of t and −t is taken, because images of points behind camera 2 do not determine the sign.
pub fn choose<'a>(
    candidates: impl IntoIterator<Item = &'a Candidate>,
    others: &[Correspondence],
    view: View,
) -> Option<&'a Candidate> {
    let mut best = (None, f64::INFINITY);
    for candidate in candidates {
        let cost = cost(&candidate.pose, others, view, best.1);
        if cost < best.1 {
            best = (Some(candidate), cost);
        }
    }
    best.0
}

/// The sum of the errors. Once it exceeds `limit`, the result is some number above `limit`.
fn cost(pose: &RelativePose, others: &[Correspondence], view: View, limit: f64) -> f64 {
    let r_21 = pose.r_21();
    let t = pose.t_21.try_normalize(0.0);
    // With t, and with −t.
    let mut sums = [0.0, 0.0];
    for m in others {
        let (b, c) = (m.bearing2(), r_21 * m.bearing1());
        let n = b.cross(&c);
        let at_infinity = || FRAC_1_SQRT_2 * n.norm().atan2(b.dot(&c));
        let error = |t: Vector3<f64>| {
            let at_depth = sampson_square(t.dot(&n), t.dot(b), t.dot(&c)).sqrt();
            // The signs of the depths: (28) crossed with b, and with c.
            match (b.cross(&t).dot(&n) < 0.0, c.cross(&t).dot(&n) < 0.0) {
                (true, true) => [at_depth, at_infinity()],
                (false, false) => [at_infinity(), at_depth],
                _ => [at_infinity(); 2],
            }
        };
        let [with_t, reversed] = t.map_or_else(|| [at_infinity(); 2], error);
        sums[0] += with_t;
        sums[1] += reversed;
        if sums[0] > limit && (view == View::InBothImages || sums[1] > limit) {
            return f64::INFINITY;
        }
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
