//! What the filter is told of the images and the motion.

use crate::RelativePose;
use crate::servo::estimators::depth_filter::fit::Plane;
use crate::servo::twist::Limits;

/// What is known of the images and the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterOptions {
    /// Standard deviation of the coordinates in the current image on the plane z = 1: pixels divided by the focal length.
    ///
    /// That of the worst tenth of the matches will do. Where 25 of them or more show less, [`Tracker`](crate::servo::Tracker) judges
    /// its start by what they show.
    pub noise: f64,
    /// The same for the goal image. It is smaller by √k where k goal images are averaged.
    pub goal_noise: f64,
    /// With fewer features than this there is no pose.
    pub min_features: usize,
    /// The standard deviation of the features' inverse depths at the goal, as a share of their mean, before anything is known of
    /// them.
    pub spread: f64,
    /// The weight of one image in the goal's depths.
    pub frame_weight: f64,
    /// How many standard deviations an image, a feature or a motion may be off.
    pub gate: f64,
    /// The largest rotation from one image to the next, in radians.
    pub largest_turn: f64,
    /// The largest change of t from one image to the next, in the unit of the goal's depths.
    pub largest_move: f64,
    /// The number of images that are averaged before the camera is told to move. The depths from their mean decide the first way,
    /// and only while the camera stands still can noise be averaged away.
    pub first_images: usize,
    /// After so many images without a pose the source is asked for candidates again. The search takes several more images.
    pub patience: usize,
    /// How exactly a robot with a level camera keeps to its plane; `None` for a free camera.
    pub plane: Option<Plane>,
    /// Where the camera is on that robot. The pose takes points of the camera's frame to the base's; its translation is in the unit
    /// of the goal's depths. It is the identity for a level camera above the axle.
    pub base: RelativePose,
}

impl FilterOptions {
    /// The options that follow from the images and the limits.
    ///
    /// `noise` is the standard deviation of a coordinate on the plane z = 1. The goal's features are the mean of `goal_images`
    /// images. `period` is the time from one image to the next, in seconds. The features are at about `unit` metres. The camera may
    /// move half as fast again as it is commanded.
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
