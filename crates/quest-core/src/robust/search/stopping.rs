//! What a sample is worth to the decision to stop.
//!
//! A sample leads to a pose with probability `p`; it has been missed by all samples with probability `Π (1 − p)`. So samples are
//! counted by their gain `−ln(1 − p)`, and there are enough when the sum reaches `−ln(1 − confidence)`.

/// The chance that a sample of `size` of `n` matches, drawn without replacement, lies within `k` of them.
pub(crate) fn chance(k: f64, n: f64, size: usize) -> f64 {
    (0..size).map(|i| ((k - i as f64) / (n - i as f64)).clamp(0.0, 1.0)).product()
}

/// `−ln(1 − p)`, finite.
pub(crate) fn gain(p: f64) -> f64 {
    // ln_1p keeps what a small probability has.
    -(-p.min(1.0 - f64::EPSILON)).ln_1p()
}

/// The sum of gains that is enough.
pub(crate) fn enough(confidence: f64) -> f64 {
    gain(confidence)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_formula() {
        let samples = |k, n, useful: f64, confidence| enough(confidence) / gain(useful * chance(k, n, 5));
        // 0.5^5 / 6 = 1/192 for many matches: ln(0.001) / ln(191/192) = 1322.8.
        let many = samples(5e5, 1e6, 1.0 / 6.0, 0.999);
        assert!((many - 1322.8).abs() < 0.1, "{many}");
        // 252 of 15504 samples of 5 out of 20 come from 10 inliers.
        let few = samples(10.0, 20.0, 1.0, 0.9);
        assert!((few - 0.1_f64.ln() / (1.0 - 252.0 / 15504.0_f64).ln()).abs() < 1e-9);
        assert!(samples(4.0, 20.0, 1.0, 0.999).is_infinite());
        assert!(gain(1.0).is_finite());
    }

    #[test]
    fn more_inliers_take_fewer_samples() {
        let all: Vec<_> = (5..100).map(|k| gain(chance(f64::from(k), 100.0, 5))).collect();
        assert!(all.windows(2).all(|w| w[1] > w[0]));
    }
}
