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
