//! Matches that determine no pose, or only a rotation, are named for what they are.

use std::f64::consts::TAU;

use nalgebra::{UnitQuaternion, Vector3};
use quest_core::simulate::{Angle, Layout, Motion, Scene, SceneOptions, View};
use quest_core::solver::{Kinds, SolverName};
use quest_core::{CandidateKind, Correspondence, Degeneracy, RelativePose};
use quest_tests::scenes::{scene, scenes, solve};

const SEED_DEGENERATE: u64 = 200;

/// The solvers that share one diagnosis.
const SOLVERS: [SolverName; 2] = [SolverName::Quest, SolverName::QuestEigen];

fn pose() -> RelativePose {
    let q_21 = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.3, 0.2));
    RelativePose::new(q_21, Vector3::new(0.4, -0.2, 0.1))
}

/// The verdict and the number of exact candidates, or of both solvers where they have no candidates.
fn verdict(matches: &[Correspondence]) -> (Option<Degeneracy>, usize) {
    let [verdict, other] = SOLVERS.map(|solver| {
        let exact = solve(solver, Kinds::Exact, matches);
        let all = solve(solver, Kinds::All, matches);
        assert_eq!(exact.degeneracy(), all.degeneracy());
        (exact.degeneracy(), exact.len())
    });
    assert_eq!(verdict, other);
    verdict
}

#[test]
fn general_matches_have_none() {
    for options in [SceneOptions::default(), SceneOptions::realistic()] {
        for noise_px in [0.0, 0.75] {
            for layout in [Layout::General, Layout::Coplanar] {
                let options = SceneOptions { noise_px, layout, ..options };
                assert!(scenes(options, SEED_DEGENERATE, 200).all(|s| verdict(&s.matches).0.is_none()));
            }
        }
    }
}

#[test]
fn too_few() {
    let one = scene(&SceneOptions::default(), SEED_DEGENERATE, 0);
    for n in 0..5 {
        assert_eq!(verdict(&one.matches[..n]), (Some(Degeneracy::TooFewMatches), 0));
    }
}

#[test]
fn coincident() {
    let one = scene(&SceneOptions::default(), SEED_DEGENERATE, 0);
    assert_eq!(verdict(&[one.matches[0]; 5]), (Some(Degeneracy::Coincident), 0));
    // Identical images are no pure rotation then: the camera may have turned about the ray.
    let ray = [0.1, 0.1, 1.0];
    let same = Correspondence::from_bearings(ray, ray).unwrap();
    for n in [5, 6, 100] {
        assert_eq!(verdict(&vec![same; n]), (Some(Degeneracy::Coincident), 0));
    }
    // Nor where some of them look the other way along the same line.
    let opposite = Correspondence::from_bearings(ray.map(|x| -x), ray.map(|x| -x)).unwrap();
    assert_eq!(verdict(&[same, opposite, same, opposite, same]), (Some(Degeneracy::Duplicate), 0));
    // In one view only: five points on one ray of camera 1.
    let on_a_ray = [1.0, 1.5, 2.0, 2.5, 3.0].map(|z| Vector3::new(0.1, 0.2, 1.0) * z);
    let scene = Scene::from_points(pose(), on_a_ray.to_vec()).unwrap();
    assert_eq!(verdict(&scene.matches), (Some(Degeneracy::Coincident), 0));
}

#[test]
fn duplicate() {
    for one in scenes(SceneOptions::default(), SEED_DEGENERATE + 1, 50) {
        for (copy, of) in [(1, 0), (4, 0), (4, 3)] {
            let mut matches = one.matches.clone();
            matches[copy] = matches[of];
            assert_eq!(verdict(&matches), (Some(Degeneracy::Duplicate), 0));
        }
    }
    // Enough others are left.
    for one in scenes(SceneOptions { points: 6, ..SceneOptions::default() }, SEED_DEGENERATE + 1, 50) {
        let mut matches = one.matches.clone();
        matches[5] = matches[2];
        assert!(verdict(&matches).0.is_none());
    }
}

#[test]
fn collinear() {
    let from = Vector3::new(-0.5, 0.3, 2.0);
    let along = Vector3::new(1.0, -0.4, 0.7);
    let line: Vec<_> = [0.0, 0.3, 0.5, 0.8, 1.0].iter().map(|s| from + along * *s).collect();
    let scene = Scene::from_points(pose(), line.clone()).unwrap();
    assert_eq!(verdict(&scene.matches), (Some(Degeneracy::Collinear), 0));
    // Four of five are one too many.
    let mut four = line.clone();
    four[2] = Vector3::new(0.3, 0.4, 2.5);
    let scene = Scene::from_points(pose(), four.clone()).unwrap();
    assert_eq!(verdict(&scene.matches), (Some(Degeneracy::Collinear), 0));
    // Three are not.
    four[4] = Vector3::new(-0.6, -0.5, 3.1);
    let scene = Scene::from_points(pose(), four).unwrap();
    assert!(verdict(&scene.matches).0.is_none());
}

/// Points on a line in one image alone: in a plane through that camera. The true pose is one of two times two.
#[test]
fn collinear_in_one_view() {
    let plane = [[-0.4, 2.0], [-0.1, 2.6], [0.15, 3.5], [0.3, 2.2], [0.55, 2.9]];
    let (u, v) = (Vector3::new(0.9, 0.4, 0.0), Vector3::new(0.1, 0.2, 1.0));
    let points = plane.map(|[x, z]| (u * x + v) * z);
    for q_21 in [pose().q_21, UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 3.0, 0.4))] {
        for length in [1.0, 1e-3, 1e-6] {
            let truth = RelativePose::new(q_21, Vector3::new(0.4, -0.2, 0.1) * length);
            let first = Scene::from_points(truth, points.to_vec()).unwrap();
            let exchanged: Vec<_> = first
                .matches
                .iter()
                .map(|m| {
                    Correspondence::from_bearings((*m.bearing2()).into(), (*m.bearing1()).into()).unwrap()
                })
                .collect();
            for (matches, truth) in [(&first.matches, truth), (&exchanged, truth.inverse())] {
                assert_eq!(verdict(matches), (None, 4));
                for solver in SOLVERS {
                    let found = solve(solver, Kinds::Exact, matches);
                    let errors = found.iter().map(|c| c.pose.rotation_error(&truth));
                    // Rounding, magnified where the two essential matrices come close.
                    assert!(errors.fold(f64::INFINITY, f64::min) < 1e-9, "{solver:?} {length:e}");
                }
            }
        }
    }
}

/// Up to three points at infinity leave the pose determined, four the rotation alone.
#[test]
fn points_at_infinity() {
    let truth = pose();
    let points = [[0.3, 0.1, 2.0], [-0.2, 0.25, 3.0], [0.1, -0.4, 2.5], [-0.35, -0.1, 4.0], [0.45, 0.3, 1.7]];
    for at_infinity in 0..6 {
        // Which of them does not matter.
        for start in 0..5 {
            let matches: Vec<_> = (0..5)
                .map(|i| {
                    let [x, y, z] = points[(start + i) % 5];
                    let a = Vector3::new(x, y, 1.0);
                    let b = if i < at_infinity { truth.q_21 * a } else { truth.q_21 * (a * z) + truth.t_21 };
                    Correspondence::from_bearings(a.into(), b.into()).unwrap()
                })
                .collect();
            match at_infinity {
                0..4 => {
                    for solver in SOLVERS {
                        let found = solve(solver, Kinds::Exact, &matches);
                        let errors = found.iter().map(|c| c.pose.rotation_error(&truth));
                        assert!(errors.fold(f64::INFINITY, f64::min) < 1e-12, "{at_infinity} {start}");
                    }
                }
                4 => assert_eq!(verdict(&matches), (Some(Degeneracy::RankDeficient), 0)),
                _ => assert_eq!(verdict(&matches), (Some(Degeneracy::PureRotation), 1)),
            }
        }
    }
}

/// What is done to a bearing.
type Change = fn([f64; 3]) -> [f64; 3];

/// What is finite at the door is finite behind it: every pose is, and those called exact satisfy the constraints.
#[test]
fn hostile_bearings_give_finite_poses_or_a_reason() {
    let one = scene(&SceneOptions::realistic(), SEED_DEGENERATE, 7);
    let bearings: Vec<[[f64; 3]; 2]> =
        one.matches.iter().map(|m| [(*m.bearing1()).into(), (*m.bearing2()).into()]).collect();
    let changes: [(&str, Change); 8] = [
        ("z = 0", |[x, y, _]| [x, y, 0.0]),
        ("negative zero", |[x, y, _]| [x, y, -0.0]),
        ("denormal z", |[x, y, _]| [x, y, 5e-324]),
        ("on an axis", |[x, _, _]| [x, 0.0, 1.0]),
        ("behind", |x| x.map(|x| -x)),
        ("1e49 long", |x| x.map(|x| 1e49 * x)),
        ("1e-49 long", |x| x.map(|x| 1e-49 * x)),
        ("rounded", |x| x.map(|x| (8.0 * x).round() / 8.0)),
    ];
    for (name, change) in changes {
        // In which views, and of how many of the matches.
        for (views, count) in [(1, 1), (1, 3), (1, 5), (2, 5), (3, 1), (3, 3), (3, 5)] {
            let changed: Vec<_> = bearings
                .iter()
                .enumerate()
                .map(|(i, &[a, b])| {
                    let [first, second] = [1, 2].map(|bit| i < count && views & bit != 0);
                    let (a, b) = (if first { change(a) } else { a }, if second { change(b) } else { b });
                    Correspondence::from_bearings(a, b).unwrap()
                })
                .collect();
            for solver in SolverName::ALL {
                for kinds in [Kinds::Exact, Kinds::All] {
                    let found = solve(solver, kinds, &changed);
                    for c in found.iter() {
                        let finite =
                            c.pose.t_21.iter().chain(c.pose.q_21.coords.iter()).all(|x| x.is_finite());
                        assert!(finite && c.residual.is_finite(), "{solver:?}, {name}, {views}, {count}");
                    }
                }
            }
            for solver in SOLVERS {
                let exact = solve(solver, Kinds::Exact, &changed);
                let residual = exact.iter().map(|c| c.residual).fold(0.0, f64::max);
                assert!(residual < 1e-12, "{solver:?}, {name}, {views}, {count}: {residual:e}");
            }
        }
    }
    for length in [0.0, 5e-324, 1e-160, 1e160, f64::INFINITY, f64::NAN] {
        assert!(Correspondence::from_bearings([0.0, length, 0.0], [0.0, 0.0, 1.0]).is_err(), "{length:e}");
    }
}

/// Whether all solvers return the rotation alone, and count the points in front of camera 2.
fn is_named_pure_rotation(one: &Scene) -> bool {
    let in_front = one.points2().filter(|x2| x2.z > 0.0).count();
    let is_named = |solver, kinds| {
        let found = solve(solver, kinds, &one.matches);
        found.degeneracy() == Some(Degeneracy::PureRotation)
            && found.len() == 1
            && found[0].pose.rotation_error(&one.truth) < 1e-12
            && found[0].pose.t_21 == Vector3::zeros()
            && found[0].in_front == in_front
    };
    SOLVERS.iter().all(|&s| is_named(s, Kinds::All) && is_named(s, Kinds::Exact))
}

#[test]
fn pure_rotation() {
    for angle in [Angle::UpTo(TAU), SceneOptions::realistic().angle] {
        for layout in [Layout::General, Layout::Coplanar] {
            for points in [5, 6, 20] {
                let base = SceneOptions { view: View::InBothImages, ..SceneOptions::default() };
                let options = SceneOptions { motion: Motion::PureRotation, layout, points, angle, ..base };
                for one in scenes(options, SEED_DEGENERATE + 2, 100) {
                    assert!(is_named_pure_rotation(&one), "{options:?}");
                }
            }
        }
    }
}

/// Section 9.3 turns the camera by up to 360°: points come to lie behind it and are projected all the same, so that
/// some bearings are opposite to the rotated ones.
#[test]
fn pure_rotation_with_points_behind_camera_2() {
    let options = SceneOptions { motion: Motion::PureRotation, ..SceneOptions::default() };
    for (index, one) in scenes(options, SEED_DEGENERATE + 2, 1_000).enumerate() {
        assert!(is_named_pure_rotation(&one), "scene {index}");
    }
}

#[test]
fn noisy_pure_rotation_has_a_candidate_near_the_truth() {
    let options = SceneOptions { motion: Motion::PureRotation, noise_px: 0.75, ..SceneOptions::realistic() };
    for solver in SOLVERS {
        let mut sum = 0.0;
        for one in scenes(options, SEED_DEGENERATE + 3, 300) {
            let found = solve(solver, Kinds::All, &one.matches);
            assert_eq!(found.degeneracy(), None);
            let best = found.iter().map(|c| c.pose.rotation_error(&one.truth)).fold(f64::INFINITY, f64::min);
            sum += best;
            let rotation = found.iter().find(|c| c.kind == CandidateKind::RotationOnly).unwrap();
            // 0.75 px are 0.7 mrad; five points spread over the image leave a few times that about the line of sight.
            assert!(rotation.pose.rotation_error(&one.truth) < 0.05);
        }
        assert!(sum / 300.0 < 0.003, "{solver:?}: {}", sum / 300.0);
    }
}

#[test]
fn identical_images() {
    let one = scene(&SceneOptions::default(), SEED_DEGENERATE, 3);
    let same: Vec<_> = one
        .matches
        .iter()
        .map(|m| Correspondence::from_bearings((*m.bearing1()).into(), (*m.bearing1()).into()).unwrap())
        .collect();
    for solver in SOLVERS {
        let found = solve(solver, Kinds::Exact, &same);
        assert_eq!(found.degeneracy(), Some(Degeneracy::PureRotation));
        assert_eq!(found.len(), 1);
        assert!(found[0].pose.q_21.angle() < 1e-15);
        assert!(found[0].pose.t_21 == Vector3::zeros());
    }
}

/// Points on a line determine a pure rotation all the same, and so do two of them, repeated.
#[test]
fn pure_rotation_of_points_on_a_line() {
    let q_21 = pose().q_21;
    let seen = |a: Vector3<f64>| Correspondence::from_bearings(a.into(), (q_21 * a).into()).unwrap();
    let line = [0.0, 0.3, 0.5, 0.8, 1.0].map(|s| seen(Vector3::new(s - 0.5, 0.3 - 0.4 * s, 1.0)));
    let [first, second, ..] = line;
    for matches in [line, [first, first, second, second, second]] {
        for solver in SOLVERS {
            let found = solve(solver, Kinds::All, &matches);
            assert_eq!((found.degeneracy(), found.len()), (Some(Degeneracy::PureRotation), 1));
            assert!(found[0].pose.q_21.angle_to(&q_21) < 1e-7 && found[0].in_front == 5);
        }
    }
}
