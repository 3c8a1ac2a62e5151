//! When enough samples have been drawn.

/// How often a sample without outliers has to come up before one is trusted to have been good enough: noise makes
/// many of them useless.
const REPEATS: f64 = 3.0;

/// How many samples of `size` matches it takes until, with probability `confidence`, enough of them hold
/// inliers alone.
///
/// Samples are drawn without replacement, which matters where there are few matches.
pub(super) fn iterations(inliers: usize, matches: usize, size: usize, confidence: f64) -> f64 {
    let all_inliers: f64 =
        (0..size).map(|k| inliers.saturating_sub(k) as f64 / (matches - k) as f64).product();
    if all_inliers >= 1.0 {
        return 1.0;
    }
    // ln_1p keeps what a small probability has.
    (REPEATS * (1.0 - confidence).ln() / (-all_inliers).ln_1p()).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_formula() {
        // 0.5^5 = 1/32 for many matches: ln(0.001) / ln(31/32) = 217.6.
        let many = iterations(500_000, 1_000_000, 5, 0.999) / REPEATS;
        assert!((many - 217.6).abs() < 0.1, "{many}");
        // 252 of 15504 samples of 5 out of 20 come from 10 inliers.
        let few = iterations(10, 20, 5, 0.9) / REPEATS;
        assert!((few - 0.1_f64.ln() / (1.0 - 252.0 / 15504.0_f64).ln()).abs() < 1e-9);
        assert!(iterations(20, 20, 5, 0.999) <= 1.0);
        assert!(iterations(4, 20, 5, 0.999).is_infinite());
    }

    #[test]
    fn more_inliers_take_fewer_samples() {
        let all: Vec<_> = (5..100).map(|k| iterations(k, 100, 5, 0.9999)).collect();
        assert!(all.windows(2).all(|w| w[1] < w[0]));
    }
}
