//! The null space of a wide matrix by Householder reflections.

use super::two::Two;

/// An orthonormal basis of the vectors orthogonal to the `R` rows of `a`, and the smallest pivot over the largest: how
/// far the rows are from dependent.
///
/// Rows that depend on those before leave nothing to reflect. `C = R + K`; `a` is overwritten.
pub(crate) fn null_space<const R: usize, const C: usize, const K: usize>(
    a: &mut [[f64; C]; R],
) -> ([[f64; C]; K], f64) {
    const { assert!(R + K == C) }
    let mut inverse = [0.0; R];
    let (mut smallest, mut largest) = (f64::INFINITY, 0.0_f64);
    for k in 0..R {
        // The row becomes the reflection's vector v, with I − v vᵀ · inverse, zero ahead of entry k: loops of fixed length
        // are worth more than the products with these zeros. No entry is written alone: what reads two would wait for it.
        let (head, tail) = a.split_at_mut(k + 1);
        let v = &mut head[k];
        for j in 0..C {
            v[j] *= Entries::<R, C>::FROM[k][j];
        }
        let length = dot(v, v).sqrt();
        smallest = smallest.min(length);
        largest = largest.max(length);
        let image = -length.copysign(v[k]);
        inverse[k] = if length > 0.0 { 1.0 / (length * length - image * v[k]) } else { 0.0 };
        for j in 0..C {
            v[j] -= image * Entries::<R, C>::ONLY[k][j];
        }
        for row in tail {
            reflect(row, v, inverse[k]);
        }
    }
    let mut basis = [[0.0; C]; K];
    for (m, e) in basis.iter_mut().enumerate() {
        e[R + m] = 1.0;
        for k in (0..R).rev() {
            reflect(e, &a[k], inverse[k]);
        }
    }
    (basis, if largest > 0.0 { smallest / largest } else { 0.0 })
}

/// Ones for the entries from `k` on, and for entry `k` alone.
struct Entries<const R: usize, const C: usize>;

impl<const R: usize, const C: usize> Entries<R, C> {
    const FROM: [[f64; C]; R] = Self::ones().0;
    const ONLY: [[f64; C]; R] = Self::ones().1;

    const fn ones() -> ([[f64; C]; R], [[f64; C]; R]) {
        let (mut from, mut only) = ([[0.0; C]; R], [[0.0; C]; R]);
        let mut k = 0;
        while k < R {
            only[k][k] = 1.0;
            let mut j = k;
            while j < C {
                from[k][j] = 1.0;
                j += 1;
            }
            k += 1;
        }
        (from, only)
    }
}

/// Applies `I − v vᵀ · inverse`.
#[inline]
fn reflect<const C: usize>(x: &mut [f64; C], v: &[f64; C], inverse: f64) {
    let dot = dot(x, v) * inverse;
    for j in 0..C {
        x[j] -= dot * v[j];
    }
}

#[inline]
fn dot<const C: usize>(x: &[f64; C], y: &[f64; C]) -> f64 {
    let ((xs, x_rest), (ys, y_rest)) = (x.as_chunks::<2>(), y.as_chunks::<2>());
    // Two sums of two, so that the additions need not wait for each other.
    let mut sums = [Two::ZERO; 2];
    for (k, (x, y)) in xs.iter().zip(ys).enumerate() {
        sums[k % 2] += Two::new(*x) * Two::new(*y);
    }
    x_rest.iter().zip(y_rest).map(|(x, y)| x * y).sum::<f64>() + (sums[0] + sums[1]).reduce_add()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn basis_is_orthonormal_and_orthogonal_to_the_rows() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for _ in 0..100 {
            let a: [[f64; 9]; 5] =
                std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
            let (basis, pivot) = null_space::<5, 9, 4>(&mut a.clone());
            assert!(pivot > 1e-3);
            for (i, x) in basis.iter().enumerate() {
                assert!(a.iter().all(|row| dot(row, x).abs() < 1e-14));
                for (j, y) in basis.iter().enumerate() {
                    assert!((dot(x, y) - f64::from(u8::from(i == j))).abs() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn dependent_rows_have_a_small_pivot() {
        let mut a = [[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]; 5];
        for (k, row) in a.iter_mut().enumerate().take(4) {
            row[k] += 1.0;
        }
        a[4] = std::array::from_fn(|j| a[0][j] + a[1][j] - 2.0 * a[2][j]);
        assert!(null_space::<5, 9, 4>(&mut a).1 < 1e-15);
        assert!(null_space::<5, 9, 4>(&mut [[0.0; 9]; 5]).1 <= 0.0);
    }
}
