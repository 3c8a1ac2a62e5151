//! What can be wrong with a camera, a pixel or a point.

use super::CameraModel;

/// Why a camera, or a pixel or point given to it, was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// There is no model of that name.
    #[error("unknown camera model {found:?}, expected one of {}", known_names())]
    UnknownModel {
        /// The name that was found.
        found: String,
    },
    /// The number of parameters does not fit the model.
    #[error("{model} takes {expected} parameters ({}), found {found}", .model.param_names().join(", "))]
    ParameterCount {
        /// The model that was named.
        model: CameraModel,
        /// How many parameters it takes.
        expected: usize,
        /// How many were given.
        found: usize,
    },
    /// A parameter is NaN or infinite, or too large to compute with.
    #[error("parameter {name} of the camera is {found}, expected a finite number of magnitude at most 1e30")]
    ParameterNotFinite {
        /// The parameter's name, as in [`CameraModel::param_names`].
        name: &'static str,
        /// What was found.
        found: f64,
    },
    /// A focal length is zero or negative.
    #[error("focal length {name} of the camera is {found} pixels, expected a positive number")]
    FocalLength {
        /// The parameter's name.
        name: &'static str,
        /// What was found, in pixels.
        found: f64,
    },
    /// A parameter lies outside of its range.
    #[error("parameter {name} of the camera is {found}, expected {expected}")]
    ParameterRange {
        /// The parameter's name.
        name: &'static str,
        /// What was found.
        found: f64,
        /// What was expected.
        expected: &'static str,
    },
    /// The image has no pixels.
    #[error("the size of the image is {width} x {height}, expected at least 1 x 1")]
    EmptyImage {
        /// In pixels.
        width: u32,
        /// In pixels.
        height: u32,
    },
    /// A calibration matrix is not of the form `[fx 0 cx; 0 fy cy; 0 0 1]`: it has skew, or a wrong last row.
    #[error(
        "entry ({row}, {column}) of the calibration matrix is {found}, \
         expected {expected} as in [fx 0 cx; 0 fy cy; 0 0 1]"
    )]
    CalibrationMatrix {
        /// Counted from zero.
        row: usize,
        /// Counted from zero.
        column: usize,
        /// What was found.
        found: f64,
        /// What stands there in a calibration matrix without skew.
        expected: f64,
    },
    /// OpenCV's distortion has no such number of coefficients.
    #[error("found {found} coefficients of the distortion, expected {expected}")]
    DistortionCount {
        /// How many were given.
        found: usize,
        /// How many there may be.
        expected: &'static str,
    },
    /// A coefficient of OpenCV's thin prism or tilted sensor is not zero.
    #[error("found {found} for thin prism or tilt, expected zero: undistort the points with OpenCV")]
    ThinPrism {
        /// What was found.
        found: f64,
    },
    /// A coordinate of a pixel, or of a point to be projected, is NaN or infinite.
    #[error("a coordinate is {found}, expected a finite number")]
    NotFinite {
        /// What was found.
        found: f64,
    },
    /// The pixel lies where the distortion has no inverse, or farther from the optical axis than
    /// [`MAX_IMAGE_COORDINATE`](super::MAX_IMAGE_COORDINATE).
    #[error(
        "the pixel lies {} focal lengths from the principal point, \
         where the camera has no viewing ray; at most {} is possible", readable(*.found), readable(*.limit)
    )]
    OutOfDomain {
        /// Distorted radius of the pixel: its distance from the principal point in focal lengths.
        found: f64,
        /// The distorted radius up to which pixels in every direction have a viewing ray.
        limit: f64,
    },
    /// The pixel lies outside of a panorama. Only the pixels of its image have viewing rays.
    #[error("the pixel ({}, {}) lies outside of the panorama of {} x {} pixels", .found[0], .found[1], .size[0], .size[1])]
    OutsidePanorama {
        /// The pixel.
        found: [f64; 2],
        /// Width and height of the panorama, in pixels.
        size: [f64; 2],
    },
    /// A perspective camera cannot see the point, since it is not in front of it.
    #[error("the point has the depth z = {z}, expected a positive one in front of the camera")]
    BehindCamera {
        /// What was found.
        z: f64,
    },
    /// A camera that sees behind itself maps the point to no pixel in particular. The point is the centre of projection,
    /// or lies straight behind a fisheye camera, where the image is a circle.
    #[error("the point is the centre of projection or straight behind it, expected one with a single image")]
    NoDirection,
    /// The point lies too far from the optical axis for the model: the distortion would fold it back into
    /// the image.
    #[error(
        "the point lies {} from the optical axis ({}); at most {} is possible",
        readable(*.found), .model.unit(), readable(*.limit)
    )]
    PointOutOfDomain {
        /// The model of the camera.
        model: CameraModel,
        /// Radius on the plane `z = 1`; angle in radians for a fisheye model.
        found: f64,
        /// The largest such radius or angle that the camera sees.
        limit: f64,
    },
}

fn known_names() -> String {
    CameraModel::ALL.map(CameraModel::name).join(", ")
}

/// A radius, without the hundreds of digits of a very large one.
fn readable(radius: f64) -> String {
    if radius < 1e5 { format!("{radius:.9}") } else { format!("{radius:.3e}") }
}

impl CameraModel {
    /// What [`CameraError::PointOutOfDomain`] measures.
    fn unit(self) -> &'static str {
        if self.is_fisheye() { "an angle in radians" } else { "on the plane z = 1" }
    }
}
