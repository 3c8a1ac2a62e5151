//! What an estimate says.

use nalgebra::Matrix6;

use crate::RelativePose;

/// Which model of the scene and the motion the matches support.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Model {
    /// Points in space, a translation.
    General,
    /// Points on a plane, a translation: there may be a second pose.
    Planar,
    /// No translation is evident. The rotation and the covariance take into account that there may be a small one; the
    /// translation is its mean, of no meaning where it is within its covariance.
    PureRotation,
}

impl Model {
    /// The name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::General => "general",
            Self::Planar => "planar",
            Self::PureRotation => "pure_rotation",
        }
    }
}

/// Another pose that the matches may mean.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RunnerUp {
    /// The pose, in a scale of its own: its mean absolute depth is one as well.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub pose: RelativePose,
    /// As [`Estimate::score`].
    pub score: f64,
    /// Matches within the threshold and in front of both cameras.
    pub inlier_count: usize,
}

/// How far off the inliers are under each model: the median residual in pixels of the focal lengths.
///
/// A rotation and a plane take a point to a point, which leaves two numbers a match; the essential matrix takes it to
/// a line, which leaves one. So even a true plane has a larger median than the general model.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Evidence {
    /// Under the best rotation without translation; infinite where that leaves most of the points behind camera 2.
    #[cfg_attr(feature = "serde", serde(with = "crate::serial::or_infinite"))]
    pub rotation_px: f64,
    /// Under the best plane; infinite where none was found.
    #[cfg_attr(feature = "serde", serde(with = "crate::serial::or_infinite"))]
    pub planar_px: f64,
    /// Under the essential matrix.
    pub general_px: f64,
}

/// One pose from matches with outliers, and what is known of it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate {
    /// Which model the matches support.
    pub model: Model,
    /// The pose. The mean absolute depth of the inliers over both views is one, so that `|t_21|` is the parallax.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub pose: RelativePose,
    /// Covariance of `(ω, t_21)`: the rotation vector in radians of the error `exp([ω]×) R_21`, in the frame of camera 2, and
    /// the translation.
    #[cfg_attr(feature = "serde", serde(with = "crate::serial::rows"))]
    pub covariance: Matrix6<f64>,
    /// Which matches are within the threshold of the pose and in front of both cameras, in the caller's order. Where
    /// matches share a keypoint, only the one that agrees best is an inlier, with its copies.
    pub inliers: Vec<bool>,
    /// How many of them there are.
    pub inlier_count: usize,
    /// How well the pose explains all matches, from zero to one.
    pub score: f64,
    /// Samples drawn.
    pub iterations: usize,
    /// The pose that explains the matches nearly as well, where there is one: of a plane, of few matches, and where the parallax
    /// is so small that noise decides between two.
    pub runner_up: Option<RunnerUp>,
    /// How well each model fits.
    pub evidence: Evidence,
    /// The standard deviation of the inliers' Sampson errors, in pixels of the focal lengths.
    pub noise_px: f64,
    /// The normal of the plane in view 1 over its distance, in the scale of the pose: `R_21 + t_21 normalᵀ` takes points of view 1 to
    /// view 2. Where the model is [`Model::Planar`] alone.
    pub normal: Option<[f64; 3]>,
    /// The share of false matches that the threshold accepts, measured on the points of view 1 with those of view 2 shifted
    /// against them. Above some tenths the threshold is far too wide: is it in the unit of the points?
    pub false_share: f64,
    /// Matches that were set aside because they did not move at all while the others did: an overlay, dirt on the lens. The pose is
    /// that of the others.
    pub unmoved: usize,
}
