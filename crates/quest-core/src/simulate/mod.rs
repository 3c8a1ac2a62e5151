//! Section 9: random scenes with a known pose, pixel noise, and the error metrics of the paper.
//!
//! ```
//! use quest_core::simulate::{Motion, Scene, SceneOptions};
//!
//! // Figure 6: parallax 0.01, 0.75 px of noise.
//! let options = SceneOptions { motion: Motion::Parallax(0.01), noise_px: 0.75, ..SceneOptions::default() };
//! let scene = Scene::generate(&options, 2018, 0)?;
//! assert!((scene.truth.t_21.norm() - 0.01).abs() < 1e-12);
//! assert_eq!(scene.matches.len(), 5);
//! # Ok::<(), quest_core::simulate::SceneError>(())
//! ```

mod camera;
mod experiment;
mod long;
mod metrics;
mod options;
mod outliers;
mod sampling;
mod scene;
mod selection;

#[cfg(test)]
mod tests;

pub use camera::{
    FOCAL_LENGTH, IMAGE_SIZE, PRINCIPAL_POINT, is_inside_image, pixel_to_plane, plane_to_pixel,
};
pub use experiment::{Cell, FURTHER_POINTS, Figure, Problem, Reading};
pub use metrics::{parallax, rotation_metric, translation_metric};
pub use options::{Angle, Boxes, Layout, Motion, SceneError, SceneOptions, View};
pub use scene::Scene;
pub use selection::{PoseErrors, choose};
