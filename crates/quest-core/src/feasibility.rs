//! Which poses a real pair of cameras can have: positive depths, and theorem 2 of the paper's appendix B.

use nalgebra::{Vector2, Vector3};

use crate::{Correspondence, RelativePose};

/// How many matches have positive depth in both views: the exact test, and the default.
///
/// A match whose rays are parallel to rounding has no depth. It counts if the rays point the same way.
#[must_use]
pub fn in_front(pose: &RelativePose, matches: &[Correspondence]) -> usize {
    let positive = |m: &&Correspondence| match pose.depths(m) {
        Some((z1, z2)) => z1 > 0.0 && z2 > 0.0,
        None => (pose.q_21 * m.bearing1()).dot(m.bearing2()) > 0.0,
    };
    matches.iter().filter(positive).count()
}

/// Theorem 2 (appendix B) as the paper states it, with `t_xy` pointing from `O2` to `O1` as in the text at (B.2):
/// the printed "from O1 to O2" rejects every true pose.
///
/// It compares directions in the image plane of camera 1 alone. Condition (a) is a heuristic: it also rejects
/// a camera that looks back at the points from their far side. [`in_front`] is the exact test.
#[must_use]
pub fn theorem_2(pose: &RelativePose, matches: &[Correspondence]) -> bool {
    let to_frame_1 = pose.q_21.inverse();
    let t_xy = (to_frame_1 * pose.t_21).xy();
    matches.iter().all(|m| {
        let s2 = to_frame_1 * m.bearing2();
        s2.z > 0.0 && moves_along(&t_xy, m.bearing1(), &s2)
    })
}

/// Conditions (b) and (c): seen from above, the point moves from `s2` to `s1` away from `t_xy`, on its side.
fn moves_along(t_xy: &Vector2<f64>, s1: &Vector3<f64>, s2: &Vector3<f64>) -> bool {
    // Rounding of unit vectors: equality must not be lost where a point does not move.
    const SLACK: f64 = 1e-12;
    let (v1, v2) = (s1.xy(), s2.xy());
    let (side1, side2) = (t_xy.perp(&v1), t_xy.perp(&v2));
    let angle1 = side1.abs().atan2(t_xy.dot(&v1));
    let angle2 = side2.abs().atan2(t_xy.dot(&v2));
    let rounding = SLACK * t_xy.norm();
    let same_side = side1.signum() == side2.signum() || side1.abs() <= rounding || side2.abs() <= rounding;
    angle2 <= angle1 + SLACK / v1.norm().min(v2.norm()).max(SLACK) && same_side
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Points in front of two cameras that look the same way, up to half a radian.
    fn scene(rng: &mut ChaCha8Rng) -> (RelativePose, Vec<Correspondence>) {
        let mut vector = |s: f64| Vector3::from_fn(|_, _| rng.random_range(-s..s));
        loop {
            let pose = RelativePose::new(UnitQuaternion::new(vector(0.5)), vector(1.0));
            let points: Vec<_> = (0..5).map(|_| vector(1.0) + Vector3::new(0.0, 0.0, 3.0)).collect();
            let matches: Option<Vec<_>> = points.iter().map(|x1| seen(&pose, x1)).collect();
            if let Some(matches) = matches {
                return (pose, matches);
            }
        }
    }

    /// The match of a point, where the point is in front of both cameras and camera 2 does not look back at it.
    fn seen(pose: &RelativePose, x1: &Vector3<f64>) -> Option<Correspondence> {
        let x2 = pose.q_21 * x1 + pose.t_21;
        let forward = (pose.q_21.inverse() * x2).z > 0.0;
        (x2.z > 0.0 && forward).then(|| Correspondence::from_bearings((*x1).into(), x2.into()).unwrap())
    }

    #[test]
    fn true_poses_are_feasible() {
        let mut rng = ChaCha8Rng::seed_from_u64(10_000);
        for k in 0..10_000 {
            let (pose, matches) = scene(&mut rng);
            assert!(theorem_2(&pose, &matches), "scene {k}");
            assert_eq!(in_front(&pose, &matches), 5, "scene {k}");
        }
    }

    #[test]
    fn reversed_translations_are_not() {
        let mut rng = ChaCha8Rng::seed_from_u64(10_001);
        for k in 0..1_000 {
            let (pose, matches) = scene(&mut rng);
            let reversed = RelativePose::new(pose.q_21, -pose.t_21);
            assert_eq!(in_front(&reversed, &matches), 0, "scene {k}");
            assert!(!theorem_2(&reversed, &matches), "scene {k}");
        }
    }

    #[test]
    fn theorem_2_rejects_a_camera_that_looks_back() {
        // Camera 2 stands behind the points and looks back at camera 1.
        let half_turn = UnitQuaternion::new(Vector3::new(0.0, std::f64::consts::PI, 0.0));
        let pose = RelativePose::new(half_turn, Vector3::new(0.1, 0.0, 8.0));
        let points =
            [[0.3, 0.1, 3.0], [-0.5, 0.4, 4.0], [0.2, -0.6, 3.5], [-0.4, -0.3, 5.0], [0.7, 0.5, 4.5]];
        let matches = points.map(|x1| {
            let x2 = pose.q_21 * Vector3::from(x1) + pose.t_21;
            Correspondence::from_bearings(x1, x2.into()).unwrap()
        });
        assert_eq!(in_front(&pose, &matches), 5);
        assert!(!theorem_2(&pose, &matches));
    }
}
