//! Matches of points whose inverse depths are given, for the tests of this folder.

use nalgebra::{UnitQuaternion, Vector3};

use crate::Correspondence;
use crate::robust::conclude::depth_field::field::{DepthField, Field, Terms, terms};
use crate::robust::conclude::evidence::Likelihood;
use crate::robust::data::observations::Observations;
use crate::robust::data::point_transfer::WIDTH;

pub(super) const FOCAL: f64 = 500.0;

/// How the camera turns.
pub(super) fn turn() -> UnitQuaternion<f64> {
    UnitQuaternion::new(Vector3::new(0.02, -0.01, 0.03))
}

/// Where point `k` is seen in view 1. No two are in the same place.
fn place(k: usize) -> Vector3<f64> {
    let k = k as f64;
    Vector3::new(0.5 * (2.1 * k).sin(), 0.4 * (3.7 * k + 1.0).cos(), 1.0)
}

/// The likelihood of points with these inverse depths, by a camera that moves by `t_21`; `off` is how far each is seen off in
/// view 2, in pixels. Of `sigma` the noise is taken to be.
pub(super) fn likelihood(
    rhos: &[f64],
    t_21: &Vector3<f64>,
    off: impl Fn(usize) -> [f64; 2],
    sigma: f64,
) -> Likelihood {
    let of_point = |(k, rho): (usize, &f64)| {
        let (x1, off) = (place(k), off(k));
        let x2 = turn() * x1 + t_21 * *rho;
        let x2 = [x2.x / x2.z + off[0] / FOCAL, x2.y / x2.z + off[1] / FOCAL];
        Correspondence::from_image_points([x1.x, x1.y], x2).unwrap()
    };
    let matches: Vec<_> = rhos.iter().enumerate().map(of_point).collect();
    let all: Vec<u32> = (0..).take(rhos.len()).collect();
    let observations = Observations::new(&matches, all.clone(), [[FOCAL; 2]; 2], 1.0);
    Likelihood::new(&observations, &all, &turn(), sigma, 0.99)
}

/// The inverse depths that a field has at the first so many points.
pub(super) fn of_field(field: &Field, count: usize) -> Vec<f64> {
    let all: Vec<Terms> = terms(&likelihood(&vec![1.0; count], &Vector3::zeros(), |_| [0.0; 2], 1.0));
    let at = |k: usize| field.iter().zip(&all[k / WIDTH]).map(|(c, lanes)| c * lanes[k % WIDTH]).sum::<f64>();
    (0..count).map(|k| 1.0 + at(k)).collect()
}

/// A pose with one parameter changed.
pub(super) fn moved(at: &DepthField, k: usize, by: f64) -> DepthField {
    let mut at = at.clone();
    match k {
        0..3 => {
            let mut turn = Vector3::zeros();
            turn[k] = by;
            at.q_21 = UnitQuaternion::new(turn) * at.q_21;
        }
        3..6 => at.t_21[k - 3] += by,
        _ => at.field[k - 6] += by,
    }
    at
}
