//! From a file to a camera.

use std::path::Path;

use quest_core::Camera;

use super::{calibration, colmap_file, keys::Keys, xml_file, yaml_file};
use crate::{
    error::{Fault, Place, ReadError},
    read,
};

/// The form of a file of cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// A calibration by OpenCV or ROS.
    Yaml,
    /// A calibration by OpenCV.
    Xml,
    /// COLMAP's `cameras.txt`.
    ColmapText,
    /// COLMAP's `cameras.bin`.
    ColmapBinary,
}

/// The camera in a file: a calibration as OpenCV (`cv::FileStorage`, YAML or XML) or ROS (`camera_info`) writes it, or COLMAP's
/// `cameras.txt` or `cameras.bin`. Where a file has several, `id` is COLMAP's number of one, or what stands before or after the
/// keys of one: `1` of `K1` and `D1`, `left` of `left: {K: …, D: …}`.
///
/// # Errors
/// A file that cannot be read, is of no such form, or has several cameras and no `id`, or none of this one.
pub fn read_camera(path: &Path, id: Option<&str>) -> Result<Camera, ReadError> {
    let place = Place::file(path.display().to_string());
    let bytes = read::whole_file(path)?;
    if bytes.trim_ascii().is_empty() {
        let message = "found an empty file, expected a calibration of OpenCV or ROS, or COLMAP's cameras";
        return Err(place.error(Fault::Calibration(message.to_owned())));
    }
    let text = || read::utf8(&place, &bytes);
    let calibrated = |keys: Result<Keys, (Option<usize>, String)>| {
        let keys = keys
            .map_err(|(line, message)| Place { line, ..place.clone() }.error(Fault::Calibration(message)))?;
        calibration::camera(&keys, id).map_err(|(key, fault)| Place { key, ..place.clone() }.error(fault))
    };
    match form(path, &bytes) {
        Form::Yaml => calibrated(yaml_file::keys(text()?)),
        Form::Xml => calibrated(xml_file::keys(text()?)),
        Form::ColmapText => colmap_file::chosen(&place, &colmap_file::of_text(&place, text()?)?, id),
        Form::ColmapBinary => colmap_file::chosen(&place, &colmap_file::of_bytes(&place, &bytes)?, id),
    }
}

/// By the beginning of the file where it tells, else by the extension.
fn form(path: &Path, bytes: &[u8]) -> Form {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        // COLMAP counts its cameras in eight bytes.
        _ if bytes.starts_with(b"%YAML") => Form::Yaml,
        _ if bytes.trim_ascii_start().starts_with(b"<") => Form::Xml,
        Some("bin") => Form::ColmapBinary,
        _ if bytes.contains(&0) => Form::ColmapBinary,
        Some("txt") => Form::ColmapText,
        _ => Form::Yaml,
    }
}
