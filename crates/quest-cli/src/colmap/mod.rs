//! `quest-cli colmap`: image pairs of COLMAP databases.

mod export;
mod verify;

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::{Args, Subcommand};
use quest_colmap::{ColmapError, VerifyOptions, Watch};
use quest_core::robust::Options;

use crate::{
    Failure, Outcome,
    estimate_options::{Defaults, EstimateOptions},
    progress::Progress,
    words,
};

/// Verify and export the image pairs of COLMAP databases.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    Verify(Box<verify::Arguments>),
    Export(Box<export::Arguments>),
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    match &arguments.command {
        Command::Verify(arguments) => verify::run(arguments),
        Command::Export(arguments) => export::run(arguments),
    }
}

/// Says why nothing was found in a database that nothing can be found in.
fn say_empty(database: &Path) {
    words::say(
        "no pose",
        &format!(
            "{}: found no pair with matches, expected those of a matcher of COLMAP's",
            database.display()
        ),
    );
}

/// An error of a list of pairs, which counts pairs, with the file and the line where the list is one.
fn of_list(error: ColmapError, list: Option<&Path>) -> Failure {
    match list {
        Some(list) => error.in_list(list).into(),
        None => error.into(),
    }
}

/// The options of a search where those of COLMAP are not given.
#[derive(Clone, Debug)]
struct OfColmap;

impl Defaults for OfColmap {
    const THRESHOLD: &'static str =
        "Matches with a Sampson error below this are inliers, in pixels [default: 4]";

    fn options() -> Options {
        VerifyOptions::default().search
    }
}

impl EstimateOptions<OfColmap> {
    /// The options for the pairs of a database, which number themselves.
    fn for_colmap(&self) -> Options {
        self.options(self.threshold.unwrap_or(OfColmap::options().threshold), 0)
    }
}

/// Shows how far a run is.
struct Shown {
    progress: Progress,
    /// Pairs that have been shown.
    done: AtomicUsize,
}

impl Shown {
    fn new(quiet: bool) -> Self {
        Self { progress: Progress::new("pairs", Some(0), quiet), done: AtomicUsize::new(0) }
    }
}

impl Watch for Shown {
    fn progress(&self, done: usize, total: usize) {
        self.progress.set_total(total as u64);
        let before = self.done.swap(done, Ordering::Relaxed);
        self.progress.add(done.saturating_sub(before) as u64);
    }
}
