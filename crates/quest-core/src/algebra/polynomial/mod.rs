//! The roots of a real polynomial of small fixed degree: the real ones (`real.rs`) counted by Sturm's theorem (`sturm.rs`),
//! isolated and refined (`bracket.rs`); the complex ones of what is left (`complex.rs`).
//!
//! Coefficients stand from the constant up; a polynomial of degree `D` has `N = D + 1` of them.

mod bracket;
mod complex;
mod real;
mod sturm;

pub(crate) use bracket::RealRoots;
pub(crate) use complex::complex_roots;
pub(crate) use real::real_roots;

/// Steps to refine a root; four are usual.
const MAX_STEPS: usize = 80;

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The polynomial of degree 10 with these roots, the complex ones with their conjugates.
    fn planted(real: &[f64], complex: &[Complex<f64>]) -> [f64; 11] {
        let mut p = [0.0; 11];
        p[0] = 1.0;
        let mut degree = 0;
        let factors = complex.iter().map(|z| [z.norm_sqr(), -2.0 * z.re, 1.0]);
        for factor in real.iter().map(|r| [-r, 1.0, 0.0]).chain(factors) {
            let mut product = [0.0; 11];
            for i in 0..=degree {
                for (j, f) in factor.iter().enumerate().filter(|(j, _)| i + j < 11) {
                    product[i + j] += p[i] * f;
                }
            }
            degree += if factor[2] == 0.0 { 1 } else { 2 };
            p = product;
        }
        assert_eq!(degree, 10);
        p
    }

    #[test]
    fn planted_roots_are_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        for round in 0..2000 {
            let pairs = round % 6;
            let mut real: Vec<f64> = (0..10 - 2 * pairs)
                .map(|_| rng.random_range(-1.0..1.0_f64) * 10_f64.powf(rng.random_range(-1.0..1.0)))
                .collect();
            real.sort_by(f64::total_cmp);
            let complex: Vec<_> = (0..pairs)
                .map(|_| Complex::new(rng.random_range(-2.0..2.0), rng.random_range(0.05..2.0)))
                .collect();
            let p = planted(&real, &complex);
            // Roots closer than this are lost in the rounding of the coefficients.
            if real.windows(2).any(|w| w[1] - w[0] < 1e-2 * w[1].abs().max(0.1)) {
                continue;
            }
            let found = real_roots(&p);
            assert_eq!(found.as_slice().len(), real.len(), "{real:?} {complex:?}");
            for (x, y) in found.as_slice().iter().zip(&real) {
                assert!((x - y).abs() < 1e-6 * (1.0 + y.abs()), "{x} {y}");
            }
            let mut out = [Complex::from(0.0); 11];
            let n = complex_roots(&p, found.as_slice(), &mut out);
            assert_eq!(n, pairs);
            for z in &complex {
                let nearest = out[..n].iter().map(|w| (w - z).norm()).fold(f64::INFINITY, f64::min);
                assert!(nearest < 1e-4, "{z} is off by {nearest:e}");
            }
        }
    }

    #[test]
    fn a_chain_that_loses_its_digits_says_so() {
        // Of a noisy five-point problem. The leading terms of its first two members nearly cancel, and the chain counts two
        // of the four real roots, near −1.3224, −1.3032, 0.3016 and 0.7417.
        let p = [
            20.410_937_491_442_69,
            -11.526_383_629_997_055,
            -145.592_640_071_085_58,
            -176.159_648_712_850_13,
            30.516_545_741_724_837,
            256.736_337_101_047_35,
            282.053_204_553_523_24,
            164.169_041_260_380_2,
            56.864_489_112_105_495,
            11.241_241_541_789_88,
            1.0,
        ];
        let found = real_roots(&p);
        assert!(found.close && found.as_slice().len() <= 4);
        let apart = planted(
            &[-2.0, -1.0, 0.5, 3.0],
            &[Complex::i(), Complex::new(1.0, 2.0), Complex::new(-1.0, 0.5)],
        );
        assert!(!real_roots(&apart).close);
    }

    #[test]
    fn roots_without_end() {
        // A leading coefficient of zero, an exact double root, NaN: no panic, and not certain.
        let mut p =
            planted(&[-2.0, -1.0, 0.5, 3.0], &[Complex::new(0.0, 1.0), Complex::new(1.0, 2.0), Complex::i()]);
        assert!(real_roots(&p).as_slice().len() >= 4);
        p[10] = 0.0;
        assert!(!real_roots(&p).certain);
        p[3] = f64::NAN;
        assert!(!real_roots(&p).certain);
        assert!(!real_roots(&[0.0; 11]).certain);
    }

    #[test]
    fn what_is_not_a_number_does_not_become_one() {
        let mut out = [Complex::new(0.0, 0.0); 11];
        assert_eq!(complex_roots(&[f64::NAN; 11], &[], &mut out), 0);
    }

    #[test]
    fn a_chain_ends_where_a_root_is_exactly_multiple_or_too_far_out() {
        // x⁴ and (x − 1)² leave nothing behind their first member.
        assert!(sturm::Chain::new(&[0.0, 0.0, 0.0, 0.0, 1.0]).is_none());
        assert!(sturm::Chain::new(&[1.0, -2.0, 1.0]).is_none());
        // (x − 1)(x − r), whose second root may be one at infinity.
        for (root, counted) in [(1e3, 2.0), (1e11, 2.0), (1e15, 1.0)] {
            let chain = sturm::Chain::new(&[root, -(1.0 + root), 1.0]).unwrap();
            let [from, _] = chain.ends([0.0; 2]);
            let to = chain.bound(1.0, from).unwrap();
            assert!((from.changes - to.changes - counted).abs() < 0.5, "{root}: {}", to.x);
            assert!(to.x < 1e13 && chain.bound(-1.0, from).is_none(), "{root}: {}", to.x);
        }
    }

    #[test]
    fn complex_roots_that_are_double_stay_where_they_were_found() {
        // (x² + 1)² has no slope at its roots.
        let mut out = [Complex::new(0.0, 0.0); 5];
        assert_eq!(complex_roots(&[1.0, 0.0, 2.0, 0.0, 1.0], &[], &mut out), 2);
        // Half of the digits are left of a double root.
        assert!(out[..2].iter().all(|z| (z - Complex::new(0.0, 1.0)).norm() < 1e-7), "{out:?}");
    }
}
