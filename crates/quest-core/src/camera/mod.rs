//! Camera models: from pixels to bearings and back.
//!
//! A camera looks along +z, x to the right and y down in the image. A pixel `(u, v)` and a point
//! `X = (X, Y, Z)` in the frame of the camera are related by
//!
//! ```text
//! u = fx xd + cx,   v = fy yd + cy          (the focal lengths and the principal point in pixels)
//! ```
//!
//! where `(xd, yd)` are distorted coordinates in units of the focal length. The centre of the first pixel may lie at
//! (0, 0) as in OpenCV or at (0.5, 0.5) as in COLMAP. The user chooses; the pixels and the principal point must agree.
//!
//! | model | parameters | distortion |
//! |---|---|---|
//! | `SIMPLE_PINHOLE` | `f, cx, cy` | none |
//! | `PINHOLE` | `fx, fy, cx, cy` | none |
//! | `SIMPLE_RADIAL` | `f, cx, cy, k` | `h = 1 + k r²` |
//! | `RADIAL` | `f, cx, cy, k1, k2` | `h = 1 + k1 r² + k2 r⁴` |
//! | `OPENCV` | `fx, fy, cx, cy, k1, k2, p1, p2` | `h` as `RADIAL`, and tangential |
//! | `FULL_OPENCV` | `fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6` | `h = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)`, and tangential |
//! | `SIMPLE_RADIAL_FISHEYE` | `f, cx, cy, k` | `θd = θ (1 + k θ²)` |
//! | `RADIAL_FISHEYE` | `f, cx, cy, k1, k2` | `θd = θ (1 + k1 θ² + k2 θ⁴)` |
//! | `OPENCV_FISHEYE` | `fx, fy, cx, cy, k1, k2, k3, k4` | `θd = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)` |
//!
//! Perspective models, with `x = X/Z`, `y = Y/Z` and `r² = x² + y²` (Brown 1966):
//!
//! ```text
//! xd = h x + 2 p1 x y + p2 (r² + 2 x²)
//! yd = h y + 2 p2 x y + p1 (r² + 2 y²)
//! ```
//!
//! Fisheye models, with the angle from the optical axis `θ = atan2(√(X² + Y²), Z)` in `[0, π]` (Kannala and
//! Brandt 2006): `(xd, yd) = θd (X, Y) / √(X² + Y²)`.
//!
//! # Domain
//! Distortion polynomials fold: beyond some radius two rays meet in one pixel. A camera is used only where its map is
//! one to one and connected to the image centre, which is up to the first radius (angle) at which the distorted
//! radius stops growing. With tangential distortion it is used on the largest disc about the optical axis on which
//! a bound proves that the map is invertible. Beyond it [`Camera::bearing`] and [`Camera::project`] return errors
//! that name the radius and the limit. The plane `z = 1` ends at [`MAX_IMAGE_COORDINATE`].
//!
//! # Sources
//! - The models, their names and their order of parameters: COLMAP, `src/colmap/sensor/models.h`.
//! - D. C. Brown, *Decentering distortion of lenses*, Photogrammetric Engineering 32(3), 444–462, 1966.
//! - J. Kannala and S. S. Brandt, *A generic camera model and calibration method for conventional,
//!   wide-angle, and fish-eye lenses*, IEEE TPAMI 28(8), 1335–1340, 2006.

mod distortion;
mod error;
mod model;
mod root;
#[cfg(test)]
mod tests;

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector2, Vector3};

pub use error::CameraError;
pub use model::CameraModel;

use distortion::{Distortion, scale};

/// The largest radius on the plane `z = 1`, `1 / sqrt(f64::EPSILON)`. A viewing ray beyond it cannot be distinguished from
/// one at a right angle to the optical axis.
pub const MAX_IMAGE_COORDINATE: f64 = 6.7e7;

/// The largest parameter. It is so small that no product of parameters overflows.
const MAX_PARAMETER: f64 = 1e30;

/// The number of parameters of the largest model.
const MAX_PARAMETERS: usize = 12;

/// A calibrated camera: pixels to viewing rays and back.
///
/// ```
/// use quest_core::{Camera, CameraModel};
///
/// let camera = Camera::new(CameraModel::SimpleRadial, &[1000.0, 640.0, 360.0, -0.1])?.with_size(1280, 720)?;
/// let ray = camera.bearing([1000.0, 500.0])?;
/// let pixel = camera.project(&ray)?;
/// assert!((pixel[0] - 1000.0).abs() < 1e-9 && (pixel[1] - 500.0).abs() < 1e-9);
/// # Ok::<(), quest_core::CameraError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(into = "crate::serial::CameraForm", try_from = "crate::serial::CameraForm")
)]
pub struct Camera {
    model: CameraModel,
    params: [f64; MAX_PARAMETERS],
    size: Option<(u32, u32)>,
    distortion: Distortion,
}

impl Camera {
    /// A camera of `model` with COLMAP's parameters in COLMAP's order ([`CameraModel::param_names`]): focal
    /// lengths and principal point in pixels, distortion coefficients without unit.
    ///
    /// # Errors
    /// [`CameraError::ParameterCount`], [`CameraError::ParameterNotFinite`], [`CameraError::FocalLength`].
    pub fn new(model: CameraModel, params: &[f64]) -> Result<Self, CameraError> {
        let names = model.param_names();
        if params.len() != names.len() {
            return Err(CameraError::ParameterCount { model, expected: names.len(), found: params.len() });
        }
        for (&name, &found) in names.iter().zip(params) {
            if !found.is_finite() || found.abs() > MAX_PARAMETER {
                return Err(CameraError::ParameterNotFinite { name, found });
            }
        }
        for (&name, &found) in names.iter().zip(params).take(model.focal_length_count()) {
            if found <= 0.0 {
                return Err(CameraError::FocalLength { name, found });
            }
        }
        let distortion = distortion(model, &params[model.focal_length_count() + 2..]);
        let mut all = [0.0; MAX_PARAMETERS];
        all[..params.len()].copy_from_slice(params);
        Ok(Self { model, params: all, size: None, distortion })
    }

    /// The `PINHOLE` camera with the calibration matrix `k = [fx 0 cx; 0 fy cy; 0 0 1]`, in pixels.
    ///
    /// # Errors
    /// [`CameraError::CalibrationMatrix`] for skew or a wrong last row (beyond rounding), and those of
    /// [`Camera::new`].
    pub fn from_k(k: &Matrix3<f64>) -> Result<Self, CameraError> {
        for (row, column, expected) in [(0, 1, 0.0), (1, 0, 0.0), (2, 0, 0.0), (2, 1, 0.0), (2, 2, 1.0)] {
            let found = k[(row, column)];
            // A matrix that was computed has rounding in place of its zeros; the first two rows are in pixels.
            let unit = if row < 2 { k[(0, 0)].abs().max(1.0) } else { 1.0 };
            if !found.is_finite() || (found - expected).abs() > 1e-12 * unit {
                return Err(CameraError::CalibrationMatrix { row, column, found, expected });
            }
        }
        Self::new(CameraModel::Pinhole, &[k[(0, 0)], k[(1, 1)], k[(0, 2)], k[(1, 2)]])
    }

    /// The camera with the size of its images in pixels. No computation needs the size.
    ///
    /// # Errors
    /// [`CameraError::EmptyImage`] where one of them is zero.
    pub fn with_size(self, width: u32, height: u32) -> Result<Self, CameraError> {
        if width == 0 || height == 0 {
            return Err(CameraError::EmptyImage { width, height });
        }
        Ok(Self { size: Some((width, height)), ..self })
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> CameraModel {
        self.model
    }

    /// The parameters, as given to [`Camera::new`].
    #[must_use]
    pub fn params(&self) -> &[f64] {
        &self.params[..self.model.param_names().len()]
    }

    /// Width and height of the images in pixels, where they are known.
    #[must_use]
    pub fn size(&self) -> Option<(u32, u32)> {
        self.size
    }

    /// `(fx, fy)` in pixels.
    #[must_use]
    pub fn focal_lengths(&self) -> (f64, f64) {
        (self.params[0], self.params[self.model.focal_length_count() - 1])
    }

    /// `(cx, cy)` in pixels.
    #[must_use]
    pub fn principal_point(&self) -> (f64, f64) {
        let first = self.model.focal_length_count();
        (self.params[first], self.params[first + 1])
    }

    /// The viewing ray of a pixel `(u, v)`: `(x, y, 1)` on the plane `z = 1` for perspective models, a unit
    /// vector for fisheye models (with `z <= 0` at 90 degrees and beyond).
    ///
    /// # Errors
    /// [`CameraError::NotFinite`], and [`CameraError::OutOfDomain`] where the model has no ray for the pixel
    /// (see [Domain](crate::camera#domain)).
    pub fn bearing(&self, pixel: [f64; 2]) -> Result<Vector3<f64>, CameraError> {
        require_finite(&pixel)?;
        let ((fx, fy), (cx, cy)) = (self.focal_lengths(), self.principal_point());
        let distorted = Vector2::new((pixel[0] - cx) / fx, (pixel[1] - cy) / fy);
        let radius = distorted.x.hypot(distorted.y);
        let ray = if self.model.is_fisheye() {
            self.distortion.undistort_radius(radius).map(|angle| {
                let (sin, cos) = angle.sin_cos();
                (distorted * scale(sin, radius)).push(cos)
            })
        } else {
            self.distortion.undistort(&distorted).map(|x| x.push(1.0))
        };
        ray.ok_or(CameraError::OutOfDomain {
            found: radius.min(f64::MAX),
            limit: self.distortion.max_distorted(),
        })
    }

    /// The pixel `(u, v)` of a point in the frame of the camera, in any unit of length.
    ///
    /// # Errors
    /// [`CameraError::NotFinite`]; [`CameraError::BehindCamera`] for a perspective model and `z <= 0`;
    /// [`CameraError::NoDirection`] for a fisheye model and the zero vector, or a point straight behind it;
    /// [`CameraError::PointOutOfDomain`] beyond the [domain](crate::camera#domain), where the pixel may belong
    /// to another ray as well.
    pub fn project(&self, x: &Vector3<f64>) -> Result<[f64; 2], CameraError> {
        require_finite(x.as_slice())?;
        let (radius, distorted) =
            if self.model.is_fisheye() { self.distort_angle(x)? } else { self.distort_plane(x)? };
        let limit = self.distortion.max_radius();
        let ((fx, fy), (cx, cy)) = (self.focal_lengths(), self.principal_point());
        let pixel = [fx * distorted.x + cx, fy * distorted.y + cy];
        // The slack lets the rays of pixels on the border, which are rounded, return to them.
        if radius <= limit * (1.0 + 8.0 * f64::EPSILON) && pixel.iter().all(|c| c.is_finite()) {
            Ok(pixel)
        } else {
            Err(CameraError::PointOutOfDomain { model: self.model, found: radius.min(f64::MAX), limit })
        }
    }

    /// The radius on the plane `z = 1` and the distorted coordinates there.
    fn distort_plane(&self, x: &Vector3<f64>) -> Result<(f64, Vector2<f64>), CameraError> {
        if x.z <= 0.0 {
            return Err(CameraError::BehindCamera { z: x.z });
        }
        let x = x.xy() / x.z;
        Ok((x.x.hypot(x.y), self.distortion.distort(&x).0))
    }

    /// The angle from the optical axis and the distorted coordinates.
    fn distort_angle(&self, x: &Vector3<f64>) -> Result<(f64, Vector2<f64>), CameraError> {
        if x.xy() == Vector2::zeros() && x.z <= 0.0 {
            return Err(CameraError::NoDirection);
        }
        // Only the direction counts: without its length nothing overflows.
        let x = x / x.amax();
        let sine = x.x.hypot(x.y);
        let angle = sine.atan2(x.z);
        Ok((angle, x.xy() * scale(self.distortion.radial(angle).0, sine)))
    }
}

/// The distortion of `model` with the parameters that follow the principal point.
fn distortion(model: CameraModel, k: &[f64]) -> Distortion {
    let (numerator, denominator, w): (&[f64], &[f64], _) = match (model, k) {
        (CameraModel::OpenCv, &[k1, k2, p1, p2]) => (&[k1, k2], &[], Vector2::new(p2, p1)),
        (CameraModel::FullOpenCv, &[k1, k2, p1, p2, k3, ref denominator @ ..]) => {
            (&[k1, k2, k3], denominator, Vector2::new(p2, p1))
        }
        _ => (k, &[], Vector2::zeros()),
    };
    let limit = if model.is_fisheye() { PI } else { MAX_IMAGE_COORDINATE };
    Distortion::new(numerator, denominator, w, limit)
}

fn require_finite(coordinates: &[f64]) -> Result<(), CameraError> {
    let not_finite = coordinates.iter().find(|c| !c.is_finite());
    not_finite.map_or(Ok(()), |&found| Err(CameraError::NotFinite { found }))
}
