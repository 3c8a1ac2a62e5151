//! The simulated loop: robots, images, scenes and runs.

pub mod closed_loop;
pub(crate) mod imaging;
pub mod plant;
pub mod scenario;
