//! Control laws: from a pose to a velocity.

pub mod differential_drive;
pub mod free_camera;
pub(crate) mod law;

pub use differential_drive::{DifferentialDriveLaw, PlanarPose};
pub use free_camera::FreeCameraLaw;
pub use law::ControlLaw;
