//! What a simulated camera sees, and what goes wrong with it.

use nalgebra::{UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::servo::controller::safety::on_plane;
use crate::{Camera, RelativePose};

/// The disturbances of the images.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Disturbances {
    /// Standard deviation of the Gaussian noise on every pixel coordinate.
    pub noise_px: f64,
    /// Whether pixels are rounded to whole numbers, after the noise.
    pub rounded: bool,
    /// The share of outliers: features that are found at a random place of the image.
    pub outliers: f64,
    /// Wrong matches that stay: how many and for how long. Descriptors make the same mistakes while a camera stands still.
    pub sticky: Option<Sticky>,
    /// The share of images that show the features as seen from somewhere else.
    pub wrong_images: f64,
    /// Delay of the images that the controller gets, in images.
    pub delay: usize,
    /// In the images of this range only so many features are found.
    pub lost: Option<(std::ops::Range<usize>, usize)>,
}

/// Wrong matches that stay the same for a while.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sticky {
    /// The share of features that are matched with another one.
    pub share: f64,
    /// The mean duration of a wrong match, in images; infinite where it stays for ever.
    pub images: f64,
}

/// The wrong matches of a run: of each feature the one that is taken for it, and how far beside.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mistakes(Vec<Option<(usize, [f64; 2])>>);

impl Mistakes {
    /// How far beside the other feature the match is, in pixels.
    const BESIDE: f64 = 3.0;

    /// Puts the wrong matches into an image, after some have changed.
    pub(crate) fn apply(
        &mut self,
        image: &mut [Option<[f64; 2]>],
        disturbances: &Disturbances,
        rng: &mut ChaCha8Rng,
    ) {
        let Some(Sticky { share, images }) = disturbances.sticky else { return };
        let n = image.len();
        let draw = |rng: &mut ChaCha8Rng| {
            let beside = [0; 2].map(|_| Self::BESIDE * rng.sample::<f64, _>(StandardNormal));
            (rng.random::<f64>() < share).then_some((rng.random_range(0..n), beside))
        };
        if self.0.is_empty() {
            self.0 = (0..n).map(|_| draw(rng)).collect();
        }
        for mistake in &mut self.0 {
            if rng.random::<f64>() < 1.0 / images {
                *mistake = draw(rng);
            }
        }
        let right = image.to_vec();
        for (pixel, mistake) in image.iter_mut().zip(&self.0) {
            if let Some((other, [du, dv])) = mistake {
                *pixel = right[*other].map(|[u, v]| [u + du, v + dv]);
            }
        }
    }
}

/// A camera with an image of known size, and its disturbances.
#[derive(Clone, Debug)]
pub(crate) struct Imaging<'a> {
    pub(crate) camera: &'a Camera,
    pub(crate) points: &'a [Vector3<f64>],
    pub(crate) disturbances: &'a Disturbances,
}

impl Imaging<'_> {
    /// The pixels of the features from a pose relative to the goal, without disturbance; `None` outside of the image.
    pub(crate) fn project(&self, pose: &RelativePose) -> impl Iterator<Item = Option<[f64; 2]>> {
        let pose = *pose;
        self.points.iter().map(move |x1| {
            let pixel = self.camera.project(&(pose.q_21 * x1 + pose.t_21)).ok()?;
            self.is_inside(pixel, 0.0).then_some(pixel)
        })
    }

    /// Whether a pixel is inside of the image, by so many pixels.
    pub(crate) fn is_inside(&self, pixel: [f64; 2], margin: f64) -> bool {
        let Some((width, height)) = self.camera.size() else { return true };
        let within = |x: f64, size: u32| x >= margin && x <= f64::from(size) - 1.0 - margin;
        within(pixel[0], width) && within(pixel[1], height)
    }

    /// The goal image: the mean of so many disturbed ones, without outliers.
    pub(crate) fn goal(&self, images: usize, rng: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
        let disturbed = |x1: &Vector3<f64>| {
            let pixel = self.camera.project(x1).unwrap_or([f64::NAN; 2]);
            let mut sum = [0.0; 2];
            for _ in 0..images.max(1) {
                let noisy = self.disturb(pixel, rng);
                sum = [sum[0] + noisy[0], sum[1] + noisy[1]];
            }
            sum.map(|s| s / images.max(1) as f64)
        };
        self.points.iter().map(disturbed).collect()
    }

    /// The image from a pose, with its disturbances, as image number `index`.
    pub(crate) fn image(
        &self,
        pose: &RelativePose,
        index: usize,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Option<[f64; 2]>> {
        let pose =
            if rng.random::<f64>() < self.disturbances.wrong_images { elsewhere(pose, rng) } else { *pose };
        let mut image: Vec<_> = self.project(&pose).collect();
        for pixel in image.iter_mut().flatten() {
            *pixel = self.disturb(*pixel, rng);
            if rng.random::<f64>() < self.disturbances.outliers {
                let (width, height) = self.camera.size().unwrap_or((640, 480));
                *pixel = [width, height].map(|size| rng.random_range(0.0..f64::from(size)));
            }
        }
        if let Some((images, found)) = &self.disturbances.lost
            && images.contains(&index)
        {
            image.iter_mut().skip(*found).for_each(|pixel| *pixel = None);
        }
        image
    }

    fn disturb(&self, pixel: [f64; 2], rng: &mut ChaCha8Rng) -> [f64; 2] {
        let Disturbances { noise_px, rounded, .. } = *self.disturbances;
        pixel.map(|c| {
            let normal: f64 = StandardNormal.sample(rng);
            let noisy = c + noise_px * normal;
            if rounded { noisy.round() } else { noisy }
        })
    }

    /// The image's features on the plane z = 1.
    pub(crate) fn on_plane(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        on_plane(self.camera, pixel)
    }
}

/// A pose that the camera does not have: turned by up to 17° about each axis, moved by up to half a metre along each.
fn elsewhere(pose: &RelativePose, rng: &mut ChaCha8Rng) -> RelativePose {
    let mut vector = |size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..size));
    let turn = UnitQuaternion::new(vector(0.3));
    RelativePose::new(turn * pose.q_21, turn * pose.t_21 + vector(0.5))
}
