//! What share of the samples without outliers leads to a pose: noise makes the others useless.

/// The share that is assumed while nothing is known, and for poses that were not found. It is that of little parallax and points near
/// a plane; with points all about and much parallax nine in ten samples lead to the pose.
pub(crate) const USEFUL: f64 = 1.0 / 6.0;

/// The assumed share counts as this many samples.
const WEIGHT: f64 = 6.0;

/// The share is never taken to be less than this part of [`USEFUL`]: it is what the search would wait for.
const LEAST: f64 = 0.5 * USEFUL;

/// More samples are not looked at: the share is known to a tenth then.
const ENOUGH: f64 = 50.0;

/// Learns the share from samples of inliers of the best pose.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Useful {
    tried: f64,
    useful: f64,
}

impl Useful {
    /// Whether more samples would tell more.
    pub(crate) fn is_open(&self) -> bool {
        self.tried < ENOUGH
    }

    /// One more sample.
    pub(crate) fn add(&mut self, is_useful: bool) {
        self.tried += 1.0;
        self.useful += f64::from(u8::from(is_useful));
    }

    /// The mean of what is known, less one standard deviation of it.
    pub(crate) fn share(&self) -> f64 {
        let weight = self.tried + WEIGHT;
        let mean = (self.useful + WEIGHT * USEFUL) / weight;
        (mean - (mean * (1.0 - mean) / (weight + 1.0)).sqrt()).max(LEAST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_goes_from_what_is_assumed_to_what_is_found() {
        let after = |tried, useful| {
            let mut share = Useful::default();
            (0..tried).for_each(|k| share.add(k < useful));
            assert_eq!(share.is_open(), tried < 50);
            share.share()
        };
        // Nothing is known: 1/6 less its deviation, √(5/36/7) = 0.14, is below the least.
        assert!((after(0, 0) - LEAST).abs() < 1e-12);
        // (50 + 1)/56 = 0.911, less √(0.911 · 0.089/57) = 0.038.
        assert!((after(50, 50) - 0.873).abs() < 1e-3);
        assert!((after(50, 0) - LEAST).abs() < 1e-12);
        assert!(after(50, 25) < 0.5 && after(50, 25) > 0.35);
    }
}
