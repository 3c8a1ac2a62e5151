//! When enough samples have been drawn.

/// The share of the samples without outliers that lead to the pose: noise makes the others useless. Of points all about, seen
/// with much parallax, nine in ten do; this is for little parallax and points near a plane.
const USEFUL: f64 = 1.0 / 6.0;

/// How many samples of `size` matches it takes until, with probability `confidence`, one of them holds inliers alone and
/// is useful.
///
/// Samples are drawn without replacement, which matters where there are few matches.
pub(crate) fn iterations(inliers: usize, matches: usize, size: usize, confidence: f64) -> f64 {
    let all_inliers: f64 =
        (0..size).map(|k| inliers.saturating_sub(k) as f64 / (matches - k) as f64).product();
    // ln_1p keeps what a small probability has.
    ((1.0 - confidence).ln() / (-USEFUL * all_inliers).ln_1p()).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_formula() {
        // 0.5^5 / 6 = 1/192 for many matches: ln(0.001) / ln(191/192) = 1322.8.
        let many = iterations(500_000, 1_000_000, 5, 0.999);
        assert!((many - 1322.8).abs() < 0.1, "{many}");
        // 252 of 15504 samples of 5 out of 20 come from 10 inliers.
        let few = iterations(10, 20, 5, 0.9);
        assert!((few - 0.1_f64.ln() / (1.0 - 42.0 / 15504.0_f64).ln()).abs() < 1e-9);
        // Inliers alone: 0.001 = (5/6)^37.89.
        assert!((iterations(20, 20, 5, 0.999) - 37.89).abs() < 0.01);
        assert!(iterations(4, 20, 5, 0.999).is_infinite());
    }

    #[test]
    fn more_inliers_take_fewer_samples() {
        let all: Vec<_> = (5..100).map(|k| iterations(k, 100, 5, 0.9999)).collect();
        assert!(all.windows(2).all(|w| w[1] < w[0]));
    }
}
