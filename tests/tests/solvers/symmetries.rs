//! The symmetries of the problem.

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};
use quest_core::Correspondence;
use quest_core::simulate::SceneOptions;
use quest_tests::scenes::{exact_rotations, scenes};

use super::{NONE, SAME, SEED_SYMMETRIES, Subject, closest, noisy, same_rotations};

fn mapped(
    matches: &[Correspondence],
    map: impl Fn(&Correspondence) -> (Vector3<f64>, Vector3<f64>),
) -> Vec<Correspondence> {
    let one = |m: &Correspondence| {
        let (b1, b2) = map(m);
        Correspondence::from_bearings(b1.into(), b2.into())
    };
    matches.iter().map(one).collect::<Result<_, _>>().unwrap_or_default()
}

pub(crate) fn the_order_of_the_matches_does_not_matter(subject: &Subject) {
    for scene in scenes(noisy(SceneOptions::default()), SEED_SYMMETRIES, 300) {
        let found = exact_rotations(&subject.exact(&scene.matches));
        for order in [[4, 3, 2, 1, 0], [1, 2, 3, 4, 0], [2, 0, 4, 1, 3]] {
            let permuted = order.map(|i| scene.matches[i]);
            assert!(same_rotations(&found, &exact_rotations(&subject.exact(&permuted))));
        }
    }
}

pub(crate) fn rotating_a_camera_rotates_the_solutions(subject: &Subject) {
    let axis_angle = |x, y, z| UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z));
    let turns = [axis_angle(0.3, -1.2, 0.4), axis_angle(PI, 0.0, 0.0), axis_angle(-2.0, 0.1, 0.7)];
    let mut broken = Vec::new();
    for (index, scene) in scenes(noisy(SceneOptions::default()), SEED_SYMMETRIES + 1, 200).enumerate() {
        let found = exact_rotations(&subject.exact(&scene.matches));
        for turn in turns {
            // X1' = P X1: R_21 X1 = (R_21 Pᵀ) X1'.
            let first = mapped(&scene.matches, |m| (turn * m.bearing1(), *m.bearing2()));
            let expected: Vec<_> = found.iter().map(|q| q * turn.inverse()).collect();
            let first_holds = same_rotations(&expected, &exact_rotations(&subject.exact(&first)));
            // X2' = P X2 = (P R_21) X1 + P t.
            let second = mapped(&scene.matches, |m| (*m.bearing1(), turn * m.bearing2()));
            let expected: Vec<_> = found.iter().map(|q| turn * q).collect();
            let second_holds = same_rotations(&expected, &exact_rotations(&subject.exact(&second)));
            if !(first_holds && second_holds) {
                broken.push(index);
            }
        }
    }
    assert_eq!(broken, NONE);
}

pub(crate) fn exchanging_the_views_inverts_the_poses(subject: &Subject) {
    for scene in scenes(noisy(SceneOptions::default()), SEED_SYMMETRIES + 2, 300) {
        let exchanged = mapped(&scene.matches, |m| (m.bearing2() * m.length2(), m.bearing1() * m.length1()));
        let (found, back) = (subject.exact(&scene.matches), subject.exact(&exchanged));
        assert_eq!(found.len(), back.len());
        for candidate in found.iter() {
            let expected = candidate.pose.inverse();
            let other = closest(&back, &expected).unwrap();
            assert!(other.pose.rotation_error(&expected) < SAME);
            assert_eq!(other.in_front, candidate.in_front);
            // With as many points in front either way the sign of t is open.
            let (t, u) = (expected.t_21, other.pose.t_21);
            let difference = if candidate.in_front >= 3 { t - u } else { t - u * t.dot(&u).signum() };
            assert!(difference.norm() < 1e-4 * t.norm(), "{difference} of {t}");
        }
    }
}

pub(crate) fn the_length_of_bearings_does_not_matter_to_the_rotation(subject: &Subject) {
    for scene in scenes(noisy(SceneOptions::default()), SEED_SYMMETRIES + 3, 100) {
        let found = exact_rotations(&subject.exact(&scene.matches));
        let rescaled = mapped(&scene.matches, |m| (m.bearing1() * 1e3, m.bearing2() * 1e-7));
        assert!(same_rotations(&found, &exact_rotations(&subject.exact(&rescaled))));
    }
}
