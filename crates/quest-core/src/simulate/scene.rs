//! One random scene.

use nalgebra::{UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;

use super::long::image2;
use super::sampling::{self, Region};
use super::{Motion, SceneError, SceneOptions, View, is_inside_image, pixel_to_plane, plane_to_pixel};
use crate::{Correspondence, InputError, RelativePose, correspondence};

/// Images further from the optical axis than this, on the plane `z = 1`, are drawn again.
const LARGEST_IMAGE_COORDINATE: f64 = 1e3;
/// How many motions are tried.
const MAX_MOTIONS: usize = 2_000;
/// How often one point is drawn, at a given motion, until both cameras see it.
const MAX_DRAWS: usize = 200;
/// How often the length of t, and then the points that are not seen with it, are computed again.
const MAX_ROUNDS: usize = 50;

/// Points seen by two cameras, and the pose between them.
///
/// Everything is scaled so that the mean absolute depth over both views is 1: `|t_21|` is the parallax of (63).
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The true pose.
    pub truth: RelativePose,
    /// The points in the frame of camera 1.
    pub points1: Vec<Vector3<f64>>,
    /// Their images on the planes `z = 1`, by (27), with noise if there is any; without, rounded once.
    pub matches: Vec<Correspondence>,
}

impl Scene {
    /// The scene number `index` of the sequence `seed`. The same two numbers and options give the same scene
    /// everywhere, whatever else was generated before.
    ///
    /// # Errors
    /// [`SceneError`] for options that no scene can meet, or for which none was found.
    pub fn generate(options: &SceneOptions, seed: u64, index: u64) -> Result<Self, SceneError> {
        Self::with_further(options, 0, seed, index).map(|(scene, _)| scene)
    }

    /// The same scene, and matches of this many further points, which are seen and disturbed like its own. With
    /// [`View::Everywhere`] a point may lie behind camera 2. Its bearing then points backwards, as that of an all-round
    /// camera does, so its depth is known to be positive.
    ///
    /// The further points are drawn last. The scene does not depend on their number, and its scale and parallax are those
    /// of its own points.
    ///
    /// # Errors
    /// Those of [`Scene::generate`].
    pub fn with_further(
        options: &SceneOptions,
        further: usize,
        seed: u64,
        index: u64,
    ) -> Result<(Self, Vec<Correspondence>), SceneError> {
        options.check()?;
        let mut rng = sampling::generator(seed, index);
        for _ in 0..MAX_MOTIONS {
            let draft = Draft::new(&mut rng, options);
            let Some((t_21, points1)) = draft.fill(&mut rng, options) else { continue };
            let pose = RelativePose::new(draft.q_21, t_21);
            let mut scene = Self::from_points(pose, points1)?;
            if options.noise_px > 0.0 || options.rounded {
                scene.matches = observe(&mut rng, options, &scene.truth, &scene.points1)?;
            }
            if let Some(points1) = draft.further(&mut rng, options, &t_21, further) {
                let mut matches = observe(&mut rng, options, &pose, &points1)?;
                for (index, m) in matches.iter_mut().enumerate() {
                    if (pose.q_21 * points1[index] + t_21).z < 0.0 {
                        let backwards =
                            Correspondence::from_bearings((*m.bearing1()).into(), (-m.bearing2()).into());
                        *m = backwards.map_err(|source| InputError::Match { index, source })?;
                    }
                }
                return Ok((scene, matches));
            }
        }
        Err(SceneError::NotSeen { attempts: MAX_MOTIONS, points: options.points })
    }

    /// The noise-free scene of these points, given in the frame of camera 1, and this pose. Both are rescaled to
    /// a mean absolute depth of 1.
    ///
    /// # Errors
    /// [`SceneError::NoPoints`], and [`SceneError::Image`] where a point has no image in one of the cameras.
    pub fn from_points(pose: RelativePose, points1: Vec<Vector3<f64>>) -> Result<Self, SceneError> {
        if points1.is_empty() {
            return Err(SceneError::NoPoints);
        }
        let images1: Vec<_> = points1.iter().map(|x1| image(*x1)).collect();
        let images2: Vec<_> = points1.iter().map(|x1| image2(&pose.q_21, &pose.t_21, x1)).collect();
        let matches = correspondence::from_image_points(&images1, &images2)?;
        let scale = 1.0 / mean_depth(&pose.q_21, &pose.t_21, &points1);
        let truth = RelativePose::new(pose.q_21, pose.t_21 * scale);
        Ok(Self { truth, points1: points1.into_iter().map(|x1| x1 * scale).collect(), matches })
    }

    /// The points in the frame of camera 2, by (28).
    pub fn points2(&self) -> impl Iterator<Item = Vector3<f64>> {
        self.points1.iter().map(|x1| self.truth.q_21 * x1 + self.truth.t_21)
    }
}

/// The images of points in both cameras, with Gaussian noise and rounding in pixels with K of (60).
fn observe(
    rng: &mut ChaCha8Rng,
    options: &SceneOptions,
    pose: &RelativePose,
    points1: &[Vector3<f64>],
) -> Result<Vec<Correspondence>, SceneError> {
    let mut disturbed = |x: Vector3<f64>| {
        let m = image(x);
        if options.noise_px == 0.0 && !options.rounded {
            return m;
        }
        let pixel = plane_to_pixel(m).map(|c| c + options.noise_px * sampling::normal(rng));
        pixel_to_plane(if options.rounded { pixel.map(f64::round) } else { pixel })
    };
    let (mut images1, mut images2) = (Vec::new(), Vec::new());
    for x1 in points1 {
        images1.push(disturbed(*x1));
        images2.push(disturbed(pose.q_21 * x1 + pose.t_21));
    }
    Ok(correspondence::from_image_points(&images1, &images2)?)
}

/// A motion and a place for the points, before it is known whether the cameras see them.
struct Draft {
    q_21: UnitQuaternion<f64>,
    /// The translation, or, where the parallax is given, its direction.
    t_21: Vector3<f64>,
    region: Region,
}

impl Draft {
    fn new(rng: &mut ChaCha8Rng, options: &SceneOptions) -> Self {
        // Every motion draws the same numbers: scenes of the same seed and index that differ only in their
        // motion can be compared.
        let q_21 = sampling::rotation(rng, options.motion, options.angle);
        let t_21 = sampling::translation(rng, &options.boxes);
        let t_21 = match options.motion {
            Motion::General | Motion::PureTranslation => t_21,
            Motion::Parallax(_) => t_21.normalize(),
            Motion::PureRotation => Vector3::zeros(),
        };
        Self { q_21, t_21, region: Region::new(rng, options.layout, &options.boxes) }
    }

    /// Draws the points. With a given parallax the length of t depends on all points, and whether a point is seen
    /// depends on t, so both are computed in turn until they agree.
    fn fill(
        &self,
        rng: &mut ChaCha8Rng,
        options: &SceneOptions,
    ) -> Option<(Vector3<f64>, Vec<Vector3<f64>>)> {
        let mut points: Vec<_> = (0..options.points).map(|_| self.region.point(rng)).collect();
        for _ in 0..MAX_ROUNDS {
            let t_21 = self.translation(options.motion, &points);
            let seen = |x1: &Vector3<f64>| self.sees(options.view, &t_21, x1);
            if points.iter().all(seen) {
                return Some((t_21, points));
            }
            for point in points.iter_mut().filter(|p| !seen(p)) {
                *point = (0..MAX_DRAWS).map(|_| self.region.point(rng)).find(seen)?;
            }
        }
        None
    }

    /// Further points that both cameras see; `None` if they are too hard to find.
    fn further(
        &self,
        rng: &mut ChaCha8Rng,
        options: &SceneOptions,
        t_21: &Vector3<f64>,
        count: usize,
    ) -> Option<Vec<Vector3<f64>>> {
        // Others of this region were seen already: it takes a while, but is hardly ever in vain.
        let seen = |x1: &Vector3<f64>| self.sees(options.view, t_21, x1);
        let mut draw = || (0..50 * MAX_DRAWS).map(|_| self.region.point(rng)).find(seen);
        (0..count).map(|_| draw()).collect()
    }

    fn sees(&self, view: View, t_21: &Vector3<f64>, x1: &Vector3<f64>) -> bool {
        is_seen(*x1, view) && is_seen(self.q_21 * x1 + t_21, view)
    }

    /// The translation, of length `s = p m(s)` where the parallax p is given; m(s) is the mean depth.
    fn translation(&self, motion: Motion, points: &[Vector3<f64>]) -> Vector3<f64> {
        let Motion::Parallax(parallax) = motion else { return self.t_21 };
        let mut t_21 = Vector3::zeros();
        // m changes by at most s/2, so that each step halves the error at least: 64 reach the last digit.
        for _ in 0..64 {
            t_21 = self.t_21 * (parallax * mean_depth(&self.q_21, &t_21, points));
        }
        t_21
    }
}

/// The projection (27).
fn image(x: Vector3<f64>) -> [f64; 2] {
    [x.x / x.z, x.y / x.z]
}

fn is_seen(x: Vector3<f64>, view: View) -> bool {
    let m = image(x);
    match view {
        View::Everywhere => m.iter().all(|c| c.abs() <= LARGEST_IMAGE_COORDINATE),
        View::InBothImages => x.z > 0.0 && is_inside_image(plane_to_pixel(m)),
    }
}

/// The mean absolute depth over both views, the denominator of (63).
fn mean_depth(q_21: &UnitQuaternion<f64>, t_21: &Vector3<f64>, points1: &[Vector3<f64>]) -> f64 {
    let sum: f64 = points1.iter().map(|x1| x1.z.abs() + (q_21 * x1 + t_21).z.abs()).sum();
    sum / (2 * points1.len()) as f64
}
