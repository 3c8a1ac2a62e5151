//! An image pair: cameras, matches, and the other data that a file has about them.

use nalgebra::{UnitQuaternion, Vector3};
use quest_core::coordinates::{look_like_image_points, look_like_pixels};
use quest_core::correspondence::Usable;
use quest_core::{Camera, Correspondence, InputError, MatchError, RelativePose};

use crate::error::{Fault, Place, ReadError};

/// The matches of two images, with what is known of the cameras and of the true pose.
#[derive(Clone, Debug, Default)]
pub struct Pair {
    /// What the file calls the pair.
    pub name: Option<String>,
    /// The key that the file gives the pair, which seeds its search in place of its number.
    pub key: Option<u64>,
    /// The cameras of view 1 and view 2; without them `matches` are on the planes `z = 1`.
    pub cameras: Option<[Camera; 2]>,
    /// `u1, v1, u2, v2` of each match. A coordinate that the file gives as NaN, infinite or missing is NaN.
    pub matches: Vec<[f64; 4]>,
    /// The first such coordinate.
    pub first_gap: Option<Gap>,
    /// One score for each match; higher is better.
    pub scores: Option<Vec<f64>>,
    /// The true pose.
    pub truth: Truth,
    /// Where the pair was read: the file, and the line of a JSON Lines file.
    pub place: Place,
    /// Keys or columns that are not known, in the order of the file. They were ignored.
    pub unknown_keys: Vec<String>,
}

/// A coordinate of a match that is no finite number. An estimate takes its match for an outlier.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gap {
    /// Where it stands.
    pub place: Place,
    /// What was found, and what was expected.
    pub message: String,
}

impl From<Gap> for ReadError {
    fn from(gap: Gap) -> Self {
        gap.place.error(Fault::Coordinate(gap.message))
    }
}

/// The ground truth of a pair, as far as the file has it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Truth {
    /// The true rotation.
    pub q_21: Option<UnitQuaternion<f64>>,
    /// The true translation; only its direction is compared.
    pub t_21: Option<Vector3<f64>>,
}

impl Pair {
    /// The matches as pairs of bearings, through the cameras where there are any.
    ///
    /// # Errors
    /// The first coordinate that is no finite number, and the first match that has no bearings, with its place.
    pub fn correspondences(&self) -> Result<Vec<Correspondence>, ReadError> {
        if let Some(gap) = &self.first_gap {
            return Err(gap.clone().into());
        }
        let each = self.matches.iter().enumerate();
        let refuse = |index, source| self.refuse(InputError::Match { index, source });
        each.map(|(index, m)| self.one(*m).map_err(|source| refuse(index, source))).collect()
    }

    /// The matches that have bearings, and which do not: to an estimate they are outliers.
    #[must_use]
    pub fn usable(&self) -> Usable {
        self.matches.iter().map(|m| self.one(*m)).collect()
    }

    fn one(&self, [u1, v1, u2, v2]: [f64; 4]) -> Result<Correspondence, MatchError> {
        match &self.cameras {
            Some([camera1, camera2]) => Correspondence::from_pixels(camera1, [u1, v1], camera2, [u2, v2]),
            None => Correspondence::from_image_points([u1, v1], [u2, v2]),
        }
    }

    /// The error that the matches of this pair are unusable, with their place.
    #[must_use]
    pub fn refuse(&self, error: InputError) -> ReadError {
        match error {
            InputError::Match { index, source } => {
                self.place.at_key(format!("matches[{index}]")).error(source)
            }
            other => self.place.at_key("matches").error(other),
        }
    }

    /// Whether there is no camera, and most matches are farther from the axis than a camera sees on the plane `z = 1`.
    #[must_use]
    pub fn looks_like_pixels(&self) -> bool {
        self.cameras.is_none() && look_like_pixels(&self.matches)
    }

    /// Whether there are cameras, and all matches are where no image's features are but points of the plane `z = 1`.
    #[must_use]
    pub fn looks_like_image_points(&self) -> bool {
        self.cameras.is_some_and(|cameras| cameras.iter().all(|c| look_like_image_points(&self.matches, c)))
    }

    /// The mean focal length of the two cameras in pixels, `None` without cameras.
    #[must_use]
    pub fn focal_length(&self) -> Option<f64> {
        let lengths = self.cameras?.map(|camera| camera.focal_lengths());
        Some(lengths.iter().map(|(fx, fy)| fx + fy).sum::<f64>() / 4.0)
    }
}

impl Truth {
    /// The angle in degrees between the true rotation and that of `pose`.
    #[must_use]
    pub fn rotation_error_deg(&self, pose: &RelativePose) -> Option<f64> {
        let truth = RelativePose::new(self.q_21?, Vector3::zeros());
        Some(pose.rotation_error(&truth).to_degrees())
    }

    /// The angle in degrees between the true translation and that of `pose`; `None` where one of them vanishes.
    #[must_use]
    pub fn translation_error_deg(&self, pose: &RelativePose) -> Option<f64> {
        let t_21 = self.t_21?;
        // Lengths that cannot be squared are brought to 1 first.
        let truth = RelativePose::new(UnitQuaternion::identity(), t_21.unscale(t_21.amax()));
        let error = pose.translation_error(&truth)?.to_degrees();
        error.is_finite().then_some(error)
    }
}
