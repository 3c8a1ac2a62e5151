//! What is drawn: figures, panels, series.

use crate::{Axis, Colour, colour};

/// A grid of panels with a title and a sentence or two below it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// The title.
    pub title: String,
    /// What the reader should know, in plain text.
    pub caption: String,
    /// What the styles of lines mean, where that is the same in every panel.
    pub key: Vec<(Style, String)>,
    /// Rows of panels. Panels of a column have one width.
    pub rows: Vec<Vec<Panel>>,
}

impl Figure {
    /// A figure without panels.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// Sets the caption.
    #[must_use]
    pub fn caption(self, caption: impl Into<String>) -> Self {
        Self { caption: caption.into(), ..self }
    }

    /// Sets what the styles of lines mean.
    #[must_use]
    pub fn key<'a>(self, key: impl IntoIterator<Item = (Style, &'a str)>) -> Self {
        let key = key.into_iter().map(|(style, words)| (style, words.to_owned())).collect();
        Self { key, ..self }
    }

    /// Adds a row of panels below the others.
    #[must_use]
    pub fn row(mut self, panels: impl IntoIterator<Item = Panel>) -> Self {
        self.rows.push(panels.into_iter().collect());
        self
    }
}

/// One pair of axes with series.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// The title; may be empty.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// What is drawn, the first at the bottom.
    pub series: Vec<Series>,
    /// Whether a unit of x is as long as one of y: for paths, and for images.
    pub equal_scales: bool,
    /// Whether axes, grid and numbers are left out: for drawings in perspective.
    pub is_bare: bool,
}

impl Panel {
    /// A panel without series.
    #[must_use]
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self { title: title.into(), x, y, series: Vec::new(), equal_scales: false, is_bare: false }
    }

    /// Adds a series on top of the others.
    #[must_use]
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// A drawing with one scale and without axes.
    #[must_use]
    pub fn drawing(title: impl Into<String>) -> Self {
        Self { equal_scales: true, is_bare: true, ..Self::new(title, Axis::default(), Axis::default()) }
    }

    /// The line below the title of a drawing.
    #[must_use]
    pub fn subtitled(mut self, subtitle: impl Into<String>) -> Self {
        self.y.label = subtitle.into();
        self
    }

    /// The ranges of both axes: those that are set, else those of the data.
    pub(crate) fn ranges(&self) -> [[f64; 2]; 2] {
        let points = || self.series.iter().flat_map(|s| &s.points);
        let bands = || self.series.iter().flat_map(|s| &s.band);
        let heights = points().map(|p| p[1]).chain(bands().flat_map(|b| [b[1], b[2]]));
        [self.x.extent(points().map(|p| p[0])), self.y.extent(heights)]
    }

    /// One scale for both axes.
    #[must_use]
    pub fn equal_scales(self) -> Self {
        Self { equal_scales: true, ..self }
    }
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// A line through the points. A point that is not finite, or not positive on a logarithmic axis, interrupts it.
    Line,
    /// A dashed line: what is aimed at, a reference.
    Dashed,
    /// A thick line: the one to look at.
    Thick,
    /// A thin, light line: what lies behind, a grid.
    Faint,
    /// A filled area, light.
    Area,
    /// Dots.
    Points,
    /// Crosses: goals, starts.
    Crosses,
    /// The label alone, at the last point.
    Words,
}

/// A curve, or a set of points.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// The name: its entry in the legend, and its label unless another is set.
    pub name: String,
    /// The label that is written at the last point; empty for none.
    pub label: String,
    /// Its colour.
    pub colour: Colour,
    /// How it is drawn.
    pub style: Style,
    /// The points, `[x, y]`.
    pub points: Vec<[f64; 2]>,
    /// A band around the curve, such as a confidence interval: `[x, low, high]`; empty for none.
    pub band: Vec<[f64; 3]>,
    /// For each point the curve that a page draws in the other panels of the row while the pointer is over it; empty for none.
    pub beside: Vec<Vec<[f64; 2]>>,
}

impl Series {
    /// A line.
    #[must_use]
    pub fn line(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        let name = name.into();
        Self {
            label: name.clone(),
            name,
            colour: colour::INK,
            style: Style::Line,
            points,
            band: Vec::new(),
            beside: Vec::new(),
        }
    }

    /// Sets the curves that are drawn beside the points, one a point.
    #[must_use]
    pub fn beside(self, beside: Vec<Vec<[f64; 2]>>) -> Self {
        Self { beside, ..self }
    }

    /// Dots, without a label.
    #[must_use]
    pub fn points(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { style: Style::Points, label: String::new(), ..Self::line(name, points) }
    }

    /// An arrow from one point to another, its head of this length, without a label: for panels with equal scales.
    #[must_use]
    pub fn arrow(name: impl Into<String>, from: [f64; 2], to: [f64; 2], head: f64) -> Self {
        let points = arrow(from, to, head);
        Self { label: String::new(), ..Self::line(name, points) }
    }

    /// Sets the colour.
    #[must_use]
    pub fn coloured(self, colour: Colour) -> Self {
        Self { colour, ..self }
    }

    /// Sets how it is drawn.
    #[must_use]
    pub fn styled(self, style: Style) -> Self {
        Self { style, ..self }
    }

    /// Sets the label; an empty one is none.
    #[must_use]
    pub fn labelled(self, label: impl Into<String>) -> Self {
        Self { label: label.into(), ..self }
    }

    /// Adds a band `[x, low, high]`.
    #[must_use]
    pub fn banded(self, band: Vec<[f64; 3]>) -> Self {
        Self { band, ..self }
    }
}

/// The outline of an arrow: its shaft and the two sides of its head.
pub(crate) fn arrow(from: [f64; 2], to: [f64; 2], head: f64) -> Vec<[f64; 2]> {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let length = dx.hypot(dy);
    if length == 0.0 || !length.is_finite() {
        return vec![from, to];
    }
    let (ux, uy) = (dx / length * head, dy / length * head);
    // Half as wide as it is long.
    let side = |s: f64| [to[0] - ux - s * 0.45 * uy, to[1] - uy + s * 0.45 * ux];
    vec![from, to, side(1.0), to, side(-1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arrow_ends_in_a_head() {
        let points = arrow([0.0, 0.0], [2.0, 0.0], 0.5);
        assert_eq!(points.len(), 5);
        let bits = |p: [f64; 2]| p.map(f64::to_bits);
        assert_eq!((bits(points[0]), bits(points[1])), (bits([0.0, 0.0]), bits([2.0, 0.0])));
        let sides = [points[2], points[4]];
        assert!(sides.iter().all(|p| (p[0] - 1.5).abs() < 1e-12 && (p[1].abs() - 0.225).abs() < 1e-12));
        assert_eq!(arrow([1.0, 1.0], [1.0, 1.0], 0.5).len(), 2);
    }
}
