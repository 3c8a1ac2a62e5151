//! Axes: what they show, their range, and where the numbers stand.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

/// How values become lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// By difference.
    #[default]
    Linear,
    /// By ratio. Values that are not positive are not drawn.
    Log,
}

/// An axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    /// What is shown, with the unit: `noise, px`.
    pub label: String,
    /// How values become lengths.
    pub scale: Scale,
    /// The range; `None` takes the range of the data. A range from a larger to a smaller value runs backwards,
    /// like the v axis of an image.
    pub range: Option<[f64; 2]>,
    /// Whether the axis of the data's range runs backwards.
    pub backwards: bool,
}

impl Axis {
    /// A linear axis.
    #[must_use]
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// A logarithmic axis.
    #[must_use]
    pub fn log(label: impl Into<String>) -> Self {
        Self { scale: Scale::Log, ..Self::linear(label) }
    }

    /// Lets the axis of the data's range run backwards, like the v axis of an image.
    #[must_use]
    pub fn backwards(self) -> Self {
        Self { backwards: true, ..self }
    }

    /// Sets the range.
    #[must_use]
    pub fn range(self, from: f64, to: f64) -> Self {
        Self { range: Some([from, to]), ..self }
    }

    /// Whether a value has a place on the axis.
    pub(crate) fn shows(&self, value: f64) -> bool {
        value.is_finite() && (self.scale == Scale::Linear || value > 0.0)
    }

    /// The range that is drawn: the one that is set, else that of these values, a little enlarged.
    pub(crate) fn extent(&self, values: impl Iterator<Item = f64>) -> [f64; 2] {
        if let Some(range) = self.range {
            return range;
        }
        let [from, to] = self.extent_of(values);
        if self.backwards { [to, from] } else { [from, to] }
    }

    fn extent_of(&self, values: impl Iterator<Item = f64>) -> [f64; 2] {
        let [low, high] = values
            .filter(|&v| self.shows(v))
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
        if low > high {
            return [0.1, 1.0];
        }
        match self.scale {
            Scale::Log => {
                let step = (high / low).powf(0.04).max(1.05);
                [low / step, high * step]
            }
            Scale::Linear => {
                let step = if high > low { 0.04 * (high - low) } else { 0.5 * high.abs().max(1.0) };
                // An axis that could begin at zero does.
                let from = if low >= 0.0 && low < 0.5 * high { 0.0 } else { low - step };
                [from, high + step]
            }
        }
    }
}

/// An axis with its range, in the form that plotters needs: it maps values to pixels.
#[derive(Clone, Debug)]
pub(crate) struct Ruler {
    scale: Scale,
    range: [f64; 2],
}

impl Ruler {
    pub(crate) fn new(scale: Scale, range: [f64; 2]) -> Self {
        Self { scale, range }
    }

    /// Where a value stands: 0 at the beginning of the axis, 1 at its end.
    pub(crate) fn fraction(&self, value: f64) -> f64 {
        let [from, to] = self.range.map(|v| self.position(v));
        (self.position(value) - from) / (to - from)
    }

    fn position(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => value,
            Scale::Log => value.log10(),
        }
    }

    /// About this many values at which numbers stand.
    fn ticks(&self, count: usize) -> Vec<f64> {
        let [low, high] = [self.range[0].min(self.range[1]), self.range[0].max(self.range[1])];
        match self.scale {
            Scale::Linear => linear_ticks(low, high, count),
            Scale::Log => log_ticks(low, high, count),
        }
    }
}

/// Multiples of 1, 2 or 5 times a power of ten.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "as many steps as there are ticks, none where there are fewer"
)]
fn linear_ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let rough = (high - low) / count.max(1) as f64;
    if rough <= 0.0 || !rough.is_finite() {
        return Vec::new();
    }
    let decade = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|s| *s >= 0.999 * rough);
    let step = step.unwrap_or(10.0 * decade);
    // The slack keeps the ends, which rounding may move out of the range.
    let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
    (0..=(last - first) as usize).map(|k| (first + k as f64) * step).collect()
}

/// Powers of ten, with gaps if there would be too many of them. Within fewer than two decades 1, 2 and 5 times a power of ten.
#[expect(clippy::cast_possible_truncation, reason = "exponents of f64")]
fn log_ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let [first, last] = [low, high].map(f64::log10);
    let is_inside = |v: &f64| (low * (1.0 - 1e-9)..=high * (1.0 + 1e-9)).contains(v);
    let decades = (first.floor() as i32)..=(last.ceil() as i32);
    let mantissas: &[f64] = if last - first < 2.0 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let every = ((last - first) / count.max(1) as f64).ceil().max(1.0) as i32;
    let chosen = decades.filter(|decade| decade.rem_euclid(every) == 0);
    chosen.flat_map(|d| mantissas.iter().map(move |m| m * 10_f64.powi(d))).filter(is_inside).collect()
}

impl Ranged for Ruler {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    #[expect(clippy::cast_possible_truncation, reason = "a position in pixels")]
    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        // Far outside is as good as outside.
        let fraction = self.fraction(*value).clamp(-10.0, 10.0);
        from + (fraction * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        self.ticks(hint.bold_points())
    }

    fn range(&self) -> Range<f64> {
        self.range[0]..self.range[1]
    }
}

impl ValueFormatter<f64> for Ruler {
    fn format(value: &f64) -> String {
        number(*value)
    }
}

/// A number as it stands at an axis: `0.05`, `10⁻⁶`.
pub(crate) fn number(value: f64) -> String {
    let size = value.abs();
    if size < 1e-12 {
        return "0".to_owned();
    }
    if (1e-3..1e5).contains(&size) {
        let text = format!("{value:.4}");
        return text.trim_end_matches('0').trim_end_matches('.').to_owned();
    }
    let text = format!("{value:.2e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
    let raised: String = exponent.chars().map(raise).collect();
    if mantissa == "1" { format!("10{raised}") } else { format!("{mantissa}·10{raised}") }
}

fn raise(digit: char) -> char {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    match digit.to_digit(10) {
        Some(d) => RAISED[d as usize],
        None => '⁻',
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let shown = [0.0, 0.05, -2.5, 1e-6, 3e-7, 1e5, 100.0, 0.001].map(number);
        assert_eq!(shown, ["0", "0.05", "-2.5", "10⁻⁶", "3·10⁻⁷", "10⁵", "100", "0.001"]);
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(linear_ticks(0.0, 10.0, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        let found: Vec<_> = linear_ticks(0.0, 0.1, 5).into_iter().map(number).collect();
        assert_eq!(found, ["0", "0.02", "0.04", "0.06", "0.08", "0.1"]);
        assert!(linear_ticks(1.0, 1.0, 5).is_empty());
        let found: Vec<_> = log_ticks(1e-3, 1.0, 5).into_iter().map(number).collect();
        assert_eq!(found, ["0.001", "0.01", "0.1", "1"]);
        assert_eq!(log_ticks(1.0, 10.0, 5).len(), 4);
        assert!(log_ticks(1e-16, 1.0, 5).len() <= 6);
    }

    #[test]
    fn the_range_is_that_of_what_can_be_shown() {
        let values = || [0.0, f64::NAN, 1.0, 100.0].into_iter();
        let [low, high] = Axis::log("").extent(values());
        assert!(low < 1.0 && low > 0.8 && high > 100.0 && high < 130.0);
        assert_eq!(Axis::linear("").extent(values())[0].to_bits(), 0);
        let given = Axis::linear("").range(3.0, -1.0).extent(values());
        assert_eq!(given.map(f64::to_bits), [3.0, -1.0].map(f64::to_bits));
        let [low, high] = Axis::linear("").extent(std::iter::empty());
        assert!(low < high);
        let [first, last] = Axis::log("").backwards().extent(values());
        assert!(first > 100.0 && last < 1.0);
    }
}
