//! Whether the motion brings the goal nearer.
//!
//! A law lets its potential V fall: `|t|² + |log R|²` in section 10.1. Where V does not fall although motion is commanded the pose is wrong,
//! or the robot does not do what it is told. On recorded runs that drove away V had not fallen by a tenth over fifteen images of
//! motion in four of four, in good ones in none of eight. Slow robots need longer than fifteen images, so that the window ends when
//! the motion that was commanded should have taken a third of what is left.

use crate::servo::estimators::estimate::Motion;

/// Judged after so many images at the earliest,
const IMAGES: usize = 15;
/// and after a commanded way of this share of √V: a right pose then leaves half of V. A unit guessed wrong by five still passes.
const SHARE: f64 = 0.3;
/// The quotient of the last and the first V above which the loop diverges.
const FALLEN: f64 = 0.9;
/// Not judged below this, 6 cm of a metre or 3.5°: there noise decides. With 0.02 it came too late by 14 cm.
const LEAST: f64 = 0.004;

/// A window of images, and what was found.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Watchdog {
    first: Option<f64>,
    images: usize,
    /// The commanded way since the window began: lengths and angles added.
    way: f64,
    /// How often the loop was found diverging.
    pub(crate) found: usize,
}

impl Watchdog {
    /// Takes in the law's potential of a pose and the motion commanded before it; whether V has not fallen although it should have.
    pub(crate) fn is_diverging(&mut self, potential: Option<f64>, motion: &Motion) -> bool {
        let Some(value) = potential else {
            self.forget();
            return false;
        };
        let Some(first) = self.first else {
            (self.first, self.images, self.way) = (Some(value), 0, 0.0);
            return false;
        };
        self.images += 1;
        self.way += motion.linear.norm() + motion.angular.norm();
        if self.images < IMAGES || self.way < SHARE * first.sqrt() {
            return false;
        }
        self.first = None;
        let diverges = value > LEAST && value > FALLEN * first;
        self.found += usize::from(diverges);
        diverges
    }

    /// Begins a new window: what happened in between is not the law's doing.
    pub(crate) fn forget(&mut self) {
        self.first = None;
    }
}
