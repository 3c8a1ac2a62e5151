//! One number of an experiment, as it stands in files.

use serde::Serialize;

use super::statistics::Statistics;

/// What is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Quantity {
    /// (61), in radians.
    #[default]
    RotationRad,
    /// (62), in radians.
    TranslationRad,
    /// The time of one solve, in milliseconds.
    TimeMs,
}

/// A row of the result.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Record {
    /// `figure 4`, `table 1`.
    pub(crate) experiment: String,
    /// `paper` or `realistic`.
    pub(crate) scenes: &'static str,
    /// What is varied: `noise_px`, `parallax`, `points`.
    pub(crate) varied: &'static str,
    /// Its value.
    pub(crate) value: f64,
    pub(crate) solver: &'static str,
    /// `exact`, `all` or `selected`.
    pub(crate) reading: &'static str,
    pub(crate) quantity: Quantity,
    /// The number of scenes; for times, the number of rounds over all scenes.
    pub(crate) trials: usize,
    /// The number of scenes without a candidate. The other numbers leave them out.
    pub(crate) unanswered: usize,
    pub(crate) mean: Option<f64>,
    pub(crate) ci95: Option<f64>,
    /// The mean difference of the errors to those of the first solver at the same scenes.
    pub(crate) difference: Option<f64>,
    pub(crate) difference_ci95: Option<f64>,
    pub(crate) median: Option<f64>,
    /// The fastest round, for times. Other work of the machine disturbs it least.
    pub(crate) smallest: Option<f64>,
    /// What the paper's table says.
    pub(crate) paper: Option<f64>,
}

impl Record {
    /// Fills in the statistics.
    pub(crate) fn with(self, statistics: Option<Statistics>) -> Self {
        Self {
            mean: statistics.map(|s| s.mean),
            ci95: statistics.and_then(|s| s.ci95),
            median: statistics.map(|s| s.median),
            smallest: statistics.map(|s| s.smallest),
            ..self
        }
    }

    /// Fills in the comparison with the first solver.
    pub(crate) fn beside(self, differences: Option<Statistics>) -> Self {
        Self {
            difference: differences.map(|s| s.mean),
            difference_ci95: differences.and_then(|s| s.ci95),
            ..self
        }
    }
}
