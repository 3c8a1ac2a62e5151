//! Real image pairs: five matches that agree with the reference always yield a candidate.
#![expect(clippy::print_stdout, reason = "says what was found")]

use quest_core::Correspondence;
use quest_core::solver::{Kinds, SolverName};
use quest_tests::pairs::load;
use quest_tests::scenes::solve;
use rand::SeedableRng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

const SEED_PAIRS: u64 = 300;
const SAMPLES: usize = 20;

#[test]
#[ignore = "needs the recorded pairs in ../shared/data; scripts/test runs it where they are"]
fn every_pair_has_a_candidate() {
    let pairs = load();
    assert!(!pairs.is_empty(), "there is no folder ../shared/data/pairs beside the workspace");
    let mut rng = ChaCha8Rng::seed_from_u64(SEED_PAIRS);
    let mut best_errors = Vec::new();
    for pair in &pairs {
        let (inliers, reference) = (pair.inliers(), pair.reference());
        assert!(inliers.len() >= 5, "{}: {} inliers", pair.name, inliers.len());
        for _ in 0..SAMPLES {
            let sample: [Correspondence; 5] = inliers.sample_array(&mut rng).unwrap();
            let found = solve(SolverName::default(), Kinds::All, &sample);
            assert!(!found.is_empty(), "{}: {:?}", pair.name, found.degeneracy());
            let finite = |x: f64| x.is_finite();
            assert!(found.iter().all(|c| finite(c.residual) && c.pose.t_21.iter().copied().all(finite)));
            let errors = found.iter().map(|c| c.pose.rotation_error(&reference));
            best_errors.push(errors.fold(f64::INFINITY, f64::min).to_degrees());
        }
    }
    best_errors.sort_by(f64::total_cmp);
    let quantile = |q: usize| best_errors[(best_errors.len() - 1) * q / 100];
    println!(
        "{} pairs, {SAMPLES} samples each: best rotation off by {:.2}° (median), {:.2}° (90 %)",
        pairs.len(),
        quantile(50),
        quantile(90)
    );
    // Five matches with errors up to a pixel: degrees, not tens of degrees.
    assert!(quantile(50) < 2.0, "{}", quantile(50));
}
