//! Words for numbers that JSON does not have, as Python's `json` writes them.

/// Longer words first: one begins with the end of the other.
const WORDS: [&str; 3] = ["-Infinity", "Infinity", "NaN"];

/// `text` with `null` for each `NaN`, `Infinity` and `-Infinity` that stands outside of strings.
pub(super) fn as_null(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    let (mut is_string, mut is_escaped) = (false, false);
    while let Some(c) = rest.chars().next() {
        if !is_string && let Some(after) = WORDS.iter().find_map(|word| rest.strip_prefix(word)) {
            out.push_str("null");
            rest = after;
            continue;
        }
        is_string ^= c == '"' && !is_escaped;
        is_escaped = c == '\\' && is_string && !is_escaped;
        out.push(c);
        rest = &rest[c.len_utf8()..];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_outside_of_strings_become_null() {
        let text = r#"{"name": "NaN \" Infinity", "matches": [[NaN, -Infinity, Infinity, -1]]} "é\\" NaN"#;
        let expected = r#"{"name": "NaN \" Infinity", "matches": [[null, null, null, -1]]} "é\\" null"#;
        assert_eq!(as_null(text), expected);
    }
}
