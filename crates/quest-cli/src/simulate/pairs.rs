//! `simulate --pairs`: scenes as pairs that other commands read.

use quest_core::simulate::{Scene, SceneOptions};
use quest_io::Output;
use serde::Serialize;

use crate::{Failure, rows};

/// A pair with its truth. Without a camera the points are on the plane z = 1.
#[derive(Debug, Serialize)]
struct PairRecord {
    name: String,
    matches: Vec<[f64; 4]>,
    q_21: [f64; 4],
    t_21: [f64; 3],
}

impl PairRecord {
    fn new(index: u64, scene: &Scene) -> Self {
        let on_plane = |b: &nalgebra::Vector3<f64>| [b.x / b.z, b.y / b.z];
        let matches = scene.matches.iter().map(|m| {
            let ([u1, v1], [u2, v2]) = (on_plane(m.bearing1()), on_plane(m.bearing2()));
            [u1, v1, u2, v2]
        });
        Self {
            name: format!("scene {index}"),
            matches: matches.collect(),
            q_21: scene.truth.wxyz(),
            t_21: scene.truth.t_21.into(),
        }
    }
}

/// Scenes 0 to `count` of a seed, a line each.
pub(super) fn write(
    output: &mut Output,
    options: &SceneOptions,
    seed: u64,
    count: u32,
) -> Result<(), Failure> {
    for index in 0..u64::from(count) {
        let scene = Scene::generate(options, seed, index)?;
        output.write(|writer| rows::write_line(writer, &PairRecord::new(index, &scene)))?;
    }
    Ok(())
}
