//! Control laws: from a pose to a velocity.

pub mod differential_drive;
pub mod free_camera;
pub(crate) mod law;
