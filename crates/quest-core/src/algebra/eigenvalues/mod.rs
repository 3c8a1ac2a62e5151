//! All eigenvalues of a small real matrix: balancing, reduction to Hessenberg form, shifted LR. Eigenvectors of those that
//! are asked for, by inverse iteration.
//!
//! After Wilkinson and Reinsch, *Handbook for Automatic Computation II* (1971), contributions II/11 (balancing), II/13
//! (elimination to Hessenberg form), II/14 (implicit double shift), II/16 (elimination with exchanges in place of
//! orthogonal transformations) and II/18 (inverse iteration), for row-major arrays of fixed and even size.
//!
//! LR and not QR: a step of the chase has two operations an entry in place of five, and waits for a division alone, where a
//! reflection waits for a square root as well. It takes about as many sweeps. What it may cost is known afterwards, from the
//! sums of the eigenvalues and of their squares.

mod hessenberg;
mod lr;

pub(crate) use hessenberg::Hessenberg;
use nalgebra::Complex;

use hessenberg::{balance, to_hessenberg};
use lr::hessenberg_eigenvalues;

/// The eigenvalues of `a`, complex pairs next to each other; `a` is overwritten.
///
/// `None` where the iteration does not converge or loses too many digits, as for a matrix that is not finite: a caller has
/// another matrix with the same solutions.
pub(crate) fn eigenvalues<const N: usize>(a: &mut [[f64; N]; N]) -> Option<[Complex<f64>; N]> {
    if a.iter().flatten().any(|x| !x.is_finite()) {
        return None;
    }
    balance(a);
    to_hessenberg(a);
    hessenberg_eigenvalues(a)
}

/// The entries of a row, two and two.
fn pairs<const N: usize>(row: &[f64; N]) -> &[[f64; 2]] {
    const { assert!(N.is_multiple_of(2)) }
    row.as_chunks().0
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::array::from_fn;

    fn agrees_with_faer<const N: usize>(a: &[[f64; N]; N]) {
        let ours = eigenvalues(&mut a.clone()).unwrap();
        let theirs = faer::Mat::from_fn(N, N, |i, j| a[i][j]).eigenvalues().unwrap();
        let mut left: Vec<_> = theirs.iter().map(|z| Complex::new(z.re, z.im)).collect();
        let norm = a.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
        for z in ours {
            let (k, distance) = left
                .iter()
                .enumerate()
                .map(|(k, y)| (k, (y - z).norm()))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap();
            // Backward stable to N ε |A|; an eigenvalue of a random matrix has a condition number of
            // up to some thousand, and both sides err.
            assert!(distance < 1e-9 * norm, "{z} is off by {distance:e}");
            left.swap_remove(k);
        }
    }

    #[test]
    fn random_matrices_agree_with_faer() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..200 {
            let mut a = [[0.0; 20]; 20];
            for x in a.as_flattened_mut() {
                *x = rng.random_range(-1.0..1.0);
            }
            agrees_with_faer(&a);
            let b: [[f64; 10]; 10] = from_fn(|i| from_fn(|j| a[i][j]));
            agrees_with_faer(&b);
        }
    }

    #[test]
    fn eigenvectors_of_badly_scaled_matrices() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        for _ in 0..200 {
            let mut a = [[0.0; 20]; 20];
            for (row, down) in a.iter_mut().zip([1.0, 1e1, 1e2].into_iter().cycle()) {
                for (x, along) in row.iter_mut().zip([1.0, 1e-1, 1e-2, 1e-3].into_iter().cycle()) {
                    *x = rng.random_range(-1.0..1.0) * down * along;
                }
            }
            let form = Hessenberg::new(a).unwrap();
            for value in form.eigenvalues().unwrap() {
                let x = form.eigenvector(value).unwrap();
                let size = x.iter().map(|x| x.norm()).fold(0.0, f64::max);
                for (k, row) in a.iter().enumerate() {
                    let product: Complex<f64> = row.iter().zip(&x).map(|(a, x)| x * a).sum();
                    // Entries of up to 100, twenty terms; eigenvalues err by 1e-12 or so.
                    assert!((product - value * x[k]).norm() < 1e-9 * size, "{value}");
                }
            }
        }
    }

    #[test]
    fn companion_matrix_has_the_planted_roots() {
        // (x − 1)(x − 2)…(x − 6): the shift that stalls on a cyclic permutation is exercised below.
        let coefficients = [21.0, -175.0, 735.0, -1624.0, 1764.0, -720.0];
        let mut a = [[0.0; 6]; 6];
        a[0] = coefficients;
        for i in 1..6 {
            a[i][i - 1] = 1.0;
        }
        let mut values: Vec<_> = eigenvalues(&mut a).unwrap().iter().map(|z| z.re).collect();
        values.sort_by(f64::total_cmp);
        for (k, x) in values.iter().enumerate() {
            assert!((x - (k + 1) as f64).abs() < 1e-9, "{x}");
        }
    }

    #[test]
    fn cyclic_permutation_has_the_roots_of_unity() {
        let mut a = [[0.0; 8]; 8];
        for i in 0..8 {
            a[i][(i + 1) % 8] = 1.0;
        }
        for z in eigenvalues(&mut a).unwrap() {
            assert!((z.powu(8) - Complex::new(1.0, 0.0)).norm() < 1e-12);
        }
    }

    #[test]
    fn matrices_that_are_not_finite_are_refused() {
        let mut a = [[1.0; 4]; 4];
        a[2][1] = f64::NAN;
        assert!(eigenvalues(&mut a).is_none());
        assert_eq!(eigenvalues(&mut [[0.0; 4]; 4]).unwrap(), [Complex::new(0.0, 0.0); 4]);
    }

    #[test]
    fn what_is_not_finite_has_no_eigenvalues() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for (row, column) in [(0, 0), (3, 1), (1, 3)] {
                let mut a = [[1.0; 4]; 4];
                a[row][column] = bad;
                assert!(Hessenberg::new(a).is_none() && eigenvalues(&mut a).is_none(), "{bad}");
            }
        }
    }

    #[test]
    fn balancing_is_a_similarity_however_far_rows_and_columns_are_apart() {
        // The last one is further apart than a factor may be: 1e100.
        for size in [1.0, 1e10, 1e100, 1e150, 1e250] {
            for (high, low) in [(size, 1.0 / size), (1.0 / size, size)] {
                let before = [[2.0, high], [low, -3.0]];
                let mut after = before;
                let scales = balance(&mut after);
                for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    // The scales are powers of two, so that nothing is rounded.
                    let expected = before[i][j] * (scales[j] / scales[i]);
                    assert_eq!(after[i][j].to_bits(), expected.to_bits(), "{size} {scales:?}");
                }
                assert!((after[0][1] / after[1][0]).abs().ln().abs() <= (high / low).ln().abs(), "{size}");
            }
        }
        // A column or a row of zeros has no scale.
        let mut triangular = [[1.0, 1e9], [0.0, 2.0]];
        assert!(balance(&mut triangular).iter().all(|scale| scale.to_bits() == 1.0_f64.to_bits()));
    }

    #[test]
    fn triangular_matrices_have_their_diagonal_and_its_vectors() {
        let a = [[1.0, 0.5, -0.3, 2.0], [0.0, 2.0, 0.7, -1.0], [0.0, 0.0, -3.0, 0.4], [0.0, 0.0, 0.0, 5.0]];
        let form = Hessenberg::new(a).unwrap();
        for (k, value) in form.eigenvalues().unwrap().into_iter().enumerate() {
            assert!((value - a[k][k]).norm() < 1e-14, "{value}");
            let x = form.eigenvector(a[k][k]).unwrap();
            let size = x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            for (row, own) in a.iter().zip(x) {
                let product: f64 = row.iter().zip(x).map(|(a, x)| a * x).sum();
                assert!((product - a[k][k] * own).abs() < 1e-14 * size, "{k}");
            }
        }
    }
}
