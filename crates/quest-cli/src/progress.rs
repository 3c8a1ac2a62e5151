//! A bar on standard error for what takes longer than a second.

use std::io::{self, IsTerminal};
use std::sync::Once;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Nothing is shown before.
const PATIENCE: Duration = Duration::from_secs(1);

/// Counts what is done, on any thread; on a terminal, after a second, where people can see it.
pub(crate) struct Progress {
    bar: ProgressBar,
    start: Instant,
    shown: Once,
    is_wanted: bool,
}

impl Progress {
    /// A count of `noun`, out of a total where that is known.
    pub(crate) fn new(noun: &'static str, total: Option<u64>, quiet: bool) -> Self {
        let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::hidden());
        let template = match total {
            Some(_) => "{prefix} {wide_bar} {pos}/{len} {msg}, {per_sec}, {eta} left",
            None => "{spinner} {pos} {msg} in {elapsed}, {per_sec}",
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(noun);
        let is_wanted = !quiet && io::stderr().is_terminal();
        Self { bar, start: Instant::now(), shown: Once::new(), is_wanted }
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
        if self.is_wanted && self.start.elapsed() > PATIENCE {
            self.shown.call_once(|| self.bar.set_draw_target(ProgressDrawTarget::stderr()));
        }
        self.bar.inc(count);
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
