//! Messages on standard error.

use std::io::{self, Write};

/// The longest line; longer ones are cut, because a message may quote a file.
const LONGEST: usize = 400;

/// Writes `kind: text` as one line. If standard error is closed or full, nothing fails.
pub(crate) fn say(kind: &str, text: &str) {
    let _ = writeln!(io::stderr().lock(), "{kind}: {}", one_line(text));
}

/// Why there is no pose, for a line that begins by saying so.
pub(crate) fn after_no_pose(reason: &str) -> &str {
    reason.strip_prefix("no pose could be found: ").unwrap_or(reason)
}

/// The text on one line of bounded length, with visible control characters.
pub(crate) fn one_line(text: &str) -> String {
    let mut line = String::new();
    for c in text.chars() {
        if line.len() > LONGEST {
            line.push('…');
            break;
        }
        if c.is_control() { line.extend(c.escape_default()) } else { line.push(c) }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_stays_on_one_line() {
        assert_eq!(one_line("a\nb\u{1b}[31m"), "a\\nb\\u{1b}[31m");
        assert!(one_line(&"x".repeat(10_000)).len() < LONGEST + 10);
    }
}
