//! Cholesky's factorisation in place, for sizes known only at run time.

/// Replaces the lower triangle of a symmetric matrix, `n` rows of `n`, by its factor `L`, `A = L Lᵀ`. The upper triangle is
/// neither read nor written. `false` where the matrix is not positive definite; it is then spoilt.
pub(crate) fn factor(a: &mut [f64], n: usize) -> bool {
    for j in 0..n {
        let (above, from_j) = a.split_at_mut(j * n);
        let (row_j, below) = from_j.split_at_mut(n);
        for k in 0..j {
            let row_k = &above[k * n..k * n + k];
            let dot: f64 = row_k.iter().zip(&row_j[..k]).map(|(x, y)| x * y).sum();
            row_j[k] = (row_j[k] - dot) / above[k * n + k];
        }
        let squares: f64 = row_j[..j].iter().map(|x| x * x).sum();
        let pivot = row_j[j] - squares;
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        row_j[j] = pivot.sqrt();
        debug_assert_eq!(below.len(), (n - j - 1) * n);
    }
    true
}

/// Replaces `b` by `L⁻¹ b`, by columns of `b`: `n` rows of `M`.
pub(crate) fn solve_lower<const M: usize>(l: &[f64], b: &mut [[f64; M]]) {
    let n = b.len();
    for i in 0..n {
        let (done, rest) = b.split_at_mut(i);
        let row = &l[i * n..i * n + i];
        for (&factor, known) in row.iter().zip(done) {
            for (x, y) in rest[0].iter_mut().zip(known.iter()) {
                *x -= factor * y;
            }
        }
        rest[0].iter_mut().for_each(|x| *x /= l[i * n + i]);
    }
}

/// Replaces `b` by `L⁻ᵀ b`.
pub(crate) fn solve_upper(l: &[f64], b: &mut [f64]) {
    let n = b.len();
    for i in (0..n).rev() {
        b[i] /= l[i * n + i];
        for k in 0..i {
            b[k] -= l[i * n + k] * b[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planted_solution_is_found() {
        for n in 1..9 {
            let entry = |i: usize, j: usize| 1.0 / (1.0 + (3 * i + 5 * j) as f64).sin();
            // B Bᵀ + I is positive definite.
            let square = |i: usize, j: usize| (0..n).map(|k| entry(i, k) * entry(j, k)).sum::<f64>();
            let a: Vec<f64> =
                (0..n * n).map(|k| square(k / n, k % n) + if k / n == k % n { 1.0 } else { 0.0 }).collect();
            let x: Vec<f64> = (0..n).map(|i| i as f64 - 1.5).collect();
            let mut b: Vec<[f64; 1]> =
                (0..n).map(|i| [(0..n).map(|j| a[i * n + j] * x[j]).sum::<f64>()]).collect();
            let mut l = a.clone();
            assert!(factor(&mut l, n));
            solve_lower(&l, &mut b);
            let mut b: Vec<f64> = b.into_iter().map(|[y]| y).collect();
            solve_upper(&l, &mut b);
            let scale = a.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
            for (found, expected) in b.iter().zip(&x) {
                // The smallest eigenvalue is 1 at least: the condition is about n · scale.
                assert!((found - expected).abs() < 1e-14 * 10.0 * n as f64 * scale, "{n}");
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        assert!(!factor(&mut [1.0, 0.0, 2.0, 1.0], 2));
        assert!(!factor(&mut [f64::NAN], 1));
        assert!(!factor(&mut [f64::INFINITY], 1));
        assert!(!factor(&mut [0.0], 1));
    }
}
