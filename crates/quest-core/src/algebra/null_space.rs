//! The null space of a wide matrix by Householder reflections.

use crate::algebra::vectors::two::Two;

/// An orthonormal basis of the vectors orthogonal to the `R` rows of `a`, and the smallest pivot over the largest: how
/// far the rows are from dependent.
///
/// Rows that depend on those before leave nothing to reflect. `C = R + K`.
pub(crate) fn null_space<const R: usize, const C: usize, const K: usize>(
    a: &[[f64; C]; R],
) -> ([[f64; C]; K], f64) {
    const { assert!(R + K == C) }
    // Row k becomes the reflection's vector v, with I − v vᵀ · inverse, zero ahead of entry k: loops of fixed length are worth more
    // than the products with these zeros.
    let mut v = a.map(|row| Blocks::new(&row));
    let mut inverse = [0.0; R];
    let (mut smallest, mut largest) = (f64::INFINITY, 0.0_f64);
    for k in 0..R {
        let (head, tail) = v.split_at_mut(k + 1);
        let row = &mut head[k];
        // The products with the row itself, which wait for no square root, give those with v.
        let (square, pivot) = (row.dot(row), row.entry(k));
        let length = square.sqrt();
        let image = -length.copysign(pivot);
        inverse[k] = if length > 0.0 { 1.0 / (square - image * pivot) } else { 0.0 };
        for other in tail {
            let factor = (row.dot(other) - image * other.entry(k)) * inverse[k];
            other.subtract_from(k + 1, factor, row);
        }
        row.subtract_unit(k, image);
        smallest = smallest.min(length);
        largest = largest.max(length);
    }
    // The product of the reflections is I − Σ v_k w_kᵀ, with w_k = inverse_k (v_k − Σ (v_k · v_l) w_l) over l > k: only of v · v
    // one waits for another.
    let mut w = [[0.0; K]; R];
    for k in (0..R).rev() {
        let mut sum: [f64; K] = std::array::from_fn(|m| v[k].entry(R + m));
        for l in k + 1..R {
            let product = v[k].dot(&v[l]);
            for m in 0..K {
                sum[m] -= product * w[l][m];
            }
        }
        w[k] = sum.map(|x| x * inverse[k]);
    }
    let basis = std::array::from_fn(|m| {
        let mut e = Blocks::new(&[0.0; C]);
        e.subtract_unit(R + m, -1.0);
        for k in 0..R {
            e.subtract_from(0, w[k][m], &v[k]);
        }
        e.to_array()
    });
    (basis, if largest > 0.0 { smallest / largest } else { 0.0 })
}

/// A row two entries a block, the first half of the blocks in use.
#[derive(Clone, Copy)]
struct Blocks<const C: usize>([Two; C]);

impl<const C: usize> Blocks<C> {
    const COUNT: usize = C.div_ceil(2);
    /// The bits of the entries from each one on, and the unit vectors.
    const FROM: [[[f64; 2]; C]; C] = Self::table(f64::from_bits(u64::MAX), C);
    const UNIT: [[[f64; 2]; C]; C] = Self::table(1.0, 1);

    /// Row by row a value in `count` entries from each one on.
    const fn table(value: f64, count: usize) -> [[[f64; 2]; C]; C] {
        let mut table = [[[0.0; 2]; C]; C];
        let mut k = 0;
        while k < C {
            let mut j = k;
            while j < C && j < k + count {
                table[k][j / 2][j % 2] = value;
                j += 1;
            }
            k += 1;
        }
        table
    }

    #[inline]
    fn new(row: &[f64; C]) -> Self {
        let entry = |j: usize| if j < C { row[j] } else { 0.0 };
        Self(std::array::from_fn(|b| Two::new([entry(2 * b), entry(2 * b + 1)])))
    }

    #[inline]
    fn entry(&self, k: usize) -> f64 {
        self.0[k / 2].to_array()[k % 2]
    }

    #[inline]
    fn to_array(self) -> [f64; C] {
        let mut row = [0.0; C];
        let (pairs, rest) = row.as_chunks_mut::<2>();
        for (pair, block) in pairs.iter_mut().zip(&self.0) {
            *pair = block.to_array();
        }
        if let [last] = rest {
            *last = self.entry(C - 1);
        }
        row
    }

    #[inline]
    fn dot(&self, other: &Self) -> f64 {
        // Two sums of two, so that the additions need not wait for each other.
        let mut sums = [Two::ZERO; 2];
        for b in 0..Self::COUNT {
            sums[b % 2] += self.0[b] * other.0[b];
        }
        (sums[0] + sums[1]).reduce_add()
    }

    /// Less a multiple of another row; what stands ahead of entry `k` becomes zero.
    #[inline]
    fn subtract_from(&mut self, k: usize, factor: f64, other: &Self) {
        for b in 0..Self::COUNT {
            self.0[b] = (self.0[b] - other.0[b] * factor) & Two::new(Self::FROM[k][b]);
        }
    }

    #[inline]
    fn subtract_unit(&mut self, k: usize, factor: f64) {
        for b in 0..Self::COUNT {
            self.0[b] -= Two::new(Self::UNIT[k][b]) * factor;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn basis_is_orthonormal_and_orthogonal_to_the_rows() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let dot = |x: &[f64; 9], y: &[f64; 9]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
        for _ in 0..100 {
            let a: [[f64; 9]; 5] =
                std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
            let (basis, pivot) = null_space::<5, 9, 4>(&a);
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
        assert!(null_space::<5, 9, 4>(&a).1 < 1e-15);
        assert!(null_space::<5, 9, 4>(&[[0.0; 9]; 5]).1 <= 0.0);
    }

    #[test]
    fn tables_have_their_value_in_so_many_entries_from_each_one_on() {
        for count in [1, 2, 5] {
            for (k, row) in Blocks::<5>::table(7.0, count).iter().enumerate() {
                for (j, entry) in row.as_flattened().iter().enumerate() {
                    let expected = if (k..(k + count).min(5)).contains(&j) { 7.0 } else { 0.0_f64 };
                    assert_eq!(entry.to_bits(), expected.to_bits(), "{count} entries from {k}: {j}");
                }
            }
        }
    }
}
