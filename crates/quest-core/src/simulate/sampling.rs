//! Random directions, rotations, translations and points.

use nalgebra::{Unit, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{Angle, Boxes, Layout, Motion};

/// The generator of one scene: the seed is the key of the cipher, the index its stream, so that no two scenes
/// share random numbers.
pub(super) fn generator(seed: u64, index: u64) -> ChaCha8Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    let mut rng = ChaCha8Rng::from_seed(key);
    rng.set_stream(index);
    rng
}

pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Uniform in the cube of half extent 1.
fn in_cube(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-1.0..=1.0))
}

/// Uniform on the unit sphere: a point uniform in the cube, kept if it lies in the unit ball.
fn on_sphere(rng: &mut ChaCha8Rng) -> Unit<Vector3<f64>> {
    loop {
        let v = in_cube(rng);
        // The inner bound keeps the direction accurate; it cuts off a millionth of the volume.
        if (1e-4..=1.0).contains(&v.norm_squared()) {
            return Unit::new_normalize(v);
        }
    }
}

pub(super) fn rotation(rng: &mut ChaCha8Rng, motion: Motion, angle: Angle) -> UnitQuaternion<f64> {
    let axis = on_sphere(rng);
    let angle = match angle {
        Angle::UpTo(largest) => largest * rng.random::<f64>(),
        Angle::Exactly(angle) => angle,
    };
    if motion == Motion::PureTranslation {
        return UnitQuaternion::identity();
    }
    UnitQuaternion::from_axis_angle(&axis, angle)
}

pub(super) fn translation(rng: &mut ChaCha8Rng, boxes: &Boxes) -> Vector3<f64> {
    in_cube(rng).component_mul(&Vector3::from(boxes.translation))
}

/// Where points are drawn from.
pub(super) struct Region {
    centre: Vector3<f64>,
    half: Vector3<f64>,
    /// For coplanar points, two unit vectors that span the plane.
    plane: Option<[Vector3<f64>; 2]>,
}

impl Region {
    pub(super) fn new(rng: &mut ChaCha8Rng, layout: Layout, boxes: &Boxes) -> Self {
        let orientation = on_sphere(rng);
        let plane = (layout == Layout::Coplanar).then(|| {
            let along = orientation.cross(&Vector3::ith(orientation.iamin(), 1.0)).normalize();
            [along, orientation.cross(&along)]
        });
        let [centre, half] = boxes.middle().map(Vector3::from);
        Self { centre, half, plane }
    }

    pub(super) fn point(&self, rng: &mut ChaCha8Rng) -> Vector3<f64> {
        let p = in_cube(rng).component_mul(&self.half);
        self.centre + self.plane.map_or(p, |[u, v]| u * p.x + v * p.y)
    }
}
