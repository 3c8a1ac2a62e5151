//! Matches of degenerate scenes of every kind and size, from random numbers or from the bytes of a fuzzer.

use nalgebra::{UnitQuaternion, Vector3};
use quest_core::Correspondence;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Where choices come from.
pub trait Choices {
    /// A number in `[0, 1)`.
    fn unit(&mut self) -> f64;

    /// A number in `[low, high)`.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A whole number below `end`, which is not zero.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in [0, end)")]
    fn below(&mut self, end: usize) -> usize {
        ((self.unit() * end as f64) as usize).min(end - 1)
    }

    /// One of these.
    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }
}

impl Choices for ChaCha8Rng {
    fn unit(&mut self) -> f64 {
        self.random_range(0.0..1.0)
    }
}

/// What is done to a point of a box.
type Place = fn(Vector3<f64>) -> Vector3<f64>;

const PLACES: [Place; 9] = [
    |x| x,
    |x| Vector3::new(x.x, x.y, 3.0),
    |x| Vector3::new(x.x, 0.0, x.z),
    |x| Vector3::new(0.3, 0.2, 3.0) * x.z,
    |x| Vector3::new(x.x, 2.0 * x.x, 3.0),
    |x| Vector3::new((3.0 * x.x).round(), (3.0 * x.y).round(), 3.0),
    |x| x * 1e8,
    |x| -x,
    |_| Vector3::new(0.1, -0.1, 2.5),
];

/// Between 5 and 60 matches of one such scene: in space, on planes, lines and grids, at infinity, behind the camera, in one place;
/// with rotations and translations from nothing to everything, false matches, repeated ones, keypoints with many matches, and
/// bearings of every length that is accepted.
pub fn matches(choices: &mut impl Choices) -> Vec<Correspondence> {
    let any = |c: &mut _| from_box(c);
    let count = 5 + choices.below(55);
    let place = choices.pick(&PLACES);
    let turn = any(choices) * choices.pick(&[0.0, 1e-9, 0.3, 3.0]);
    let q_21 = UnitQuaternion::from_scaled_axis(turn);
    let t_21 = any(choices) * choices.pick(&[0.0, 1e-12, 1e-6, 1e-3, 0.3, 10.0, 1e6]);
    let scale = choices.pick(&[1.0, 1.0, 1e-8, 1e8, 1e-40, 1e40]);
    let noise = 10.0_f64.powf(choices.between(-16.0, -2.0));
    let outliers = choices.pick(&[0.0, 0.3, 0.8, 1.0]);
    let shared = choices.pick(&[0.0, 0.0, 0.2, 0.6]);
    // Some points lie before the epipole.
    let near = choices.unit() < 0.1;
    let hub = any(choices) + Vector3::z() * 3.0;
    let mut out: Vec<Correspondence> = Vec::new();
    for _ in 0..count {
        let in_box = any(choices) + Vector3::z() * 3.0;
        let x1 = if near { any(choices) * 1e-9 - t_21 } else { place(in_box) };
        let is_false = choices.unit() < outliers;
        let x2 = if is_false { any(choices) + Vector3::z() * 3.0 } else { q_21 * x1 + t_21 };
        let x2 = if choices.unit() < shared { hub } else { x2 };
        let [b1, b2] = [x1, x2].map(|x| (x + any(choices) * noise * x.norm()) * scale);
        out.extend(Correspondence::from_bearings(b1.into(), b2.into()));
        if choices.unit() < 0.02 {
            out.extend(out.first().copied());
        }
    }
    out
}

fn from_box(choices: &mut impl Choices) -> Vector3<f64> {
    Vector3::from_fn(|_, _| choices.between(-1.0, 1.0))
}
