//! What goes wrong in a laboratory, on planted features: starts next to the goal, wrong matches that stay, tags, borders, mounts,
//! hostile input.

mod cells;
mod hostile;
mod run;
mod scenes;

use std::convert::Infallible;

use quest_benches::parallel;
use quest_benches::statistics::{percentile, sorted};
use quest_core::RelativePose;
use quest_core::servo::{Estimate, Record, Step};

use cells::cells;
use run::Outcome;

/// Runs the cells whose name contains `filter`, and prints the table.
pub(crate) fn print_table(starts: u64, seed: u64, filter: &str, threads: usize, filtered: bool, lost: usize) {
    println!(
        "| cell | starts | arrives | resection | six right | arrives of them | astray | never starts | holds at the end | cm, median | 98 % | °, median | 98 % | furthest beyond the start, 98 %, cm | restarts a run | largest step, m/s | unsafe |"
    );
    println!("|---|{}", "---:|".repeat(16));
    for cell in cells().iter().filter(|cell| cell.name.contains(filter)) {
        let starts = cell.starts(starts);
        let run = |index| Ok::<_, Infallible>(run::run(cell, seed, index, filtered));
        let Ok(outcomes) = parallel::map(starts, threads, run);
        print_row(&cell.name, cell.count, &outcomes);
        let lost_ones = outcomes.iter().enumerate().filter(|(_, o)| !o.arrives() || o.is_astray());
        for (index, outcome) in lost_ones.take(lost) {
            println!("  {index}: {outcome:?}");
        }
    }
    hostile::print_table(starts.min(1_000), seed, filter, threads, filtered, lost);
}

/// Prints every image of one run of the cells whose name contains `filter`.
pub(crate) fn print_trace(index: u64, seed: u64, filter: &str, filtered: bool) {
    for cell in cells().iter().filter(|cell| cell.name.contains(filter)) {
        println!("{}, start {index}", cell.name);
        let outcome = run::run_watched(cell, seed, index, filtered, |record| println!("{}", line(record)));
        println!("{outcome:?}");
    }
    if "hostile input".contains(filter) {
        println!("hostile input, start {index}");
        let outcome = hostile::run(seed, index, filtered, |record| println!("{}", line(record)));
        println!("{outcome:?}");
    }
}

/// An image in one line: the true pose, the estimated one, the command.
fn line(record: &Record) -> String {
    let Step { command, estimate, state, status } = &record.step;
    let cm =
        |t: nalgebra::Vector3<f64>| format!("({:.1} {:.1} {:.1})", 100.0 * t.x, 100.0 * t.y, 100.0 * t.z);
    let degrees = |pose: &RelativePose| pose.q_21.angle().to_degrees();
    let estimated = estimate.as_ref().map_or(String::new(), |e| {
        format!(
            "estimate {} cm {:.1}°, {:.1} σ, {} alive",
            cm(e.pose.t_21 * scenes::UNIT),
            degrees(&e.pose),
            deviations(e),
            e.alternatives
        )
    });
    format!(
        "{:4} {:13} truth {} cm {:.1}° {estimated}, {} of {}, command {} cm/s {:.1}°/s{}",
        status.images,
        state.name(),
        cm(record.truth.t_21),
        degrees(&record.truth),
        status.inliers,
        status.seen,
        cm(command.linear),
        command.angular.norm().to_degrees(),
        if status.border_limits { ", border" } else { "" },
    )
}

/// How many standard deviations the pose is from the goal's.
fn deviations(estimate: &Estimate) -> f64 {
    let t_21 = &estimate.pose.t_21;
    let information = estimate.covariance.and_then(|c| c.fixed_view::<3, 3>(3, 3).try_inverse());
    information.map_or(f64::NAN, |m| t_21.dot(&(m * t_21)).sqrt())
}

fn print_row(name: &str, count: usize, outcomes: &[Outcome]) {
    let share = |is: &dyn Fn(&Outcome) -> bool| {
        100.0 * outcomes.iter().filter(|o| is(o)).count() as f64 / outcomes.len() as f64
    };
    let six_right = outcomes.iter().filter(|o| o.right >= 6.min(count));
    let numbers = |of: &dyn Fn(&Outcome) -> f64| sorted(outcomes.iter().map(of));
    let (cm, degrees) = (numbers(&|o| 100.0 * o.position), numbers(&|o| o.angle));
    println!(
        "| {name} | {} | {:.1} % | {:.1} % | {} | {:.1} % | {:.1} % | {:.1} % | {:.1} % | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} | {:.2} | {:.2} | {} |",
        outcomes.len(),
        share(&Outcome::arrives),
        share(&|o| o.resection_arrives),
        six_right.clone().count(),
        100.0 * six_right.clone().filter(|o| o.arrives()).count() as f64 / six_right.count().max(1) as f64,
        share(&Outcome::is_astray),
        share(&|o| !o.has_started),
        share(&|o| o.holds),
        percentile(&cm, 0.5),
        percentile(&cm, 0.98),
        percentile(&degrees, 0.5),
        percentile(&degrees, 0.98),
        100.0 * percentile(&numbers(&|o| o.beyond), 0.98),
        outcomes.iter().map(|o| o.restarts).sum::<usize>() as f64 / outcomes.len() as f64,
        percentile(&numbers(&|o| o.largest_step), 1.0),
        outcomes.iter().map(|o| o.unsafe_commands).sum::<usize>(),
    );
}
