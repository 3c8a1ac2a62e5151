//! Cameras as they are written in files and on the command line.

mod calibration;
mod colmap_file;
mod file;
mod keys;
mod xml_file;
mod yaml_file;

use quest_core::{Camera, CameraError, CameraModel};

pub use file::read_camera;

/// The camera of COLMAP's model `name`, in capital or small letters, with the parameters in COLMAP's order.
///
/// # Errors
/// [`CameraError`] for an unknown model, and for parameters or a size that do not fit it.
pub fn camera(name: &str, size: Option<(u32, u32)>, params: &[f64]) -> Result<Camera, CameraError> {
    // No two models differ by the case of their letters. An error names what was given.
    let model = name.to_ascii_uppercase().parse::<CameraModel>().or_else(|_| name.parse())?;
    let camera = Camera::new(model, params)?;
    match size {
        Some((width, height)) => camera.with_size(width, height),
        None => Ok(camera),
    }
}

/// The key of a camera that an error is about.
pub(crate) fn key(error: &CameraError) -> Option<&'static str> {
    match error {
        CameraError::UnknownModel { .. } => Some("model"),
        CameraError::ParameterCount { .. }
        | CameraError::ParameterNotFinite { .. }
        | CameraError::FocalLength { .. }
        | CameraError::ParameterRange { .. } => Some("params"),
        _ => None,
    }
}
