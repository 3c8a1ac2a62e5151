//! What every candidate is.

use quest_core::simulate::{Layout, SceneOptions};
use quest_core::solver::Kinds;
use quest_core::{Candidate, CandidateKind};
use quest_tests::literal_quest::constant;
use quest_tests::scenes::{exact_rotations, scene, scenes};
use quest_tests::solution_sets::{angle_between, five_bearings, literal};

use super::{SAME, SEED_LITERAL, SEED_PLANTED, SEED_SYMMETRIES, Subject, closest, noisy, same_rotations};

pub(crate) fn exact_candidates_are_the_real_solutions_of_section_7_1(subject: &Subject) {
    let mut solutions = 0;
    for options in [SceneOptions::default(), SceneOptions::realistic()] {
        for (index, scene) in scenes(noisy(options), SEED_LITERAL, 500).enumerate() {
            let expected = literal(&five_bearings(&scene.matches)).real;
            let found = exact_rotations(&subject.exact(&scene.matches));
            assert!(same_rotations(&found, &expected), "{:?}, scene {index}", options.view);
            solutions += found.len();
        }
    }
    // About nine real solutions a problem.
    assert!(solutions > 8_000, "{solutions}");
}

pub(crate) fn candidates_satisfy_the_quartics(subject: &Subject) {
    for options in [SceneOptions::default(), SceneOptions::realistic()] {
        for scene in scenes(noisy(options), SEED_LITERAL + 1, 200) {
            let quartics = quest_tests::quartics::quartics(&five_bearings(&scene.matches));
            for q in exact_rotations(&subject.exact(&scene.matches)) {
                let worst = quartics.iter().map(|p| p.evaluate(constant(q)).norm()).fold(0.0, f64::max);
                assert!(worst < 1e-9, "{worst:e}");
            }
        }
    }
}

pub(crate) fn exact_candidates_fit_to_rounding(subject: &Subject) {
    for layout in [Layout::General, Layout::Coplanar] {
        for options in [SceneOptions::default(), SceneOptions::realistic()] {
            for scene in scenes(SceneOptions { layout, ..noisy(options) }, SEED_LITERAL + 3, 500) {
                let found = subject.exact(&scene.matches);
                assert!(!found.is_empty());
                for candidate in found.iter() {
                    assert!(candidate.residual < 1e-9, "{:e}", candidate.residual);
                    assert!((candidate.pose.r_21().determinant() - 1.0).abs() < 1e-14);
                }
            }
        }
    }
}

pub(crate) fn every_kind_keeps_the_exact_candidates(subject: &Subject) {
    for scene in scenes(noisy(SceneOptions::default()), SEED_LITERAL + 2, 200) {
        let (all, exact) = (subject.all(&scene.matches), subject.exact(&scene.matches));
        assert!(exact.iter().all(|c| c.kind == CandidateKind::Exact));
        assert!(same_rotations(&exact_rotations(&all), &exact_rotations(&exact)));
        assert_eq!(all.iter().filter(|c| c.kind == CandidateKind::RotationOnly).count(), 1);
        assert!(all.iter().all(|c| c.residual.is_finite() && c.pose.t_21.iter().all(|x| x.is_finite())));
        // Residuals of exact solutions are rounding, and do not decide the order.
        let best_first = |w: &[Candidate]| {
            let smaller = w[0].residual <= w[1].residual.max(1e-13);
            w[0].in_front > w[1].in_front || (w[0].in_front == w[1].in_front && smaller)
        };
        assert!(exact.windows(2).all(best_first));
    }
}

pub(crate) fn points_in_front_are_counted(subject: &Subject) {
    for scene in scenes(SceneOptions::realistic(), SEED_PLANTED + 2, 300) {
        let found = subject.exact(&scene.matches);
        let best = closest(&found, &scene.truth).unwrap();
        assert_eq!(best.in_front, 5);
        assert!((best.pose.t_21 - scene.truth.t_21).norm() < 1e-5);
    }
    // Where points lie behind camera 2, the sign of t is the one with more points in front.
    for scene in scenes(SceneOptions::default(), SEED_PLANTED + 2, 300) {
        let found = subject.exact(&scene.matches);
        let best = closest(&found, &scene.truth).unwrap();
        let front = scene.points2().filter(|x2| x2.z > 0.0).count();
        // Every point lies in front of camera 1: with the other sign it lies behind it.
        assert_eq!(best.in_front, front);
    }
}

pub(crate) fn solving_twice_gives_the_same_bits(subject: &Subject) {
    let one = scene(&noisy(SceneOptions::default()), SEED_SYMMETRIES + 4, 0);
    let (a, b) = (subject.all(&one.matches), subject.all(&one.matches));
    assert_eq!(&a[..], &b[..]);
    // A used list is emptied first.
    let mut used = a;
    subject.solver.solve(Kinds::All, &one.matches, &mut used);
    assert_eq!(&used[..], &b[..]);
}

pub(crate) fn rotations_far_from_each_other_are_told_apart(subject: &Subject) {
    // The comparisons above mean something: solutions are seldom closer than SAME.
    let mut close = 0;
    for scene in scenes(noisy(SceneOptions::default()), SEED_SYMMETRIES + 5, 300) {
        let found = exact_rotations(&subject.exact(&scene.matches));
        for (i, a) in found.iter().enumerate() {
            close += found[..i].iter().filter(|b| angle_between(a, b) < 10.0 * SAME).count();
        }
    }
    assert_eq!(close, 0);
}
