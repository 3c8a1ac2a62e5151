//! The panorama of the whole sphere: longitude to the right, latitude down.

use nalgebra::{Vector2, Vector3};

use super::CameraError;

/// The unit ray of a pixel, whose `angles` from the middle of the panorama to the right and down are in radians.
pub(super) fn ray(
    pixel: [f64; 2],
    size: [f64; 2],
    angles: &Vector2<f64>,
) -> Result<Vector3<f64>, CameraError> {
    if pixel.iter().zip(size).any(|(x, side)| !(0.0..=side).contains(x)) {
        return Err(CameraError::OutsidePanorama { found: pixel, size });
    }
    let ((sin_a, cos_a), (sin_e, cos_e)) = (angles.x.sin_cos(), angles.y.sin_cos());
    Ok(Vector3::new(cos_e * sin_a, sin_e, cos_e * cos_a))
}

/// The angles of a point from the middle of the panorama to the right and down, in radians.
pub(super) fn angles(x: &Vector3<f64>) -> Result<Vector2<f64>, CameraError> {
    let length = x.amax();
    if length <= 0.0 {
        return Err(CameraError::NoDirection);
    }
    // Only the direction counts: without its length nothing overflows.
    let x = x / length;
    Ok(Vector2::new(x.x.atan2(x.z), x.y.atan2(x.x.hypot(x.z))))
}
