#![no_main]
//! Any bytes as an array of NumPy's or an archive of them: an error or pairs, whose matches are an error or finite.
use libfuzzer_sys::fuzz_target;
use quest_io::Format;

fuzz_target!(|bytes: &[u8]| {
    quest_fuzz::read(bytes, Format::Npy, |pair| {
        if let Ok(matches) = pair.correspondences() {
            assert!(matches.iter().all(|m| m.bearing1().iter().chain(m.bearing2()).all(|x| x.is_finite())));
        }
    });
});
