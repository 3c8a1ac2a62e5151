//! `quest-cli`: camera poses from matched points.
//!
//! One file a subcommand: arguments, one call, a table. Data goes to standard output, words to standard error.

mod candidate_table;
#[cfg(feature = "colmap")]
mod colmap;
mod drawing;
mod estimate;
mod estimate_options;
mod estimate_table;
mod figures;
mod in_order;
mod input;
mod matrix;
mod options;
mod parquet;
mod plot;
mod polynomials;
mod progress;
mod resume;
mod rows;
mod servo;
mod shell;
mod simulate;
mod solve;
mod solvers;
mod sources;
mod table;
mod tally;
mod view;
mod words;
mod writer;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

const EXAMPLES: &str = "\
Examples:
  quest-cli solve examples/points.json                  a table of the candidate poses
  quest-cli solve --format json pair.json | jq          the same for programs
  quest-cli view examples/points.json -o view.html      the same in three dimensions
  quest-cli estimate examples/tumfr3_98072_98172.json   one pose, from matches with outliers
  quest-cli simulate --figure 4 --plot errors.html      the experiments of the paper
  quest-cli servo --scenario robot --noise 0.5          a robot that drives to where an image was taken
  quest-cli colmap verify database.db                   the image pairs of a COLMAP database
  quest-cli solvers                                     the solvers to choose from

Exit status: 0 an answer, 1 no pose could be found, 2 bad input or arguments.";

/// Camera relative pose from matched image points.
#[derive(Parser)]
#[command(version, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Solve(Box<solve::Arguments>),
    Estimate(Box<estimate::Arguments>),
    Simulate(Box<simulate::Arguments>),
    Servo(Box<servo::Arguments>),
    View(Box<view::Arguments>),
    #[cfg(feature = "colmap")]
    Colmap(Box<colmap::Arguments>),
    Figures(Box<figures::Arguments>),
    Matrix(Box<matrix::Arguments>),
    Polynomials(Box<polynomials::Arguments>),
    Solvers(solvers::Arguments),
    Completions(shell::Completions),
    Man(shell::Manual),
}

/// What the exit status says of a run that went well.
enum Outcome {
    Answer,
    NoPose,
}

/// Bad input or arguments, or a result that could not be written.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error(transparent)]
    Read(#[from] quest_io::ReadError),
    #[error(transparent)]
    Write(#[from] quest_io::WriteError),
    #[error(transparent)]
    Scene(#[from] quest_core::simulate::SceneError),
    #[error(transparent)]
    Plot(#[from] quest_plot::PlotError),
    #[cfg(feature = "colmap")]
    #[error(transparent)]
    Colmap(#[from] quest_colmap::ColmapError),
    /// Arguments that do not go together.
    #[error("{0}")]
    Arguments(String),
}

fn main() -> ExitCode {
    survive_full_files();
    if let Err(error) = quest_core::lanes::Instructions::chosen() {
        words::say("error", &error.to_string());
        return ExitCode::from(2);
    }
    let result = match Arguments::parse().command {
        Command::Solve(arguments) => solve::run(&arguments),
        Command::Estimate(arguments) => estimate::run(&arguments),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Servo(arguments) => servo::run(&arguments),
        Command::View(arguments) => view::run(&arguments),
        #[cfg(feature = "colmap")]
        Command::Colmap(arguments) => colmap::run(&arguments),
        Command::Figures(arguments) => figures::run(&arguments),
        Command::Matrix(arguments) => matrix::run(&arguments),
        Command::Polynomials(arguments) => polynomials::run(&arguments),
        Command::Solvers(arguments) => solvers::run(&arguments),
        Command::Completions(arguments) => shell::completions(&arguments, Arguments::command()),
        Command::Man(arguments) => shell::manual(&arguments, Arguments::command()),
    };
    match result {
        Ok(Outcome::Answer) => ExitCode::SUCCESS,
        Ok(Outcome::NoPose) => ExitCode::from(1),
        Err(Failure::Write(error)) if error.is_broken_pipe() => ExitCode::SUCCESS,
        Err(failure) => {
            words::say("error", &failure.to_string());
            ExitCode::from(2)
        }
    }
}

/// A file that may grow no further (`ulimit -f`) is an error of the write, after which nothing is left behind; without a handler the
/// signal would end the program in the middle.
fn survive_full_files() {
    #[cfg(unix)]
    {
        let flag = std::sync::Arc::default();
        // Where the signal cannot be caught it does what it did before.
        let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, flag);
    }
}
