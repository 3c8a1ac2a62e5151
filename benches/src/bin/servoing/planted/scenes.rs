//! Scenes and starts.

use nalgebra::{Unit, UnitQuaternion, Vector3};
use quest_core::servo::scenario::{self, Features};
use quest_core::servo::{
    DifferentialDrive, Disturbances, FreeCamera, FreeCameraLaw, Limits, Mount, Plant, Twist, World,
};
use quest_core::{Camera, CameraModel, RelativePose};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::cells::{Cell, Place};

pub(crate) const LIMITS: Limits = Limits { speed: 0.3, turn_rate: 0.5 };
/// About how far the features are, in metres.
pub(crate) const UNIT: f64 = 2.0;
const NOISE_PX: f64 = 0.5;
/// Turned away the camera may see too few features to begin with: starts with fewer than this are left out.
const SEEN: usize = 8;

/// What moves.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Body {
    Camera(FreeCamera),
    /// A robot, and where its camera is.
    Robot(DifferentialDrive, Mount),
}

impl Plant for Body {
    /// That of the camera relative to where it is at the goal.
    fn pose(&self) -> RelativePose {
        match self {
            Self::Camera(camera) => camera.pose(),
            Self::Robot(robot, mount) => {
                // X_base = M X_cam + p in both places.
                let (base, mount) = (robot.pose(), mount.pose());
                let back = mount.q_21.inverse();
                let q_21 = back * base.q_21 * mount.q_21;
                RelativePose::new(q_21, back * (base.q_21 * mount.t_21 + base.t_21 - mount.t_21))
            }
        }
    }

    fn advance(&mut self, twist: &Twist, seconds: f64) {
        match self {
            Self::Camera(camera) => camera.advance(twist, seconds),
            Self::Robot(robot, _) => robot.advance(twist, seconds),
        }
    }
}

impl Body {
    /// How far the body is from its goal, in metres and radians.
    pub(crate) fn off(&self) -> (f64, f64) {
        match self {
            Self::Camera(camera) => (camera.pose().t_21.norm(), camera.pose().q_21.angle()),
            Self::Robot(robot, _) => (robot.x.hypot(robot.z), robot.heading.abs()),
        }
    }
}

fn camera(focal: f64, width: u32, height: u32) -> Camera {
    let params = [focal, focal, f64::from(width) / 2.0, f64::from(height) / 2.0];
    Camera::new(CameraModel::Pinhole, &params)
        .and_then(|c| c.with_size(width, height))
        .unwrap_or_else(|error| unreachable!("a valid camera: {error}"))
}

fn unit_vector(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    loop {
        let v = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        if (1e-4..=1.0).contains(&v.norm_squared()) {
            return v.normalize();
        }
    }
}

/// A random world of the cell, and a start.
pub(crate) fn draw(cell: &Cell, rng: &mut ChaCha8Rng) -> (World, Body) {
    let disturbances = Disturbances { noise_px: NOISE_PX, sticky: cell.sticky, ..Disturbances::default() };
    let world = |points: Vec<Vector3<f64>>, camera: Camera| World {
        points,
        camera,
        disturbances: disturbances.clone(),
        goal_images: 1,
        period: 0.1,
    };
    match cell.place {
        Place::Beside { metres, degrees } => loop {
            let world = world(wide_points(cell, rng), camera(800.0, 1280, 960));
            let axis = Unit::new_normalize(unit_vector(rng).component_mul(&Vector3::new(0.3, 0.3, 1.0)));
            let angle = rng.random_range(0.0..=degrees).to_radians();
            let turn = UnitQuaternion::from_axis_angle(&axis, angle);
            let start = RelativePose::new(turn, unit_vector(rng) * metres);
            if world.seen_from(&start) >= SEEN {
                return (world, Body::Camera(FreeCamera::new(start)));
            }
        },
        Place::Arm => arm(cell, &disturbances, rng),
        Place::Tag { size } => tag(world(tag_points(cell.count, size, rng), camera(510.0, 640, 480)), rng),
        Place::Robot { spread } => {
            let half = 0.5 * spread * 640.0 / 510.0;
            let point = |rng: &mut ChaCha8Rng| {
                let z = rng.random_range(1.5..2.5);
                Vector3::new(rng.random_range(-half..half) * z, rng.random_range(-0.35..0.35) * z, z)
            };
            loop {
                let points = (0..cell.count).map(|_| point(rng)).collect();
                let world = world(points, camera(510.0, 640, 480));
                let start = Body::Robot(scenario::random_robot(rng), Mount::Camera);
                if world.seen_from(&start.pose()) >= SEEN {
                    return (world, start);
                }
            }
        }
        Place::Mounted { forward, degrees } => {
            let mount = Mount::ahead(forward, 0.3, degrees.to_radians());
            loop {
                let world = scenario::robot_world(Features::General, cell.count, disturbances.clone(), rng);
                let start = Body::Robot(scenario::random_robot(rng), mount);
                if world.sees_all(&RelativePose::identity(), 15.0) && world.sees_all(&start.pose(), 15.0) {
                    return (world, start);
                }
            }
        }
    }
}

/// A free camera that sees twenty of the features all the way: with very many hardly a start keeps them all in view.
fn arm(cell: &Cell, disturbances: &Disturbances, rng: &mut ChaCha8Rng) -> (World, Body) {
    let features = if cell.coplanar { Features::Coplanar } else { Features::General };
    let seen = cell.count.min(20);
    loop {
        let (mut world, start) = scenario::random(features, seen, disturbances, rng, scenario::random_camera);
        let law = FreeCameraLaw { rate: 0.5, unit: UNIT };
        if !world.stays_in_view(start, law, &LIMITS, UNIT, 300) {
            continue;
        }
        while world.points.len() < cell.count {
            let more = scenario::robot_world(features, 1, disturbances.clone(), rng);
            world.points.extend(more.points);
        }
        return (world, Body::Camera(start));
    }
}

/// A free camera that sees the tag all the way.
fn tag(world: World, rng: &mut ChaCha8Rng) -> (World, Body) {
    loop {
        let start = scenario::random_camera(rng);
        let law = FreeCameraLaw { rate: 0.5, unit: UNIT };
        if world.stays_in_view(start, law, &LIMITS, UNIT, 300) {
            return (world, Body::Camera(start));
        }
    }
}

/// Features over most of the image, at 1.5 to 3 m; or on a plane at 2 m, tilted by up to 30° about each axis.
fn wide_points(cell: &Cell, rng: &mut ChaCha8Rng) -> Vec<Vector3<f64>> {
    let tilt = Vector3::new(rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5), 0.0);
    let tilt = UnitQuaternion::new(tilt);
    let point = |rng: &mut ChaCha8Rng| {
        let (x, y) = (rng.random_range(-0.8..0.8), rng.random_range(-0.6..0.6));
        if cell.coplanar {
            tilt * Vector3::new(x, y, 0.0) + Vector3::new(0.0, 0.0, 2.0)
        } else {
            Vector3::new(x, y, rng.random_range(1.5..3.0))
        }
    };
    (0..cell.count).map(|_| point(rng)).collect()
}

/// Four corners of a square and its middle, or eight points around it, two metres ahead, tilted by up to 30° about each axis.
fn tag_points(count: usize, size: f64, rng: &mut ChaCha8Rng) -> Vec<Vector3<f64>> {
    let tilt = Vector3::new(rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5), 0.0);
    let tilt = UnitQuaternion::new(tilt);
    let h = 0.5 * size;
    let corners = [[-h, -h], [h, -h], [h, h], [-h, h]];
    let rest: &[[f64; 2]] =
        if count == 5 { &[[0.0, 0.0]] } else { &[[0.0, -h], [h, 0.0], [0.0, h], [-h, 0.0]] };
    let all = corners.iter().chain(rest);
    all.map(|p| tilt * Vector3::new(p[0], p[1], 0.0) + Vector3::new(0.0, 0.0, 2.0)).collect()
}
