//! COLMAP's `cameras.txt` and `cameras.bin`.

use quest_core::{Camera, CameraModel};

use super::camera;
use crate::error::{Fault, Place, ReadError};

/// A camera under its number.
type Numbered = (u32, Camera);

/// As many numbers as an error names.
const SHOWN: usize = 20;

/// The camera with the number `id`, or the only one.
pub(super) fn chosen(place: &Place, cameras: &[Numbered], id: Option<&str>) -> Result<Camera, ReadError> {
    let is_wanted = |number: u32| id.is_none_or(|id| id.parse() == Ok(number));
    let mut found = cameras.iter().filter(|(number, _)| is_wanted(*number));
    if let (Some((_, camera)), None) = (found.next(), found.next()) {
        return Ok(*camera);
    }
    let mut numbers: Vec<_> = cameras.iter().take(SHOWN).map(|(number, _)| number.to_string()).collect();
    numbers.extend((cameras.len() > SHOWN).then(|| "…".to_owned()));
    let (count, numbers) = (cameras.len(), numbers.join(", "));
    let found =
        format!("found {count} cameras with the numbers {numbers}, expected FILE:ID with one of them");
    Err(place.clone().error(Fault::Calibration(found)))
}

/// `CAMERA_ID MODEL WIDTH HEIGHT PARAMS…` a line, comments after `#`.
pub(super) fn of_text(place: &Place, text: &str) -> Result<Vec<Numbered>, ReadError> {
    let lines = text.lines().enumerate().map(|(index, line)| (place.at_line(index + 1), line.trim()));
    lines
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
        .map(|(place, line)| of_line(&place, line))
        .collect()
}

fn of_line(place: &Place, line: &str) -> Result<Numbered, ReadError> {
    let fields: Vec<_> = line.split_whitespace().collect();
    let refuse = || {
        let message = format!("found {line:?}, expected COLMAP's CAMERA_ID MODEL WIDTH HEIGHT PARAMS");
        place.clone().error(Fault::Calibration(message))
    };
    let [id, model, width, height, params @ ..] = &fields[..] else { return Err(refuse()) };
    let (Ok(id), Ok(width), Ok(height)) = (id.parse(), width.parse(), height.parse()) else {
        return Err(refuse());
    };
    let params: Vec<f64> =
        params.iter().map(|x| x.parse()).collect::<Result<_, _>>().map_err(|_| refuse())?;
    let camera = camera(model, sized(width, height), &params).map_err(|error| place.clone().error(error))?;
    Ok((id, camera))
}

/// A camera of another program may have no size.
fn sized(width: u32, height: u32) -> Option<(u32, u32)> {
    (width > 0 && height > 0).then_some((width, height))
}

/// Their count, then number, model, width, height and parameters of each, little-endian.
pub(super) fn of_bytes(place: &Place, bytes: &[u8]) -> Result<Vec<Numbered>, ReadError> {
    let mut rest = bytes;
    let mut read = || -> Result<Vec<Numbered>, String> {
        let count = u64::from_le_bytes(take(&mut rest)?);
        let cameras = (0..count).map(|_| of_record(&mut rest)).collect::<Result<_, _>>()?;
        if rest.is_empty() {
            Ok(cameras)
        } else {
            Err(format!("found more bytes after {count} cameras, {EXPECTED}"))
        }
    };
    read().map_err(|message| place.clone().error(Fault::Calibration(message)))
}

const EXPECTED: &str = "expected COLMAP's cameras.bin";

/// The next camera.
fn of_record(rest: &mut &[u8]) -> Result<Numbered, String> {
    let id = u32::from_le_bytes(take(rest)?);
    let number = i32::from_le_bytes(take(rest)?);
    let [width, height] = [u64::from_le_bytes(take(rest)?), u64::from_le_bytes(take(rest)?)];
    let model = CameraModel::from_colmap_id(number)
        .ok_or_else(|| format!("camera {id}: found the model {number}, {EXPECTED} with models 0 to 17"))?;
    let params = model.param_names().iter().map(|_| Ok(f64::from_le_bytes(take(rest)?)));
    let params = params.collect::<Result<Vec<_>, String>>()?;
    let [width, height] = [width, height].map(|side| u32::try_from(side).unwrap_or(0));
    let camera = camera(model.name(), sized(width, height), &params);
    Ok((id, camera.map_err(|error| format!("camera {id}: {error}"))?))
}

fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], String> {
    let (first, after) = rest
        .split_first_chunk::<N>()
        .ok_or_else(|| format!("found a file that ends within a camera, {EXPECTED}"))?;
    *rest = after;
    Ok(*first)
}
