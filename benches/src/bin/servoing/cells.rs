//! The cells of the table.

use quest_core::servo::scenario::Features;
use quest_core::servo::{Choice, Disturbances, Length};
use quest_core::solver::SolverName;

/// What moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Body {
    Robot,
    Arm,
}

/// How poses are made of images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Method {
    /// The map of the goal's features.
    Tracker,
    /// The filter on the goal's depths.
    Filter,
    /// One candidate of each image, the goal's depths being known.
    PerFrame(SolverName, Choice, Length),
}

/// A cell of the table.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    pub(crate) name: String,
    pub(crate) body: Body,
    pub(crate) features: Features,
    pub(crate) count: usize,
    pub(crate) disturbances: Disturbances,
    pub(crate) goal_images: usize,
    pub(crate) known_depths: bool,
    pub(crate) plane: bool,
    pub(crate) method: Method,
}

impl Cell {
    fn new(body: Body, count: usize, noise_px: f64, name: &str) -> Self {
        let noise = if noise_px > 0.0 { format!("{noise_px} px") } else { "noise-free".to_owned() };
        let body_name = if body == Body::Robot { "robot" } else { "arm" };
        let rounded = noise_px > 0.0 && body == Body::Robot;
        Self {
            name: format!("{body_name}, {count} features, {noise}{name}"),
            body,
            features: Features::General,
            count,
            disturbances: Disturbances { noise_px, rounded, ..Disturbances::default() },
            goal_images: 1,
            known_depths: false,
            plane: body == Body::Robot,
            method: Method::Tracker,
        }
    }
}

pub(crate) fn cells() -> Vec<Cell> {
    use Body::{Arm, Robot};
    let features = Features::Coplanar;
    let thirty = ", 30 goal images";
    let mut cells = vec![
        Cell::new(Robot, 5, 0.0, ""),
        Cell::new(Robot, 20, 0.5, ""),
        Cell { goal_images: 30, ..Cell::new(Robot, 8, 0.5, thirty) },
        Cell { goal_images: 30, ..Cell::new(Robot, 5, 0.5, thirty) },
        Cell::new(Robot, 5, 0.5, ""),
        Cell { known_depths: true, ..Cell::new(Robot, 5, 0.5, ", known depths") },
        Cell { plane: false, ..Cell::new(Robot, 20, 0.5, ", plane not known") },
        Cell { features, ..Cell::new(Robot, 20, 0.0, ", coplanar") },
        Cell { features, ..Cell::new(Robot, 20, 0.5, ", coplanar") },
        Cell { features, goal_images: 30, ..Cell::new(Robot, 20, 0.5, ", coplanar, 30 goal images") },
        Cell::new(Arm, 5, 0.0, ""),
        Cell::new(Arm, 20, 0.0, ""),
        Cell::new(Arm, 20, 0.5, ""),
        Cell::new(Arm, 20, 1.0, ""),
        Cell { known_depths: true, ..Cell::new(Arm, 5, 0.5, ", known depths") },
        Cell {
            known_depths: true,
            goal_images: 30,
            ..Cell::new(Arm, 5, 0.5, ", known depths, 30 goal images")
        },
        Cell::new(Arm, 5, 0.5, ""),
    ];
    cells.extend(disturbed());
    cells.extend(per_frame());
    cells
}

/// Everything that can be wrong with images.
fn disturbed() -> Vec<Cell> {
    let mut cells = Vec::new();
    let mut add = |body, count, name: &str, disturb: &dyn Fn(&mut Disturbances)| {
        let mut cell = Cell::new(body, count, 0.5, name);
        disturb(&mut cell.disturbances);
        cell.goal_images = if count < 20 { 30 } else { 1 };
        cells.push(cell);
    };
    for count in [5, 8, 20] {
        let name = if count < 20 { ", 5 % outliers, 30 goal images" } else { ", 5 % outliers" };
        add(Body::Robot, count, name, &|d| d.outliers = 0.05);
    }
    for body in [Body::Robot, Body::Arm] {
        add(body, 20, ", 2 % wrong images", &|d| d.wrong_images = 0.02);
        add(body, 20, ", down to four and back", &|d| d.lost = Some((20..60, 4)));
        add(body, 20, ", 3 images late", &|d| d.delay = 3);
    }
    cells
}

/// The paper's way, and the essential matrix.
fn per_frame() -> Vec<Cell> {
    let mut cells = Vec::new();
    for body in [Body::Robot, Body::Arm] {
        for (count, noise) in [(5, 0.0), (5, 0.5), (20, 0.5)] {
            for (name, solver, choice, length) in [
                (", rule (10.1)", SolverName::Quest, Choice::ClosestDepths, Length::GoalDepths),
                (", rule of reprojection", SolverName::Quest, Choice::Reprojection, Length::GoalDepths),
                (", essential matrix", SolverName::Stewenius, Choice::Reprojection, Length::Unit),
            ] {
                let method = Method::PerFrame(solver, choice, length);
                cells.push(Cell { method, ..Cell::new(body, count, noise, name) });
            }
        }
    }
    let method = Method::PerFrame(SolverName::Homography, Choice::Reprojection, Length::GoalDepths);
    for noise in [0.0, 0.5] {
        let cell = Cell::new(Body::Robot, 20, noise, ", coplanar, homography");
        cells.push(Cell { method, features: Features::Coplanar, ..cell });
    }
    cells
}
