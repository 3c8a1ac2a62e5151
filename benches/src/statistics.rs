//! Numbers about many numbers.

/// The value that a fraction `p` of the sorted values do not exceed, `NaN` of none: the nearest rank.
#[must_use]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a rank within the length of a slice"
)]
pub fn percentile(sorted: &[f64], p: f64) -> f64 {
    let rank = (p * sorted.len() as f64).ceil().max(1.0) as usize;
    sorted.get(rank.min(sorted.len()).wrapping_sub(1)).copied().unwrap_or(f64::NAN)
}

/// The values in ascending order, infinite ones last.
#[must_use]
pub fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    all
}

/// The mean, `NaN` of nothing.
#[must_use]
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_ranks() {
        let all = sorted((1..=1000).rev().map(f64::from).chain([f64::INFINITY]));
        assert!((percentile(&all, 0.5) - 501.0).abs() < 1e-12);
        assert!((percentile(&all, 0.999) - 1000.0).abs() < 1e-12);
        assert!(percentile(&all, 1.0).is_infinite() && (percentile(&all, 0.0) - 1.0).abs() < 1e-12);
        assert!(percentile(&[], 0.5).is_nan());
    }

    #[test]
    fn the_mean_of_nothing_is_no_number() {
        assert!((mean([1.0, 2.0, 6.0].into_iter()) - 3.0).abs() < 1e-15);
        assert!(mean(std::iter::empty()).is_nan());
    }
}
