//! The closed loop, simulated: images of a scene, a controller, a plant.

use std::collections::VecDeque;

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;

use crate::servo::controller::Servo;
use crate::servo::controller::safety::Border;
use crate::servo::controller::state::Step;
use crate::servo::estimators::estimate::PoseEstimator;
use crate::servo::simulation::imaging::{Disturbances, Imaging, Mistakes};
use crate::servo::{ControlLaw, FilterOptions, Limits, Plant};
use crate::{Camera, RelativePose};

/// What a robot sees and how often.
#[derive(Clone, Debug)]
pub struct World {
    /// The features in the goal's frame, in metres.
    pub points: Vec<Vector3<f64>>,
    /// The camera, with the size of its image.
    pub camera: Camera,
    /// What is wrong with its images.
    pub disturbances: Disturbances,
    /// How many goal images are averaged.
    pub goal_images: usize,
    /// The time from one image to the next, in seconds.
    pub period: f64,
}

/// One image of a run.
#[derive(Clone, Debug)]
pub struct Record {
    /// In seconds.
    pub time: f64,
    /// The true pose of the current camera relative to the goal, in metres.
    pub truth: RelativePose,
    /// What the camera saw in pixels, as the controller got it.
    pub pixels: Vec<Option<[f64; 2]>>,
    /// The same on the plane z = 1.
    pub features: Vec<Option<[f64; 2]>>,
    /// What the controller made of it.
    pub step: Step,
}

impl World {
    fn imaging(&self) -> Imaging<'_> {
        Imaging { camera: &self.camera, points: &self.points, disturbances: &self.disturbances }
    }

    /// A goal image, in pixels. NaN for a feature that the goal does not see.
    #[must_use]
    pub fn goal_pixels(&self, rng: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
        self.imaging().goal(self.goal_images, rng)
    }

    /// Pixels on the plane z = 1; NaN for one without a viewing ray.
    #[must_use]
    pub fn on_plane(&self, pixels: &[[f64; 2]]) -> Vec<[f64; 2]> {
        pixels.iter().map(|&p| self.imaging().on_plane(p).unwrap_or([f64::NAN; 2])).collect()
    }

    /// The estimator's options for these images. They have the noise on the plane z = 1, rounding included, and the largest motion
    /// from one image to the next: that of the limits at this frame rate, with the features at about `unit` metres.
    #[must_use]
    pub fn filter_options(&self, limits: &Limits, unit: f64) -> FilterOptions {
        // Exact pixels are given a twentieth of a pixel: a standard deviation of zero has no inverse.
        const LEAST_PX: f64 = 0.05;
        let Disturbances { noise_px, rounded, .. } = self.disturbances;
        let variance = noise_px * noise_px + if rounded { 1.0 / 12.0 } else { 0.0 };
        let noise = variance.sqrt().max(LEAST_PX) / self.camera.focal_lengths().0;
        FilterOptions::for_images(noise, self.goal_images, limits, self.period, unit)
    }

    /// The image without `margin` pixels at the left and the right; `None` for a camera without a size.
    #[must_use]
    pub fn border(&self, margin: f64) -> Option<Border> {
        Border::of_camera(&self.camera, margin)
    }

    /// Whether all features are at least `margin` pixels inside of the image.
    #[must_use]
    pub fn sees_all(&self, pose: &RelativePose, margin: f64) -> bool {
        let imaging = self.imaging();
        imaging.project(pose).all(|pixel| pixel.is_some_and(|p| imaging.is_inside(p, margin)))
    }

    /// How many features are in the image from a pose.
    #[must_use]
    pub fn seen_from(&self, pose: &RelativePose) -> usize {
        self.imaging().project(pose).flatten().count()
    }

    /// Whether a law keeps all features in view for `images` images. It gets the true pose, in the unit of `unit` metres.
    #[must_use]
    pub fn stays_in_view(
        &self,
        mut plant: impl Plant,
        mut law: impl ControlLaw,
        limits: &Limits,
        unit: f64,
        images: usize,
    ) -> bool {
        (0..images).all(|_| {
            let pose = plant.pose();
            let command = law.command(&RelativePose::new(pose.q_21, pose.t_21 / unit));
            plant.advance(&limits.apply(&command), self.period);
            self.sees_all(&pose, 0.0)
        })
    }

    /// Runs the loop for `images` images; `watch` sees each and may end the run by returning `false`.
    pub fn run<E: PoseEstimator, L: ControlLaw>(
        &self,
        plant: &mut impl Plant,
        servo: &mut Servo<E, L>,
        images: usize,
        rng: &mut ChaCha8Rng,
        mut watch: impl FnMut(&Record) -> bool,
    ) {
        let imaging = self.imaging();
        let mut waiting = VecDeque::new();
        let mut mistakes = Mistakes::default();
        for index in 0..images {
            let mut image = imaging.image(&plant.pose(), index, rng);
            mistakes.apply(&mut image, &self.disturbances, rng);
            waiting.push_back(image);
            // Before the first image has come through, there is none.
            let late = waiting.len() > self.disturbances.delay;
            let pixels = if late { waiting.pop_front() } else { None };
            let pixels = pixels.unwrap_or_else(|| vec![None; self.points.len()]);
            let features: Vec<_> = pixels.iter().map(|p| p.and_then(|p| imaging.on_plane(p))).collect();
            let step = servo.step(&features);
            let time = index as f64 * self.period;
            let record = Record { time, truth: plant.pose(), pixels, features, step };
            if !watch(&record) {
                return;
            }
            plant.advance(&step.command, self.period);
        }
    }
}
