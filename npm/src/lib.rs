//! quest-core for JavaScript: what the npm package `quest-pose` is made of.
//!
//! Each function checks the shapes, calls the core, and makes objects of its answer. An error of the core is a JavaScript
//! `Error` with its text.

#![expect(unreachable_pub, reason = "what goes to JavaScript is public, in whichever module it stands")]

mod estimate;
mod input;
mod output;
mod servo;
mod solve;

use wasm_bindgen::prelude::wasm_bindgen;

/// The types of objects; those of functions and classes are made of their signatures.
#[wasm_bindgen(typescript_custom_section)]
const TYPES: &str = include_str!("types.ts");
