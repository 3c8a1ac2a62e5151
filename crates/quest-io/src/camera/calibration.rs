//! A calibration as a camera: the matrix, the coefficients of OpenCV's distortion, the size of the image.

use quest_core::{Camera, CameraError};

use super::keys::Keys;
use crate::error::Fault;

const MATRIX: [&str; 3] = ["camera_matrix", "K", "M"];
const DISTORTION: [&str; 3] = ["distortion_coefficients", "dist_coeffs", "D"];
const MODEL: [&str; 1] = ["distortion_model"];
const FISHEYE: [&str; 2] = ["fisheye_model", "fisheye"];
const SIZES: [[&str; 2]; 2] = [["image_width", "width"], ["image_height", "height"]];
const SIZE: [&str; 1] = ["image_size"];

/// The key of an error, and the error.
type Refusal = (Option<String>, Fault);

/// The camera of `keys`, of several the one with this id.
pub(super) fn camera(keys: &Keys, id: Option<&str>) -> Result<Camera, Refusal> {
    let Some((name, matrix)) = keys.find(&MATRIX, id) else {
        let wanted = id.map_or_else(String::new, |id| format!(" of {id:?}"));
        let names = if keys.names.is_empty() { "no keys".to_owned() } else { keys.names.join(", ") };
        return Err((
            None,
            Fault::Calibration(format!(
                "found {names}, expected camera_matrix or K{wanted}; FILE:ID names one of several cameras, K1 and D1 by FILE:1"
            )),
        ));
    };
    let k = focal_lengths_and_centre(name, &numbers(name, matrix)?)?;
    let distortion = match keys.find(&DISTORTION, id) {
        Some((name, values)) => numbers(name, values)?,
        None => Vec::new(),
    };
    let camera = Camera::from_opencv(k, &distortion, is_fisheye(keys, id)?).map_err(|error| {
        let is_distortion =
            matches!(error, CameraError::DistortionCount { .. } | CameraError::ThinPrism { .. });
        (Some(if is_distortion { DISTORTION[0] } else { name }.to_owned()), error.into())
    })?;
    match size(keys, id)? {
        Some((width, height)) => {
            camera.with_size(width, height).map_err(|error| (Some(name.to_owned()), error.into()))
        }
        None => Ok(camera),
    }
}

fn numbers(name: &str, values: &[String]) -> Result<Vec<f64>, Refusal> {
    let number = |value: &String| {
        let number = value.parse::<f64>().ok().filter(|x| x.is_finite());
        number.ok_or_else(|| (Some(name.to_owned()), Fault::NotANumber(value.clone())))
    };
    values.iter().map(number).collect()
}

/// `fx, fy, cx, cy` of the nine numbers of a matrix.
fn focal_lengths_and_centre(name: &str, matrix: &[f64]) -> Result<[f64; 4], Refusal> {
    let refuse = |message| Err((Some(name.to_owned()), Fault::Calibration(message)));
    match *matrix {
        [fx, skew, cx, m10, fy, cy, m20, m21, m22] => {
            if skew == 0.0 && m10 == 0.0 && m20 == 0.0 && m21 == 0.0 && (m22 - 1.0).abs() < 1e-12 {
                Ok([fx, fy, cx, cy])
            } else {
                refuse(format!("found the matrix {matrix:?}, expected fx, 0, cx, 0, fy, cy, 0, 0, 1"))
            }
        }
        _ => refuse(format!("found {} numbers, expected the 9 of a matrix", matrix.len())),
    }
}

/// Whether the distortion is that of a fisheye: ROS names it, OpenCV's calibration has a key for it.
fn is_fisheye(keys: &Keys, id: Option<&str>) -> Result<bool, Refusal> {
    // One key may stand for all cameras of a file.
    let find = |names: &[&'static str]| keys.find(names, id).or_else(|| keys.find(names, None));
    if let Some((name, values)) = find(&MODEL) {
        return match values.first().map_or("", String::as_str) {
            "" | "plumb_bob" | "rational_polynomial" => Ok(false),
            "equidistant" | "fisheye" => Ok(true),
            found => Err((
                Some(name.to_owned()),
                Fault::Calibration(format!(
                    "found {found:?}, expected plumb_bob, rational_polynomial or equidistant"
                )),
            )),
        };
    }
    match find(&FISHEYE).map(|(name, values)| (name, values.first().map_or("", String::as_str))) {
        None | Some((_, "0" | "false" | "False")) => Ok(false),
        Some((_, "1" | "true" | "True")) => Ok(true),
        Some((name, found)) => {
            Err((Some(name.to_owned()), Fault::Calibration(format!("found {found:?}, expected 0 or 1"))))
        }
    }
}

/// Width and height, where they are there: calibrations without an image have zeros.
fn size(keys: &Keys, id: Option<&str>) -> Result<Option<(u32, u32)>, Refusal> {
    let find = |names: &[&'static str]| keys.find(names, id).or_else(|| keys.find(names, None));
    let side = |value: &String| {
        let side = value.parse::<u32>().ok();
        side.ok_or_else(|| {
            (Some(SIZE[0].to_owned()), Fault::Calibration(format!("found {value:?}, expected pixels")))
        })
    };
    let both: Vec<u32> = match (find(&SIZE), SIZES.map(|names| find(&names))) {
        (Some((_, values)), _) => values.iter().map(side).collect::<Result<_, _>>()?,
        (None, [Some((_, width)), Some((_, height))]) => {
            width.iter().chain(height).map(side).collect::<Result<_, _>>()?
        }
        (None, [None, None]) => return Ok(None),
        (None, _) => return Err((None, Fault::HalfASize)),
    };
    match both[..] {
        [0, 0] => Ok(None),
        [width, height] => Ok(Some((width, height))),
        _ => Err((Some(SIZE[0].to_owned()), Fault::HalfASize)),
    }
}
