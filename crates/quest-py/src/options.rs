//! The options of `estimate`, taken once from the keywords of every function that searches for poses.
//!
//! Their names, their types and their defaults are those of the core's [`Options`], read by serde: an option that the core gains is
//! taken here without a change. What they mean in Python is told in `quest_pose/_options.py`.

use std::fmt::Display;

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_core::robust::Options;
use serde::Deserialize;
use serde::de::value::{MapDeserializer, StringDeserializer};
use serde::de::{Deserializer, Error, Expected, IntoDeserializer, Unexpected, Visitor};
use serde::forward_to_deserialize_any;

use crate::errors::QuestError;

/// The threshold in pixels where cameras are given and no threshold.
const THRESHOLD: f64 = 1.0;

/// What a function takes in a place of its own: it is no keyword there.
const CAMERAS: &str = "focal_lengths";

/// The options among the keywords of a function, None for those that are absent or None. `taken` are options that the function
/// sets itself. Without cameras the threshold must be given.
pub(crate) fn options(
    function: &str,
    keywords: Option<&Bound<'_, PyDict>>,
    taken: &[&str],
    has_cameras: bool,
) -> PyResult<Options> {
    let mut given = Vec::new();
    for (name, value) in keywords.into_iter().flatten() {
        let name: String = name.extract()?;
        if name == CAMERAS || taken.contains(&name.as_str()) {
            return Err(Refused::unknown_field(&name, &[]).error(function));
        }
        if !value.is_none() {
            given.push((name.clone(), Keyword { name, value }));
        }
    }
    let has_threshold = given.iter().any(|(name, _)| name == "threshold");
    let options = Options::deserialize(MapDeserializer::new(given.into_iter()));
    let options = options.map_err(|refused| refused.error(function))?;
    match (has_threshold, has_cameras) {
        (true, _) => Ok(options),
        (false, true) => Ok(Options { threshold: THRESHOLD, ..options }),
        (false, false) => Err(QuestError::new_err(
            "neither cameras nor a threshold are given, expected cameras, or a threshold in units of the plane z = 1 \
             (radians for bearings)",
        )),
    }
}

/// The value of a keyword.
struct Keyword<'py> {
    name: String,
    value: Bound<'py, PyAny>,
}

impl IntoDeserializer<'_, Refused> for Keyword<'_> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Keyword<'_> {
    type Error = Refused;

    /// A number: whole ones of Python and NumPy are counts, all others are floating.
    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        let Self { name, value } = self;
        let found = if let Ok(count) = value.extract::<u64>() {
            visitor.visit_u64(count)
        } else if let Ok(whole) = value.extract::<i64>() {
            visitor.visit_i64(whole)
        } else if let Ok(number) = value.extract::<f64>() {
            visitor.visit_f64(number)
        } else {
            let found = value.get_type().to_string();
            Err(Refused::invalid_type(Unexpected::Other(&found), &visitor))
        };
        found.map_err(|refused| refused.of(&name))
    }

    /// A choice by its name.
    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        choices: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refused> {
        let Self { name, value } = self;
        let found = match value.extract::<String>() {
            Ok(text) => {
                let text: StringDeserializer<Refused> = text.into_deserializer();
                visitor.visit_enum(text)
            }
            Err(_) => Err(Refused {
                what: What::Type,
                text: format!("is of {}, expected one of {}", value.get_type(), choices.join(", ")),
            }),
        };
        found.map_err(|refused| refused.of(&name))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

/// Why keywords are refused.
#[derive(Debug)]
struct Refused {
    what: What,
    text: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    /// There is no such keyword.
    Keyword,
    /// Its value is of another type.
    Type,
    /// Its value is impossible.
    Value,
}

impl Refused {
    /// With the name of the keyword in front.
    fn of(self, name: &str) -> Self {
        Self { text: format!("{name} {}", self.text), ..self }
    }

    fn error(self, function: &str) -> PyErr {
        match self.what {
            What::Keyword => {
                PyTypeError::new_err(format!("{function}() got an unexpected keyword argument {}", self.text))
            }
            What::Type => PyTypeError::new_err(self.text),
            What::Value => QuestError::new_err(self.text),
        }
    }
}

/// What Python calls the type that serde expects.
fn plain(expected: &dyn Expected) -> String {
    match expected.to_string().as_str() {
        "usize" | "u64" => "a whole number that is not negative".to_owned(),
        "f64" => "a number".to_owned(),
        other => other.to_owned(),
    }
}

impl Error for Refused {
    fn custom<T: Display>(text: T) -> Self {
        Self { what: What::Value, text: text.to_string() }
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self { what: What::Type, text: format!("is {found}, expected {}", plain(expected)) }
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self { what: What::Value, text: format!("is {found}, expected {}", plain(expected)) }
    }

    fn unknown_variant(found: &str, choices: &'static [&'static str]) -> Self {
        Self { what: What::Value, text: format!("is {found:?}, expected one of {}", choices.join(", ")) }
    }

    fn unknown_field(name: &str, fields: &'static [&'static str]) -> Self {
        let known: Vec<_> = fields.iter().copied().filter(|field| *field != CAMERAS).collect();
        let known =
            if known.is_empty() { String::new() } else { format!(", expected one of {}", known.join(", ")) };
        Self { what: What::Keyword, text: format!("'{name}'{known}") }
    }
}

impl Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

impl std::error::Error for Refused {}
