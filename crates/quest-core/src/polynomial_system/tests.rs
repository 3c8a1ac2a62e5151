//! Systems of which all solutions are known.

use faer::c64;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

const SEED_PLANTED: u64 = 430;

fn real(x: &[f64]) -> Vec<c64> {
    x.iter().map(|x| c64::new(*x, 0.0)).collect()
}

fn distance(a: &[c64], b: &[c64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

/// Every one of the points is a solution.
fn has(solutions: &Solutions, points: &[Vec<c64>], within: f64) -> bool {
    points.iter().all(|x| solutions.all.iter().any(|s| distance(&s.x, x) < within))
}

/// Dense polynomials of a degree with normally distributed coefficients that vanish at points, real ones or pairs of
/// conjugate ones.
fn planted(rng: &mut ChaCha8Rng, unknowns: usize, degrees: &[usize], roots: &[Vec<c64>]) -> System {
    let equations = degrees.iter().map(|&degree| {
        let monomials = Grading { unknowns, step: 1 }.monomials(degree);
        let mut c: Vec<f64> = monomials.iter().map(|_| rng.random_range(-1.0..1.0)).collect();
        let value = |m: &Vec<u8>, x: &Vec<c64>| {
            m.iter().zip(x).fold(c64::ONE, |product, (e, x)| product * x.powu((*e).into()))
        };
        // Two linear conditions a root, on the coefficients.
        let conditions = roots.iter().flat_map(|x| {
            let values: Vec<c64> = monomials.iter().map(|m| value(m, x)).collect();
            [values.iter().map(|v| v.re).collect::<Vec<_>>(), values.iter().map(|v| v.im).collect()]
        });
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for mut v in conditions {
            for _ in 0..2 {
                for b in &basis {
                    let along: f64 = v.iter().zip(b).map(|(v, b)| v * b).sum();
                    v.iter_mut().zip(b).for_each(|(v, b)| *v -= along * b);
                }
            }
            let norm = v.iter().map(|v| v * v).sum::<f64>().sqrt();
            if norm > 1e-9 {
                basis.push(v.iter().map(|v| v / norm).collect());
            }
        }
        for _ in 0..2 {
            for b in &basis {
                let along: f64 = c.iter().zip(b).map(|(c, b)| c * b).sum();
                c.iter_mut().zip(b).for_each(|(c, b)| *c -= along * b);
            }
        }
        c.into_iter().zip(monomials).collect::<Vec<_>>()
    });
    System::new(unknowns, equations.collect::<Vec<_>>()).unwrap()
}

fn random_point(rng: &mut ChaCha8Rng, unknowns: usize) -> Vec<c64> {
    (0..unknowns).map(|_| c64::new(rng.random_range(-1.5..1.5), 0.0)).collect()
}

/// Equations from lists of terms.
fn system<const N: usize>(equations: &[&[(f64, [u8; N])]]) -> System {
    System::new(N, equations.iter().map(|f| f.iter().copied())).unwrap()
}

fn solved(system: &System) -> Solutions {
    solve(system, &Options::default()).unwrap()
}

#[test]
fn planted_roots_of_dense_systems_are_found() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED_PLANTED);
    // As many equations as unknowns, of which all solutions are found, and more, which leave the planted ones.
    let kinds: [(usize, &[usize], usize, usize); 8] = [
        (2, &[2, 2], 1, 4),
        (2, &[3, 2], 2, 6),
        (2, &[4, 4, 4], 3, 3),
        (3, &[2, 2, 2], 1, 8),
        (3, &[2, 3, 2], 2, 12),
        (3, &[3, 3, 3, 3, 3], 4, 4),
        (4, &[2, 2, 2, 2], 1, 16),
        (4, &[2, 2, 2, 2, 2, 2], 2, 2),
    ];
    let (mut failures, mut all) = (Vec::new(), 0);
    for (unknowns, degrees, planted_roots, expected) in kinds {
        for round in 0..20 {
            let roots: Vec<_> = (0..planted_roots).map(|_| random_point(&mut rng, unknowns)).collect();
            let system = planted(&mut rng, unknowns, degrees, &roots);
            all += 1;
            match solve(&system, &Options::default()) {
                Ok(found) if found.all.len() == expected && has(&found, &roots, 1e-7) => {}
                Ok(found) => {
                    panic!("{degrees:?}, {round}: {} solutions, {:?}", found.all.len(), found.report)
                }
                Err(error) => failures.push((degrees, round, error.to_string())),
            }
        }
    }
    assert!(failures.len() * 100 < all, "{failures:?}");
}

#[test]
#[ignore = "two thousand systems: a minute"]
fn a_thousand_of_every_number_of_unknowns() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED_PLANTED + 1);
    for unknowns in 2..=4 {
        let (mut wrong, mut said) = (Vec::new(), Vec::new());
        for round in 0..1_000 {
            let highest = if unknowns == 4 { 2 } else { 3 };
            let equations = unknowns + rng.random_range(0..3);
            let degrees: Vec<usize> = (0..equations).map(|_| rng.random_range(2..=highest)).collect();
            let count = rng.random_range(1..=2);
            let mut roots: Vec<_> = (0..count).map(|_| random_point(&mut rng, unknowns)).collect();
            if round % 2 == 1 {
                // A pair of complex ones.
                let x = &mut roots[0];
                for x in x.iter_mut() {
                    x.im = rng.random_range(-1.0..1.0);
                }
                let conjugate = x.iter().map(c64::conj).collect();
                roots.push(conjugate);
            }
            let system = planted(&mut rng, unknowns, &degrees, &roots);
            let all: usize = degrees.iter().product();
            match solve(&system, &Options::default()) {
                Ok(found) => {
                    let counted: usize = found.all.iter().map(|s| s.multiplicity).sum();
                    let complete = equations > unknowns || counted + found.at_infinity == all;
                    if !complete || !has(&found, &roots, 1e-6) {
                        wrong.push((round, degrees, counted, found.at_infinity));
                    }
                }
                Err(error) => said.push((round, degrees, error.to_string())),
            }
        }
        assert!(wrong.len() <= 1, "{unknowns} unknowns: {wrong:?}");
        assert!(said.len() <= 10, "{unknowns} unknowns: {said:?}");
    }
}

#[test]
fn one_unknown_has_the_roots_of_a_polynomial() {
    // (x − 1)(x + 2)(x² + 1).
    let found = solved(&system(&[&[(1.0, [4]), (1.0, [3]), (-1.0, [2]), (1.0, [1]), (-2.0, [0])]]));
    let roots = [c64::new(1.0, 0.0), c64::new(-2.0, 0.0), c64::new(0.0, 1.0), c64::new(0.0, -1.0)];
    assert_eq!((found.all.len(), found.at_infinity), (4, 0));
    assert!(has(&found, &roots.map(|x| vec![x]), 1e-12));
    assert_eq!(found.real().count(), 2);
}

#[test]
fn solutions_that_run_together_are_counted() {
    // A circle and its tangent x = 1; the line y = 0 twice with a parabola that touches it.
    let circle = [(1.0, [2, 0]), (1.0, [0, 2]), (-1.0, [0, 0])];
    let found = solved(&system(&[&circle, &[(1.0, [1, 0]), (-1.0, [0, 0])]]));
    assert_eq!((found.all.len(), found.at_infinity), (1, 0));
    assert_eq!(found.all[0].multiplicity, 2);
    assert!(distance(&found.all[0].x, &real(&[1.0, 0.0])) < 1e-6);
}

#[test]
fn solutions_at_infinity_are_counted_and_left_out() {
    // Two circles meet in two points; every circle goes through the same two at infinity.
    let circle = |x: f64| [(1.0, [2, 0]), (1.0, [0, 2]), (-2.0 * x, [1, 0]), (x * x - 2.0, [0, 0])];
    let found = solved(&system(&[&circle(-1.0), &circle(1.0)]));
    assert_eq!((found.all.len(), found.at_infinity), (2, 2));
    assert!(has(&found, &[real(&[0.0, 1.0]), real(&[0.0, -1.0])], 1e-12));
    // Parallel lines.
    let line = |c: f64| [(1.0, [1, 0]), (2.0, [0, 1]), (c, [0, 0])];
    let found = solved(&system(&[&line(0.0), &line(1.0)]));
    assert_eq!((found.all.len(), found.at_infinity), (0, 1));
}

/// A planar arm with two links, lengths 2 and 1, that reaches for a point: cosines and sines of the joints. At infinity the
/// equations have whole lines in common.
fn arm(x: f64, y: f64) -> System {
    system(&[
        &[(1.0, [2, 0, 0, 0]), (1.0, [0, 2, 0, 0]), (-1.0, [0; 4])],
        &[(1.0, [0, 0, 2, 0]), (1.0, [0, 0, 0, 2]), (-1.0, [0; 4])],
        &[(2.0, [1, 0, 0, 0]), (1.0, [1, 0, 1, 0]), (-1.0, [0, 1, 0, 1]), (-x, [0; 4])],
        &[(2.0, [0, 1, 0, 0]), (1.0, [0, 1, 1, 0]), (1.0, [1, 0, 0, 1]), (-y, [0; 4])],
    ])
}

#[test]
fn a_curve_at_infinity_does_not_hide_the_points() {
    let found = solved(&arm(2.0, 1.0));
    assert_eq!(found.all.len(), 2);
    assert!(has(&found, &[real(&[1.0, 0.0, 0.0, 1.0]), real(&[0.6, 0.8, 0.0, -1.0])], 1e-9));
    // Out of reach: a pair of complex solutions.
    let found = solved(&arm(3.0, 1.0));
    assert_eq!((found.all.len(), found.real().count()), (2, 0));
    assert!(found.report.rounds >= 1);
}

#[test]
fn homogeneous_systems_have_solutions_of_norm_one() {
    // Two cones: (1, ±1, ±√2) up to scale.
    let cones = [
        [(1.0, [2, 0, 0]), (1.0, [0, 2, 0]), (-1.0, [0, 0, 2])],
        [(1.0, [2, 0, 0]), (-1.0, [0, 2, 0]), (0.0, [0, 0, 2])],
    ];
    let found = solved(&system(&[&cones[0], &cones[1]]));
    assert_eq!((found.all.len(), found.at_infinity, found.report.grading), (4, 0, 0));
    let root = 2.0_f64.sqrt();
    let expected =
        [[0.5, 0.5, root / 2.0], [0.5, -0.5, root / 2.0], [-0.5, 0.5, root / 2.0], [-0.5, -0.5, root / 2.0]];
    assert!(has(&found, &expected.map(|x| real(&x)), 1e-12), "{:?}", found.all);
}

#[test]
fn contradictions_have_no_solutions() {
    let lines = [[(1.0, [1, 0]), (1.0, [0, 1])], [(1.0, [1, 0]), (-1.0, [0, 1])]];
    let third = [(1.0, [1, 0]), (-1.0, [0, 0])];
    let found = solved(&system(&[&lines[0], &lines[1], &third]));
    assert!(found.all.is_empty() && found.at_infinity == 0);
    assert_eq!(found.report.relinearized.nullity(), 0);
}

#[test]
fn what_cannot_be_listed_is_an_error() {
    let plane = [(1.0, [2, 0, 0]), (1.0, [0, 1, 0]), (1.0, [0, 0, 1])];
    assert_eq!(
        solve(&system(&[&plane]), &Options::default()).unwrap_err(),
        SolveError::NotOverdetermined { equations: 1, unknowns: 3, homogeneous: false }
    );
    // The same circle twice.
    let circle = [(1.0, [2, 0]), (1.0, [0, 2]), (-1.0, [0, 0])];
    let twice = circle.map(|(c, e)| (2.0 * c, e));
    let error = solve(&system(&[&circle, &twice]), &Options::default()).unwrap_err();
    assert!(matches!(error, SolveError::NotZeroDimensional { .. }), "{error}");
    // A line and a point.
    let product = [(1.0, [1, 1]), (-1.0, [0, 1])];
    let error =
        solve(&system(&[&product, &[(1.0, [0, 2]), (-1.0, [0, 1])]]), &Options::default()).unwrap_err();
    assert!(matches!(error, SolveError::NotZeroDimensional { .. }), "{error}");
    // Sixteen points, of which one round leaves fifteen directions.
    let mut rng = ChaCha8Rng::seed_from_u64(SEED_PLANTED + 2);
    let four = planted(&mut rng, 4, &[2, 2, 2, 2], &[]);
    let error = solve(&four, &Options { max_rounds: 1, ..Options::default() }).unwrap_err();
    assert!(matches!(error, SolveError::TooManySolutions { rounds: 1, .. }), "{error}");
    let error = solve(&four, &Options { max_monomials: 50, ..Options::default() }).unwrap_err();
    assert_eq!(error, SolveError::TooLarge { monomials: 70, limit: 50 });
}

/// (39) and (40) of a pose problem: the quartics of all triples, and the norm.
fn pose_system(points: usize, noise_px: f64, index: u64) -> (System, crate::RelativePose) {
    use crate::simulate::{Scene, SceneOptions};
    let options = SceneOptions { points, noise_px, ..SceneOptions::default() };
    let scene = Scene::generate(&options, SEED_PLANTED + 3, index).unwrap();
    (equations_of(&scene.matches), scene.truth)
}

/// The same of five matches with 0.75 px of noise: scenes over all angles and as a camera sees them take turns.
fn noisy_pose_system(index: u64) -> (System, Vec<crate::Correspondence>) {
    use crate::simulate::{Scene, SceneOptions};
    let base = if index.is_multiple_of(2) { SceneOptions::default() } else { SceneOptions::realistic() };
    let options = SceneOptions { noise_px: 0.75, ..base };
    let scene = Scene::generate(&options, SEED_PLANTED + 4, index).unwrap();
    (equations_of(&scene.matches), scene.matches)
}

/// (39) and (40).
fn equations_of(matches: &[crate::Correspondence]) -> System {
    use crate::quaternion::{MONOMIALS, constraint_matrix};
    let rows = constraint_matrix(matches).unwrap();
    let mut equations: Vec<Vec<(f64, [u8; 4])>> =
        rows.iter().map(|row| row.iter().copied().zip(MONOMIALS).collect()).collect();
    // (q·q)² = 1.
    let squares = MONOMIALS.iter().filter(|m| m.iter().all(|e| e % 2 == 0));
    let mut norm: Vec<_> = squares.map(|m| (if m.contains(&4) { 1.0 } else { 2.0 }, *m)).collect();
    norm.push((-1.0, [0; 4]));
    equations.push(norm);
    System::new(4, equations).unwrap()
}

#[test]
fn the_pose_system_has_the_sizes_of_the_paper() {
    // Points, rows and directions of C, columns of D̄, solutions.
    let expected = [(5, 11, 24, 325, 20), (6, 21, 14, 120, 2), (7, 36, 3, 10, 2), (8, 57, 2, 6, 2)];
    for (points, rows, directions, columns, nullity) in expected {
        for index in 0..3 {
            let (system, truth) = pose_system(points, 0.0, index);
            let found = solved(&system);
            let report = &found.report;
            // One direction of [C −c] stands for x_p.
            assert_eq!((report.linearized.rows, report.linearized.nullity()), (rows, directions + 1));
            assert_eq!(report.d_bar, (465, columns));
            assert_eq!((report.relinearized.nullity(), report.rounds, report.grading), (nullity, 1, 4));
            assert_eq!(found.all.len(), nullity);
            let q = truth.wxyz();
            let same = |s: &Solution| {
                let dot: f64 = s.x.iter().zip(q).map(|(x, q)| x.re * q).sum();
                s.is_real() && 1.0 - dot.abs() < 1e-12
            };
            assert!(found.real().any(same), "{points} points, scene {index}: {:?}", found.all);
        }
    }
}

/// The rotations of real solutions, of the engine and of a solver.
fn rotations_of(found: &Solutions) -> Vec<nalgebra::UnitQuaternion<f64>> {
    let of = |s: &Solution| {
        let x = s.real();
        nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(x[0], x[1], x[2], x[3]))
    };
    found.real().map(of).collect()
}

/// How many of the real solutions of noisy five-point problems the engine and each solver have, that the other has not to 1e-6 rad.
fn agreement(problems: u64) -> [[usize; 3]; 3] {
    use crate::solver::{Kinds, SolverName};
    let solvers = [SolverName::Quest, SolverName::QuestLiteral, SolverName::RelinearizationLiteral];
    let mut counts = [[0; 3]; 3];
    for index in 0..problems {
        let (system, matches) = noisy_pose_system(index);
        let engine = rotations_of(&solved(&system));
        for (solver, [missed, more, all]) in solvers.into_iter().zip(&mut counts) {
            let mut out = crate::Candidates::new();
            solver.solve(Kinds::Exact, &matches, &mut out);
            let found: Vec<_> = out.iter().map(|c| c.pose.q_21).collect();
            let is_lonely = |q: &nalgebra::UnitQuaternion<f64>, others: &[nalgebra::UnitQuaternion<f64>]| {
                others.iter().all(|other| q.angle_to(other) > 1e-6)
            };
            *missed += found.iter().filter(|q| is_lonely(q, &engine)).count();
            *more += engine.iter().filter(|q| is_lonely(q, &found)).count();
            *all += found.len();
        }
    }
    counts
}

#[test]
fn the_engine_finds_the_solutions_of_the_solvers() {
    for (solver, [missed, more, all]) in
        ["quest", "quest-literal", "relinearization-literal"].iter().zip(agreement(20))
    {
        assert!(missed + more == 0 && all > 150, "{solver}: {missed} missed, {more} more, of {all}");
    }
}

#[test]
#[ignore = "a thousand systems of 165 octics: minutes"]
fn the_engine_finds_the_solutions_of_the_solvers_a_thousand_times() {
    for (solver, [missed, more, all]) in
        ["quest", "quest-literal", "relinearization-literal"].iter().zip(agreement(1_000))
    {
        assert!(missed + more <= 8 && all > 8_000, "{solver}: {missed} missed, {more} more, of {all}");
    }
}

#[test]
fn an_odd_root_of_a_negative_number_is_real() {
    // x³ = −8, whose three roots are one solution but for the symmetry of the equation.
    let found = solved(&system(&[&[(1.0, [3]), (8.0, [0])]]));
    assert_eq!((found.report.grading, found.all.len()), (3, 1));
    assert!(has(&found, &[real(&[-2.0])], 1e-12), "{:?}", found.all);
}

#[test]
fn a_number_of_solutions_that_is_given_is_found_among_noise() {
    // Equations with noise have no common solution: those of least squares are near the pose.
    let mut near = 0;
    for index in 0..10 {
        let (system, truth) = pose_system(8, 0.1, 100 + index);
        let options = Options { solutions: Some(2), ..Options::default() };
        let found = solve(&system, &options).unwrap();
        assert_eq!(found.all.len(), 2, "scene {index}");
        let q = truth.wxyz();
        let off = |s: &Solution| {
            let dot: c64 = s.x.iter().zip(q).fold(c64::ZERO, |dot, (x, q)| dot + *x * q);
            let norm = s.x.iter().map(c64::norm_sqr).sum::<f64>().sqrt();
            1.0 - dot.norm() / norm
        };
        // The cosine of half an angle: 0.05 rad.
        near += usize::from(found.all.iter().map(off).fold(f64::INFINITY, f64::min) < 3e-4);
    }
    assert!(near >= 8, "{near} of 10");
}

#[test]
fn degrees_and_rounds_have_their_limits() {
    // A degree that exponents cannot hold, although it has few monomials.
    let high = system(&[&[(1.0, [200]), (1.0, [1]), (-1.0, [0])]]);
    let error = solve(&high, &Options::default()).unwrap_err();
    assert_eq!(error, SolveError::TooLarge { monomials: 401, limit: 1_000 });
    // A curve is named as soon as it shows, also where no round is left to see it twice.
    let circle = [(1.0, [2, 0]), (1.0, [0, 2]), (-1.0, [0, 0])];
    let twice = circle.map(|(c, e)| (2.0 * c, e));
    let circles = system(&[&circle, &twice]);
    let errors: Vec<_> = (0..4)
        .map(|max_rounds| solve(&circles, &Options { max_rounds, ..Options::default() }).unwrap_err())
        .collect();
    assert!(matches!(errors[0], SolveError::TooManySolutions { rounds: 0, .. }), "{}", errors[0]);
    assert!(errors[1].to_string().contains("one round"), "{}", errors[1]);
    assert!(matches!(errors[3], SolveError::NotZeroDimensional { .. }), "{}", errors[3]);
}

#[test]
fn a_point_without_derivatives_stays_where_it_is() {
    let circles = system(&[&[(1.0, [2, 0]), (-1.0, [0, 0])], &[(1.0, [0, 2]), (-4.0, [0, 0])]]);
    let polished = newton::polish(&circles, real(&[0.0, 0.0]), false).unwrap();
    assert_eq!(polished.x, real(&[0.0, 0.0]));
    assert!(polished.regularity <= 0.0 && (polished.residual - 1.0).abs() < 1e-12, "{polished:?}");
    let polished = newton::polish(&circles, real(&[0.9, 2.2]), false).unwrap();
    assert!(distance(&polished.x, &real(&[1.0, 2.0])) < 1e-12 && polished.regularity > 0.1);
    let mut none = real(&[0.0, 0.0]);
    newton::normalize(&mut none);
    assert_eq!(none, real(&[0.0, 0.0]));
    // Where every term vanishes nothing is left.
    let product = system(&[&[(1.0, [1, 1]), (3.0, [2, 1])], &[(2.0, [1, 0])]]);
    assert!(product.equations()[0].relative_residual(&real(&[0.0, 5.0])) <= 0.0);
    assert!(product.equations()[0].relative_residual(&real(&[1.0, 5.0])) > 0.9);
}

#[test]
fn simple_solutions_next_to_each_other_are_two_and_a_common_cone_is_none() {
    for gap in [1e-2, 1e-4, 5e-6] {
        // (x − 1)(x − 1 − gap).
        let found = solved(&system(&[&[(1.0, [2]), (-2.0 - gap, [1]), (1.0 + gap, [0])]]));
        let counted: usize = found.all.iter().map(|s| s.multiplicity).sum();
        assert_eq!((counted, found.at_infinity), (2, 0), "{gap}: {:?}", found.all);
        assert!(has(&found, &[real(&[1.0]), real(&[1.0 + gap])], 0.1 * gap), "{gap}: {:?}", found.all);
    }
    let cone = [(1.0, [2, 0, 0]), (1.0, [0, 2, 0]), (-1.0, [0, 0, 2])];
    let twice = cone.map(|(c, e)| (2.0 * c, e));
    let error = solve(&system(&[&cone, &twice]), &Options::default()).unwrap_err();
    assert!(matches!(error, SolveError::NotZeroDimensional { .. }), "{error}");
}
