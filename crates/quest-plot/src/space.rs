//! A scene in three dimensions.

use crate::Colour;

/// Parts in a common frame. A page shows them with one scale for all axes; the reader turns and zooms it. There is no SVG form.
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
        Self { up: [0.0, -1.0, 0.0], eye: [-0.9, -0.8, -1.5], ..Self::new(title) }
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
