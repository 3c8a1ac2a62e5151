//! Time of every solver on the same scenes, and of the stages that are public.
//!
//! Before anything is timed, the true rotation has to be among the answers for the same scenes without noise.
#![expect(clippy::expect_used, reason = "a benchmark whose scenes do not exist cannot go on")]

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use quest_benches::cells::Cell;
use quest_benches::{SEED, errors};
use quest_core::quaternion::constraint_matrix_5;
use quest_core::simulate::{Layout, Scene, SceneOptions};
use quest_core::solver::{Kinds, SolverName};
use quest_core::{Candidates, Correspondence};

/// Scenes of a measurement, taken in turn: time depends on the number of solutions.
const SCENES: u64 = 1_000;

fn scenes(layout: Layout, points: usize, noise_px: f64) -> Vec<Scene> {
    // Large scenes differ less, and fill the cache.
    let count = if points > 100 { 50 } else { SCENES };
    let options = SceneOptions { layout, points, noise_px, ..SceneOptions::realistic() };
    (0..count).map(|index| Scene::generate(&options, SEED, index).expect("realistic scenes exist")).collect()
}

/// Calls `f` with one scene's matches after another.
fn cycle<'a, T>(scenes: &'a [T]) -> impl FnMut() -> &'a T {
    let mut all = scenes.iter().cycle();
    move || all.next().expect("there are scenes")
}

/// The share of noise-free scenes of which a solver has to find the truth: known failures of the older methods aside.
fn least_share(solver: SolverName) -> f64 {
    match solver {
        SolverName::Quest | SolverName::QuestEigen => 0.999,
        _ => 0.9,
    }
}

fn assert_truth_is_found(cell: Cell, scenes: &[Scene]) {
    let mut out = Candidates::new();
    let found = scenes.iter().filter(|scene| {
        cell.solve(&scene.matches, &mut out);
        errors::rotation_error(&scene.truth, &out) < errors::TOLERANCE
    });
    let (found, all) = (found.count(), scenes.len());
    let share = found as f64 / all as f64;
    assert!(share >= least_share(cell.solver), "{cell:?} finds the truth of {found} of {all} scenes");
}

fn solvers(c: &mut Criterion) {
    for points in [5, 6, 50, 1000] {
        let mut group = c.benchmark_group(format!("{points}-matches"));
        for cell in Cell::of(&SolverName::ALL, points) {
            // More than five matches are always refined from every kind: one row is enough.
            if points > 5 && cell.kinds == Kinds::Exact {
                continue;
            }
            // A homography exists for a plane only.
            let is_planar = cell.solver == SolverName::Homography;
            let layout = if is_planar { Layout::Coplanar } else { Layout::General };
            assert_truth_is_found(cell, &scenes(layout, points, 0.0));
            let noisy = scenes(layout, points, 0.75);
            group.bench_function(BenchmarkId::new(cell.solver_name(), cell.kinds_name()), |b| {
                let (mut next, mut out) = (cycle(&noisy), Candidates::new());
                b.iter(|| {
                    cell.solve(black_box(&next().matches), &mut out);
                    out.len()
                });
            });
        }
        group.finish();
    }
}

fn stages(c: &mut Criterion) {
    let five: Vec<[Correspondence; 5]> = scenes(Layout::General, 5, 0.75)
        .iter()
        .map(|s| s.matches.as_slice().try_into().expect("five matches"))
        .collect();
    let mut next = cycle(&five);
    c.bench_function("stages/constraint_matrix_5", |b| b.iter(|| constraint_matrix_5(black_box(next()))));
}

#[cfg(feature = "peers")]
fn peers(c: &mut Criterion) {
    use quest_benches::peers::{essential_error, kornia, kornia_problem};
    let problems = |scenes: &[Scene]| -> Vec<_> {
        scenes.iter().map(|s| kornia_problem(&s.matches).expect("five matches")).collect()
    };
    let clean = scenes(Layout::General, 5, 0.0);
    let found = |(s, p): &(&Scene, _)| essential_error(&s.truth, &kornia(p)) < errors::TOLERANCE;
    let right = clean.iter().zip(problems(&clean)).filter(found).count();
    // Not ours to mend: it has to be the right use of it, with a few failures.
    assert!(100 * right > 97 * clean.len(), "kornia-3d finds {right} of {}", clean.len());
    let noisy = problems(&scenes(Layout::General, 5, 0.75));
    let mut next = cycle(&noisy);
    c.bench_function("5-matches/kornia-3d essential_5pt (no poses)", |b| {
        b.iter(|| kornia(black_box(next())).len());
    });
}

#[cfg(not(feature = "peers"))]
fn peers(_: &mut Criterion) {}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2));
    targets = solvers, stages, peers
}
criterion_main!(benches);
