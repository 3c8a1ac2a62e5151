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

    /// Whether two hypotheses have come to the same answer: of one class, and all key images at one place.
    pub(crate) fn is_one_with(&self, other: &Self) -> bool {
        let same = |a: &RelativePose, b: &RelativePose| {
            a.rotation_error(b) < 1e-3 && (a.t_21 - b.t_21).norm() < 1e-3
        };
        let (a, b) = (&self.map, &other.map);
        a.is_planar() == b.is_planar()
            && a.keys.len() == b.keys.len()
            && a.keys.iter().zip(&b.keys).all(|(a, b)| same(a, b))
            && self.fit.zip(other.fit).is_some_and(|(a, b)| same(&a.pose, &b.pose))
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

/// The way of the camera as a hypothesis sees it, beside the commanded way.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Track {
    entries: [Entry; Track::LENGTH],
    count: usize,
    /// Where the way that is judged next began, and so many images ago.
    anchor: Option<Entry>,
    since: usize,
    /// Where it all began, and the last image.
    begin: Option<Entry>,
    last: Option<Entry>,
    /// The mean square of how far a pose is from where the commands took the last one, over so many images.
    scatter: f64,
    judged: usize,
    /// Whether the camera has been seen to go where it was sent.
    pub(crate) is_confirmed: bool,
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
    /// Whether the camera went the other way, over a way that says something.
    pub(crate) is_reversed: bool,
}

impl Track {
    /// Over so many entries: three images of delay leave five.
    const LENGTH: usize = 9;
    /// An entry is added after so much motion, so that slow cameras and fast images do not shorten the window to nothing.
    const STEP: f64 = 2e-3;
    /// A way is judged after so many images, of which three may be delayed,
    const IMAGES: usize = 6;
    /// and once it is longer than the sum of this and so many standard deviations of a pose.
    const WAY: f64 = 4e-3;
    const DEVIATIONS: f64 = 5.0;
    /// At this length it is judged whether the camera went the other way, whatever the standard deviations are.
    const LONG_WAY: f64 = 0.1;
    /// An unconfirmed pose takes the camera no further from the start than this.
    const UNCONFIRMED: f64 = 0.2;
    /// The weight of an image in the scatter of the poses.
    const WEIGHT: f64 = 0.1;
    /// A pose is confirmed where the motion seen is within 25° of the commanded one: its cosine. With 60° 19 of 5,000 hostile runs were wild,
    /// with 25° 10; as many arrive.
    const CONFIRMS: f64 = 0.9;

    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Whether the camera was told to go anywhere.
    pub(crate) fn has_moved(&self) -> bool {
        self.way.norm() > 0.01
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
        let deviation = way_deviation.max(self.scatter_with(&now));
        let is_reversed = self.judge_way(&now, deviation);
        let mut odometry = Odometry { score: 0.0, contradicts: is_reversed, is_reversed };
        let last = self.entries[(self.count + Self::LENGTH - 1) % Self::LENGTH];
        let stirred = (now.way - last.way).norm() + now.turn.angle_to(&last.turn) > Self::STEP;
        if self.count >= Self::LENGTH && stirred {
            let first = self.entries[self.count % Self::LENGTH];
            let (way, moved) = (now.way - first.way, now.centre - first.centre);
            let length = way.norm();
            let commanded = (now.turn * first.turn.inverse()).scaled_axis();
            let turned = (now.q_21 * first.q_21.inverse()).scaled_axis();
            odometry.contradicts |=
                (turned - commanded).norm() > 0.6 * commanded.norm() + 0.03 + 4.0 * turn_deviation;
            if length > 0.006 {
                let along = moved.dot(&way) / length.powi(2);
                odometry.score = 2.0 * (0.5 - along).clamp(-0.5, 1.0);
            }
        }
        if odometry.contradicts {
            odometry.score += 5.0;
            self.is_confirmed = false;
        }
        if stirred || self.count == 0 {
            self.entries[self.count % Self::LENGTH] = now;
            self.count += 1;
        }
        odometry
    }

    /// Takes in how far this pose is from where the commands took the last one; the standard deviation of a pose by that. Wrong
    /// poses scatter more than their covariance says.
    fn scatter_with(&mut self, now: &Entry) -> f64 {
        if let Some(last) = self.last.replace(*now) {
            let off = ((now.centre - last.centre) - (now.way - last.way)).norm_squared();
            self.judged += 1;
            let weight = Self::WEIGHT.max(1.0 / self.judged as f64);
            self.scatter += weight * (off - self.scatter);
        }
        // Of a difference of two.
        (0.5 * self.scatter).sqrt()
    }

    /// Judges the way since the last judgement, once it is long enough: whether it contradicts the commands.
    ///
    /// The sign alone counts, for the unit is a guess. By the reversed scene the camera goes the other way.
    fn judge_way(&mut self, now: &Entry, deviation: f64) -> bool {
        let begin = *self.begin.get_or_insert(*now);
        let first = *self.anchor.get_or_insert(*now);
        self.since += 1;
        let (way, moved) = (now.way - first.way, now.centre - first.centre);
        let length = way.norm();
        let full = Self::WAY + Self::DEVIATIONS * deviation;
        if self.since <= Self::IMAGES || length < full.min(Self::LONG_WAY) || length.is_nan() {
            return false;
        }
        let along = moved.dot(&way);
        // Unseen motion contradicts too.
        if along < 0.1 * length * length {
            (self.anchor, self.since) = (Some(*now), 0);
            return true;
        }
        if length >= full {
            (self.anchor, self.since) = (Some(*now), 0);
            self.is_confirmed |= along > Self::CONFIRMS * moved.norm() * length;
        }
        !self.is_confirmed && (now.way - begin.way).norm() > Self::UNCONFIRMED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera that turns and moves as it is told, as a hypothesis sees it whose centres are stretched by `stretch`.
    fn judged(stretch: f64, images: usize) -> (Vec<Odometry>, Track) {
        let motion =
            Motion { linear: Vector3::new(0.004, -0.002, 0.003), angular: Vector3::new(0.0, 0.01, 0.005) };
        let (mut track, mut truth) = (Track::default(), RelativePose::identity());
        let mut all = Vec::new();
        for _ in 0..images {
            let centre = truth.inverse().t_21 * stretch;
            let seen = RelativePose::new(truth.q_21, -(truth.q_21 * centre));
            all.push(track.judge(&seen, 1e-3, 1e-3));
            track.moved(&motion, &truth);
            let turn = UnitQuaternion::new(-motion.angular);
            truth = RelativePose::new(turn * truth.q_21, turn * truth.t_21 - motion.linear);
        }
        (all, track)
    }

    #[test]
    fn a_camera_that_goes_where_it_is_sent_is_confirmed_whatever_its_unit() {
        for stretch in [0.2, 1.0, 5.0] {
            let (all, track) = judged(stretch, 40);
            assert!(track.is_confirmed, "{stretch}");
            assert!(all.iter().all(|o| !o.contradicts && !o.is_reversed), "{stretch}");
        }
    }

    #[test]
    fn the_reversed_scene_is_found_out_within_a_few_images() {
        let (all, track) = judged(-1.0, 12);
        assert!(all.iter().any(|o| o.is_reversed) && !track.is_confirmed);
    }

    #[test]
    fn nothing_is_said_of_a_camera_that_stands_still() {
        let mut track = Track::default();
        let still = Motion { linear: Vector3::zeros(), angular: Vector3::zeros() };
        for k in 0..40 {
            let noisy = RelativePose::new(UnitQuaternion::identity(), Vector3::x() * 1e-3 * f64::from(k % 3));
            let odometry = track.judge(&noisy, 1e-3, 1e-3);
            assert!(!odometry.contradicts && !track.is_confirmed);
            track.moved(&still, &noisy);
        }
    }
}
