//! JSON: one object a pair.
//!
//! A coordinate that is `null`, `NaN` or `Infinity` makes its match one without a bearing.

use std::{fmt, marker::PhantomData};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use quest_core::Camera;
use serde::{
    Deserialize, Deserializer,
    de::{DeserializeOwned, Error, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer},
};

use super::{gaps, json_words};
use crate::{
    Gap, Pair, Truth,
    camera::{self, camera},
    error::{Fault, Place, ReadError},
};

/// How far from 1 the length of a true quaternion may be: four written decimals stay within it.
const UNIT_TOLERANCE: f64 = 1e-3;

/// Keys that tell people where a pair comes from and what is known of it.
const FOR_PEOPLE: [&str; 3] = ["source", "scene", "inliers_known"];

/// A pair with matches of the form `M`.
#[derive(Deserialize)]
struct PairFile<M> {
    name: Option<String>,
    camera1: Option<Object<CameraFile>>,
    camera2: Option<Object<CameraFile>>,
    matches: Vec<M>,
    scores: Option<Vec<f64>>,
    q_21: Option<Numbers<4>>,
    t_21: Option<Numbers<3>>,
}

#[derive(Deserialize)]
struct CameraFile {
    model: String,
    width: Option<u32>,
    height: Option<u32>,
    params: Vec<f64>,
}

/// A match some of whose coordinates may be missing.
type WithGaps = [Option<f64>; 4];

/// Exactly `N` numbers. For a longer list, serde's own array reports only trailing characters.
struct Numbers<const N: usize>([f64; N]);

impl<'de, const N: usize> Deserialize<'de> for Numbers<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(NumbersVisitor)
    }
}

struct NumbersVisitor<const N: usize>;

impl<'de, const N: usize> Visitor<'de> for NumbersVisitor<N> {
    type Value = Numbers<N>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a list of {N} numbers")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Numbers<N>, A::Error> {
        let mut values = [0.0; N];
        let mut found = 0;
        while let Some(value) = list.next_element()? {
            if let Some(slot) = values.get_mut(found) {
                *slot = value;
            }
            found += 1;
        }
        if found == N {
            return Ok(Numbers(values));
        }
        Err(Error::custom(format_args!("found {found} numbers, expected {N}")))
    }
}

/// An object of the form `T`. A plain serde struct would also accept a list of its values.
struct Object<T>(T);

impl<'de, T: DeserializeOwned> Deserialize<'de> for Object<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(ObjectVisitor(PhantomData))
    }
}

struct ObjectVisitor<T>(PhantomData<T>);

impl<'de, T: DeserializeOwned> Visitor<'de> for ObjectVisitor<T> {
    type Value = Object<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Object<T>, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map)).map(Object)
    }
}

/// The pair in `text`, which starts at the line of `place`, or at line 1 of the file if `place` has no line.
pub(crate) fn parse(place: &Place, text: &str) -> Result<Pair, ReadError> {
    let error = match read::<Numbers<4>>(place, text) {
        Ok((file, unknown_keys)) => return check(place, file, |m| m.0, unknown_keys),
        Err(error) => error,
    };
    // Programs write NaN and infinities as `null`, or as words that are not JSON.
    let Ok((file, unknown_keys)) = read::<WithGaps>(place, &gaps::as_null(text)) else { return Err(error) };
    let pair = check(place, file, |m: WithGaps| m.map(|x| x.unwrap_or(f64::NAN)), unknown_keys)?;
    if pair.matches.iter().flatten().all(|x| x.is_finite()) {
        // The words stand somewhere else.
        return Err(error);
    }
    let gap = Gap { message: error.fault.to_string(), place: error.place };
    Ok(Pair { first_gap: Some(gap), ..pair })
}

/// The object in `text`, and the keys that are not known.
fn read<M: DeserializeOwned>(place: &Place, text: &str) -> Result<(PairFile<M>, Vec<String>), ReadError> {
    let mut unknown_keys = Vec::new();
    let mut track = serde_path_to_error::Track::new();
    let mut json = serde_json::Deserializer::from_str(text);
    let tracked = serde_path_to_error::Deserializer::new(&mut json, &mut track);
    let file: Result<Object<PairFile<M>>, _> = serde_ignored::deserialize(tracked, |path| {
        // serde_ignored writes `camera1.?.k` for a key of an optional object.
        let key = path.to_string().replace(".?", "");
        if !FOR_PEOPLE.contains(&key.as_str()) {
            unknown_keys.push(key);
        }
    });
    let file = file.map_err(|e| json_words::error(place, text, &track.path().to_string(), &e))?;
    json.end().map_err(|e| json_words::error(place, text, ".", &e))?;
    Ok((file.0, unknown_keys))
}

fn check<M>(
    place: &Place,
    file: PairFile<M>,
    numbers: impl Fn(M) -> [f64; 4],
    unknown_keys: Vec<String>,
) -> Result<Pair, ReadError> {
    let camera1 = file.camera1.map(|c| c.0.check(place, "camera1")).transpose()?;
    let camera2 = file.camera2.map(|c| c.0.check(place, "camera2")).transpose()?;
    let cameras = match (camera1, camera2) {
        (None, None) => None,
        (Some(camera1), camera2) => Some([camera1, camera2.unwrap_or(camera1)]),
        (None, Some(_)) => return Err(place.at_key("camera2").error(Fault::FirstCameraMissing)),
    };
    let expected = file.matches.len();
    if let Some(found) = file.scores.as_ref().map(Vec::len).filter(|&found| found != expected) {
        return Err(place.at_key("scores").error(Fault::ScoreCount { found, expected }));
    }
    let q_21 = file.q_21.map(|q| unit(&place.at_key("q_21"), q.0)).transpose()?;
    let t_21 = file.t_21.map(|t| Vector3::from(t.0));
    Ok(Pair {
        name: file.name,
        key: None,
        cameras,
        matches: file.matches.into_iter().map(numbers).collect(),
        first_gap: None,
        scores: file.scores,
        truth: Truth { q_21, t_21 },
        place: place.clone(),
        unknown_keys,
    })
}

impl CameraFile {
    fn check(self, place: &Place, key: &str) -> Result<Camera, ReadError> {
        let size = match (self.width, self.height) {
            (Some(width), Some(height)) => Some((width, height)),
            (None, None) => None,
            _ => return Err(place.at_key(key).error(Fault::HalfASize)),
        };
        camera(&self.model, size, &self.params).map_err(|error| {
            let part = camera::key(&error).map(|part| format!(".{part}")).unwrap_or_default();
            place.at_key(format!("{key}{part}")).error(error)
        })
    }
}

fn unit(place: &Place, [w, x, y, z]: [f64; 4]) -> Result<UnitQuaternion<f64>, ReadError> {
    let q = Quaternion::new(w, x, y, z);
    let norm = q.norm();
    // Written so that a norm that overflows to infinity is refused as well.
    if (norm - 1.0).abs() <= UNIT_TOLERANCE {
        return Ok(UnitQuaternion::new_normalize(q));
    }
    Err(place.clone().error(Fault::NotUnit(norm)))
}
