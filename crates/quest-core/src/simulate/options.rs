//! What to simulate, and why it may be impossible.

use std::f64::consts::{FRAC_PI_6, TAU};

/// Where the points lie, in front of camera 1, within [`Boxes::points`]. Lengths are in the scene's own unit until everything is
/// scaled to a mean depth of 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layout {
    /// Uniform in the box.
    #[default]
    General,
    /// Uniform on a rectangle around the middle of the box, as wide and as high as the box, its normal uniform on the sphere.
    Coplanar,
}

/// The boxes that points and translations are drawn from. The paper says only that there are boxes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boxes {
    /// The least and the largest x, y and z of a point in the frame of camera 1; by default `[−1, 1]² × [2, 4]`.
    pub points: [[f64; 2]; 3],
    /// The largest absolute x, y and z of a translation; by default 1 each, which keeps camera 2 out of the box of the points for
    /// every rotation.
    pub translation: [f64; 3],
}

impl Default for Boxes {
    fn default() -> Self {
        Self { points: [[-1.0, 1.0], [-1.0, 1.0], [2.0, 4.0]], translation: [1.0; 3] }
    }
}

impl Boxes {
    /// The middle of the points' box, and half of its extent.
    pub(super) fn middle(&self) -> [[f64; 3]; 2] {
        [self.points.map(|[low, high]| 0.5 * (low + high)), self.points.map(|[low, high]| 0.5 * (high - low))]
    }

    /// Camera 1 has all points in front of it, and the translation some extent.
    fn check(&self) -> Result<(), SceneError> {
        let is_box = self.points.iter().all(|[low, high]| low < high && low.is_finite() && high.is_finite());
        let [centre, half] = self.middle();
        // A rectangle may have any orientation about the middle.
        let nearest = self.points[2][0].min(centre[2] - half[0].hypot(half[1]));
        if !is_box || nearest <= 0.0 {
            return Err(SceneError::PointsBox { found: self.points });
        }
        let extents = self.translation.iter();
        if !extents.clone().all(|x| x.is_finite() && *x >= 0.0) || extents.sum::<f64>() == 0.0 {
            return Err(SceneError::TranslationBox { found: self.translation });
        }
        Ok(())
    }
}

/// How camera 2 is moved. A translation is uniform in [`Boxes::translation`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Motion {
    /// Rotation and translation.
    #[default]
    General,
    /// Rotation and translation, the length of which is adjusted to this parallax, equation (63).
    /// In `[0, 1]`; figure 6 goes from 0 to 0.1.
    Parallax(f64),
    /// Rotation alone (figure 7).
    PureRotation,
    /// Translation alone (figure 8).
    PureTranslation,
}

/// The angle of the rotation, in radians. The axis is uniform on the sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Angle {
    /// Uniform from 0 to this angle; section 9 has 2π.
    UpTo(f64),
    /// Always this angle.
    Exactly(f64),
}

/// Which points count as seen by both cameras.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum View {
    /// Every point, as in section 9, in front of camera 2 or behind it.
    ///
    /// A point behind the camera is projected by (27) too: its image is `(x/z, y/z, 1)` and its true depth is
    /// negative. A point is drawn again only if it is so close to the plane `z = 0` of a camera that its image lies a
    /// thousand focal lengths off the axis.
    #[default]
    Everywhere,
    /// Points in front of both cameras and inside both images of 1024 × 768 pixels. Other points are drawn again.
    InBothImages,
}

/// What to simulate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneOptions {
    /// Where the points lie.
    pub layout: Layout,
    /// The sizes of what is drawn from.
    pub boxes: Boxes,
    /// How camera 2 is moved.
    pub motion: Motion,
    /// The angle of its rotation, unused for [`Motion::PureTranslation`].
    pub angle: Angle,
    /// Which points count as seen.
    pub view: View,
    /// The number of points.
    pub points: usize,
    /// Standard deviation of the Gaussian noise on every pixel coordinate, with K of (60).
    ///
    /// It is drawn after everything else: the same seed and index give the same scene, and proportional
    /// noise, at every level.
    pub noise_px: f64,
    /// Whether pixels, after the noise, are rounded to whole numbers.
    pub rounded: bool,
}

impl SceneOptions {
    /// What a camera sees: angles up to 30°, all points in front of both cameras and inside both images.
    #[must_use]
    pub fn realistic() -> Self {
        Self { angle: Angle::UpTo(FRAC_PI_6), view: View::InBothImages, ..Self::default() }
    }
}

impl Default for SceneOptions {
    /// Five general points, a general motion with angles up to 2π, no noise.
    fn default() -> Self {
        Self {
            layout: Layout::General,
            boxes: Boxes::default(),
            motion: Motion::General,
            angle: Angle::UpTo(TAU),
            view: View::Everywhere,
            points: 5,
            noise_px: 0.0,
            rounded: false,
        }
    }
}

impl SceneOptions {
    /// Refuses options that no scene can meet.
    pub(super) fn check(&self) -> Result<(), SceneError> {
        if self.points == 0 {
            return Err(SceneError::NoPoints);
        }
        self.boxes.check()?;
        if let Motion::Parallax(parallax) = self.motion
            && !(0.0..=1.0).contains(&parallax)
        {
            return Err(SceneError::Parallax { found: parallax });
        }
        let (Angle::UpTo(angle) | Angle::Exactly(angle)) = self.angle;
        if !(0.0..=TAU).contains(&angle) {
            return Err(SceneError::Angle { found: angle });
        }
        if !(self.noise_px >= 0.0 && self.noise_px.is_finite()) {
            return Err(SceneError::Noise { found: self.noise_px });
        }
        Ok(())
    }
}

/// Why there is no such scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A scene without points has no scale.
    #[error("found 0 points, expected at least 1")]
    NoPoints,
    /// The box of the points is none, or not in front of camera 1.
    #[error(
        "the box of the points is {found:?}, expected the least and the largest x, y and z, the largest larger, and every point \
         in front of camera 1, also those of a rectangle that is turned about the middle of the box"
    )]
    PointsBox {
        /// What was asked for.
        found: [[f64; 2]; 3],
    },
    /// The box of the translations has no extent, a negative one, or none that is finite.
    #[error(
        "the box of the translations is {found:?}, expected three finite numbers that are not negative, one of them positive"
    )]
    TranslationBox {
        /// What was asked for.
        found: [f64; 3],
    },
    /// The parallax is out of its range, or NaN.
    #[error("the parallax is {found}, expected a number from 0 to 1")]
    Parallax {
        /// What was asked for.
        found: f64,
    },
    /// The angle of the rotation is out of its range, or NaN.
    #[error("the rotation's angle is {found} rad, expected a number from 0 to 2π")]
    Angle {
        /// What was asked for.
        found: f64,
    },
    /// The noise is negative or not finite.
    #[error("the noise is {found} px, expected a finite number that is not negative")]
    Noise {
        /// What was asked for.
        found: f64,
    },
    /// No motion was found for which both cameras see the points.
    #[error("none of {attempts} random motions let both cameras see {points} points")]
    NotSeen {
        /// How many motions were tried.
        attempts: usize,
        /// How many points had to be seen.
        points: usize,
    },
    /// A point has no image: it lies on the plane `z = 0` of a camera, or is not finite.
    #[error("the images of the points: {0}")]
    Image(#[from] crate::InputError),
}
