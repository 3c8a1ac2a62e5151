//! A bar on standard error for what takes longer than a second.

use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Nothing is shown before.
const PATIENCE: Duration = Duration::from_secs(1);

/// Counts what is done; on a terminal, after a second, where people can see it.
pub(crate) struct Progress {
    bar: ProgressBar,
    start: Instant,
    is_shown: bool,
    is_wanted: bool,
}

impl Progress {
    /// A count of `noun`; of an unknown total.
    pub(crate) fn new(noun: &'static str, quiet: bool) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{spinner} {pos} {msg} in {elapsed}, {per_sec}") {
            bar.set_style(style);
        }
        bar.set_message(noun);
        let is_wanted = !quiet && io::stderr().is_terminal();
        Self { bar, start: Instant::now(), is_shown: false, is_wanted }
    }

    /// So many more are done.
    pub(crate) fn add(&mut self, count: usize) {
        if self.is_wanted && !self.is_shown && self.start.elapsed() > PATIENCE {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
            self.is_shown = true;
        }
        self.bar.inc(count as u64);
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
