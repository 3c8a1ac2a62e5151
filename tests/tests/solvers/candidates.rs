//! What every candidate is.

use std::collections::HashMap;
use std::sync::{LazyLock, Mutex};

use nalgebra::UnitQuaternion;
use quest_core::simulate::{Layout, SceneOptions};
use quest_core::solver::Kinds;
use quest_core::{Candidate, CandidateKind};
use quest_tests::literal_quest::constant;
use quest_tests::quartics::Match;
use quest_tests::scenes::{scene, scenes};
use quest_tests::solution_sets::{five_bearings, literal};

use super::{
    SEED_LITERAL, SEED_NOISY, SEED_PLANTED, Subject, closest, exact_poses, noisy, rotations, same_poses,
    same_rotations,
};

/// What section 7.1 finds for a problem. All solvers are asked the same problems, and this takes longer than they do: each is solved once.
fn real_solutions(problem: &[Match; 5]) -> Vec<UnitQuaternion<f64>> {
    // By the bits of the problem.
    type Solutions = HashMap<Vec<u64>, Vec<UnitQuaternion<f64>>>;
    static KNOWN: LazyLock<Mutex<Solutions>> = LazyLock::new(Mutex::default);
    let key: Vec<u64> =
        problem.iter().flat_map(|(a, b)| a.iter().chain(b.iter()).map(|x| x.to_bits())).collect();
    let known = KNOWN.lock().unwrap().get(&key).cloned();
    known.unwrap_or_else(|| {
        let real = literal(problem).real;
        KNOWN.lock().unwrap().insert(key, real.clone());
        real
    })
}

pub(crate) fn exact_candidates_are_the_real_solutions_of_section_7_1(subject: &Subject) {
    let (mut solutions, count) = (0, subject.share(500));
    for options in subject.views() {
        let mut different = Vec::new();
        for (index, scene) in scenes(noisy(options), SEED_LITERAL, count).enumerate() {
            let expected = real_solutions(&five_bearings(&scene.matches));
            let found = rotations(&subject.exact(&scene.matches));
            if !same_rotations(&found, &expected) {
                different.push(index);
            }
            solutions += found.len() as u64;
        }
        let most = subject.missed.solution_sets;
        assert!(different.len() <= most, "{:?}: {} {different:?}", options.view, different.len());
    }
    // About nine real solutions a problem.
    assert!(solutions > 16 * count, "{solutions}");
}

pub(crate) fn exact_candidates_satisfy_the_quartics(subject: &Subject) {
    for options in subject.views() {
        for scene in scenes(noisy(options), SEED_LITERAL + 1, subject.share(200)) {
            let quartics = quest_tests::quartics::quartics(&five_bearings(&scene.matches));
            for q in rotations(&subject.exact(&scene.matches)) {
                let worst = quartics.iter().map(|p| p.evaluate(constant(q)).norm()).fold(0.0, f64::max);
                assert!(worst < 1e-9, "{worst:e}");
            }
        }
    }
}

pub(crate) fn exact_candidates_fit_to_rounding(subject: &Subject) {
    for layout in [Layout::General, Layout::Coplanar] {
        for options in subject.views() {
            let mut unanswered = 0;
            let options = SceneOptions { layout, ..noisy(options) };
            for scene in scenes(options, SEED_LITERAL + 3, subject.share(500)) {
                let found = subject.solve(Kinds::Exact, &scene.matches);
                unanswered += usize::from(found.is_empty());
                for candidate in found.iter() {
                    assert!(candidate.residual < 1e-9, "{:e}", candidate.residual);
                    assert!((candidate.pose.r_21().determinant() - 1.0).abs() < 1e-14);
                }
            }
            assert!(unanswered <= subject.missed.unanswered, "{layout:?}, {:?}: {unanswered}", options.view);
        }
    }
}

pub(crate) fn candidates_are_finite_and_ranked(subject: &Subject) {
    let info = subject.solver.info();
    for scene in scenes(noisy(subject.scenes), SEED_NOISY, subject.share(500)) {
        let [all, exact] = [Kinds::All, Kinds::Exact].map(|kinds| subject.solve(kinds, &scene.matches));
        assert_eq!(all.degeneracy(), None);
        assert!(all.len() <= info.max_candidates);
        assert!(exact.iter().all(|c| c.kind == CandidateKind::Exact));
        assert!(same_poses(&exact_poses(&all), &exact_poses(&exact)));
        let finite = |c: &Candidate| c.residual.is_finite() && c.pose.t_21.iter().all(|x| x.is_finite());
        assert!(all.iter().all(finite));
        // Residuals below this are rounding, and do not decide the order.
        let best_first = |w: &[Candidate]| {
            let smaller = w[0].residual <= w[1].residual.max(1e-12);
            w[0].in_front > w[1].in_front || (w[0].in_front == w[1].in_front && smaller)
        };
        assert!(all.windows(2).all(best_first) && exact.windows(2).all(best_first));
    }
}

pub(crate) fn a_used_list_is_emptied_first(subject: &Subject) {
    let one = scene(&noisy(subject.scenes), SEED_NOISY + 1, 0);
    let fresh = subject.solve(Kinds::All, &one.matches);
    let mut used = fresh.clone();
    subject.solver.solve(Kinds::All, &one.matches, &mut used);
    // The same bits.
    assert_eq!(&used[..], &fresh[..]);
}

pub(crate) fn points_in_front_are_counted(subject: &Subject) {
    let [everywhere, realistic] = subject.views();
    for scene in scenes(realistic, SEED_PLANTED + 2, subject.share(300)) {
        let found = subject.solve(Kinds::Exact, &scene.matches);
        let best = closest(&found, &scene.truth).unwrap();
        assert_eq!(best.in_front, scene.matches.len());
        assert!((best.pose.t_21 - scene.truth.t_21).norm() < 1e-5);
    }
    // Where points lie behind camera 2, the sign of t is the one with more points in front.
    for scene in scenes(everywhere, SEED_PLANTED + 2, subject.share(300)) {
        let found = subject.solve(Kinds::Exact, &scene.matches);
        let best = closest(&found, &scene.truth).unwrap();
        let front = scene.points2().filter(|x2| x2.z > 0.0).count();
        // Every point lies in front of camera 1: with the other sign it lies behind it.
        assert_eq!(best.in_front, front);
    }
}

/// A true pose that noise does not move far stays near a candidate, complex ones included.
pub(crate) fn noise_moves_the_pose_a_little(subject: &Subject) {
    let [_, realistic] = subject.views();
    let options = SceneOptions { noise_px: 0.1, points: 20, ..realistic };
    let mut errors: Vec<f64> = scenes(options, SEED_NOISY + 2, subject.share(300))
        .map(|one| {
            let found = subject.solve(Kinds::All, &one.matches);
            found.iter().map(|c| c.pose.rotation_error(&one.truth)).fold(f64::INFINITY, f64::min)
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let median = errors[errors.len() / 2];
    assert!(median < subject.missed.median_of_twenty, "{median:e}");
}
