//! What an estimator says of one image.

use nalgebra::Matrix6;

use crate::RelativePose;

/// The pose of the current camera relative to the goal, as far as one image tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The current camera (2) relative to the goal (1), in the unit of the run.
    pub pose: RelativePose,
    /// The covariance of a small rotation from the left in radians, then of `t_21` in the unit of the run. Of the images
    /// alone where the estimator has no other; infinite on the diagonal where nothing is known.
    pub covariance: Matrix6<f64>,
    /// How many features it rests on.
    pub inliers: usize,
    /// Root mean square of their reprojection errors, on the plane z = 1; NaN never.
    pub residual: f64,
    /// How many answers fit about as well: 1 where the pose is settled.
    pub alternatives: usize,
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
}
