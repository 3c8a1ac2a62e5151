#![no_main]
//! Estimates of degenerate matches with every option and prior: whole or refused, and the same in a batch.
use libfuzzer_sys::fuzz_target;
use quest_core::RelativePose;
use quest_core::robust::{self, KnownDirection, Options, Priors};
use quest_core::solver::SolverName;
use quest_fuzz::Bytes;
use quest_fuzz::hostile::{Choices, matches};
use quest_fuzz::invariants;

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let focal_length = bytes.pick(&[1.0, 500.0, 1e6]);
    let options = Options {
        threshold: bytes.pick(&[1e-9, 1e-3, 1.5, 100.0]),
        focal_lengths: [[focal_length; 2]; 2],
        max_iterations: bytes.pick(&[1, 8, 200, 5_000]),
        min_iterations: bytes.pick(&[1, 300]),
        confidence: bytes.pick(&[0.5, 0.9999]),
        max_false_alarms: bytes.pick(&[0.03, f64::INFINITY]),
        solver: bytes.pick(&[SolverName::Quest, SolverName::Quest, SolverName::Nister, SolverName::EightPoint]),
        seed: bytes.word(),
        ..Options::default()
    };
    let direction = nalgebra::Vector3::from_fn(|_, _| bytes.anything());
    let wants_direction = bytes.unit() < 0.2;
    let wants_pose = bytes.unit() < 0.2;
    let wants_scores = bytes.unit() < 0.2;
    let matches = matches(&mut bytes);
    let scores: Vec<f64> = matches.iter().map(|_| bytes.unit()).collect();
    let priors = Priors {
        direction: wants_direction
            .then(|| KnownDirection { in_view1: direction, in_view2: direction, tolerance: 0.1 }),
        pose: wants_pose.then(RelativePose::identity),
        scores: wants_scores.then_some(&scores[..]),
    };
    let found = robust::estimate_with(&matches, &options, &priors);
    if let Ok(found) = &found {
        invariants::estimate(found, matches.len());
    }
    // An error may hold a NaN that was found, which equals nothing.
    let again = robust::estimate_with(&matches, &options, &priors);
    assert!(found == again || format!("{found:?}") == format!("{again:?}"), "{found:?}, then {again:?}");
});
