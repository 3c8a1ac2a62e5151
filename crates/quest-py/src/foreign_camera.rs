//! Cameras as other libraries have them, read by their keys or attributes: none of the libraries is needed.
//!
//! - a mapping with `model` and `params`: PoseLib's and COLMAP's dictionaries;
//! - an object with `model` or `model_name()`, and `params`: `pycolmap.Camera`, `poselib.Camera`;
//! - an object with `k`, `d` and `distortion_model`: `sensor_msgs/CameraInfo` of ROS.

use pyo3::prelude::*;
use pyo3::types::PyMapping;
use quest_core::{Camera, CameraModel};

pub(crate) use crate::arrays::flat;
use crate::errors::{self, BadCamera};

/// The camera that a mapping or an object describes; `None` where it is neither.
pub(crate) fn read(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Option<Camera>> {
    if let Ok(mapping) = given.cast::<PyMapping>() {
        let get = |key: &str| mapping.get_item(key).ok().filter(|value| !value.is_none());
        let (Some(model), Some(params)) = (get("model"), get("params")) else {
            return Err(BadCamera::new_err(format!(
                "{name} is a mapping without model and params, expected both"
            )));
        };
        return parts(name, &model_name(name, &model)?, &params, [get("width"), get("height")]).map(Some);
    }
    let get = |key: &str| given.getattr(key).ok().filter(|value| !value.is_none());
    if let Some(distortion) = get("distortion_model") {
        return camera_info(name, &distortion.extract::<String>()?, get).map(Some);
    }
    let Some(params) = get("params") else { return Ok(None) };
    let model = match (get("model_name"), get("model")) {
        (Some(called), _) if called.is_callable() => model_name(name, &called.call0()?)?,
        (Some(text), _) | (None, Some(text)) => model_name(name, &text)?,
        (None, None) => return Ok(None),
    };
    parts(name, &model, &params, [get("width"), get("height")]).map(Some)
}

/// The name of a model: a text, an enumeration with names, or COLMAP's number.
fn model_name(name: &str, given: &Bound<'_, PyAny>) -> PyResult<String> {
    if let Ok(text) = given.extract::<String>() {
        return Ok(text);
    }
    if let Ok(text) = given.getattr("name").and_then(|text| text.extract::<String>()) {
        return Ok(text);
    }
    let known = given.extract::<i32>().ok().and_then(CameraModel::from_colmap_id);
    known.map(|model| model.name().to_owned()).ok_or_else(|| {
        BadCamera::new_err(format!("{name} has the model {given}, expected COLMAP's name or number of one"))
    })
}

fn parts(
    name: &str,
    model: &str,
    params: &Bound<'_, PyAny>,
    size: [Option<Bound<'_, PyAny>>; 2],
) -> PyResult<Camera> {
    let bad = |error| errors::camera(name, &error);
    let params = flat(&format!("{name}.params"), params)?;
    let camera = Camera::new(model.parse().map_err(bad)?, &params).map_err(bad)?;
    sized(name, &camera, size)
}

/// The camera with its size, where it has one: libraries write zero, or -1, where they have none.
fn sized(name: &str, camera: &Camera, size: [Option<Bound<'_, PyAny>>; 2]) -> PyResult<Camera> {
    let size = size.map(|side| side.and_then(|side| side.extract::<i64>().ok()));
    match size.map(|side| side.and_then(|side| u32::try_from(side).ok()).filter(|side| *side > 0)) {
        [Some(width), Some(height)] => {
            camera.with_size(width, height).map_err(|error| errors::camera(name, &error))
        }
        _ => Ok(*camera),
    }
}

/// `sensor_msgs/CameraInfo`: `k` and `d`, in ROS 1 `K` and `D`.
fn camera_info<'py>(
    name: &str,
    distortion: &str,
    get: impl Fn(&str) -> Option<Bound<'py, PyAny>>,
) -> PyResult<Camera> {
    let missing =
        || BadCamera::new_err(format!("{name} has a distortion_model without k and d, expected all three"));
    let k = get("k").or_else(|| get("K")).ok_or_else(missing)?;
    let d = get("d").or_else(|| get("D")).ok_or_else(missing)?;
    let k = flat(&format!("{name}.k"), &k)?;
    let &[fx, skew, cx, _, fy, cy, ..] = k.as_slice() else {
        return Err(BadCamera::new_err(format!("{name}.k has {} numbers, expected 9", k.len())));
    };
    if skew != 0.0 {
        return Err(BadCamera::new_err(format!("{name}.k has the skew {skew}, expected none")));
    }
    let pinhole = Camera::new(CameraModel::Pinhole, &[fx, fy, cx, cy]);
    let pinhole = pinhole.map_err(|error| errors::camera(name, &error))?;
    let d = flat(&format!("{name}.d"), &d)?;
    let fisheye = match distortion {
        "" | "plumb_bob" | "rational_polynomial" => false,
        "equidistant" | "fisheye" => true,
        found => {
            return Err(BadCamera::new_err(format!(
                "{name} has the distortion_model {found:?}, expected plumb_bob, rational_polynomial or equidistant"
            )));
        }
    };
    let camera = opencv(name, &pinhole, &d, fisheye, None)?;
    sized(name, &camera, [get("width"), get("height")])
}

/// The camera of OpenCV's coefficients, and the focal lengths and the principal point of `pinhole`.
pub(crate) fn opencv(
    name: &str,
    pinhole: &Camera,
    dist: &[f64],
    fisheye: bool,
    size: Option<(u32, u32)>,
) -> PyResult<Camera> {
    let ((fx, fy), (cx, cy)) = (pinhole.focal_lengths(), pinhole.principal_point());
    let k = [fx, fy, cx, cy];
    let camera = Camera::from_opencv(k, dist, fisheye).map_err(|error| errors::camera(name, &error))?;
    match size {
        Some((width, height)) => camera.with_size(width, height).map_err(|e| errors::camera(name, &e)),
        None => Ok(camera),
    }
}
