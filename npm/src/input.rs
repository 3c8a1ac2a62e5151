//! What JavaScript hands over: options with names that are checked, rows of numbers, cameras.

use js_sys::Object;
use quest_core::solver::SolverName;
use quest_core::{Camera, Correspondence, InputError, correspondence};
use serde::de::DeserializeOwned;
use wasm_bindgen::{JsError, JsValue};

/// Options from an object whose keys are all among `known`; the defaults where it is undefined or null.
pub(crate) fn options<T: DeserializeOwned + Default>(given: JsValue, known: &[&str]) -> Result<T, JsError> {
    if given.is_undefined() || given.is_null() {
        return Ok(T::default());
    }
    let object = given.dyn_ref_object()?;
    for key in Object::keys(object).iter().filter_map(|key| key.as_string()) {
        if !known.contains(&key.as_str()) {
            let known = known.join(", ");
            return Err(JsError::new(&format!("there is no option {key:?}, expected one of {known}")));
        }
    }
    serde_wasm_bindgen::from_value(given)
        .map_err(|error| JsError::new(&format!("the options cannot be read: {error}")))
}

trait AsObject {
    fn dyn_ref_object(&self) -> Result<&Object, JsError>;
}

impl AsObject for JsValue {
    fn dyn_ref_object(&self) -> Result<&Object, JsError> {
        use wasm_bindgen::JsCast;
        self.dyn_ref::<Object>().ok_or_else(|| {
            JsError::new(&format!("the options are {self:?}, expected an object with named options"))
        })
    }
}

/// Rows of `N` numbers each, one after the other.
pub(crate) fn rows<const N: usize>(name: &str, numbers: &[f64]) -> Result<Vec<[f64; N]>, JsError> {
    let (rows, rest) = numbers.as_chunks();
    if rest.is_empty() {
        return Ok(rows.to_vec());
    }
    let found = numbers.len();
    Err(JsError::new(&format!(
        "{name} holds {found} numbers, expected a multiple of {N}: rows one after the other"
    )))
}

/// The two cameras: the second is the first where absent.
pub(crate) fn cameras(first: Option<Camera>, second: Option<Camera>) -> Result<Option<[Camera; 2]>, JsError> {
    match (first, second) {
        (None, Some(_)) => Err(JsError::new("camera2 is given without camera1, expected both")),
        (first, second) => Ok(first.map(|first| [first, second.unwrap_or(first)])),
    }
}

/// The matches of rows `u1, v1, u2, v2`: pixels where there are cameras, otherwise points on the planes `z = 1`.
pub(crate) fn matches(
    rows: &[[f64; 4]],
    cameras: Option<&[Camera; 2]>,
) -> Result<Vec<Correspondence>, InputError> {
    let view = |k: usize| rows.iter().map(|row| [row[k], row[k + 1]]).collect::<Vec<_>>();
    let (x1, x2) = (view(0), view(2));
    match cameras {
        Some([camera1, camera2]) => correspondence::from_pixels(camera1, &x1, camera2, &x2),
        None => correspondence::from_image_points(&x1, &x2),
    }
}

/// The solver of this name; the default where there is none.
pub(crate) fn solver(name: Option<&str>) -> Result<SolverName, JsError> {
    Ok(name.map_or(Ok(SolverName::default()), str::parse)?)
}

/// A positive number of the option `name`.
pub(crate) fn positive(name: &str, value: Option<f64>) -> Result<f64, JsError> {
    match value {
        Some(x) if x > 0.0 && x.is_finite() => Ok(x),
        Some(x) => Err(JsError::new(&format!("{name} is {x}, expected a positive number"))),
        None => Err(JsError::new(&format!("{name} is missing, expected a positive number"))),
    }
}

/// A number of the option `name` that is not negative, infinity included; `usual` where there is none.
pub(crate) fn not_negative(name: &str, value: Option<f64>, usual: f64) -> Result<f64, JsError> {
    match value.unwrap_or(usual) {
        x if x >= 0.0 => Ok(x),
        x => Err(JsError::new(&format!("{name} is {x}, expected a number that is not negative"))),
    }
}
