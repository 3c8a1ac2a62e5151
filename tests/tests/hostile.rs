//! Matches of all kinds of degenerate scenes, with noise and focal lengths of every size: no panic, no number that is none, no
//! covariance that is not one.

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};
use quest_core::robust::{self, Estimate, Options};
use quest_core::solver::{Kinds, SolverName};
use quest_core::{Correspondence, RelativePose};
use quest_tests::scenes::solve;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEED_HOSTILE: u64 = 210;

/// What is done to a point of a box.
type Place = fn(Vector3<f64>) -> Vector3<f64>;

const PLACES: [Place; 9] = [
    |x| x,
    |x| Vector3::new(x.x, x.y, 3.0),
    |x| Vector3::new(x.x, 0.0, x.z),
    |x| Vector3::new(0.3, 0.2, 3.0) * x.z,
    |x| Vector3::new(x.x, 2.0 * x.x, 3.0),
    |x| Vector3::new((3.0 * x.x).round(), (3.0 * x.y).round(), 3.0),
    |x| x * 1e8,
    |x| -x,
    |_| Vector3::new(0.1, -0.1, 2.5),
];

fn pick<T: Copy>(rng: &mut ChaCha8Rng, of: &[T]) -> T {
    of[rng.random_range(0..of.len())]
}

/// A few matches of one such scene.
fn matches(rng: &mut ChaCha8Rng) -> Vec<Correspondence> {
    let any = |rng: &mut ChaCha8Rng| Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    let count = rng.random_range(5..60);
    let place = pick(rng, &PLACES);
    let turn = any(rng) * pick(rng, &[0.0, 1e-9, 0.3, 3.0]);
    let q_21 = UnitQuaternion::from_scaled_axis(turn);
    let t_21 = any(rng) * pick(rng, &[0.0, 1e-12, 1e-6, 1e-3, 0.3, 10.0, 1e6]);
    let scale = pick(rng, &[1.0, 1.0, 1e-8, 1e8, 1e149]);
    let (noise, outliers) = (10.0_f64.powf(rng.random_range(-16.0..-2.0)), pick(rng, &[0.0, 0.3, 0.8, 1.0]));
    // Some points lie before the epipole.
    let near = rng.random_bool(0.1);
    let mut out = Vec::new();
    for _ in 0..count {
        let in_box = any(rng) + Vector3::z() * 3.0;
        let x1 = if near { any(rng) * 1e-9 - t_21 } else { place(in_box) };
        let x2 = if rng.random_bool(outliers) { any(rng) + Vector3::z() * 3.0 } else { q_21 * x1 + t_21 };
        let [b1, b2] = [x1, x2].map(|x| (x + any(rng) * noise * x.norm()) * scale);
        out.extend(Correspondence::from_bearings(b1.into(), b2.into()));
    }
    out
}

fn is_finite(pose: &RelativePose) -> bool {
    let size = pose.q_21.coords.norm();
    pose.t_21.iter().all(|x| x.is_finite()) && (size - 1.0).abs() < 1e-9
}

#[test]
fn solvers_answer_with_poses_or_none() {
    let mut found = 0;
    for index in 0..1_000 {
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
            assert!(candidates.iter().all(|c| is_finite(&c.pose)), "{index} {}", solver.info().name);
            found += candidates.len();
        }
    }
    assert!(found > 10_000, "{found}");
}

#[test]
fn estimates_are_whole_or_refused() {
    let (mut found, mut refused) = (0, 0);
    for index in 0..6_000 {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED_HOSTILE + 1);
        rng.set_stream(index);
        let matches = matches(&mut rng);
        let focal_length = pick(&mut rng, &[1.0, 500.0, 1e6]);
        let options = Options {
            threshold: pick(&mut rng, &[1e-9, 1e-3, 1.5, 100.0]),
            focal_lengths: [[focal_length; 2]; 2],
            max_iterations: pick(&mut rng, &[1, 8, 200]),
            min_iterations: 1,
            max_false_alarms: pick(&mut rng, &[0.03, f64::INFINITY]),
            ..Options::default()
        };
        match robust::estimate(&matches, &options) {
            Ok(estimate) => {
                assert!(is_whole(&estimate), "{index} {estimate:?}");
                found += 1;
            }
            Err(_) => refused += 1,
        }
    }
    assert!(found > 1_000 && refused > 1_000, "{found} {refused}");
}

fn is_whole(estimate: &Estimate) -> bool {
    let poses = [Some(estimate.pose), estimate.runner_up.map(|other| other.pose)];
    let numbers = [estimate.noise_px, estimate.score, estimate.evidence.general_px];
    let variances = estimate.covariance.symmetric_eigenvalues();
    // Rounding may take a small eigenvalue below zero.
    let is_covariance = variances.min() >= -1e-14 * variances.max();
    poses.iter().flatten().all(is_finite)
        && numbers.iter().all(|x| x.is_finite())
        && is_covariance
        && estimate.covariance.fixed_view::<3, 3>(0, 0).trace() <= PI * PI
        && estimate.inlier_count >= robust::MIN_MATCHES
        && estimate.inliers.iter().filter(|is_inlier| **is_inlier).count() == estimate.inlier_count
}
