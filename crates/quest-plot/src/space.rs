//! A scene in three dimensions.

use crate::{Colour, Panel, Series, Style};

/// Parts in a common frame. A page shows them with one scale for all axes; the reader turns and zooms it. [`Space::drawn`] is the
/// same scene on paper.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Space {
    /// The title.
    pub title: String,
    /// What the reader should know, in plain text.
    pub caption: String,
    /// What the axes are, with units.
    pub axes: [String; 3],
    /// What is drawn.
    pub parts: Vec<Part>,
    /// The direction that is up when the page is opened.
    pub up: [f64; 3],
    /// The position from which the middle of the scene is seen at first, in units of about the size of the scene.
    pub eye: [f64; 3],
    /// Whether axes and grid are left out.
    pub is_bare: bool,
}

impl Space {
    /// An empty space; the axes' names are `x`, `y`, `z`, and z is up.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            axes: ["x", "y", "z"].map(str::to_owned),
            up: [0.0, 0.0, 1.0],
            eye: [1.25, 1.25, 1.25],
            ..Self::default()
        }
    }

    /// The frame of a camera: x to the right, y down, z forward. It is seen from above and beside camera 1, looking forward.
    #[must_use]
    pub fn of_camera(title: impl Into<String>) -> Self {
        Self { up: [0.0, -1.0, 0.0], eye: [-1.05, -0.95, -1.75], ..Self::new(title) }
    }

    /// The parts that are shown, as they look from [`eye`](Self::eye), far away.
    #[must_use]
    pub fn drawn(&self, title: impl Into<String>) -> Panel {
        let projection = Projection::new(self.eye, self.up);
        let mut panel = Panel::drawing(title);
        for part in self.parts.iter().filter(|part| part.is_shown) {
            let style = if part.opacity < 0.5 { Style::Faint } else { Style::Line };
            for line in &part.lines {
                let points = line.iter().map(|x| projection.at(*x)).collect();
                let series = Series::line(part.name.as_str(), points).labelled("");
                panel = panel.with(series.coloured(part.colour).styled(style));
            }
            if !part.points.is_empty() {
                let points = part.points.iter().map(|(x, _)| projection.at(*x)).collect();
                panel = panel.with(Series::points(part.name.as_str(), points).coloured(part.colour));
            }
            for (x, word) in &part.words {
                let series = Series::points(part.name.as_str(), vec![projection.at(*x)]);
                panel = panel.with(series.coloured(part.colour).styled(Style::Words).labelled(word.as_str()));
            }
        }
        panel
    }

    /// Adds a part.
    #[must_use]
    pub fn with(mut self, part: Part) -> Self {
        self.parts.push(part);
        self
    }
}

/// Lines and points of one colour. Parts with the same name are switched on and off together.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// The name: its entry in the legend.
    pub name: String,
    /// The colour.
    pub colour: Colour,
    /// Polylines: rays, paths, the frustum of a camera.
    pub lines: Vec<Vec<[f64; 3]>>,
    /// Points, each with the text that is shown when the mouse is over it.
    pub points: Vec<([f64; 3], String)>,
    /// Words in the scene.
    pub words: Vec<([f64; 3], String)>,
    /// From 0, invisible, to 1.
    pub opacity: f64,
    /// Whether it is seen when the page is opened.
    pub is_shown: bool,
}

impl Part {
    /// An empty part that is shown.
    #[must_use]
    pub fn new(name: impl Into<String>, colour: Colour) -> Self {
        Self {
            name: name.into(),
            colour,
            lines: Vec::new(),
            points: Vec::new(),
            words: Vec::new(),
            opacity: 1.0,
            is_shown: true,
        }
    }
}

/// How a scene looks from far away: to the right, up, and towards the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    right: [f64; 3],
    up: [f64; 3],
    towards: [f64; 3],
}

impl Projection {
    /// As seen from the direction `eye` with `up` upwards. Where they are parallel, or zero, something is up.
    #[must_use]
    pub fn new(eye: [f64; 3], up: [f64; 3]) -> Self {
        let towards = unit(eye).unwrap_or([0.0, 0.0, 1.0]);
        let other = if towards[0].abs() < 0.7 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let right = unit(cross(up, towards)).or_else(|| unit(cross(other, towards))).unwrap_or(other);
        Self { right, up: cross(towards, right), towards }
    }

    /// Where a point is drawn.
    #[must_use]
    pub fn at(&self, x: [f64; 3]) -> [f64; 2] {
        [dot(self.right, x), dot(self.up, x)]
    }

    /// How near a point is to the eye: of a sphere around the origin, the points in front have a positive one.
    #[must_use]
    pub fn nearness(&self, x: [f64; 3]) -> f64 {
        dot(self.towards, x)
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(a, a).sqrt();
    (length > 1e-9 && length.is_finite()).then(|| a.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_projection_keeps_what_is_up_and_near() {
        // From the front, y down as in a camera.
        let p = Projection::new([0.0, 0.0, -1.0], [0.0, -1.0, 0.0]);
        assert_eq!(p.at([2.0, 3.0, 5.0]).map(f64::to_bits), [2.0_f64, -3.0].map(f64::to_bits));
        assert!(p.nearness([0.0, 0.0, -1.0]) > 0.0);
        for (eye, up) in [([1.0, 2.0, 3.0], [0.0, 0.0, 1.0]), ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])] {
            let p = Projection::new(eye, up);
            for (a, b) in [(p.right, p.up), (p.up, p.towards), (p.towards, p.right)] {
                assert!(dot(a, b).abs() < 1e-12 && (dot(a, a) - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn only_shown_parts_are_drawn() {
        let line = vec![[0.0; 3], [1.0, 0.0, 0.0]];
        let part = |name, is_shown| Part {
            lines: vec![line.clone()],
            words: vec![([0.0; 3], "here".to_owned())],
            is_shown,
            ..Part::new(name, Colour(1, 2, 3))
        };
        let drawn = Space::new("s").with(part("a", true)).with(part("b", false)).drawn("d");
        let names: Vec<_> = drawn.series.iter().map(|s| (s.name.as_str(), s.label.as_str())).collect();
        assert_eq!(names, [("a", ""), ("a", "here")]);
        assert!(drawn.is_bare && drawn.equal_scales);
    }
}
