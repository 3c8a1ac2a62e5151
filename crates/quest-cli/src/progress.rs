//! What takes longer than a second tells how far it is on standard error: a bar on a terminal, lines elsewhere where they are asked for.

use std::io::{self, IsTerminal};
use std::sync::{Mutex, Once};
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::words;

/// Nothing is shown before.
pub(crate) const PATIENCE: Duration = Duration::from_secs(1);

/// From one line to the next.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// When progress is told.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct ProgressOptions {
    /// When to tell of the progress on standard error: `auto` by a bar on a terminal, `always` elsewhere too, by a line every ten
    /// seconds and one at the end.
    #[arg(long, value_enum, value_name = "WHEN", default_value_t = When::Auto, conflicts_with = "quiet")]
    progress: When,
}

/// When progress is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum When {
    /// On a terminal.
    Auto,
    /// On a terminal and elsewhere.
    Always,
    /// Nowhere.
    Never,
}

/// How progress is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Telling {
    Nothing,
    Bar,
    Lines,
}

/// Counts what is done, on any thread; after a second, where people can see it.
pub(crate) struct Progress {
    bar: ProgressBar,
    noun: &'static str,
    start: Instant,
    shown: Once,
    telling: Telling,
    /// When the last line was written.
    last: Mutex<Instant>,
}

impl ProgressOptions {
    /// A count of `noun`, out of a total where that is known.
    pub(crate) fn start(self, noun: &'static str, total: Option<u64>, quiet: bool) -> Progress {
        let telling = match (self.progress, io::stderr().is_terminal()) {
            _ if quiet => Telling::Nothing,
            (When::Never, _) | (When::Auto, false) => Telling::Nothing,
            (_, true) => Telling::Bar,
            (When::Always, false) => Telling::Lines,
        };
        Progress::told(noun, total, telling)
    }
}

impl Progress {
    /// A count of `noun`, out of a total where that is known, told on a terminal alone.
    #[cfg_attr(not(feature = "colmap"), expect(dead_code, reason = "databases alone have no option for it"))]
    pub(crate) fn new(noun: &'static str, total: Option<u64>, quiet: bool) -> Self {
        ProgressOptions { progress: When::Auto }.start(noun, total, quiet)
    }

    fn told(noun: &'static str, total: Option<u64>, telling: Telling) -> Self {
        let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::hidden());
        let template = match total {
            Some(_) => "{prefix} {wide_bar} {pos}/{len} {msg}, {per_sec}, {eta} left",
            None => "{spinner} {pos} {msg} in {elapsed}, {per_sec}",
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(noun);
        let start = Instant::now();
        Self { bar, noun, start, shown: Once::new(), telling, last: Mutex::new(start) }
    }

    /// What is being done, ahead of the bar.
    pub(crate) fn begin(&self, part: String) {
        self.bar.set_prefix(part);
    }

    /// The total, where it is known late.
    #[cfg_attr(not(feature = "colmap"), expect(dead_code, reason = "databases alone know their total late"))]
    pub(crate) fn set_total(&self, total: u64) {
        self.bar.set_length(total);
    }

    /// Adds to the number that is done.
    pub(crate) fn add(&self, count: u64) {
        if self.telling == Telling::Bar && self.start.elapsed() > PATIENCE {
            self.shown.call_once(|| self.bar.set_draw_target(ProgressDrawTarget::stderr()));
        }
        self.bar.inc(count);
        // Where another thread is writing a line there is nothing to add to it.
        if self.telling == Telling::Lines
            && let Ok(mut last) = self.last.try_lock()
            && last.elapsed() > BETWEEN_LINES
        {
            *last = Instant::now();
            self.line();
        }
    }

    /// Removes the bar, or writes the last line.
    pub(crate) fn finish(&self) {
        if self.telling == Telling::Lines {
            self.line();
        }
        self.bar.finish_and_clear();
    }

    fn line(&self) {
        let total = self.bar.length().map_or_else(String::new, |total| format!(" of {total}"));
        let seconds = self.start.elapsed().as_secs_f64();
        words::say("progress", &format!("{}{total} {} in {seconds:.1} s", self.bar.position(), self.noun));
    }
}
