//! What an estimator says of one image.

use nalgebra::{Matrix6, Vector3};

use crate::RelativePose;

/// How much of the pose the images support.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// Rotation and translation.
    Full,
    /// The rotation alone: there is no parallax that stands clear of the noise, or the depths are too uncertain for a translation to
    /// point the right way.
    RotationOnly,
    /// Rotation and translation, but the camera has not yet been seen to go where it was sent.
    Unconfirmed,
    /// Several poses are possible and command different things; this is the likeliest.
    Several,
}

/// A commanded motion of the camera, in its own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// The translation, in the unit of `t_21`.
    pub linear: Vector3<f64>,
    /// The rotation vector, in radians.
    pub angular: Vector3<f64>,
}

/// The pose of the current camera relative to the goal, as far as one image tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The current camera (2) relative to the goal (1), in the unit of the run.
    pub pose: RelativePose,
    /// The covariance of a small rotation from the left in radians, then of `t_21` in the unit of the run; `None` for an estimator
    /// that knows none.
    pub covariance: Option<Matrix6<f64>>,
    /// How many features it rests on.
    pub inliers: usize,
    /// Root mean square of their reprojection errors, on the plane z = 1; never NaN.
    pub residual: f64,
    /// How many answers fit about as well: 1 where the pose is settled.
    pub alternatives: usize,
    /// How much of the pose the images support.
    pub support: Support,
}

/// Why there is no pose that can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum HoldReason {
    /// The first images are being averaged, and their candidates tried.
    #[error("the first images are being averaged, and their candidates tried")]
    Starting,
    /// Too few features of the goal are seen.
    #[error("too few features of the goal are seen")]
    TooFewFeatures,
    /// The features determine no pose: they lie on a line, or coincide.
    #[error("the features determine no pose")]
    Degenerate,
    /// No pose explains the features by the goal's depths: wrong matches, or a scene that has changed.
    #[error("no pose explains the features by the goal's depths")]
    Inconsistent,
    /// The pose is further from the last one than the camera can have moved.
    #[error("the pose is further from the last one than the camera can have moved")]
    Jump,
    /// The covariance of the pose is too large to act on it.
    #[error("the pose is too uncertain")]
    Uncertain,
    /// The distance to the goal does not fall although the camera was told to move.
    #[error("the distance to the goal does not fall although the camera was told to move")]
    Diverging,
    /// The image is older than the last one, or too old.
    #[error("the image is older than the last one, or too old")]
    Stale,
}

impl HoldReason {
    /// The name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Starting => "starting",
            Self::TooFewFeatures => "too_few_features",
            Self::Degenerate => "degenerate",
            Self::Inconsistent => "inconsistent",
            Self::Jump => "jump",
            Self::Uncertain => "uncertain",
            Self::Diverging => "diverging",
            Self::Stale => "stale",
        }
    }
}

/// From images to poses: one pose a frame, or the reason why there is none.
pub trait PoseEstimator {
    /// The pose for one image. `features` has one entry for each feature of the goal, in the same order: the point on
    /// the plane z = 1 of the current camera, or `None` where it is not seen.
    ///
    /// # Errors
    /// The reason to hold.
    fn estimate(&mut self, features: &[Option<[f64; 2]>]) -> Result<Estimate, HoldReason>;

    /// Tells the estimator how the camera was commanded to move between the last image and the next one. It may compare its
    /// hypotheses with that.
    fn moved(&mut self, _motion: &Motion) {}

    /// Begins anew, but keeps what it knows of the commanded motion.
    fn restart(&mut self) {}

    /// Forgets everything but the goal and the depths that were given.
    fn reset(&mut self) {
        self.restart();
    }

    /// Which features agreed with the pose of the last image; empty for an estimator that does not say.
    fn inliers(&self) -> &[bool] {
        &[]
    }

    /// The pose of the camera at the start, as the estimator knows it now. `None` for an estimator that learns nothing on the way.
    fn begin(&self) -> Option<RelativePose> {
        None
    }

    /// How many hypotheses are alive.
    fn hypotheses(&self) -> usize {
        0
    }

    /// How often the estimator has begun anew.
    fn restarts(&self) -> usize {
        0
    }
}
