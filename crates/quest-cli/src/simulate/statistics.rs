//! Statistics of many numbers.

/// Mean, its confidence interval, and the median.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Statistics {
    /// The mean.
    pub(crate) mean: f64,
    /// Half the width of the mean's 95 % confidence interval, by the normal approximation; none for one value.
    pub(crate) ci95: Option<f64>,
    /// The median.
    pub(crate) median: f64,
    /// The smallest.
    pub(crate) smallest: f64,
}

impl Statistics {
    /// The statistics of these values, summed in their order; `None` if there are none.
    pub(crate) fn of(values: &[f64]) -> Option<Self> {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let half = sorted.len() / 2;
        let median = if sorted.len() % 2 == 1 {
            sorted[half]
        } else {
            let below = half.checked_sub(1)?;
            0.5 * (sorted[below] + sorted[half])
        };
        let ci95 = (values.len() > 1).then(|| 1.96 * (squares / (count - 1.0) / count).sqrt());
        Some(Self { mean, ci95, median, smallest: *sorted.first()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_a_few_numbers() {
        let found = Statistics::of(&[1.0, 5.0, 3.0, 3.0]).unwrap();
        assert_eq!((found.mean, found.median, found.smallest), (3.0, 3.0, 1.0));
        // The variance is 8/3, of the mean 2/3.
        assert!((found.ci95.unwrap() - 1.96 * (2.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        let one = Statistics::of(&[2.0]).unwrap();
        assert_eq!((one.median, one.ci95), (2.0, None));
        assert_eq!(Statistics::of(&[]), None);
    }
}
