//! Reading no more than was asked for: an endless input is an error, not all of the memory.

use std::io::{self, BufRead};

use crate::error::Fault;

/// The most bytes of one pair where nothing else is asked for: more than ten million matches have.
pub const MOST_BYTES: u64 = 1 << 30;

/// Appends what comes up to the next line break, which is taken too, to `text`; returns how many bytes that was, 0 at the end.
pub(super) fn line(input: &mut dyn BufRead, most: u64, text: &mut Vec<u8>) -> Result<usize, Fault> {
    take(input, most, Some(b'\n'), text)
}

/// Appends all that comes to `text`.
pub(super) fn all(input: &mut dyn BufRead, most: u64, text: &mut Vec<u8>) -> Result<usize, Fault> {
    take(input, most, None, text)
}

/// `text` does not become longer than `most`, and memory that is not there is an error.
fn take(input: &mut dyn BufRead, most: u64, end: Option<u8>, text: &mut Vec<u8>) -> Result<usize, Fault> {
    let before = text.len();
    loop {
        let part = match input.fill_buf() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            part => part?,
        };
        let last = end.and_then(|end| part.iter().position(|&byte| byte == end));
        let taken = last.map_or(part.len(), |last| last + 1);
        if (text.len() + taken) as u64 > most {
            return Err(Fault::TooLarge { most });
        }
        text.try_reserve(taken).map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
        text.extend_from_slice(&part[..taken]);
        input.consume(taken);
        if taken == 0 || last.is_some() {
            return Ok(text.len() - before);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufReader, Read};

    use super::*;

    /// Says first what it is told, then the text.
    struct Troubled {
        trouble: Option<io::ErrorKind>,
        text: &'static [u8],
    }

    impl Read for Troubled {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            match self.trouble.take() {
                Some(trouble) => Err(trouble.into()),
                None => self.text.read(buffer),
            }
        }
    }

    fn read(trouble: Option<io::ErrorKind>, most: u64) -> Result<String, Fault> {
        // Two bytes at a time.
        let mut input = BufReader::with_capacity(2, Troubled { trouble, text: b"ab\ncdefg" });
        let mut text = Vec::new();
        assert_eq!(line(&mut input, most, &mut text)?, 3);
        assert_eq!(all(&mut input, most, &mut text)?, 5);
        assert_eq!(line(&mut input, most, &mut text)?, 0);
        Ok(String::from_utf8(text).unwrap())
    }

    #[test]
    fn a_text_in_parts_is_read_up_to_the_limit() {
        assert_eq!(read(None, 8).unwrap(), "ab\ncdefg");
        for most in [0, 2, 3, 7] {
            assert!(matches!(read(None, most), Err(Fault::TooLarge { most: found }) if found == most));
        }
    }

    #[test]
    fn an_interruption_is_no_error_and_anything_else_is() {
        assert_eq!(read(Some(io::ErrorKind::Interrupted), 8).unwrap(), "ab\ncdefg");
        let refused = read(Some(io::ErrorKind::PermissionDenied), 8);
        assert!(matches!(refused, Err(Fault::Io(error)) if error.kind() == io::ErrorKind::PermissionDenied));
    }
}
