//! Camera models: from pixels to bearings and back.

use nalgebra::Vector3;

/// The camera models that are understood, with COLMAP's names and parameter order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CameraModel {
    /// `fx, fy, cx, cy`.
    Pinhole,
}

/// Why a camera, or a pixel of it, was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// The number of parameters does not fit the model.
    #[error("{model:?} takes {expected} parameters, found {found}")]
    ParameterCount {
        /// The model that was named.
        model: CameraModel,
        /// How many parameters it takes.
        expected: usize,
        /// How many were given.
        found: usize,
    },
}

/// A calibrated camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    params: [f64; 4],
}

impl Camera {
    /// A camera of `model` with COLMAP's parameters, in pixels.
    ///
    /// # Errors
    /// [`CameraError`] for a wrong number of parameters.
    pub fn new(model: CameraModel, params: &[f64]) -> Result<Self, CameraError> {
        let params = params.try_into().map_err(|_| CameraError::ParameterCount {
            model,
            expected: 4,
            found: params.len(),
        })?;
        Ok(Self { params })
    }

    /// The viewing ray of a pixel `(u, v)`.
    ///
    /// # Errors
    /// [`CameraError`] where the model has no ray for the pixel.
    pub fn bearing(&self, pixel: [f64; 2]) -> Result<Vector3<f64>, CameraError> {
        let [fx, fy, cx, cy] = self.params;
        Ok(Vector3::new((pixel[0] - cx) / fx, (pixel[1] - cy) / fy, 1.0))
    }
}
