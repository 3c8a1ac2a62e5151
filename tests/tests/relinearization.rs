//! Section 7.2 and appendix A word for word, by the general method of section 4.2, and the library against it.
#![expect(clippy::unwrap_used, reason = "a problem that cannot be made or solved is a failed test")]

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use quest_core::Correspondence;
use quest_core::solver::{Kinds, SolverName};
use quest_tests::literal_quest::{
    Solution, System, coefficient_matrix, constant, distance, hamilton, scaled,
};
use quest_tests::polynomial::{Polynomial, monomials};
use quest_tests::quartics::{Match, quartics};
use quest_tests::relinearization::{Linearized, null_space, unknowns};
use quest_tests::scenes::{exact_rotations, solve};
use quest_tests::solution_sets::{literal, nearest};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEED: u64 = 400;

/// Points all around two cameras, without noise: in the narrow field of view of section 9 the equations of six and seven
/// points come close to dependent.
fn problem(rng: &mut ChaCha8Rng, points: usize) -> (Vec<Match>, [Solution; 2]) {
    let mut vector = |size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..size));
    let (turn, t) = (vector(2.0), vector(1.0));
    let q = UnitQuaternion::from_scaled_axis(turn);
    let bearings = |x: Vector3<f64>| (x.normalize(), (q * x + t).normalize());
    let matches = (0..points).map(|_| bearings(vector(3.0))).collect();
    let half_turn = UnitQuaternion::new_unchecked(Quaternion::from_imag(t.normalize()));
    (matches, [scaled(constant(q)), scaled(hamilton(constant(half_turn), constant(q)))])
}

/// (39) and (40): the quartics, and `(q·q)² = 1`.
fn linearized(matches: &[Match]) -> Linearized {
    let square = |k: usize| Polynomial::unknown(k).times(&Polynomial::unknown(k));
    let norm = (0..4).fold(Polynomial::default(), |sum, k| sum.plus(1.0, &square(k)));
    let mut rows = quartics(matches);
    rows.push(norm.times(&norm));
    let c = coefficient_matrix(&rows, &monomials(4));
    let mut rhs = vec![0.0; rows.len()];
    // The matrix has its rows scaled to norm 1; any other norm of q would do as well.
    rhs[rows.len() - 1] = 1.0;
    Linearized::new(&c, &rhs)
}

fn solutions(matches: &[Match]) -> Vec<Solution> {
    let solutions = linearized(matches).solutions(&monomials(4)).unwrap();
    solutions.iter().map(|x| scaled(unknowns(&monomials(4), 4, x))).collect()
}

/// The distance of each true solution from the nearest one found.
fn errors(truth: &[Solution; 2], found: &[Solution]) -> [f64; 2] {
    truth.map(|q| found.iter().map(|p| distance(&q, p)).fold(f64::INFINITY, f64::min))
}

#[test]
fn sizes_and_numbers_of_solutions_are_those_of_the_paper() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    // D has a column less than [D −d]. For seven matches the paper gives the columns of the latter.
    for (points, directions, columns, nullity) in [(5, 24, 325, 20), (6, 14, 120, 2), (7, 3, 10, 2)] {
        for _ in 0..3 {
            let (matches, _) = problem(&mut rng, points);
            let system = linearized(&matches);
            assert_eq!(system.directions.ncols(), directions);
            let d_bar = system.relinearized(&monomials(4));
            assert_eq!((d_bar.nrows(), d_bar.ncols()), (465, columns));
            assert_eq!(null_space(&d_bar).ncols(), nullity);
        }
    }
}

#[test]
fn the_literal_method_finds_the_truth_and_its_twisted_partner() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED + 1);
    for (points, rounds) in [(5, 4), (6, 10), (7, 100), (8, 100)] {
        for _ in 0..rounds {
            let (matches, truth) = problem(&mut rng, points);
            let found = solutions(&matches);
            assert_eq!(found.len(), if points == 5 { 20 } else { 2 });
            // 1e-15 over the smallest singular values that are not zero, 1e-4 of the first or more.
            assert!(
                errors(&truth, &found).iter().all(|e| *e < 1e-9),
                "{points}: {:?}",
                errors(&truth, &found)
            );
        }
    }
}

#[test]
fn sections_7_1_and_7_2_find_the_same_twenty_solutions() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED + 2);
    for _ in 0..8 {
        let (matches, _) = problem(&mut rng, 5);
        let expected = literal(&matches.clone().try_into().unwrap()).all;
        let system = System::new(&quartics(&matches));
        let found = system.distinct(&solutions(&matches));
        assert_eq!((found.len(), expected.len()), (20, 20));
        let is_there = |q: &Solution| expected.iter().any(|p| distance(p, q) < 1e-8);
        assert!(found.iter().all(is_there));
    }
}

#[test]
fn the_solver_finds_what_the_literal_method_finds() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED + 3);
    for (points, rounds) in [(5, 8), (6, 20), (7, 100)] {
        for round in 0..rounds {
            let (matches, _) = problem(&mut rng, points);
            let real: Vec<_> = solutions(&matches)
                .into_iter()
                .filter(|q| q.iter().all(|c| c.im.abs() < 1e-7))
                .map(|q| UnitQuaternion::new_normalize(Quaternion::new(q[0].re, q[1].re, q[2].re, q[3].re)))
                .collect();
            let bearings = |(x1, x2): &Match| Correspondence::from_bearings((*x1).into(), (*x2).into());
            let given = matches.iter().map(bearings).collect::<Result<Vec<_>, _>>().unwrap();
            let found = exact_rotations(&solve(SolverName::Relinearization, Kinds::Exact, &given));
            assert_eq!(found.len(), real.len(), "{points} points, round {round}");
            assert!(found.iter().all(|q| nearest(q, &real) < 1e-6), "{points} points, round {round}");
        }
    }
}
