//! Newton's method for the point that a distortion takes to a given one.

use nalgebra::{Matrix2, Vector2};

/// Solves `D(x) = y` from `x` in the disc of `max_radius`, each step shortened until the error decreases. `distort` gives `D(x)` and
/// its Jacobian.
pub(super) fn solve(
    distort: impl Fn(&Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>),
    y: &Vector2<f64>,
    mut x: Vector2<f64>,
    max_radius: f64,
) -> Option<Vector2<f64>> {
    let (value, mut jacobian) = distort(&x);
    let mut error = value - y;
    // The usual number of steps is three; points near the border of the domain take up to twenty.
    for _ in 0..60 {
        let step = jacobian.try_inverse()? * error;
        let settled = |tolerance: f64| step.norm() <= tolerance * x.norm();
        if settled(4.0 * f64::EPSILON) {
            return (x.norm() <= max_radius).then_some(x);
        }
        let shorter = (0..20).map(|k| x - step * 0.5f64.powi(k)).filter(|x| x.norm() <= max_radius);
        let mut evaluated = shorter.map(|x| (x, distort(&x)));
        let Some((next, (value, j))) = evaluated.find(|(_, (v, _))| (v - y).norm() < error.norm()) else {
            // Rounding stops the descent at a tiny step, or, at a fold, at a tiny error; a point without
            // an inverse stops at the border with an error as large as its distance from the image.
            let solved = settled(1e-12) || error.norm() <= 1e-11 * y.norm();
            return solved.then_some(x);
        };
        (x, error, jacobian) = (next, value - y, j);
    }
    None
}
