//! The distortion of a model by its kind.

use std::f64::consts::PI;

use nalgebra::Vector2;

use super::closed_form::ClosedForm;
use super::distortion::{Distortion, scale};
use super::prism::Prism;
use super::{CameraError, CameraModel, MAX_IMAGE_COORDINATE};

/// A viewing ray by its angle from the optical axis.
pub(super) struct Ray {
    /// In radians.
    pub(super) angle: f64,
    /// The direction in which the ray leaves the axis, of any length.
    pub(super) direction: Vector2<f64>,
    /// The length of `direction`.
    pub(super) length: f64,
}

/// The distortion of a model with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Lens {
    /// A quotient of polynomials in the radius on the plane or in the angle.
    Polynomial(Distortion),
    /// A function of the radius on the plane.
    ClosedForm(ClosedForm),
    /// A fisheye lens with thin prism distortion.
    Prism(Prism),
    /// All directions, without a distortion.
    Panorama,
}

impl Lens {
    /// The lens of a model with all of its parameters, which are as many as it takes and finite.
    pub(super) fn new(model: CameraModel, params: &[f64]) -> Result<Self, CameraError> {
        let refuse = |name, found, expected| Err(CameraError::ParameterRange { name, found, expected });
        let k = &params[(model.focal_length_count() + 2).min(params.len())..];
        let (numerator, denominator, w): (&[f64], &[f64], _) = match (model, k) {
            (CameraModel::OpenCv, &[k1, k2, p1, p2]) => (&[k1, k2], &[], Vector2::new(p2, p1)),
            (CameraModel::FullOpenCv, &[k1, k2, p1, p2, k3, ref denominator @ ..]) => {
                (&[k1, k2, k3], denominator, Vector2::new(p2, p1))
            }
            (CameraModel::Fov, &[omega]) => {
                if omega.abs() >= PI {
                    return refuse("omega", omega, "an angle below pi");
                }
                // The model is even in ω. Below 1e-100 its distortion is less than rounding, and quotients lose digits.
                let omega = if omega.abs() < 1e-100 { 0.0 } else { omega.abs() };
                return Ok(Self::ClosedForm(ClosedForm::Fov { omega }));
            }
            (CameraModel::SimpleDivision | CameraModel::Division, &[k]) => {
                return Ok(Self::ClosedForm(ClosedForm::Division { k }));
            }
            (CameraModel::Eucm, &[alpha, beta]) => {
                if !(0.0..=1.0).contains(&alpha) {
                    return refuse("alpha", alpha, "a number from 0 to 1");
                }
                if beta <= 0.0 {
                    return refuse("beta", beta, "a positive number");
                }
                return Ok(Self::ClosedForm(ClosedForm::Eucm { alpha, beta }));
            }
            (CameraModel::ThinPrismFisheye, k) => {
                return Ok(Self::Prism(Prism::thin(std::array::from_fn(|i| k[i]))));
            }
            (CameraModel::RadTanThinPrismFisheye, k) => {
                return Ok(Self::Prism(Prism::radial_tangential(std::array::from_fn(|i| k[i]))));
            }
            (CameraModel::Equirectangular, _) => {
                let empty = ["w", "h"].into_iter().zip(params).find(|(_, side)| **side <= 0.0);
                return empty.map_or(Ok(Self::Panorama), |(name, &found)| {
                    refuse(name, found, "a positive number of pixels")
                });
            }
            _ => (k, &[], Vector2::zeros()),
        };
        let limit = if model.is_fisheye() { PI } else { MAX_IMAGE_COORDINATE };
        Ok(Self::Polynomial(Distortion::new(numerator, denominator, w, limit)))
    }

    /// The radius on the plane, or the angle, up to which the lens sees.
    pub(super) fn max_radius(&self) -> f64 {
        match self {
            Self::Polynomial(distortion) => distortion.max_radius(),
            Self::ClosedForm(form) => form.max_radius(),
            Self::Prism(prism) => prism.max_radius(),
            Self::Panorama => PI,
        }
    }

    /// The distorted radius up to which pixels in every direction have a ray.
    pub(super) fn max_distorted(&self) -> f64 {
        match self {
            Self::Polynomial(distortion) => distortion.max_distorted(),
            Self::ClosedForm(form) => form.max_distorted(),
            Self::Prism(prism) => prism.max_distorted(),
            Self::Panorama => PI,
        }
    }

    /// The point of the plane that is distorted to `y`.
    pub(super) fn undistort(&self, y: &Vector2<f64>) -> Option<Vector2<f64>> {
        match self {
            Self::Polynomial(distortion) => distortion.undistort(y),
            Self::ClosedForm(form) => {
                let radius = y.x.hypot(y.y);
                Some(y * scale(form.undistorted(radius)?, radius))
            }
            Self::Prism(prism) => prism.undistort(y),
            Self::Panorama => None,
        }
    }

    /// Where a point of the plane is distorted to.
    pub(super) fn distort(&self, x: &Vector2<f64>) -> Vector2<f64> {
        match self {
            Self::Polynomial(distortion) => distortion.distort(x).0,
            Self::ClosedForm(form) => {
                let radius = x.x.hypot(x.y);
                x * scale(form.distorted(radius), radius)
            }
            Self::Prism(prism) => prism.distort(x).0,
            Self::Panorama => *x,
        }
    }

    /// The ray that is distorted to `y`, by its angle from the optical axis.
    pub(super) fn undistort_angle(&self, y: &Vector2<f64>) -> Option<Ray> {
        if let Self::Polynomial(distortion) = self {
            let length = y.x.hypot(y.y);
            return Some(Ray { angle: distortion.undistort_radius(length)?, direction: *y, length });
        }
        let direction = self.undistort(y)?;
        let angle = direction.x.hypot(direction.y);
        Some(Ray { angle, direction, length: angle })
    }

    /// Where an angle from the optical axis is distorted to, in the direction of a vector of this length.
    pub(super) fn distort_angle(&self, angle: f64, direction: &Vector2<f64>, length: f64) -> Vector2<f64> {
        match self {
            Self::Polynomial(distortion) => direction * scale(distortion.radial(angle).0, length),
            other => other.distort(&(direction * scale(angle, length))),
        }
    }
}
