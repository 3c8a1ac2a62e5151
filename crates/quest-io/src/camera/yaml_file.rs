//! YAML, as ROS and OpenCV write it.

use saphyr_parser::{Event, Parser};

use super::keys::Keys;

/// A list or a mapping that is open.
enum Open {
    List,
    /// The key whose value comes next.
    Mapping(Option<String>),
}

/// The values in `text`, or the line of a mistake and what it is.
pub(super) fn keys(text: &str) -> Result<Keys, (Option<usize>, String)> {
    let mut keys = Keys::default();
    let mut open: Vec<Open> = Vec::new();
    let body = without_version(text);
    // The lines that were taken away.
    let before = text[..text.len() - body.len()].matches('\n').count();
    for event in Parser::new_from_str(body) {
        let (event, _) = event.map_err(|error| {
            (Some(error.marker().line() + before), format!("found no YAML: {}", error.info()))
        })?;
        match event {
            Event::MappingStart(..) => open.push(Open::Mapping(None)),
            Event::SequenceStart(..) => open.push(Open::List),
            Event::MappingEnd | Event::SequenceEnd => {
                open.pop();
                value_ends(&mut open);
            }
            Event::Scalar(value, ..) => {
                if let Some(Open::Mapping(key @ None)) = open.last_mut() {
                    *key = Some(value.into_owned());
                } else {
                    keys.push(&path(&open), &value);
                    value_ends(&mut open);
                }
            }
            Event::Alias(_) => value_ends(&mut open),
            _ => {}
        }
    }
    Ok(keys)
}

/// OpenCV begins with `%YAML:1.0`, which YAML does not know.
fn without_version(text: &str) -> &str {
    match text.split_once('\n') {
        Some((first, rest)) if first.starts_with("%YAML") => rest,
        _ => text,
    }
}

fn value_ends(open: &mut [Open]) {
    if let Some(Open::Mapping(key)) = open.last_mut() {
        *key = None;
    }
}

fn path(open: &[Open]) -> Vec<&str> {
    let key = |level| match level {
        &Open::Mapping(Some(ref key)) => Some(key.as_str()),
        _ => None,
    };
    open.iter().filter_map(key).collect()
}
