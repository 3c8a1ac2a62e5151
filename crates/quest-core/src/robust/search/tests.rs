//! The search with a source that knows the answer, and no solver.

use super::*;
use crate::lanes::SearchScore;
use crate::robust::search::sampling::generator;
use crate::simulate::{FOCAL_LENGTH, Scene, SceneOptions};
use crate::{Correspondence, RelativePose};

const SEED: u64 = 2018;

/// Says the same essential matrix of every sample from one on, and nothing of those before.
#[derive(Debug)]
struct Oracle {
    essential: Matrix3<f64>,
    from: usize,
    asked: usize,
}

impl HypothesisSource for Oracle {
    fn hypotheses(&mut self, _: &[Correspondence], samples: &[Sample], out: &mut Hypotheses) {
        for _ in samples {
            self.asked += 1;
            out.push_sample((self.asked > self.from).then_some(self.essential));
        }
    }
}

struct Case {
    matches: Vec<Correspondence>,
    truth: RelativePose,
}

fn case(points: usize, outliers: f64) -> Case {
    let options = SceneOptions { points, noise_px: 0.5, ..SceneOptions::realistic() };
    let mut scene = Scene::generate(&options, SEED, 1).unwrap();
    scene.add_outliers(outliers, SEED, 1).unwrap();
    Case { matches: scene.matches, truth: scene.truth }
}

fn run(case: &Case, from: usize, limits: &Limits) -> (Option<Scored>, usize) {
    run_beside(None, case, from, limits)
}

fn run_beside(known: Option<Motion>, case: &Case, from: usize, limits: &Limits) -> (Option<Scored>, usize) {
    let options = Options { loss: SearchScore::Marginalised, ..Options::default() };
    let order = (0..).take(case.matches.len()).collect();
    let observations = Observations::new(&case.matches, order, [[FOCAL_LENGTH; 2]; 2], 1.5);
    let mut search = Search::new(&observations, &options, None);
    if let Some(known) = known {
        search.know(known);
    }
    let draws = Draws { rng: generator(SEED, 0), size: 5, given: None };
    let mut oracle = Oracle { essential: case.truth.essential(), from, asked: 0 };
    search.run(&mut oracle, draws, limits, &mut |_, _| false);
    assert_eq!(search.iterations, oracle.asked);
    let best = search.best;
    (best, search.iterations)
}

const LIMITS: Limits =
    Limits { confidence: 0.9999, min_iterations: 0, max_iterations: 1_000, is_cancelled: &|| false };

#[test]
fn what_a_source_finds_is_kept_and_ends_the_search() {
    let case = case(200, 0.2);
    let (best, iterations) = run(&case, 0, &LIMITS);
    let motion = best.unwrap().motion;
    assert!(motion.q_21.angle_to(&case.truth.q_21) < 0.01);
    // 0.8^5 / 6 of the samples: 164 are enough.
    assert!(iterations <= 170, "{iterations}");
    let (late, iterations) = run(&case, 500, &LIMITS);
    assert!(late.unwrap().motion.q_21.angle_to(&case.truth.q_21) < 0.01);
    assert!((501..=532).contains(&iterations), "{iterations}");
}

#[test]
fn a_source_without_hypotheses_is_asked_to_the_end() {
    let case = case(100, 0.5);
    let (best, iterations) = run(&case, usize::MAX, &LIMITS);
    assert!(best.is_none());
    assert_eq!(iterations, LIMITS.max_iterations);
}

#[test]
fn the_smallest_number_of_samples_is_drawn() {
    let case = case(100, 0.0);
    let limits = Limits { min_iterations: 300, ..LIMITS };
    assert!((300..=332).contains(&run(&case, 0, &limits).1));
}

#[test]
fn a_known_pose_is_not_looked_for_again() {
    let case = case(200, 0.2);
    let truth = Motion { q_21: case.truth.q_21, direction: case.truth.t_21.normalize() };
    // No other explains clearly more than four in five of the matches.
    let (best, iterations) = run_beside(Some(truth), &case, usize::MAX, &LIMITS);
    assert!(best.is_some() && iterations == 0, "{iterations}");
}

#[test]
fn a_pose_is_found_that_explains_clearly_more_than_the_known_one() {
    let case = case(200, 0.5);
    let direction = case.truth.t_21.normalize();
    let wrong = Motion { q_21: UnitQuaternion::identity(), direction: -direction };
    let limits = Limits { max_iterations: 10_000, ..LIMITS };
    let (best, iterations) = run_beside(Some(wrong), &case, 500, &limits);
    assert!(best.unwrap().motion.q_21.angle_to(&case.truth.q_21) < 0.01);
    // The search goes on from the pose that was found as any other does: 0.5^5 of the samples, a twelfth of them useful, would need 3,500.
    assert!((501..5_000).contains(&iterations), "{iterations}");
}
