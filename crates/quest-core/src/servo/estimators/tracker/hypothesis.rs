//! One answer to the first images, and what has become of it.

use nalgebra::{UnitQuaternion, Vector3};

use crate::RelativePose;
use crate::servo::estimators::estimate::Motion;
use crate::servo::estimators::tracker::map::Map;
use crate::servo::estimators::tracker::resection::Fit;

#[derive(Clone, Debug)]
pub(crate) struct Hypothesis {
    pub(crate) map: Map,
    pub(crate) pose: RelativePose,
    /// Minus twice its log likelihood, relative to the others: lower is better.
    pub(crate) score: f64,
    /// The same against a rotation, for the start.
    pub(crate) against_rotation: f64,
    /// The cost of the first images on this map, for the start.
    pub(crate) start_cost: f64,
    /// Its fit of the current image, and the features' squared residuals.
    pub(crate) fit: Option<Fit>,
    pub(crate) squares: Vec<f64>,
    pub(crate) track: Track,
    /// How much of late the images have shown features off the map but on their epipolar lines, from zero to one.
    pub(crate) off_map: f64,
    /// The scene has been found to be no plane.
    pub(crate) is_relief: bool,
}

impl Hypothesis {
    pub(crate) fn new(map: Map) -> Self {
        let features = map.points.len();
        Self {
            map,
            pose: RelativePose::identity(),
            score: 0.0,
            against_rotation: 0.0,
            start_cost: 0.0,
            fit: None,
            squares: vec![f64::NAN; features],
            track: Track::default(),
            off_map: 0.0,
            is_relief: false,
        }
    }

    /// Whether two answers are one.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        self.pose.rotation_error(&other.pose) < 3e-3 && (self.pose.t_21 - other.pose.t_21).norm() < 1e-2
    }

    /// Whether two answers command different things: translations more than 60° apart, or rotations that differ by half.
    pub(crate) fn disagrees(&self, other: &Self) -> bool {
        /// Below this, in the unit of the depths, a translation is at its goal.
        const NEAR: f64 = 0.02;
        let (a, b) = (&self.pose.t_21, &other.pose.t_21);
        let apart = a.dot(b) < 0.5 * a.norm() * b.norm() && a.norm().max(b.norm()) > NEAR;
        apart || self.pose.rotation_error(&other.pose) > 0.03 + 0.5 * self.pose.q_21.angle()
    }
}

/// Where a hypothesis says the camera has been, beside where it was sent.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Track {
    entries: [Entry; Track::LENGTH],
    count: usize,
    /// The commanded way in the goal's frame, and the commanded rotation, since the start.
    way: Vector3<f64>,
    turn: UnitQuaternion<f64>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    centre: Vector3<f64>,
    q_21: UnitQuaternion<f64>,
    way: Vector3<f64>,
    turn: UnitQuaternion<f64>,
}

/// What the track says of a hypothesis.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Odometry {
    /// What is to be added to its score.
    pub(crate) score: f64,
    /// Whether it contradicts the commands beyond what noise and delay explain.
    pub(crate) contradicts: bool,
}

impl Track {
    /// Over so many entries: three images of delay leave five.
    const LENGTH: usize = 9;
    /// An entry is added after so much motion, so that slow cameras and fast images do not shorten the window to nothing.
    const STEP: f64 = 2e-3;

    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Takes in a command, from the pose before it.
    pub(crate) fn moved(&mut self, motion: &Motion, pose: &RelativePose) {
        self.way += pose.q_21.inverse() * motion.linear;
        self.turn =
            UnitQuaternion::new_normalize((UnitQuaternion::new(-motion.angular) * self.turn).into_inner());
    }

    /// Takes in a pose, with its standard deviations, and holds it against the commands.
    pub(crate) fn judge(&mut self, pose: &RelativePose, turn_deviation: f64, way_deviation: f64) -> Odometry {
        let now = Entry { centre: pose.inverse().t_21, q_21: pose.q_21, way: self.way, turn: self.turn };
        let mut odometry = Odometry::default();
        let is_full = self.count >= Self::LENGTH;
        let last = self.entries[(self.count + Self::LENGTH - 1) % Self::LENGTH];
        let stirred = (now.way - last.way).norm() + now.turn.angle_to(&last.turn) > Self::STEP;
        if is_full && stirred {
            let first = self.entries[self.count % Self::LENGTH];
            let (way, moved) = (now.way - first.way, now.centre - first.centre);
            let length = way.norm();
            // The sign alone counts, the unit is a guess: 1 for the truth, −1 for the reversed scene.
            let along = moved.dot(&way) / length.powi(2).max(f64::MIN_POSITIVE);
            let commanded = (now.turn * first.turn.inverse()).scaled_axis();
            let turned = (now.q_21 * first.q_21.inverse()).scaled_axis();
            let is_reversed = length > 0.015 + 3.0 * way_deviation.min(0.02) && along < 0.1;
            let turns_otherwise =
                (turned - commanded).norm() > 0.6 * commanded.norm() + 0.03 + 4.0 * turn_deviation;
            odometry.contradicts = is_reversed || turns_otherwise;
            if length > 0.006 {
                odometry.score = 2.0 * (0.5 - along).clamp(-0.5, 1.0);
            }
            if odometry.contradicts {
                odometry.score += 5.0;
            }
        }
        if stirred || self.count == 0 {
            self.entries[self.count % Self::LENGTH] = now;
            self.count += 1;
        }
        odometry
    }
}
