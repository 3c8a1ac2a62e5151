//! Whether a pose agrees with more matches, or more closely, than chance would let it.
//!
//! How often a false match comes within a distance `r` of agreeing with a pose is measured on false matches: the points of view 1
//! with those of view 2 shifted against them. That probability is `α(r) = r α(1)`, a band along a line, or what was measured at `r`
//! where that is clearly more: with a threshold that spans the image, or with points that are not spread over it. The `k` nearest of
//! `n` matches are within `r_k`, and any sample fits five of them. So among `m` motions that were tried, the number of those that do
//! as well by chance is at most
//!
//! ```text
//! NFA = min over k of (n − 5) m C(n − 5, k − 5) α(r_k)^(k − 5)
//! ```
//!
//! (after L. Moisan, B. Stival, *A probabilistic criterion to detect rigid point matches between two images*, IJCV 2004, who take
//! all `C(n, 5)` samples for `m`).

use crate::robust::data::columns::{Columns, Residuals};
use crate::robust::data::observations::Observations;
use crate::robust::search::pose_score::ScoredPose;
use crate::solver::shared::motion::Motion;

/// False matches that are looked at.
const FALSE_MATCHES: usize = 1_000;

/// False matches are counted up to this multiple of the threshold, where there are more of them to count.
const WIDE: f64 = 3.0;

/// Real solutions of a sample, on average.
const SOLUTIONS: f64 = 4.0;

/// The base ten logarithm of the number of false alarms of a pose that was found among so many samples.
pub(crate) fn log_false_alarms(pose: &ScoredPose, tries: usize, false_matches: &Columns) -> f64 {
    let chance = Chance::new(false_matches, &pose.scored.motion);
    let mut errors: Vec<f64> = pose.inlier_residuals().map(f64::abs).collect();
    errors.sort_unstable_by(f64::total_cmp);
    least_log_false_alarms(pose.residuals().len(), &errors, &chance, SOLUTIONS * tries as f64)
}

/// The same for the inliers' errors in ascending order.
fn least_log_false_alarms(matches: usize, errors: &[f64], chance: &Chance, tried: f64) -> f64 {
    let free = matches - 5;
    let all_samples: f64 = (0..5).map(|i| ((matches - i) as f64 / (5 - i) as f64).log10()).sum();
    let fixed = (free as f64).log10() + tried.log10().min(all_samples + SOLUTIONS.log10());
    let (mut choose, mut least) = (0.0, f64::INFINITY);
    for (k, error) in (1..).zip(errors.iter().skip(5)) {
        choose += ((free + 1 - k) as f64 / k as f64).log10();
        let alarms = fixed + choose + k as f64 * chance.within(*error).min(1.0).log10();
        least = alarms.min(least);
    }
    least
}

/// How often false matches agree with a motion.
#[derive(Debug)]
pub(crate) struct Chance {
    /// The errors of those that come near, in ascending order.
    errors: Vec<f64>,
    /// How many were looked at.
    count: f64,
    /// `α(1)`.
    of_a_pixel: f64,
}

impl Chance {
    pub(crate) fn new(false_matches: &Columns, motion: &Motion) -> Self {
        let wide = WIDE * false_matches.threshold();
        let mut residuals = Residuals::default();
        false_matches.residuals(&motion.essential(), motion, &mut residuals);
        let near = |&i: &usize| residuals.values[i].abs() < wide && residuals.is_in_front(i, 0);
        let near = (0..false_matches.len()).filter(near);
        let mut errors: Vec<f64> = near.map(|i| residuals.values[i].abs()).collect();
        errors.sort_unstable_by(f64::total_cmp);
        let count = 1.0 + false_matches.len() as f64;
        let of_a_pixel = (1.0 + errors.len() as f64) / count / wide;
        Self { errors, count, of_a_pixel }
    }

    /// `α` of an error: the line, or what was measured less two of its standard deviations.
    fn within(&self, error: f64) -> f64 {
        let counted = self.share(error) * self.count;
        (error * self.of_a_pixel).max((counted - 2.0 * counted.sqrt()) / self.count)
    }

    /// The share of false matches within an error.
    pub(crate) fn share(&self, error: f64) -> f64 {
        self.errors.partition_point(|e| *e < error) as f64 / self.count
    }
}

/// Matches that are false.
pub(crate) fn false_matches(observations: &Observations) -> Columns {
    observations.columns.shifted(FALSE_MATCHES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robust::data::image::Image;
    use crate::robust::search::sampling;
    use nalgebra::{UnitQuaternion, Vector3};
    use rand::RngExt;

    #[test]
    fn false_alarms_are_counted() {
        let chance = |of_a_pixel| Chance { errors: Vec::new(), count: 1.0, of_a_pixel };
        // 5 · 252 · 4 · C(5, 5) · 0.01^5 = 5.04e-7.
        let all = least_log_false_alarms(10, &[1.0; 10], &chance(0.01), 1e9);
        assert!((10_f64.powf(all) / 5.04e-7 - 1.0).abs() < 1e-9, "{all}");
        // Ten of a hundred are no sign of anything, thirty are, and ten that agree closely.
        assert!(least_log_false_alarms(100, &[1.0; 10], &chance(0.01), 1e5) > 0.0);
        assert!(least_log_false_alarms(100, &[1.0; 30], &chance(0.01), 1e5) < -10.0);
        assert!(least_log_false_alarms(100, &[1e-4; 10], &chance(0.01), 1e5) < -10.0);
        assert!(least_log_false_alarms(100, &[1.0; 5], &chance(0.01), 1e5).is_infinite());
        // False matches of which most agree exactly: thirty that do are no sign of anything, whatever the line says.
        let exact = Chance { errors: vec![0.0; 400], count: 1_000.0, of_a_pixel: 0.01 };
        assert!(least_log_false_alarms(100, &[1e-4; 30], &exact, 1e5) > 0.0);
    }

    #[test]
    fn chance_is_the_share_of_a_band_in_the_image() {
        let rng = &mut sampling::generator(0xfa_15, 0);
        // A camera that moves to the side: epipolar lines are rows, and half of the matches would be behind it.
        let mut pixel = || Vector3::new(rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5), 1.0);
        let points: Vec<_> = (0..4_000).map(|_| [pixel(), pixel()]).collect();
        let columns = Columns::of_points([Image::Plane([500.0; 2]); 2], 2.0, points.into_iter());
        let chance =
            Chance::new(&columns, &Motion { q_21: UnitQuaternion::identity(), direction: Vector3::x() });
        // Both rows scatter: an error of one pixel is √2 of their difference, which is within ±r in 2 r/L for small r.
        let expected = |error: f64| 0.5 * 2.0 * 2_f64.sqrt() * error / 500.0;
        for error in [1.0, 2.0, 5.0] {
            let share = chance.share(error);
            // Three deviations of a count.
            assert!(
                (share - expected(error)).abs() < 3.0 * (expected(error) / 4_000.0).sqrt(),
                "{error}: {share}"
            );
            assert!((chance.within(error) / expected(error) - 1.0).abs() < 0.35, "{error}");
        }
        assert!(chance.share(0.0) <= 0.0 && chance.within(0.0) <= 0.0);
        // More than a line says, less two deviations of a count of hundred.
        let dense = Chance { errors: vec![0.5; 100], count: 1_000.0, of_a_pixel: 1e-3 };
        assert!((dense.within(1.0) - 0.08).abs() < 1e-12 && (dense.within(0.4) - 4e-4).abs() < 1e-15);
    }
}
