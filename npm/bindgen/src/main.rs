//! Writes the JavaScript and the types around a WebAssembly file: `bindgen FILE.wasm FOLDER`.
//!
//! It is what `wasm-bindgen --target web` does, of a version that Cargo.lock pins, with nothing to install.

use anyhow::Context;
use wasm_bindgen_cli_support::Bindgen;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let input = arguments.next().context("the WebAssembly file is missing: bindgen FILE.wasm FOLDER")?;
    let folder = arguments.next().context("the folder is missing: bindgen FILE.wasm FOLDER")?;
    let mut bindgen = Bindgen::new();
    bindgen.input_path(input).out_name("quest_pose").typescript(true);
    // `init()` without an argument loads the file beside the script.
    bindgen.web(true)?.omit_default_module_path(false).generate(folder)
}
