//! The cells of the table.

use quest_core::servo::Sticky;

/// Where the camera starts, and what it sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Place {
    /// So many metres beside the goal, turned by up to so many degrees, mostly about the optical axis.
    Beside { metres: f64, degrees: f64 },
    /// A free camera up to 80 cm away and 60° turned.
    Arm,
    /// A tag of so many metres two metres ahead, from up to 60 cm away.
    Tag { size: f64 },
    /// A robot whose features are spread over this share of the image's width.
    Robot { spread: f64 },
    /// A robot with its camera so many metres ahead of the axle, looking down by so many degrees.
    Mounted { forward: f64, degrees: f64 },
}

/// A cell of the table.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    pub(crate) name: String,
    pub(crate) place: Place,
    pub(crate) count: usize,
    pub(crate) coplanar: bool,
    pub(crate) sticky: Option<Sticky>,
    pub(crate) explore: f64,
    pub(crate) known_depths: bool,
}

impl Cell {
    fn new(name: &str, place: Place, count: usize) -> Self {
        let name = format!("{name}, {count} features");
        Self { name, place, count, coplanar: false, sticky: None, explore: 0.0, known_depths: false }
    }

    fn with(mut self, name: &str, change: impl Fn(&mut Self)) -> Self {
        self.name.push_str(name);
        change(&mut self);
        self
    }

    /// Runs with hundreds of features take as many times as long.
    pub(crate) fn starts(&self, wanted: u64) -> u64 {
        if self.count >= 200 { wanted.min(400) } else { wanted }
    }
}

pub(crate) fn cells() -> Vec<Cell> {
    let mut cells = next_to_the_goal();
    cells.extend(arms());
    let tag = |name, size, count| Cell::new(name, Place::Tag { size }, count).with("", |c| c.coplanar = true);
    for (name, size, count) in [("a tag of 0.3 m", 0.3, 5), ("a board of 0.6 m", 0.6, 8)] {
        cells.push(tag(name, size, count));
        cells.push(tag(name, size, count).with(", size known", |c| c.known_depths = true));
    }
    for spread in [0.5, 0.7, 0.95] {
        let name = format!("robot, {:.0} % of the width", 100.0 * spread);
        for count in [12, 40] {
            cells.push(Cell::new(&name, Place::Robot { spread }, count));
        }
    }
    for (forward, degrees) in
        [(0.0, 0.0), (0.1, 0.0), (0.2, 0.0), (0.3, 0.0), (0.2, 10.0), (0.0, 15.0), (0.3, 20.0)]
    {
        let name = format!("robot, camera {:.0} cm ahead, down by {degrees}°", 100.0 * forward);
        cells.push(Cell::new(&name, Place::Mounted { forward, degrees }, 20));
    }
    cells
}

fn next_to_the_goal() -> Vec<Cell> {
    let beside = |metres: f64, degrees: f64, count| {
        let turned = if degrees > 0.0 { format!(", turned by up to {degrees}°") } else { String::new() };
        let name = format!("{:.0} cm beside the goal{turned}", 100.0 * metres);
        Cell::new(&name, Place::Beside { metres, degrees }, count)
    };
    let mut cells = Vec::new();
    for count in [12, 40, 200] {
        for metres in [0.0, 0.01] {
            cells.push(beside(metres, 60.0, count));
        }
    }
    for coplanar in [false, true] {
        let plane = if coplanar { ", coplanar" } else { "" };
        for metres in [0.02, 0.03, 0.05] {
            let cell = || beside(metres, 0.0, 12).with(plane, |c| c.coplanar = coplanar);
            cells.push(cell());
            cells.push(cell().with(", may explore", |c| c.explore = 0.04));
        }
    }
    cells.push(beside(0.0, 0.0, 12).with(", may explore", |c| c.explore = 0.04));
    cells
}

/// An arm with few features, and with wrong matches.
fn arms() -> Vec<Cell> {
    let mut cells = Vec::new();
    for count in [6, 8] {
        cells.push(Cell::new("arm", Place::Arm, count));
    }
    for count in [12, 20, 40, 200] {
        for share in [0.05, 0.1, 0.2, 0.3] {
            for images in [20.0, f64::INFINITY] {
                let long = if images > 1e3 { "for ever" } else { "20 images" };
                let name = format!(", {:.0} % wrong, {long}", 100.0 * share);
                let cell = Cell::new("arm", Place::Arm, count);
                cells.push(cell.with(&name, |c| c.sticky = Some(Sticky { share, images })));
            }
        }
    }
    cells
}
