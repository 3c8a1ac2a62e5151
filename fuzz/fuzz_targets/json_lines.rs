#![no_main]
//! Any bytes as JSON Lines, with the estimate of every pair that can be read.
use libfuzzer_sys::fuzz_target;
use quest_core::robust::{self, Options};
use quest_io::Format;
use quest_fuzz::invariants;

fuzz_target!(|bytes: &[u8]| {
    quest_fuzz::read(bytes, Format::JsonLines, |pair| {
        let Ok(matches) = pair.correspondences() else { return };
        let options = Options { max_iterations: 50, min_iterations: 1, ..Options::default() };
        if let Ok(found) = robust::estimate(&matches, &options) {
            invariants::estimate(&found, matches.len());
        }
    });
});
