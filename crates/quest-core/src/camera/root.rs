//! How far a polynomial stays positive.

/// Number of coefficients of a [`Polynomial`].
pub(super) const COEFFICIENTS: usize = 15;

/// A polynomial by its coefficients in ascending order.
pub(super) type Polynomial = [f64; COEFFICIENTS];

/// A radius up to which `p` is positive: just short of its first root in `(0, limit]`, or `limit`.
///
/// Expects `p(0) > 0`. Walks to the root in steps that cannot jump over it: with `p(a + h) = Σ c_k h^k`, the
/// polynomial is positive as long as `c_0` outweighs the negative terms. If no root follows, there are no negative terms and
/// the steps grow without bound. Steps to a simple root converge quadratically.
pub(super) fn positive_up_to(p: &Polynomial, limit: f64) -> f64 {
    // A pair of complex roots close to the axis shortens the steps geometrically, then lets them grow again:
    // about 60 steps at the worst. Stopping early is safe, only too cautious.
    const MAX_STEPS: usize = 500;
    let mut shifted = *p;
    let mut a = 0.0;
    for _ in 0..MAX_STEPS {
        let step = safe_step(&shifted);
        if a + step >= limit {
            return limit;
        }
        a += step;
        if step <= 1e-13 * a {
            break;
        }
        shift(&mut shifted, step);
    }
    // The root may be a pole of the caller's: stay clear of it by more than rounding.
    a * (1.0 - 1e-12)
}

/// Replaces `p(x)` by `p(x + a)`: repeated synthetic division.
fn shift(p: &mut Polynomial, a: f64) {
    for first in 0..COEFFICIENTS - 1 {
        for k in (first..COEFFICIENTS - 1).rev() {
            p[k] += a * p[k + 1];
        }
    }
}

/// A step `h` with `c_0 > Σ |c_k| h^k` over the negative `c_k`; infinite where there are none.
fn safe_step(c: &Polynomial) -> f64 {
    if c[0] <= 0.0 {
        return 0.0;
    }
    // Each negative term alone gives an upper bound. From there Newton descends to the root of the concave
    // difference without crossing it.
    let alone =
        |(k, &ck): (usize, &f64)| if ck < 0.0 { (c[0] / -ck).powf(1.0 / k as f64) } else { f64::INFINITY };
    let mut h = c.iter().enumerate().skip(1).map(alone).fold(f64::INFINITY, f64::min);
    if h.is_finite() {
        for _ in 0..50 {
            let (value, slope) = c[1..].iter().rev().fold((0.0, 0.0), |(v, d), &ck| {
                let negative = ck.min(0.0);
                (v * h + negative, d * h + v)
            });
            // The fold evaluated q(h) = Σ c_k h^(k-1); the difference is c_0 + h q(h).
            let change = (c[0] + h * value) / (value + h * slope);
            h -= change;
            if change.abs() <= 1e-12 * h {
                break;
            }
        }
    }
    h * (1.0 - 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from_roots(roots: &[f64]) -> Polynomial {
        let mut p = [0.0; COEFFICIENTS];
        p[0] = 1.0;
        for root in roots {
            for k in (0..COEFFICIENTS).rev() {
                p[k] -= if k > 0 { p[k - 1] / root } else { 0.0 };
            }
        }
        p
    }

    #[test]
    fn the_first_positive_root_is_found_from_below() {
        for (roots, first) in [
            (&[0.5, 0.7, 2.0][..], 0.5),
            (&[-1.0, 3.0, 1e4], 3.0),
            (&[1e-6, 1.0, -5.0], 1e-6),
            (&[-3.0, -2.0, 2.0, 3.0, -1.0, 1.0, 4.0, -4.0, 5.0, -5.0, 6.0, -6.0], 1.0),
        ] {
            let found = positive_up_to(&from_roots(roots), 6.7e7);
            // 1e-12 by design and the condition of the root, below 1e3 here.
            assert!(found <= first * (1.0 + 1e-13) && found >= first * (1.0 - 1e-9), "{found} {first}");
        }
    }

    #[test]
    fn a_double_root_stops_the_walk_and_a_near_miss_does_not() {
        let mut p = [0.0; COEFFICIENTS];
        p[..3].copy_from_slice(&[1.0, -2.0, 1.0]);
        // The double root is determined to the square root of the rounding only.
        assert!((positive_up_to(&p, 10.0) - 1.0).abs() < 1e-6);
        p[0] += 1e-9;
        assert_eq!(positive_up_to(&p, 10.0).to_bits(), 10f64.to_bits());
    }

    #[test]
    fn without_roots_the_limit_is_returned() {
        let mut p = [0.0; COEFFICIENTS];
        p[0] = 1.0;
        assert_eq!(positive_up_to(&p, 7.0).to_bits(), 7f64.to_bits());
        p[4] = 1e30;
        assert_eq!(positive_up_to(&p, 7.0).to_bits(), 7f64.to_bits());
        // One that begins without being positive is so nowhere.
        for begin in [0.0, -1.0] {
            p[0] = begin;
            assert_eq!(positive_up_to(&p, 7.0).to_bits(), 0f64.to_bits());
        }
    }
}
