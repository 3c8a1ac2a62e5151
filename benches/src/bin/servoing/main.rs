//! How often the closed loop ends at the goal: thousands of random starts a cell, losses by cause, as Markdown.
#![expect(clippy::print_stdout, reason = "a program for people: tables are its output")]

mod bound;
mod cells;
mod planted;
mod run;

use std::convert::Infallible;

use clap::Parser;
use quest_benches::statistics::{percentile, sorted};
use quest_benches::{SEED, parallel};

use cells::{Method, cells};
use run::{End, Outcome};

/// The closed loop from many starts.
#[derive(Debug, Parser)]
struct Arguments {
    /// Starts of a cell
    #[arg(long, default_value_t = 2_000)]
    starts: u64,
    /// Seed of the starts
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    /// Only cells whose name contains this
    #[arg(long, default_value = "")]
    cell: String,
    /// The table of what goes wrong in a laboratory in place of the paper's
    #[arg(long)]
    planted: bool,
    /// With the filter in place of the tracker
    #[arg(long)]
    filter: bool,
    /// Threads; the numbers do not depend on it
    #[arg(long, default_value_t = parallel::all_cores())]
    threads: usize,
    /// Print the indices of lost starts, so many
    #[arg(long, default_value_t = 0)]
    lost: usize,
    /// Print every image of this start of the laboratory's cells, and no table
    #[arg(long, requires = "planted")]
    trace: Option<u64>,
}

fn main() {
    let arguments = Arguments::parse();
    println!("{} starts a cell, seed {}\n", arguments.starts, arguments.seed);
    if arguments.planted {
        let Arguments { starts, seed, cell, threads, filter, lost, trace, .. } = &arguments;
        if let Some(index) = trace {
            planted::print_trace(*index, *seed, cell, *filter);
            return;
        }
        planted::print_table(*starts, *seed, cell, *threads, *filter, *lost);
        return;
    }
    println!(
        "| cell | starts | 2 cm, 1° | resection | 5 cm, 2° | left image | held | inaccurate | astray | cm, median | 98 % | °, median | 98 % | holds a run | unsafe |"
    );
    println!("|---|{}", "---:|".repeat(14));
    for cell in cells().iter_mut().filter(|cell| cell.name.contains(&arguments.cell)) {
        if arguments.filter && cell.method == Method::Tracker {
            cell.method = Method::Filter;
        }
        let run = |index| Ok::<_, Infallible>(cell.run(arguments.seed, index));
        let Ok(outcomes) = parallel::map(arguments.starts, arguments.threads, run);
        print_row(&cell.name, &outcomes);
        let lost = outcomes.iter().enumerate().filter(|(_, o)| o.end != End::Converged);
        for (index, outcome) in lost.take(arguments.lost) {
            println!("  {index}: {outcome:?}");
        }
    }
}

fn print_row(name: &str, outcomes: &[Outcome]) {
    let count = |end| outcomes.iter().filter(|o| o.end == end).count();
    let share = |count: usize| 100.0 * count as f64 / outcomes.len() as f64;
    let near = outcomes.iter().filter(|o| o.position < 0.05 && o.angle < 2.0).count();
    let resected = outcomes.iter().filter(|o| o.resection_converged).count();
    let position = sorted(outcomes.iter().map(|o| 100.0 * o.position));
    let angle = sorted(outcomes.iter().map(|o| o.angle));
    let causes = [End::LeftImage, End::Held, End::Inaccurate, End::Astray].map(|end| count(end).to_string());
    println!(
        "| {name} | {} | {:.2} % | {:.1} % | {:.2} % | {} | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} | {} |",
        outcomes.len(),
        share(count(End::Converged)),
        share(resected),
        share(near),
        causes.join(" | "),
        percentile(&position, 0.5),
        percentile(&position, 0.98),
        percentile(&angle, 0.5),
        percentile(&angle, 0.98),
        outcomes.iter().map(|o| o.holds).sum::<usize>() as f64 / outcomes.len() as f64,
        outcomes.iter().map(|o| o.unsafe_commands).sum::<usize>(),
    );
}
