//! One pose from the matches of two views, a third of which are wrong.
#![expect(clippy::print_stdout, reason = "an example shows what it finds")]

use quest_core::robust::{self, Options};
use quest_core::simulate::{FOCAL_LENGTH, Scene, SceneOptions};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Your matches come from `Correspondence::from_pixels(&camera1, [u1, v1], &camera2, [u2, v2])`.
    let options = SceneOptions { points: 200, noise_px: 0.5, ..SceneOptions::realistic() };
    let mut scene = Scene::generate(&options, 7, 0)?;
    scene.add_outliers(0.33, 7, 0)?;

    // The threshold is in pixels of these focal lengths: three times the noise.
    let options = Options { threshold: 1.5, focal_lengths: [[FOCAL_LENGTH; 2]; 2], ..Options::default() };
    let found = robust::estimate(&scene.matches, &options)?;

    println!("{} pose from {} of {} matches", found.model.name(), found.inlier_count, scene.matches.len());
    println!("rotation as (w, x, y, z) {:.4?}", found.pose.wxyz());
    println!("translation {:.4?}, in mean depths", found.pose.t_21.as_slice());
    println!("the rotation is off by {:.3}°", found.pose.rotation_error(&scene.truth).to_degrees());
    Ok(())
}
