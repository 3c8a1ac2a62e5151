//! Refuses coordinates of the wrong unit, which would have a wrong pose without a word.

use pyo3::PyResult;
use quest_core::Camera;
use quest_core::coordinates::{look_like_image_points, look_like_pixels};

use crate::errors::{BadCamera, QuestError};

/// Refuses pixels, called `name`, where there is no camera.
pub(crate) fn on_plane(name: &str, points: &[[f64; 2]]) -> PyResult<()> {
    if look_like_pixels(points) {
        return Err(BadCamera::new_err(format!(
            "{name} looks like pixels and no camera is given: expected a camera, or points on the plane z = 1 (of which most are within \
             84 degrees of the axis)"
        )));
    }
    Ok(())
}

/// Refuses points of the plane z = 1, called `name`, where a camera is given.
pub(crate) fn in_pixels(name: &str, points: &[[f64; 2]], camera: &Camera) -> PyResult<()> {
    if look_like_image_points(points, camera) {
        return Err(QuestError::new_err(format!(
            "{name} lies within 2 pixels of the corner of the image, expected pixels: points that are on the plane z = 1 already are \
             given without a camera"
        )));
    }
    Ok(())
}
