//! The symmetries of the problem.

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};
use quest_core::simulate::Scene;
use quest_core::solver::Kinds;
use quest_core::{Correspondence, RelativePose};
use quest_tests::scenes::scenes;

use super::{SEED_SYMMETRIES, Subject, closest, exact_poses, noisy, rotations, same_poses, same_rotations};

fn mapped(
    matches: &[Correspondence],
    map: impl Fn(&Correspondence) -> (Vector3<f64>, Vector3<f64>),
) -> Vec<Correspondence> {
    let one = |m: &Correspondence| {
        let (b1, b2) = map(m);
        Correspondence::from_bearings(b1.into(), b2.into()).unwrap()
    };
    matches.iter().map(one).collect()
}

/// Counts the noisy problems, of its share of 1,000, of which a law does not hold.
fn holds(subject: &Subject, seed: u64, law: impl Fn(&Scene) -> bool) {
    let all = scenes(noisy(subject.scenes), seed, subject.share(1_000)).enumerate();
    let broken: Vec<_> = all.filter(|(_, scene)| !law(scene)).map(|(index, _)| index).collect();
    assert!(broken.len() <= subject.most_different, "{}: {broken:?}", broken.len());
}

pub(crate) fn the_order_of_the_matches_does_not_matter(subject: &Subject) {
    holds(subject, SEED_SYMMETRIES, |scene| {
        let found = subject.exact(&scene.matches);
        let mut permuted = scene.matches.clone();
        permuted.reverse();
        let reversed = subject.exact(&permuted);
        permuted.rotate_left(1);
        same_poses(&reversed, &found) && same_poses(&subject.exact(&permuted), &found)
    });
}

pub(crate) fn rotating_the_cameras_rotates_the_poses(subject: &Subject) {
    let turn = |x, y, z| UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z));
    let none = UnitQuaternion::identity();
    let turns = [
        (turn(0.3, -1.2, 0.4), turn(-2.0, 0.1, 0.7)),
        (turn(PI, 0.0, 0.0), none),
        (none, turn(0.0, PI, 0.0)),
    ];
    holds(subject, SEED_SYMMETRIES + 1, |scene| {
        let found = subject.exact(&scene.matches);
        turns.iter().all(|(turn1, turn2)| {
            // X1' = P X1 and X2' = Q X2 = (Q R Pᵀ) X1' + Q t.
            let turned = mapped(&scene.matches, |m| (turn1 * m.bearing1(), turn2 * m.bearing2()));
            let expected =
                found.iter().map(|p| RelativePose::new(turn2 * p.q_21 * turn1.inverse(), turn2 * p.t_21));
            same_poses(&subject.exact(&turned), &expected.collect::<Vec<_>>())
        })
    });
}

pub(crate) fn exchanging_the_views_inverts_the_poses(subject: &Subject) {
    holds(subject, SEED_SYMMETRIES + 2, |scene| {
        let exchanged = mapped(&scene.matches, |m| (m.bearing2() * m.length2(), m.bearing1() * m.length1()));
        let [found, back] = [&scene.matches, &exchanged].map(|matches| subject.solve(Kinds::Exact, matches));
        let inverses: Vec<_> = exact_poses(&found).iter().map(RelativePose::inverse).collect();
        same_poses(&inverses, &exact_poses(&back))
            && found.iter().all(|candidate| {
                let expected = candidate.pose.inverse();
                let other = closest(&back, &expected).unwrap();
                // With as many points in front either way the sign of t is open.
                let (t, u) = (expected.t_21, other.pose.t_21);
                let is_open = 2 * candidate.in_front <= scene.matches.len();
                let difference = if is_open { t - u * t.dot(&u).signum() } else { t - u };
                other.in_front == candidate.in_front && difference.norm() < 1e-4 * t.norm()
            })
    });
}

pub(crate) fn the_length_of_bearings_does_not_matter_to_the_rotation(subject: &Subject) {
    holds(subject, SEED_SYMMETRIES + 3, |scene| {
        let rescaled = mapped(&scene.matches, |m| (m.bearing1() * 1e3, m.bearing2() * 1e-7));
        let [found, other] = [&scene.matches, &rescaled].map(|matches| rotations(&subject.exact(matches)));
        same_rotations(&found, &other)
    });
}
