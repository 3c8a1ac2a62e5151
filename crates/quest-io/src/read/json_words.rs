//! Errors of `serde_json`, in this crate's words.

use serde_json::error::Category;

use crate::error::{Fault, Place, ReadError};

/// The error of `serde_json` at `path` in this crate's words.
pub(crate) fn error(place: &Place, text: &str, path: &str, error: &serde_json::Error) -> ReadError {
    let (line, column) = (error.line().max(1), error.column().max(1));
    let mut here = place.at_line(place.line.unwrap_or(line));
    here.column = Some(column);
    // A key that is not complete is `?`, the object as a whole is `.`.
    let path = path.trim_end_matches('?').trim_end_matches('.');
    if !path.is_empty() {
        here = here.at_key(path);
    }
    let said = error.to_string();
    let said = said.rfind(" at line ").map_or(said.as_str(), |end| &said[..end]);
    let rest = text.lines().nth(line - 1).and_then(|l| l.get(column - 1..)).unwrap_or_default();
    let found = rest.split([',', ']', '}', ' ']).next().unwrap_or_default();
    here.error(Fault::Json(in_words(error.classify(), said, found)))
}

/// The parser's message in this crate's words: what was found, what was expected.
fn in_words(category: Category, said: &str, found: &str) -> String {
    const PLAIN: [(&str, &str); 6] = [
        ("f64", "a number"),
        ("u32", "a whole number up to 4294967295"),
        ("a sequence", "a list"),
        ("sequence", "a list"),
        ("map", "an object"),
        ("value", "a JSON value"),
    ];
    let plain = |word: &str| {
        PLAIN.iter().find(|(theirs, _)| *theirs == word).map_or(word.to_owned(), |p| p.1.to_owned())
    };
    if category == Category::Eof {
        let inside = said.strip_prefix("EOF while parsing ").unwrap_or("a value");
        return format!("found the end of the text inside {inside}, expected the rest of the JSON");
    }
    if said == "trailing characters" {
        return "found more text after the JSON object, expected one object (JSON Lines: the extension .jsonl)"
            .to_owned();
    }
    if said == "number out of range" {
        return "found a number out of range, expected one below 1.8e308".to_owned();
    }
    if let Some(key) = said.strip_prefix("missing field ") {
        return format!("found no key {key}, expected one");
    }
    if let Some(key) = said.strip_prefix("duplicate field ") {
        return format!("found the key {key} twice, expected it once");
    }
    let mistyped = said.strip_prefix("invalid type: ").or_else(|| said.strip_prefix("invalid value: "));
    if let Some((wrong, right)) = mistyped.and_then(|m| m.rsplit_once(", expected ")) {
        return format!("found {}, expected {}", plain(wrong), plain(right));
    }
    match said.strip_prefix("expected ") {
        Some(right) if !found.is_empty() => format!("found {found:?}, expected {}", plain(right)),
        _ if category == Category::Syntax => format!("not JSON: {said}"),
        _ => said.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(said: &str) -> String {
        in_words(Category::Data, said, "")
    }

    #[test]
    fn the_names_of_types_are_in_plain_words() {
        assert_eq!(
            words("invalid type: string \"a\", expected f64"),
            "found string \"a\", expected a number"
        );
        assert_eq!(words("invalid type: map, expected a sequence"), "found an object, expected a list");
        let whole = "found integer `-1`, expected a whole number up to 4294967295";
        assert_eq!(words("invalid value: integer `-1`, expected u32"), whole);
    }

    #[test]
    fn what_was_found_is_quoted() {
        let said = in_words(Category::Syntax, "expected `,` or `]`", "NaN");
        assert_eq!(said, "found \"NaN\", expected `,` or `]`");
        let said = in_words(Category::Syntax, "key must be a string", "1");
        assert_eq!(said, "not JSON: key must be a string");
        assert_eq!(words("expected value"), "expected value");
    }
}
