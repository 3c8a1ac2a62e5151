#![no_main]
//! Any bytes as the file of a camera, in each of its forms: an error or a camera whose parameters are finite. The first byte says
//! which form, and whether one of several cameras is asked for.
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Some((&choice, text)) = bytes.split_first() else { return };
    let extension = ["yaml", "xml", "txt", "bin"][usize::from(choice % 4)];
    let path = quest_fuzz::written(text, extension);
    let id = [None, Some("1"), Some("left")][usize::from(choice / 4 % 3)];
    if let Ok(camera) = quest_io::read_camera(&path, id) {
        assert!(camera.params().iter().all(|x| x.is_finite()), "{camera:?}");
    }
});
