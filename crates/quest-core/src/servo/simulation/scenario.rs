//! The scenes of section 10, and random ones like them.

use nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::servo::simulation::closed_loop::World;
use crate::servo::{DifferentialDrive, Disturbances, FreeCamera, Plant};
use crate::{Camera, CameraModel, RelativePose};

/// Focal lengths and principal point of the camera (64), in pixels.
pub const CAMERA_64: [f64; 4] = [509.5, 510.2, 329.9, 242.9];

/// How features are laid out before the goal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Features {
    /// In a box.
    #[default]
    General,
    /// On a plane.
    Coplanar,
}

/// The camera (64) with images of this size.
fn camera_64(width: u32, height: u32) -> Camera {
    let camera = Camera::new(CameraModel::Pinhole, &CAMERA_64).and_then(|c| c.with_size(width, height));
    camera.unwrap_or_else(|_| unreachable!("the parameters above are valid"))
}

/// The random numbers of run number `index` of the sequence `seed`.
#[must_use]
pub fn generator(seed: u64, index: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index);
    rng
}

/// Section 10.1: five points at the depths that it prints, F2 at (−1094, 46, 646) mm with the orientation
/// (0.943, 0.110, 0.223, 0.221), the camera (64) at 30 Hz. The places of the points across the image are ours: the paper
/// does not give them. Its figure 9 shows pixels up to u = 1000, so that the image is 1024 wide here.
#[must_use]
pub fn paper() -> (World, FreeCamera) {
    let points = [
        [0.30, -0.25, 1.78],
        [0.62, 0.32, 1.75],
        [-0.10, 0.20, 1.80],
        [0.75, -0.35, 2.33],
        [0.10, 0.02, 2.33],
    ];
    let world = World {
        points: points.map(Vector3::from).to_vec(),
        camera: camera_64(1024, 768),
        disturbances: Disturbances::default(),
        goal_images: 1,
        period: 1.0 / 30.0,
    };
    let q_12 = UnitQuaternion::new_normalize(Quaternion::new(0.943, 0.110, 0.223, 0.221));
    let pose_12 = RelativePose::new(q_12, Vector3::new(-1.094, 0.046, 0.646));
    (world, FreeCamera::new(pose_12.inverse()))
}

/// Sections 10.3 and 10.4: the start 80 cm back and 20 cm to the right, turned 20° to the left; mirrored for coplanar features.
#[must_use]
pub fn robot_start(features: Features) -> DifferentialDrive {
    let side = if features == Features::General { 1.0 } else { -1.0 };
    DifferentialDrive { x: 0.2 * side, z: -0.8, heading: -20_f64.to_radians() * side }
}

/// The world of the robot: so many features about two metres ahead of the goal, seen from the goal and from `start`.
pub fn robot_world(
    features: Features,
    count: usize,
    disturbances: Disturbances,
    rng: &mut ChaCha8Rng,
) -> World {
    World {
        points: layout(features, count, rng),
        camera: camera_64(640, 480),
        disturbances,
        goal_images: 1,
        period: 0.1,
    }
}

/// A start of the robot like those of figure 15: up to 1.2 m back and 40 cm aside, up to 25° turned.
pub fn random_robot(rng: &mut ChaCha8Rng) -> DifferentialDrive {
    DifferentialDrive {
        x: rng.random_range(-0.4..0.4),
        z: rng.random_range(-1.2..-0.4),
        heading: rng.random_range(-25.0_f64..25.0).to_radians(),
    }
}

/// A start of the free camera: turned by up to 60° about any axis, up to 80 cm away along each axis.
pub fn random_camera(rng: &mut ChaCha8Rng) -> FreeCamera {
    let mut inside = || loop {
        let v = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        if (1e-4..=1.0).contains(&v.norm_squared()) {
            return v;
        }
    };
    let (axis, position) = (Unit::new_normalize(inside()), inside());
    let angle = rng.random_range(0.0..60.0_f64).to_radians();
    let pose_12 = RelativePose::new(UnitQuaternion::from_axis_angle(&axis, angle), position * 0.8);
    FreeCamera::new(pose_12.inverse())
}

/// Features about two metres ahead of the goal: in a box, or on a plane turned by up to 30° about each axis.
fn layout(features: Features, count: usize, rng: &mut ChaCha8Rng) -> Vec<Vector3<f64>> {
    let mut uniform = |size: f64| rng.random_range(-size..size);
    let tilt = UnitQuaternion::new(Vector3::new(uniform(0.5), uniform(0.5), 0.0));
    let mut point = || {
        let (x, y, z) = (uniform(0.6), uniform(0.45), uniform(0.5));
        match features {
            Features::General => Vector3::new(x, y, z),
            Features::Coplanar => tilt * Vector3::new(x, y, 0.0),
        }
    };
    (0..count).map(|_| point() + Vector3::new(0.0, 0.0, 2.0)).collect()
}

/// A random world and a start from which all features are seen, 15 px inside of the image, as at the goal.
///
/// Draws until there is one: about one in five starts is.
pub fn random<P: Plant>(
    features: Features,
    count: usize,
    disturbances: &Disturbances,
    rng: &mut ChaCha8Rng,
    start: impl Fn(&mut ChaCha8Rng) -> P,
) -> (World, P) {
    const MARGIN: f64 = 15.0;
    loop {
        let world = robot_world(features, count, disturbances.clone(), rng);
        let plant = start(rng);
        if world.sees_all(&RelativePose::identity(), MARGIN) && world.sees_all(&plant.pose(), MARGIN) {
            return (world, plant);
        }
    }
}
