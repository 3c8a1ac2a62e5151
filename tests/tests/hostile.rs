//! Matches of all kinds of degenerate scenes, with noise and focal lengths of every size: no panic, no number that is none, no
//! covariance that is not one.

use nalgebra::Vector3;
use quest_core::Correspondence;
use quest_core::robust::{self, Options};
use quest_core::solver::Kinds;
use quest_core::solver::SolverName;
use quest_tests::hostile::{Choices, matches};
use quest_tests::invariants;
use quest_tests::scenes::solve;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const SEED_HOSTILE: u64 = 210;

#[test]
fn solvers_answer_with_poses_or_none_and_no_more_than_the_table_says() {
    let mut found = 0;
    for index in 0..2_000 {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED_HOSTILE);
        rng.set_stream(index);
        let all = matches(&mut rng);
        for solver in SolverName::ALL {
            let minimal = solver.info().min_matches;
            if all.len() < minimal {
                continue;
            }
            let some = if index % 2 == 0 { &all[..minimal] } else { &all };
            let candidates = solve(solver, Kinds::All, some);
            invariants::candidates(&candidates, some);
            let most = solver.most_candidates(Kinds::All);
            assert!(candidates.len() <= most, "{solver:?}, {index}: {}", candidates.len());
            found += candidates.len();
        }
    }
    assert!(found > 10_000, "{found}");
}

/// Eight matches that contradict each other: descents from one solution and from its twisted partner end in different minima.
#[test]
fn inconsistent_matches_have_no_more_candidates_than_the_table_says() {
    let mut largest = 0;
    for index in 0..2_000 {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED_HOSTILE + 2);
        rng.set_stream(index);
        let mut any = || Vector3::from_fn(|_, _| rng.between(-1.0, 1.0)) + Vector3::z() * 1.5;
        let matches: Vec<_> =
            (0..8).filter_map(|_| Correspondence::from_bearings(any().into(), any().into()).ok()).collect();
        for solver in [SolverName::Quest, SolverName::QuestEigen, SolverName::Relinearization] {
            for kinds in Kinds::CHOICES {
                let found = solve(solver, kinds, &matches);
                invariants::candidates(&found, &matches);
                assert!(found.len() <= solver.most_candidates(kinds), "{solver:?}, {index}: {}", found.len());
                largest = largest.max(found.len());
            }
        }
    }
    assert!(largest > 10, "{largest}");
}

#[test]
fn estimates_are_whole_or_refused() {
    let (mut found, mut refused) = (0, 0);
    for index in 0..6_000 {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED_HOSTILE + 1);
        rng.set_stream(index);
        let matches = matches(&mut rng);
        let focal_length = rng.pick(&[1.0, 500.0, 1e6]);
        let options = Options {
            threshold: rng.pick(&[1e-9, 1e-3, 1.5, 100.0]),
            focal_lengths: [[focal_length; 2]; 2],
            max_iterations: rng.pick(&[1, 8, 200]),
            min_iterations: 1,
            max_false_alarms: rng.pick(&[0.03, f64::INFINITY]),
            ..Options::default()
        };
        match robust::estimate(&matches, &options) {
            Ok(estimate) => {
                invariants::estimate(&estimate, matches.len());
                found += 1;
            }
            Err(_) => refused += 1,
        }
    }
    assert!(found > 1_000 && refused > 1_000, "{found} {refused}");
}
