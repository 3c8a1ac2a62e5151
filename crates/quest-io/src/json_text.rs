//! JSON for people: one key a line, lists of numbers on the line of their key.

use std::io;

use serde::Serialize;
use serde_json::{Serializer, ser::Formatter};

/// Writes `value` as indented JSON that ends in a newline. Numbers that are not finite become `null`.
///
/// # Errors
/// The error of `writer`.
pub fn write_json<T: Serialize + ?Sized>(mut writer: &mut dyn io::Write, value: &T) -> io::Result<()> {
    value.serialize(&mut Serializer::with_formatter(&mut writer, Indented::default()))?;
    writer.write_all(b"\n")
}

/// Breaks lines in objects and in lists of objects, but not in lists of numbers.
#[derive(Default)]
struct Indented {
    /// How many objects are open.
    depth: usize,
}

impl Indented {
    fn new_line<W: io::Write + ?Sized>(&self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b"\n")?;
        (0..self.depth).try_for_each(|_| writer.write_all(b"  "))
    }
}

impl Formatter for Indented {
    fn begin_object<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth += 1;
        writer.write_all(b"{")
    }

    fn end_object<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth -= 1;
        self.new_line(writer)?;
        writer.write_all(b"}")
    }

    fn begin_object_key<W: io::Write + ?Sized>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        if !first {
            writer.write_all(b",")?;
        }
        self.new_line(writer)
    }

    fn begin_object_value<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b": ")
    }

    fn begin_array_value<W: io::Write + ?Sized>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        writer.write_all(if first { b"" } else { b", " })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Inner {
        list: Vec<f64>,
    }

    #[derive(Serialize)]
    struct Outer {
        name: &'static str,
        items: Vec<Inner>,
        none: Vec<Inner>,
    }

    #[test]
    fn lists_of_numbers_stay_on_a_line_and_nothing_is_lost() {
        let items = vec![Inner { list: vec![1.0, f64::NAN] }, Inner { list: vec![] }];
        let mut text = Vec::new();
        write_json(&mut text, &Outer { name: "a", items, none: vec![] }).unwrap();
        let expected = "{\n  \"name\": \"a\",\n  \"items\": [{\n    \"list\": [1.0, null]\n  }, {\n    \"list\": []\n  \
                        }],\n  \"none\": []\n}\n";
        assert_eq!(String::from_utf8(text).unwrap(), expected);
    }
}
