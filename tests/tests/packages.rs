//! What is published carries its licences.

use std::fs;
use std::path::Path;

#[test]
fn every_crate_has_the_licence_files_of_the_workspace() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut crates = 0;
    for entry in fs::read_dir(root.join("crates")).unwrap() {
        let folder = entry.unwrap().path();
        crates += 1;
        for name in ["LICENSE-MIT", "LICENSE-APACHE"] {
            let found = fs::read(folder.join(name)).unwrap_or_default();
            assert_eq!(found, fs::read(root.join(name)).unwrap(), "{}/{name}", folder.display());
        }
    }
    assert!(crates >= 6, "{crates}");
}
