//! What goes wrong in a laboratory, on planted features: starts next to the goal, wrong matches that stay, tags, borders, mounts,
//! hostile input.

mod cells;
mod hostile;
mod run;
mod scenes;

use std::convert::Infallible;

use quest_benches::parallel;
use quest_benches::statistics::{percentile, sorted};

use cells::cells;
use run::Outcome;

/// Runs the cells whose name contains `filter`, and prints the table.
pub(crate) fn print_table(starts: u64, seed: u64, filter: &str, threads: usize, filtered: bool, lost: usize) {
    println!(
        "| cell | starts | arrives | resection | astray | never starts | holds at the end | cm, median | 98 % | °, median | 98 % | furthest beyond the start, 98 %, cm | restarts a run | largest step, m/s | unsafe |"
    );
    println!("|---|{}", "---:|".repeat(14));
    for cell in cells().iter().filter(|cell| cell.name.contains(filter)) {
        let starts = cell.starts(starts);
        let run = |index| Ok::<_, Infallible>(run::run(cell, seed, index, filtered));
        let Ok(outcomes) = parallel::map(starts, threads, run);
        print_row(&cell.name, &outcomes);
        let lost_ones = outcomes.iter().enumerate().filter(|(_, o)| !o.arrives() || o.is_astray());
        for (index, outcome) in lost_ones.take(lost) {
            println!("  {index}: {outcome:?}");
        }
    }
    hostile::print_table(starts.min(1_000), seed, filter, threads, filtered);
}

fn print_row(name: &str, outcomes: &[Outcome]) {
    let share = |is: &dyn Fn(&Outcome) -> bool| {
        100.0 * outcomes.iter().filter(|o| is(o)).count() as f64 / outcomes.len() as f64
    };
    let numbers = |of: &dyn Fn(&Outcome) -> f64| sorted(outcomes.iter().map(of));
    let (cm, degrees) = (numbers(&|o| 100.0 * o.position), numbers(&|o| o.angle));
    println!(
        "| {name} | {} | {:.1} % | {:.1} % | {:.1} % | {:.1} % | {:.1} % | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} | {:.2} | {:.2} | {} |",
        outcomes.len(),
        share(&Outcome::arrives),
        share(&|o| o.resection_arrives),
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
