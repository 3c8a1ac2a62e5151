//! The noise of the inliers.

use crate::algebra::vectors::exponential::exp;

/// The median absolute value of a standard normal variable.
const MEDIAN_TO_SIGMA: f64 = 1.482_602_218_505_602;

/// Residuals beyond this many standard deviations are left out of the variance.
const CUT: f64 = 2.5;

/// Where it is normal, 1.2 % lie there; more than this share is a sign of heavier tails.
const MOST_BEYOND: f64 = 0.045;

/// The variance is taken again over what the last one leaves, at most `ROUNDS` times, until it moves by less than the share
/// `SETTLED`. It then is off by less than it scatters: by `1/√(2n)`, 2 % with 1,250 matches.
const ROUNDS: usize = 6;
const SETTLED: f64 = 0.02;

/// Parameters of a motion.
const PARAMETERS: f64 = 5.0;

/// The noise is not taken to be below this share of the threshold: exact matches are fitted all the same.
const FLOOR: f64 = 0.01;

/// What is known of the noise before any residual is seen: a threshold is usually chosen at three standard deviations. It
/// counts as `USUAL_COUNT` residuals where there are few, and is forgotten over `FORGOTTEN` more of them.
const USUAL: f64 = 1.0 / 3.0;
const USUAL_COUNT: f64 = 4.0;
const FORGOTTEN: f64 = 10.0;

/// The noise of sharp images, as a share of the threshold, and as how many residuals it counts where a loss is scaled.
const EXPECTED: f64 = 0.22;
const EXPECTED_COUNT: f64 = 60.0;

/// The standard deviation of the Sampson errors of inliers within `threshold`: by the median first, then by the variance of
/// what that leaves, corrected for the cut (which is the threshold where that is nearer) and for the five parameters that were
/// fitted.
pub(crate) fn estimate(residuals: impl Iterator<Item = f64>, threshold: f64) -> f64 {
    let usual = USUAL * threshold;
    let mut absolute: Vec<f64> = residuals.map(f64::abs).filter(|r| *r < threshold).collect();
    let free = absolute.len() as f64 - PARAMETERS;
    if free <= 0.0 {
        return usual;
    }
    let prior = USUAL_COUNT * exp(-free / FORGOTTEN);
    let middle = absolute.len() / 2;
    let median = *absolute.select_nth_unstable_by(middle, f64::total_cmp).1;
    // The factor for few residuals is that of P. J. Rousseeuw, A. M. Leroy, Robust regression (1987), chapter 5.
    let by_median = MEDIAN_TO_SIGMA * (1.0 + PARAMETERS / free) * median;
    let mut sigma = by_median.max(usual * prior / USUAL_COUNT).clamp(FLOOR * threshold, threshold);
    for _ in 0..ROUNDS {
        let cut = (CUT * sigma).min(threshold);
        let kept = absolute.iter().filter(|r| **r < cut);
        let (n, sum) = kept.fold((0.0, 0.0), |(n, sum), r| (n + 1.0, sum + r * r));
        let weight = (n - PARAMETERS).max(0.0) + prior;
        if weight <= 0.0 {
            break;
        }
        let variance = (sum / share_left(cut / sigma) + prior * usual * usual) / weight;
        let last = sigma;
        sigma = variance.sqrt().clamp(FLOOR * threshold, threshold);
        if (sigma - last).abs() < SETTLED * last {
            break;
        }
    }
    sigma
}

/// What share of its variance a standard normal variable has left when it is cut at `cut`, up to [`CUT`]: by the rule of
/// midpoints, to three digits.
fn share_left(cut: f64) -> f64 {
    const NODES: u32 = 16;
    let mut sums = (0.0, 0.0);
    for node in 0..NODES {
        let x = (f64::from(node) + 0.5) / f64::from(NODES) * cut;
        let density = exp(-0.5 * x * x);
        sums = (sums.0 + density, sums.1 + density * x * x);
    }
    sums.1 / sums.0
}

/// The noise that a loss is scaled by, when so many inliers within `threshold` show the noise `sigma`: of few residuals the
/// smallest and the largest scale fit as well, and what is usual decides (the mean of a variance whose prior is the inverse
/// χ² distribution).
pub(crate) fn prudent(sigma: f64, inliers: usize, threshold: f64) -> f64 {
    let free = (inliers as f64 - PARAMETERS).max(0.0);
    let expected = EXPECTED * threshold;
    let sum = EXPECTED_COUNT * expected * expected + free * sigma * sigma;
    (sum / (EXPECTED_COUNT + free)).sqrt()
}

/// Whether residuals have no heavier tails than normal ones, as far as so many can tell. Points that are matched in real images
/// have 5 to 30 % of them beyond 2.5 standard deviations.
pub(crate) fn is_normal(residuals: impl ExactSizeIterator<Item = f64>, sigma: f64) -> bool {
    let count = residuals.len() as f64;
    let beyond = residuals.filter(|r| r.abs() > CUT * sigma).count() as f64;
    beyond + 1.0 < MOST_BEYOND * count
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn normal_noise_is_measured() {
        let mut rng = ChaCha8Rng::seed_from_u64(41);
        // The last is cut at the threshold, where half of the variance is left.
        for sigma in [0.1, 0.3, 0.65] {
            let all: Vec<f64> =
                (0..20_000).map(|_| sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng)).collect();
            let found = estimate(all.into_iter(), 1.0);
            // 20,000 values scatter by half a percent, by one and a half where so few are left; the last round moves
            // by two, towards the truth.
            assert!((found / sigma - 1.0).abs() < 0.04, "{found}");
        }
    }

    #[test]
    fn cut_normal_variables_have_less_variance() {
        // 1 − 2 k φ(k) / (2 Φ(k) − 1).
        for (cut, share) in [(2.5, 0.911_25), (1.5, 0.551_5), (0.1, 0.003_33)] {
            assert!((share_left(cut) / share - 1.0).abs() < 5e-3, "{cut}: {}", share_left(cut));
        }
    }

    #[test]
    fn heavy_tails_are_told_from_normal_ones() {
        let mut rng = ChaCha8Rng::seed_from_u64(42);
        let mut normal = || Distribution::<f64>::sample(&StandardNormal, &mut rng);
        for count in [70, 500, 5_000] {
            let all: Vec<f64> = (0..count).map(|_| normal()).collect();
            assert!(is_normal(all.iter().copied(), 1.0));
            // One in five is three times as large: the noise that is measured is about 1.2.
            let mixed = all.iter().enumerate().map(|(i, r)| if i % 5 == 0 { 3.0 * r } else { *r });
            assert!(!is_normal(mixed.collect::<Vec<_>>().into_iter(), 1.2));
        }
        // Of a few nothing can be told.
        assert!(!is_normal([0.1; 20].into_iter(), 1.0));
    }

    #[test]
    fn prudence_yields_to_evidence() {
        assert!((prudent(0.5, 5, 1.0) - 0.22).abs() < 1e-12);
        let half_way = (0.5_f64 * (0.22 * 0.22 + 0.25)).sqrt();
        assert!((prudent(0.5, 65, 1.0) - half_way).abs() < 1e-12);
        assert!((prudent(0.5, 100_000, 1.0) / 0.5 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn few_or_exact_residuals_leave_a_usable_value() {
        assert!((estimate([0.1; 4].into_iter(), 1.5) - 0.5).abs() < 1e-15);
        // Six residuals of which five are fitted say little.
        assert!(estimate([1e-3; 6].into_iter(), 1.5) > 0.3);
        assert!(estimate([0.0; 50].into_iter(), 1.0) > 0.0);
    }
}
