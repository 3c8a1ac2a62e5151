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
//! | `SIMPLE_FISHEYE` | `f, cx, cy` | `θd = θ` |
//! | `FISHEYE` | `fx, fy, cx, cy` | `θd = θ` |
//! | `THIN_PRISM_FISHEYE` | `fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1` | `h` as `OPENCV_FISHEYE`, tangential and thin prism |
//! | `RAD_TAN_THIN_PRISM_FISHEYE` | `fx, fy, cx, cy, k0, …, k5, p0, p1, s0, …, s3` | `h` of six terms, then tangential and thin prism |
//! | `FOV` | `fx, fy, cx, cy, omega` | `rd = atan(2 r tan(ω/2)) / ω` |
//! | `SIMPLE_DIVISION` | `f, cx, cy, k` | `r = rd / (1 + k rd²)` |
//! | `DIVISION` | `fx, fy, cx, cy, k` | as `SIMPLE_DIVISION` |
//! | `EUCM` | `fx, fy, cx, cy, alpha, beta` | `rd = r / (α √(β r² + 1) + 1 - α)` |
//! | `EQUIRECTANGULAR` | `w, h` | a panorama of the whole sphere |
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
//! The two thin prism models start from `(x, y) = θ (X, Y) / √(X² + Y²)`. With `r² = x² + y²`:
//!
//! ```text
//! THIN_PRISM_FISHEYE           xd = h x + 2 p1 x y + p2 (r² + 2 x²) + sx1 r²
//!                              yd = h y + 2 p2 x y + p1 (r² + 2 y²) + sy1 r²
//! RAD_TAN_THIN_PRISM_FISHEYE   (x, y) is replaced by h (x, y), and r² with it; then
//!                              xd = x + 2 p1 x y + p0 (r² + 2 x²) + s0 r² + s1 r⁴
//!                              yd = y + 2 p0 x y + p1 (r² + 2 y²) + s2 r² + s3 r⁴
//! ```
//!
//! A panorama: `u = w (a / 2π + 1/2)` with `a = atan2(X, Z)`, `v = h (e / π + 1/2)` with `e = atan2(Y, √(X² + Z²))`.
//!
//! # Domain
//! Distortion polynomials fold: beyond some radius two rays meet in one pixel. A camera is used only where its map is
//! one to one and connected to the image centre, which is up to the first radius (angle) at which the distorted
//! radius stops growing. With tangential distortion it is used on the largest disc about the optical axis on which
//! a bound proves that the map is invertible. Beyond it [`Camera::bearing`] and [`Camera::project`] return errors
//! that name the radius and the limit. The plane `z = 1` ends at [`MAX_IMAGE_COORDINATE`].
//! `FOV`, the division models and `EUCM` are used in front of the camera only, as COLMAP uses them. A panorama has rays
//! for the pixels of its image, borders included, and for no others.
//!
//! # Sources
//! - The models, their names and their order of parameters: COLMAP, `src/colmap/sensor/models.h`.
//! - D. C. Brown, *Decentering distortion of lenses*, Photogrammetric Engineering 32(3), 444–462, 1966.
//! - F. Devernay and O. Faugeras, *Straight lines have to be straight*, Machine Vision and Applications 13, 14–24, 2001
//!   (`FOV`).
//! - A. W. Fitzgibbon, *Simultaneous linear estimation of multiple view geometry and lens distortion*, CVPR 2001 (division).
//! - B. Khomutenko, G. Garcia and P. Martinet, *An enhanced unified camera model*, IEEE RA-L 1(1), 137–144, 2016 (`EUCM`).
//! - J. Weng, P. Cohen and M. Herniou, *Camera calibration with distortion models and accuracy evaluation*, IEEE TPAMI
//!   14(10), 965–980, 1992 (thin prism).
//! - J. Kannala and S. S. Brandt, *A generic camera model and calibration method for conventional,
//!   wide-angle, and fish-eye lenses*, IEEE TPAMI 28(8), 1335–1340, 2006.

mod closed_form;
mod distortion;
mod error;
mod lens;
mod model;
mod newton;
mod panorama;
mod prism;
mod root;
#[cfg(test)]
mod tests;

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector2, Vector3};

pub use error::CameraError;
pub use model::CameraModel;

use distortion::scale;
use lens::Lens;

/// The largest radius on the plane `z = 1`, `1 / sqrt(f64::EPSILON)`. A viewing ray beyond it cannot be distinguished from
/// one at a right angle to the optical axis.
pub const MAX_IMAGE_COORDINATE: f64 = 6.7e7;

/// The largest parameter. It is so small that no product of parameters overflows.
const MAX_PARAMETER: f64 = 1e30;

/// The number of parameters of the largest model.
const MAX_PARAMETERS: usize = 16;

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
    lens: Lens,
}

impl Camera {
    /// A camera of `model` with COLMAP's parameters in COLMAP's order ([`CameraModel::param_names`]): focal
    /// lengths and principal point in pixels, distortion coefficients without unit.
    ///
    /// # Errors
    /// [`CameraError::ParameterCount`], [`CameraError::ParameterNotFinite`], [`CameraError::FocalLength`],
    /// [`CameraError::ParameterRange`].
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
        let lens = Lens::new(model, params)?;
        let mut all = [0.0; MAX_PARAMETERS];
        all[..params.len()].copy_from_slice(params);
        Ok(Self { model, params: all, size: None, lens })
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

    /// The camera of OpenCV's calibration: focal lengths and principal point `fx, fy, cx, cy` in pixels, and the coefficients of
    /// the distortion in OpenCV's order. A fisheye has none or four, other cameras none, 4, 5, 8, 12 or 14.
    ///
    /// # Errors
    /// [`CameraError::DistortionCount`], [`CameraError::ThinPrism`] where a coefficient after the eighth is not zero, and those of
    /// [`Camera::new`].
    pub fn from_opencv(k: [f64; 4], distortion: &[f64], is_fisheye: bool) -> Result<Self, CameraError> {
        let (model, used) = match (is_fisheye, distortion.len()) {
            (false, 0) => (CameraModel::Pinhole, 0),
            (true, 0 | 4) => (CameraModel::OpenCvFisheye, 4),
            (false, 4) => (CameraModel::OpenCv, 4),
            (false, 5 | 8 | 12 | 14) => (CameraModel::FullOpenCv, 8),
            (_, found) => {
                let expected = if is_fisheye { "0 or 4" } else { "0, 4, 5, 8, 12 or 14" };
                return Err(CameraError::DistortionCount { found, expected });
            }
        };
        if let Some(&found) = distortion.iter().skip(used).find(|x| **x != 0.0) {
            return Err(CameraError::ThinPrism { found });
        }
        // The coefficients that are not given are zero.
        let mut params = [0.0; 12];
        params[..4].copy_from_slice(&k);
        let given = distortion.len().min(used);
        params[4..4 + given].copy_from_slice(&distortion[..given]);
        Self::new(model, &params[..4 + used])
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

    /// `(fx, fy)` in pixels. A panorama has pixels a radian instead, along the equator and along a meridian.
    #[must_use]
    pub fn focal_lengths(&self) -> (f64, f64) {
        match self.model.focal_length_count() {
            0 => (self.params[0] / (2.0 * PI), self.params[1] / PI),
            count => (self.params[0], self.params[count - 1]),
        }
    }

    /// `(cx, cy)` in pixels; the middle of a panorama.
    #[must_use]
    pub fn principal_point(&self) -> (f64, f64) {
        match self.model.focal_length_count() {
            0 => (0.5 * self.params[0], 0.5 * self.params[1]),
            first => (self.params[first], self.params[first + 1]),
        }
    }

    /// The viewing ray of a pixel `(u, v)`: `(x, y, 1)` on the plane `z = 1` for perspective models, a unit
    /// vector for fisheye models and panoramas (with `z <= 0` at 90 degrees and beyond).
    ///
    /// # Errors
    /// [`CameraError::NotFinite`]; [`CameraError::OutOfDomain`] and [`CameraError::OutsidePanorama`] where the model has
    /// no ray for the pixel (see [Domain](crate::camera#domain)).
    pub fn bearing(&self, pixel: [f64; 2]) -> Result<Vector3<f64>, CameraError> {
        require_finite(&pixel)?;
        let ((fx, fy), (cx, cy)) = (self.focal_lengths(), self.principal_point());
        let distorted = Vector2::new((pixel[0] - cx) / fx, (pixel[1] - cy) / fy);
        let radius = distorted.x.hypot(distorted.y);
        let ray = match self.lens {
            Lens::Panorama => return panorama::ray(pixel, [self.params[0], self.params[1]], &distorted),
            _ if self.model.is_fisheye() => self.lens.undistort_angle(&distorted).map(|x| {
                let (sin, cos) = x.angle.sin_cos();
                (x.direction * scale(sin, x.length)).push(cos)
            }),
            _ => self.lens.undistort(&distorted).map(|x| x.push(1.0)),
        };
        ray.ok_or(CameraError::OutOfDomain { found: radius.min(f64::MAX), limit: self.lens.max_distorted() })
    }

    /// The pixel `(u, v)` of a point in the frame of the camera, in any unit of length.
    ///
    /// # Errors
    /// [`CameraError::NotFinite`]; [`CameraError::BehindCamera`] for a perspective model and `z <= 0`;
    /// [`CameraError::NoDirection`] for a fisheye model or a panorama and the zero vector, and for a point straight behind a
    /// fisheye camera;
    /// [`CameraError::PointOutOfDomain`] beyond the [domain](crate::camera#domain), where the pixel may belong
    /// to another ray as well.
    pub fn project(&self, x: &Vector3<f64>) -> Result<[f64; 2], CameraError> {
        require_finite(x.as_slice())?;
        let (radius, distorted) = match self.lens {
            // Zero lies in every domain: a panorama sees all directions.
            Lens::Panorama => (0.0, panorama::angles(x)?),
            _ if self.model.is_fisheye() => self.distort_angle(x)?,
            _ => self.distort_plane(x)?,
        };
        let limit = self.lens.max_radius();
        let ((fx, fy), (cx, cy)) = (self.focal_lengths(), self.principal_point());
        let mut pixel = [fx * distorted.x + cx, fy * distorted.y + cy];
        if matches!(self.lens, Lens::Panorama) {
            // Rounding leads out of the image, where a pixel has no ray.
            pixel = [pixel[0].clamp(0.0, self.params[0]), pixel[1].clamp(0.0, self.params[1])];
        }
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
        Ok((x.x.hypot(x.y), self.lens.distort(&x)))
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
        Ok((angle, self.lens.distort_angle(angle, &x.xy(), sine)))
    }
}

fn require_finite(coordinates: &[f64]) -> Result<(), CameraError> {
    let not_finite = coordinates.iter().find(|c| !c.is_finite());
    not_finite.map_or(Ok(()), |&found| Err(CameraError::NotFinite { found }))
}
