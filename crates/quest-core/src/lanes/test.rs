//! The laws of the lanes, and what their tests share.

use super::batch::BatchSolver;
use super::{Essentials, Instructions, Tolerance};
use crate::simulate::{Motion, Scene, SceneOptions};
use crate::solver::{Kinds, PoseSolver, Quest};
use crate::{Candidates, Correspondence};

/// The instructions of this processor.
pub(super) fn available() -> impl Iterator<Item = Instructions> {
    Instructions::ALL.into_iter().filter(|i| i.is_available())
}

/// A realistic scene.
pub(super) fn scene(points: usize, noise_px: f64, index: u64) -> Scene {
    const SEED: u64 = 606;
    let options = SceneOptions { points, noise_px, ..SceneOptions::realistic() };
    Scene::generate(&options, SEED, index).unwrap()
}

/// Matches of as many scenes, and the sample of each.
fn samples(scenes: impl Iterator<Item = Scene>) -> (Vec<Correspondence>, Vec<[u32; 5]>) {
    let matches: Vec<_> = scenes.flat_map(|s| s.matches).collect();
    let sample = |i: u32| std::array::from_fn(|k| 5 * i + u32::try_from(k).unwrap());
    let samples = (0..u32::try_from(matches.len() / 5).unwrap()).map(sample).collect();
    (matches, samples)
}

fn distance(x: &[f64; 9], y: &[f64; 9]) -> f64 {
    let norm = |sign: f64| x.iter().zip(y).map(|(x, y)| (x - sign * y).powi(2)).sum::<f64>().sqrt();
    norm(1.0).min(norm(-1.0))
}

/// The largest distance from a matrix of one list to the nearest of the other.
fn hausdorff(x: &[[f64; 9]], y: &[[f64; 9]]) -> f64 {
    let from = |x: &[[f64; 9]], y: &[[f64; 9]]| {
        let nearest = |a: &[f64; 9]| y.iter().map(|b| distance(a, b)).fold(f64::INFINITY, f64::min);
        x.iter().map(nearest).fold(0.0, f64::max)
    };
    from(x, y).max(from(y, x))
}

fn scalar(five: &[Correspondence]) -> Vec<[f64; 9]> {
    let mut candidates = Candidates::new();
    Quest { kinds: Kinds::Exact }.solve(five, &mut candidates);
    let essential = |pose: crate::RelativePose| pose.essential().transpose() / pose.t_21.norm();
    candidates.iter().map(|c| essential(c.pose).as_slice().try_into().unwrap()).collect()
}

/// How the lanes and the scalar solver compare on many samples.
#[derive(Debug, Default)]
struct Comparison {
    /// Samples that the lanes leave to the scalar solver.
    flagged: usize,
    /// Others where one of the two has a matrix that the other has not.
    unequal: usize,
}

impl Comparison {
    /// Adds samples of five consecutive matches; panics where the same matrix differs by more than `tolerance`.
    fn add(
        &mut self,
        instructions: Instructions,
        matches: &[Correspondence],
        samples: &[[u32; 5]],
        tolerance: f64,
    ) {
        /// What is further apart is not the same matrix.
        const APART: f64 = 1e-3;
        let solver = BatchSolver::with_instructions(Tolerance::Tight, instructions).unwrap();
        let mut found = Essentials::new();
        solver.solve(matches, samples, &mut found).unwrap();
        assert_eq!(found.samples(), samples.len());
        for sample in 0..samples.len() {
            if !found.is_complete(sample) {
                self.flagged += 1;
                continue;
            }
            let expected = scalar(&matches[5 * sample..5 * sample + 5]);
            let error = hausdorff(&found.matrices()[found.of(sample)], &expected);
            self.unequal += usize::from(error > APART);
            assert!(error < tolerance || error > APART, "{instructions:?}, scene {sample}: {error:e}");
        }
    }
}

#[test]
fn lanes_are_the_scalar_solver() {
    let (matches, samples) = samples((0..1000).map(|index| scene(5, 0.75, index)));
    for instructions in available() {
        let mut found = Comparison::default();
        found.add(instructions, &matches, &samples, 1e-9);
        assert!(found.flagged < 10 && found.unequal == 0, "{instructions:?} {found:?}");
    }
}

/// Rounding decides which of nearly coincident solutions are real, so either of the two solvers may lose a pair.
#[test]
#[ignore = "ten seconds: 100,000 scenes"]
fn lanes_are_the_scalar_solver_a_hundred_thousand_times() {
    let mut found = Instructions::ALL.map(|_| Comparison::default());
    for batch in 0..100 {
        let (matches, samples) = samples((0..1000).map(|index| scene(5, 0.75, 1000 * batch + index)));
        for (instructions, found) in Instructions::ALL.into_iter().zip(&mut found) {
            if instructions.is_available() {
                found.add(instructions, &matches, &samples, 1e-9);
            }
        }
    }
    assert!(found.iter().all(|found| found.flagged < 500 && found.unequal < 10), "{found:?}");
}

#[test]
fn little_parallax_is_no_difficulty() {
    // The direction of the translation is known to the rounding of the bearings over the parallax.
    for (parallax, tolerance) in [(1e-2, 1e-8), (1e-4, 1e-6)] {
        let options = SceneOptions { motion: Motion::Parallax(parallax), ..SceneOptions::realistic() };
        let scenes = (0..300).map(|index| Scene::generate(&options, 607, index).unwrap());
        let (matches, samples) = samples(scenes);
        for instructions in available() {
            let mut found = Comparison::default();
            found.add(instructions, &matches, &samples, tolerance);
            assert!(found.flagged < 10 && found.unequal < 3, "{instructions:?} {parallax} {found:?}");
        }
    }
}

#[test]
fn nothing_depends_on_the_lane_or_the_neighbours_or_the_batch() {
    let (mut matches, mut samples) = samples((0..60).map(|index| scene(5, 0.75, index)));
    // Every third sample is degenerate: one match five times, or a pure rotation, whose lanes hold no numbers.
    for (k, sample) in samples.iter_mut().enumerate().filter(|(k, _)| k % 3 == 0) {
        let first = 5 * k;
        if k % 2 == 0 {
            *sample = [sample[0]; 5];
        } else {
            for m in &mut matches[first..first + 5] {
                *m = Correspondence::from_bearings((*m.bearing1()).into(), (*m.bearing1()).into()).unwrap();
            }
        }
    }
    for instructions in available() {
        for tolerance in [Tolerance::Tight, Tolerance::Loop] {
            let solver = BatchSolver::with_instructions(tolerance, instructions).unwrap();
            let (mut together, mut apart) = (Essentials::new(), Essentials::new());
            solver.solve(&matches, &samples, &mut together).unwrap();
            for size in [1, 2, 3, 7, 8, 13] {
                for (chunk, some) in samples.chunks(size).enumerate() {
                    solver.solve(&matches, some, &mut apart).unwrap();
                    for k in 0..some.len() {
                        let sample = chunk * size + k;
                        // To the last bit.
                        let (x, y) =
                            (&together.matrices()[together.of(sample)], &apart.matrices()[apart.of(k)]);
                        assert_eq!(
                            x, y,
                            "{instructions:?} {tolerance:?}, sample {sample} in a batch of {size}"
                        );
                        assert_eq!(together.is_complete(sample), apart.is_complete(k));
                        assert!(sample % 3 != 0 || !apart.is_complete(k), "sample {sample} is degenerate");
                        assert!(x.as_flattened().iter().all(|e| e.is_finite()));
                    }
                }
            }
        }
    }
}

#[test]
fn what_is_flagged_is_solved_again() {
    let (matches, mut samples) = samples((0..100).map(|index| scene(5, 0.0, index)));
    samples[17] = [3; 5];
    for instructions in available() {
        for tolerance in [Tolerance::Tight, Tolerance::Loop] {
            let solver = BatchSolver::with_instructions(tolerance, instructions).unwrap();
            let mut found = Essentials::new();
            solver.solve_all(&matches, &samples, &mut found).unwrap();
            assert!((0..100).all(|sample| found.is_complete(sample)));
            assert!(found.of(17).is_empty() && found.of(100).is_empty());
            for sample in (0..100).filter(|&sample| sample != 17) {
                let truth = scene(5, 0.0, sample).truth;
                let is_right = |k| {
                    let (rotations, t) = found.motions(k).unwrap();
                    let near = |q: &nalgebra::UnitQuaternion<f64>| q.angle_to(&truth.q_21) < 1e-6;
                    rotations.iter().any(near) && t.cross(&truth.t_21.normalize()).norm() < 1e-6
                };
                assert!(
                    found.of(usize::try_from(sample).unwrap()).any(is_right),
                    "{instructions:?} {sample}"
                );
            }
        }
    }
}

#[test]
fn for_a_robust_loop_the_sample_fits_exactly() {
    let (matches, samples) = samples((0..200).map(|index| scene(5, 0.75, index)));
    for instructions in available() {
        let solver = BatchSolver::with_instructions(Tolerance::Loop, instructions).unwrap();
        let mut found = Essentials::new();
        solver.solve(&matches, &samples, &mut found).unwrap();
        let mut uneven = 0;
        for sample in 0..samples.len() {
            for k in found.of(sample) {
                let e = nalgebra::Matrix3::from_row_slice(&found.matrices()[k]);
                for m in &matches[5 * sample..5 * sample + 5] {
                    assert!(m.bearing2().dot(&(e * m.bearing1())).abs() < 1e-12);
                }
                // 2 E Eᵀ E − tr(E Eᵀ) E vanishes for the singular values (1, 1, 0).
                let cubic = e * e.transpose() * e * 2.0 - e * (e * e.transpose()).trace();
                uneven += usize::from(cubic.norm() > 1e-5);
            }
        }
        assert!(100 * uneven < found.len(), "{uneven} of {}", found.len());
    }
}

#[test]
fn a_sample_of_a_match_that_is_not_there_is_an_error() {
    let (matches, mut samples) = samples((0..20).map(|index| scene(5, 0.0, index)));
    samples[11][2] = 100;
    for instructions in available() {
        let solver = BatchSolver::with_instructions(Tolerance::Tight, instructions).unwrap();
        let mut found = Essentials::new();
        let error = solver.solve(&matches, &samples, &mut found).unwrap_err();
        assert_eq!(
            error.to_string(),
            "sample 11 names match 100, expected an index below the number of matches, 100"
        );
        assert_eq!((found.samples(), found.len()), (0, 0));
        solver.solve(&matches, &[], &mut found).unwrap();
        assert!(found.is_empty());
    }
}

/// The sides of the epipoles on which matches are, times their distances from them: the least and the most.
fn sides(e: &[f64; 9], five: &[Correspondence]) -> [f64; 2] {
    let e = nalgebra::Matrix3::from_row_slice(e);
    let columns = [0, 1, 2].map(|k| e.column(k).into_owned());
    let all = [0, 1, 2].map(|k| columns[k].cross(&columns[(k + 1) % 3]));
    let t = all.into_iter().max_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap();
    let sides = five.iter().map(|m| t.cross(m.bearing2()).dot(&(e * m.bearing1())));
    sides.fold([f64::MAX, f64::MIN], |[least, most], side| [least.min(side), most.max(side)])
}

#[test]
fn oriented_matrices_are_those_that_a_pose_belongs_to() {
    const CLEAR: f64 = 2e-4;
    // Two hundred samples of true matches, and as many of matches of five scenes each.
    let (matches, mut samples) = samples((0..200).map(|i| scene(5, 0.0, i)));
    let false_samples =
        (0..200_u32).map(|i| std::array::from_fn(|k| (5 * i + 6 * u32::try_from(k).unwrap()) % 1000));
    samples.extend(false_samples);
    for instructions in available() {
        let solver = BatchSolver::with_instructions(Tolerance::Loop, instructions).unwrap();
        let (mut all, mut oriented) = (Essentials::new(), Essentials::new());
        solver.solve(&matches, &samples, &mut all).unwrap();
        solver.solve_oriented(&matches, &samples, &mut oriented).unwrap();
        for (k, sample) in samples.iter().enumerate() {
            let five = sample.map(|i| matches[i as usize]);
            let kept = &oriented.matrices()[oriented.of(k)];
            for e in &all.matrices()[all.of(k)] {
                let [least, most] = sides(e, &five);
                let is_kept = kept.contains(e);
                assert!(is_kept || least < CLEAR && most > -CLEAR, "{instructions:?} {k}: {least} {most}");
                assert!(!is_kept || least > -CLEAR || most < CLEAR, "{instructions:?} {k}: {least} {most}");
            }
        }
        let count = |samples: std::ops::Range<usize>| samples.map(|k| oriented.of(k).len()).sum::<usize>();
        let is_truth = |k: &usize| {
            let truth = scene(5, 0.0, *k as u64).truth.essential();
            let truth: [f64; 9] = truth.transpose().as_slice().try_into().unwrap();
            let scale = truth.iter().map(|x| x * x).sum::<f64>().sqrt() / 2.0_f64.sqrt();
            let truth = truth.map(|x| x / scale);
            oriented.matrices()[oriented.of(*k)].iter().any(|e| distance(e, &truth) < 1e-4)
        };
        // A sample in a hundred is flagged.
        assert!((0..200).filter(is_truth).count() > 195, "{instructions:?}");
        // Of 4.5 matrices of a false sample a sixteenth would be left, were the signs those of coins.
        assert!(count(200..400) < 200, "{instructions:?}: {}", count(200..400));
    }
}
