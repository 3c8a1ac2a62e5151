//! What an earlier run wrote, for one that goes on.

use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

use crate::error::{Place, ReadError};

/// The lines of an earlier run, one after the other.
#[derive(Debug)]
pub struct Earlier {
    name: String,
    file: BufReader<File>,
    line: usize,
}

impl Earlier {
    /// Those of the first of these files that is there.
    pub(crate) fn open(name: &str, part: &Path, path: &Path) -> io::Result<Option<Self>> {
        for (file, name) in [(part, format!("{name}.part")), (path, name.to_owned())] {
            match File::open(file) {
                Ok(file) => {
                    let mut file = BufReader::new(file);
                    // A directory opens, and says only here that it cannot be read.
                    file.fill_buf()?;
                    return Ok(Some(Self { name, file, line: 0 }));
                }
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
        Ok(None)
    }

    fn read(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut text = Vec::new();
        self.file.read_until(b'\n', &mut text)?;
        // A run that was killed may have ended within a line.
        Ok(text.ends_with(b"\n").then_some(text))
    }
}

impl Iterator for Earlier {
    /// A line with its end, and its place.
    type Item = Result<(Place, Vec<u8>), ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        let line = self.read().transpose()?;
        self.line += 1;
        let place = Place::file(&self.name).at_line(self.line);
        Some(match line {
            Ok(line) => Ok((place, line)),
            Err(error) => Err(place.error(error)),
        })
    }
}
