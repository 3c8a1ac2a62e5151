//! Samples solved and matrices scored in lanes: time with every set of instructions, and how often the truth is missed.
#![expect(clippy::print_stdout, reason = "a program for people: tables are its output")]

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use clap::Parser;
use quest_benches::kinds::SceneKind;
use quest_benches::{SEED, errors, kinds, parallel};
use quest_core::lanes::{
    BatchSolver, BearingMatches, Essentials, ImageMatches, Instructions, MatchColumns, Real, Scorer,
    SearchScore, Stop, Tolerance,
};
use quest_core::simulate::{Scene, SceneError, SceneOptions};
use quest_core::{Candidates, Correspondence};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Time of solving and scoring in lanes, and failures without noise: tables in Markdown.
#[derive(Debug, Parser)]
struct Arguments {
    /// Scenes of each kind, for the failures
    #[arg(long, default_value_t = 100_000)]
    scenes: u64,
    /// Rounds; every time is the minimum over the rounds
    #[arg(long, default_value_t = 100)]
    rounds: usize,
    /// Seed of the scenes and samples
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    /// Threads, for the failures
    #[arg(long, default_value_t = parallel::all_cores())]
    threads: usize,
    /// Time nothing: only solve this many samples for a robust loop, with the instructions of this processor that are
    /// fastest, for an instruction counter
    #[arg(long, value_name = "N")]
    callgrind: Option<usize>,
}

/// Matches of the scene that samples are drawn from.
const MATCHES: u32 = 512;
/// Samples of a round, and of a call.
const SAMPLES: usize = 4096;
const BATCH: usize = 128;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let options = SceneOptions { noise_px: 0.75, points: MATCHES as usize, ..SceneOptions::realistic() };
    let scene = Scene::generate(&options, arguments.seed, 0)?;
    let samples = draw(arguments.seed, arguments.callgrind.unwrap_or(SAMPLES));
    if arguments.callgrind.is_some() {
        let mut found = Essentials::new();
        BatchSolver::new(Tolerance::Loop).solve(&scene.matches, &samples, &mut found)?;
        black_box(&found);
        return Ok(());
    }
    solving(&arguments, &scene.matches, &samples)?;
    scoring(&arguments, &scene);
    failures(&arguments)
}

/// Samples of five different matches.
fn draw(seed: u64, count: usize) -> Vec<[u32; 5]> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut sample = || loop {
        let s: [u32; 5] = std::array::from_fn(|_| rng.random_range(0..MATCHES));
        if (0..5).all(|i| !s[..i].contains(&s[i])) {
            return s;
        }
    };
    (0..count).map(|_| sample()).collect()
}

/// The seconds of the fastest of many calls.
fn fastest(rounds: usize, mut call: impl FnMut()) -> f64 {
    let time = |_| {
        let start = Instant::now();
        call();
        start.elapsed().as_secs_f64()
    };
    (0..rounds).map(time).fold(f64::INFINITY, f64::min)
}

fn available() -> impl Iterator<Item = Instructions> {
    Instructions::ALL.into_iter().filter(|i| i.is_available())
}

fn solving(
    arguments: &Arguments,
    matches: &[Correspondence],
    samples: &[[u32; 5]],
) -> Result<(), Box<dyn Error>> {
    println!("{SAMPLES} samples of five of {MATCHES} matches, realistic, 0.75 px\n");
    println!("| instructions | tolerance | µs a solve | matrices | flagged |\n|---|---|---|---|---|");
    let mut found = Essentials::new();
    for instructions in available() {
        for tolerance in [Tolerance::Tight, Tolerance::Loop] {
            let Some(solver) = BatchSolver::with_instructions(tolerance, instructions) else { continue };
            solver.solve(matches, samples, &mut found)?;
            let flagged = (0..found.samples()).filter(|&sample| !found.is_complete(sample)).count();
            let matrices = found.len() as f64 / samples.len() as f64;
            // Short pieces, each at its fastest: other work on the machine rarely spares a long one.
            let piece = |samples: &[[u32; 5]]| {
                let mut found = Essentials::new();
                fastest(arguments.rounds, || {
                    let _ = black_box(solver.solve(matches, samples, &mut found));
                })
            };
            let seconds: f64 = samples.chunks(BATCH).map(piece).sum();
            println!(
                "| {instructions:?} | {tolerance:?} | {:.2} | {matrices:.2} | {:.2} % |",
                seconds * 1e6 / samples.len() as f64,
                100.0 * flagged as f64 / samples.len() as f64
            );
        }
    }
    Ok(())
}

fn scoring(arguments: &Arguments, scene: &Scene) {
    println!("\nScores over {MATCHES} matches, ns a match\n");
    println!(
        "| instructions | loss | plane f64 | plane f32 | bearings f64 | bearings f32 |\n|---|---|---|---|---|---|"
    );
    let (mut plane, mut plane_f32) = (ImageMatches::<f64>::new(), ImageMatches::<f32>::new());
    let (mut bearings, mut bearings_f32) = (BearingMatches::<f64>::new(), BearingMatches::<f32>::new());
    for m in &scene.matches {
        let (a, b) = (m.bearing1(), m.bearing2());
        bearings.push((*a).into(), (*b).into());
        bearings_f32.push((*a).into(), (*b).into());
        let (a, b) = (a / a.z, b / b.z);
        plane.push([a.x, a.y], [b.x, b.y]);
        plane_f32.push([a.x, a.y], [b.x, b.y]);
    }
    let e = scene.truth.essential();
    let e: [f64; 9] = std::array::from_fn(|i| e[(i / 3, i % 3)]);
    for instructions in available() {
        let Some(scorer) = Scorer::with_instructions(instructions) else { continue };
        for loss in [SearchScore::Truncated, SearchScore::Marginalised] {
            println!(
                "| {instructions:?} | {loss:?} | {:.2} | {:.2} | {:.2} | {:.2} |",
                nanoseconds(arguments, scorer, &plane, &e, loss),
                nanoseconds(arguments, scorer, &plane_f32, &e, loss),
                nanoseconds(arguments, scorer, &bearings, &e, loss),
                nanoseconds(arguments, scorer, &bearings_f32, &e, loss),
            );
        }
    }
}

fn nanoseconds<T: Real>(
    arguments: &Arguments,
    scorer: Scorer,
    matches: &impl MatchColumns<T>,
    e: &[f64; 9],
    loss: SearchScore,
) -> f64 {
    const CALLS: u32 = 64;
    let seconds = fastest(10 * arguments.rounds, || {
        for _ in 0..CALLS {
            black_box(scorer.score(matches, black_box(e), 2e-3, loss, Stop::Never));
        }
    });
    seconds * 1e9 / (f64::from(CALLS) * f64::from(MATCHES))
}

/// What became of a batch of scenes.
#[derive(Clone, Copy, Debug, Default)]
struct Failures {
    flagged: u64,
    /// No candidate has the true rotation, without and with the scalar solver's help.
    rotation: [u64; 2],
    pose: [u64; 2],
}

fn failures(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    println!(
        "\n{} scenes of a kind without noise, missed without / with the flagged ones solved again\n",
        arguments.scenes
    );
    println!("| scenes | flagged | R | pose |\n|---|---|---|---|");
    for name in ["general", "coplanar", "parallax-1e-3", "realistic"] {
        let Some(kind) = kinds::noise_free().into_iter().find(|kind| kind.name == name) else { continue };
        let batches = arguments.scenes.div_ceil(BATCH as u64);
        let all = parallel::map(batches, arguments.threads, |batch| judge(arguments, &kind, batch))?;
        let sum = |f: &dyn Fn(&Failures) -> u64| all.iter().map(f).sum::<u64>();
        println!(
            "| {name} | {} | {} / {} | {} / {} |",
            sum(&|f| f.flagged),
            sum(&|f| f.rotation[0]),
            sum(&|f| f.rotation[1]),
            sum(&|f| f.pose[0]),
            sum(&|f| f.pose[1])
        );
    }
    Ok(())
}

fn judge(arguments: &Arguments, kind: &SceneKind, batch: u64) -> Result<Failures, SceneError> {
    let first = batch * BATCH as u64;
    let indices = first..arguments.scenes.min(first + BATCH as u64);
    let scenes: Result<Vec<Scene>, _> = indices.map(|index| kind.scene(arguments.seed, index)).collect();
    let scenes = scenes?;
    let matches: Vec<_> = scenes.iter().flat_map(|scene| scene.matches.iter().copied()).collect();
    let samples: Vec<[u32; 5]> =
        (0..).step_by(5).take(scenes.len()).map(|first| [0, 1, 2, 3, 4].map(|i| first + i)).collect();
    let solver = BatchSolver::new(Tolerance::Tight);
    let (mut found, mut candidates) = (Essentials::new(), Candidates::new());
    let mut out = Failures::default();
    for again in [false, true] {
        let solved = if again {
            solver.solve_all(&matches, &samples, &mut found)
        } else {
            solver.solve(&matches, &samples, &mut found)
        };
        debug_assert!(solved.is_ok(), "all samples are of matches that exist");
        for (sample, scene) in scenes.iter().enumerate() {
            found.candidates(sample, &scene.matches, &mut candidates);
            let pose = errors::nearest(scene, &candidates).map_or(f64::INFINITY, |(_, error)| error);
            let rotation = errors::rotation_error(&scene.truth, &candidates);
            out.flagged += u64::from(!found.is_complete(sample));
            out.rotation[usize::from(again)] += u64::from(rotation > errors::TOLERANCE);
            out.pose[usize::from(again)] += u64::from(pose > errors::TOLERANCE);
        }
    }
    Ok(out)
}
