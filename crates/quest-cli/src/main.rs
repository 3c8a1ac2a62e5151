//! `quest-cli`: candidate poses from matched points.

fn main() {}
