//! Cameras of a database.

use quest_core::{Camera, CameraModel};
use rusqlite::Row;

use crate::image::floats;

/// A camera of the table `cameras`.
#[derive(Clone, Debug)]
pub struct ColmapCamera {
    /// Its key.
    pub id: i64,
    /// The camera, or why it cannot be used: an unknown model, or impossible parameters.
    pub camera: Result<Camera, String>,
    /// Whether the focal length is known; where it is not, it is COLMAP's guess.
    pub has_prior_focal_length: bool,
}

impl ColmapCamera {
    /// From `camera_id, model, width, height, params, prior_focal_length`.
    pub(crate) fn from_row(row: &Row) -> rusqlite::Result<Self> {
        let (id, model, width, height): (i64, i64, i64, i64) =
            (row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?);
        let params = row.get_ref(4)?.as_blob_or_null().ok().flatten().unwrap_or_default();
        let prior: i64 = row.get(5)?;
        Ok(Self { id, camera: camera(model, [width, height], params), has_prior_focal_length: prior != 0 })
    }
}

fn camera(model: i64, size: [i64; 2], params: &[u8]) -> Result<Camera, String> {
    let known = i32::try_from(model).ok().and_then(CameraModel::from_colmap_id);
    let model = known
        .ok_or_else(|| format!("found the camera model {model}, expected one of COLMAP 4.2's, 0 to 17"))?;
    let params = floats(params).ok_or("the parameters of the camera are no list of numbers")?;
    let camera = Camera::new(model, &params).map_err(|error| error.to_string())?;
    match size.map(u32::try_from) {
        // COLMAP writes no size of zero; a camera of another program without one still has rays.
        [Ok(width), Ok(height)] if width > 0 && height > 0 => {
            camera.with_size(width, height).map_err(|error| error.to_string())
        }
        _ => Ok(camera),
    }
}
