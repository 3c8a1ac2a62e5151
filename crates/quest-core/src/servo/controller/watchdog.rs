//! Whether the motion brings the goal nearer.
//!
//! A law lets its potential V fall: `|t|² + |log R|²` in section 10.1. Where V does not fall although motion is commanded, the pose
//! is wrong, or the robot does not do what it is told. Recorded runs were judged by whether V fell by a tenth over fifteen images
//! of motion. It did in none of the four that drove away, and in all eight good ones. A slow robot needs more than fifteen images.
//! So the window ends once the commanded motion should have covered a third of what is left.
//!
//! An estimator learns the length of the remaining way while the camera moves. With few features the first images say two thirds of
//! it, and V then stays the same though the camera comes nearer. So the first V of a window is scaled by how much longer the way
//! from the start has become since.

use crate::servo::estimators::estimate::Motion;

/// A judgement needs this many images,
const IMAGES: usize = 15;
/// and a commanded way of this share of √V. A right pose then leaves half of V, and a unit guessed wrong by a factor of five still
/// passes.
const SHARE: f64 = 0.3;
/// The quotient of the last and the first V above which the loop diverges.
const FALLEN: f64 = 0.9;
/// Below this V noise decides, and there is no judgement: 6 cm with features at a metre, or 3.5°. With 0.02 the judgement came 14
/// cm too late.
pub(crate) const LEAST: f64 = 0.004;

/// A window of images, and what was found.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Watchdog {
    /// V at its beginning, in units of what `scale` was then.
    first: Option<f64>,
    images: usize,
    /// The commanded way since the window began: lengths and angles added.
    way: f64,
    /// How often the loop was found diverging.
    pub(crate) found: usize,
}

impl Watchdog {
    /// Takes in the law's potential V of a pose and the motion commanded before it. Returns whether V has not fallen although it
    /// should have.
    ///
    /// `scale` is V at the start, as the estimator sees the start now. `variance` is the sum of the variances of the pose's six
    /// numbers: within three standard deviations of the goal noise decides.
    pub(crate) fn is_diverging(
        &mut self,
        potential: Option<f64>,
        scale: f64,
        variance: f64,
        motion: &Motion,
    ) -> bool {
        let Some(value) = potential else {
            self.forget();
            return false;
        };
        let scale = scale.max(LEAST);
        let Some(first) = self.first.map(|first| first * scale) else {
            (self.first, self.images, self.way) = (Some(value / scale), 0, 0.0);
            return false;
        };
        self.images += 1;
        self.way += motion.linear.norm() + motion.angular.norm();
        if self.images < IMAGES || self.way < SHARE * first.sqrt() {
            return false;
        }
        self.first = None;
        let diverges = value > LEAST.max(9.0 * variance) && value > FALLEN * first;
        self.found += usize::from(diverges);
        diverges
    }

    /// Counts a divergence that leaves no doubt: as two.
    pub(crate) fn count_as_two(&mut self) {
        self.found += 2;
    }

    /// Begins a new window, for what happened in between is not the law's doing.
    pub(crate) fn forget(&mut self) {
        self.first = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// Whether forty images of motion, each with this potential, are found diverging.
    fn diverges(potential: impl Fn(i32) -> f64, variance: f64) -> bool {
        diverges_by(potential, |_| 1.0, variance)
    }

    /// The same where the potential of the start becomes another one on the way.
    fn diverges_by(potential: impl Fn(i32) -> f64, scale: impl Fn(i32) -> f64, variance: f64) -> bool {
        let motion = Motion { linear: Vector3::new(0.01, 0.0, 0.0), angular: Vector3::zeros() };
        let mut watchdog = Watchdog::default();
        (0..40).any(|k| watchdog.is_diverging(Some(potential(k)), scale(k), variance, &motion))
    }

    #[test]
    fn a_distance_that_does_not_fall_is_found_unless_noise_decides() {
        let falling = |k| 0.09 * 0.95_f64.powi(2 * k);
        assert!(!diverges(falling, 0.0));
        assert!(diverges(|_| 0.09, 0.0));
        assert!(diverges(|k| 0.09 + 0.001 * f64::from(k), 1e-4));
        // Within three standard deviations of the goal.
        assert!(!diverges(|_| 0.09, 0.02));
    }

    #[test]
    fn a_length_that_is_learnt_on_the_way_is_no_divergence() {
        // The way left falls by a twentieth an image, and is seen longer and longer: at first as two thirds of what it is.
        let seen = |k: i32| (0.67 + 0.33 * f64::from(k) / 40.0).powi(2);
        let left = |k: i32| 0.2 * 0.975_f64.powi(2 * k);
        assert!(!diverges_by(|k| left(k) * seen(k), seen, 0.0));
        // Where it does not fall, what is learnt excuses nothing.
        assert!(diverges_by(|k| 0.2 * seen(k), seen, 0.0));
        assert!(diverges_by(|_| 0.2, |_| 0.2, 0.0));
    }

    #[test]
    fn a_window_ends_with_the_commanded_way() {
        // Of a potential of 0.09 a share of 0.3 of the way is 0.09: nine images of a hundredth, but it takes fifteen.
        for (step, judged_at) in [(0.01, 15), (0.0031, 30), (0.0, i32::MAX)] {
            let mut watchdog = Watchdog::default();
            let motion = Motion { linear: Vector3::x() * step, angular: Vector3::zeros() };
            let found = (0..200).find(|_| watchdog.is_diverging(Some(0.09), 0.09, 0.0, &motion));
            assert_eq!(found.unwrap_or(i32::MAX), judged_at, "{step}");
        }
    }
}
