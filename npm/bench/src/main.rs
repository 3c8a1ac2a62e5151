//! The time of an estimate by the native library: `bench ROUNDS FILE.json` prints the shortest of so many rounds, and the pose.

use std::fs;
use std::time::Instant;

use anyhow::{Context, ensure};
use quest_core::robust::{self, Options};
use quest_core::{Camera, correspondence};
use serde::Deserialize;

#[derive(Deserialize)]
struct Pair {
    matches: Vec<[f64; 4]>,
    camera1: Camera,
    camera2: Option<Camera>,
}

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let rounds: usize = arguments.next().context("expected bench ROUNDS FILE.json")?.parse()?;
    let path = arguments.next().context("the file is missing: bench ROUNDS FILE.json")?;
    ensure!(rounds > 0, "found 0 rounds, expected at least one");
    let pair: Pair = serde_json::from_str(&fs::read_to_string(&path)?).context(path)?;
    let camera2 = pair.camera2.unwrap_or(pair.camera1);
    let options = Options::in_pixels(1.0, &pair.camera1, &camera2);
    let view = |k: usize| pair.matches.iter().map(|row| [row[k], row[k + 1]]).collect::<Vec<_>>();
    let (x1, x2) = (view(0), view(2));
    let mut shortest = f64::INFINITY;
    let mut found = None;
    for _ in 0..rounds {
        let start = Instant::now();
        let matches = correspondence::from_pixels(&pair.camera1, &x1, &camera2, &x2)?;
        found = Some(robust::estimate(&matches, &options)?);
        shortest = shortest.min(start.elapsed().as_secs_f64());
    }
    let found = found.context("no round was run")?;
    let answer = serde_json::json!({
        "milliseconds": 1e3 * shortest,
        "quaternion": found.pose.wxyz(),
        "t": [found.pose.t_21.x, found.pose.t_21.y, found.pose.t_21.z],
        "inliers": found.inliers,
    });
    println!("{answer}");
    Ok(())
}
