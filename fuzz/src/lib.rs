//! What the fuzz targets share: choices from the bytes of an input, and files of them.

/// The same scenes and the same invariants as the tests of the workspace, without what else its crate brings.
#[path = "../../tests/src/hostile.rs"]
pub mod hostile;
#[path = "../../tests/src/invariants.rs"]
pub mod invariants;

use std::io::Write;
use std::path::PathBuf;

use quest_io::Format;
use hostile::Choices;

/// Choices from bytes; zeros once they are used up, so that every input is whole.
#[derive(Debug)]
pub struct Bytes<'a>(pub &'a [u8]);

impl Bytes<'_> {
    /// The next eight bytes.
    pub fn word(&mut self) -> u64 {
        let mut word = [0; 8];
        let taken = self.0.len().min(8);
        word[..taken].copy_from_slice(&self.0[..taken]);
        self.0 = &self.0[taken..];
        u64::from_le_bytes(word)
    }

    /// Any number at all: NaN, infinity, subnormal.
    pub fn anything(&mut self) -> f64 {
        f64::from_bits(self.word())
    }
}

impl Choices for Bytes<'_> {
    fn unit(&mut self) -> f64 {
        // Two bytes choose, which keeps inputs short; what mutates one choice leaves the others.
        let taken = self.0.len().min(2);
        let mut pair = [0; 2];
        pair[..taken].copy_from_slice(&self.0[..taken]);
        self.0 = &self.0[taken..];
        f64::from(u16::from_le_bytes(pair)) / 65_536.0
    }
}

/// The bytes as a file in the directory for temporary files, one for each process.
pub fn written(bytes: &[u8], extension: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("quest-fuzz-{}.{extension}", std::process::id()));
    let written = std::fs::File::create(&path).and_then(|mut file| file.write_all(bytes));
    written.expect("a file in the directory for temporary files");
    path
}

/// Reads the bytes as a file of this format, and hands over the pairs that can be read.
pub fn read(bytes: &[u8], format: Format, mut pair: impl FnMut(&quest_io::Pair)) {
    if let Ok(pairs) = quest_io::read(&written(bytes, "pair"), Some(format)) {
        pairs.flatten().for_each(|found| pair(&found));
    }
}
