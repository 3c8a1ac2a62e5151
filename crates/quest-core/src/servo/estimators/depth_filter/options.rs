//! What the filter is told of the images and the motion.

use crate::RelativePose;
use crate::servo::estimators::depth_filter::fit::Plane;
use crate::servo::twist::Limits;

/// What is known of the images and the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterOptions {
    /// Standard deviation of the coordinates in the current image on the plane z = 1: pixels divided by the focal length.
    pub noise: f64,
    /// The same of the goal image: smaller by √k where k goal images are averaged.
    pub goal_noise: f64,
    /// Fewer features than this are not acted on.
    pub min_features: usize,
    /// How much the inverse depths of the features at the goal differ from their mean, before anything is known of them:
    /// one standard deviation, as a share of the mean.
    pub spread: f64,
    /// The weight of one image in the goal's depths.
    pub frame_weight: f64,
    /// How many standard deviations an image, a feature or a motion may be off.
    pub gate: f64,
    /// The largest rotation from one image to the next, in radians.
    pub largest_turn: f64,
    /// The largest change of t from one image to the next, in the unit of the goal's depths.
    pub largest_move: f64,
    /// The number of images that are averaged before the camera is told to move. The depths of the first pair decide the way, and the
    /// noise of these images can still be averaged away.
    pub first_images: usize,
    /// The number of images without a pose after which the candidates are asked again. That takes several images too.
    pub patience: usize,
    /// For a robot that moves on a plane with a level camera: how exactly.
    pub plane: Option<Plane>,
    /// Where the camera is on the robot whose plane that is: takes points of the camera's frame to the base's, with the translation
    /// in the unit of the goal's depths. The identity for a level camera above the axle.
    pub base: RelativePose,
}

impl FilterOptions {
    /// What follows from the images and the limits: `noise` is the standard deviation of a coordinate on the plane z = 1, the goal's
    /// features are the mean of `goal_images`, `period` is the time from image to image in seconds, the features are at about `unit` metres.
    /// The camera may move half as fast again as it is told.
    #[must_use]
    pub fn for_images(noise: f64, goal_images: usize, limits: &Limits, period: f64, unit: f64) -> Self {
        Self {
            noise,
            goal_noise: noise / (goal_images.max(1) as f64).sqrt(),
            largest_turn: 1.5 * limits.turn_rate * period,
            largest_move: 1.5 * limits.speed * period / unit,
            ..Self::default()
        }
    }
}

impl Default for FilterOptions {
    /// Half a pixel at a focal length of 500, a free camera.
    fn default() -> Self {
        Self {
            noise: 1e-3,
            goal_noise: 1e-3,
            min_features: 5,
            spread: 0.3,
            frame_weight: 0.05,
            gate: 5.0,
            largest_turn: 0.1,
            largest_move: 0.1,
            first_images: 10,
            patience: 5,
            plane: None,
            base: RelativePose::identity(),
        }
    }
}
