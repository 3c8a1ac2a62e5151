//! All eigenvalues and eigenvectors of a small symmetric matrix: reduction to tridiagonal form, implicit QL.
//!
//! After Wilkinson and Reinsch, *Handbook for Automatic Computation II* (1971), contributions II/2 and II/4. Vectors are rows, so
//! that reflections and rotations of them are loops over neighbours.

/// Iterations a single eigenvalue may take before the matrix is given up; about two are usual.
const MAX_ITERATIONS: usize = 60;

/// Eigenvalues, the largest first, and orthonormal eigenvectors of a symmetric matrix: exact to the rounding of its largest
/// eigenvalue.
pub(crate) fn eigen<const N: usize>(mut a: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let (mut off, mut vectors) = tridiagonal(&mut a);
    let mut values: [f64; N] = std::array::from_fn(|k| a[k][k]);
    let largest = values.iter().chain(&off).fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let negligible = f64::EPSILON * largest;
    for k in 0..N {
        for _ in 0..MAX_ITERATIONS {
            let end = (k..N - 1).find(|&i| off[i].abs() <= negligible).unwrap_or(N - 1);
            if end == k {
                break;
            }
            iterate(&mut values[k..=end], &mut off[k..=end], &mut vectors[k..=end]);
        }
    }
    let mut order: [usize; N] = std::array::from_fn(|k| k);
    order.sort_unstable_by(|&i, &j| values[j].total_cmp(&values[i]));
    (order.map(|k| values[k]), order.map(|k| vectors[k]))
}

/// Householder reflections from both sides: the diagonal of `a` becomes that of `Q A Qᵀ`. Returns what stands beside the
/// diagonal, and `Q`.
fn tridiagonal<const N: usize>(a: &mut [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let mut off = [0.0; N];
    let mut reflections = [([0.0; N], 0.0); N];
    for k in 0..N - 1 {
        // Zero up to entry k: loops of fixed length are worth more than the products with these zeros.
        let mut v = a[k];
        v[..=k].fill(0.0);
        let square = dot(&v, &v);
        let image = -square.sqrt().copysign(v[k + 1]);
        off[k] = image;
        // I − inverse v vᵀ.
        let inverse = if square > 0.0 { 1.0 / (square - image * v[k + 1]) } else { 0.0 };
        v[k + 1] -= image;
        reflections[k] = (v, inverse);
        // A − v wᵀ − w vᵀ with w = p − ½ inverse (pᵀ v) v, p = inverse A v.
        let mut w: [f64; N] = std::array::from_fn(|i| inverse * dot(&a[i], &v));
        let half = 0.5 * inverse * dot(&w, &v);
        for i in 0..N {
            w[i] -= half * v[i];
        }
        for (row, (v_i, w_i)) in a[k + 1..].iter_mut().zip(v[k + 1..].iter().zip(&w[k + 1..])) {
            for j in 0..N {
                row[j] -= v_i * w[j] + w_i * v[j];
            }
        }
    }
    let mut q = [[0.0; N]; N];
    for (k, row) in q.iter_mut().enumerate() {
        row[k] = 1.0;
        for (v, inverse) in reflections[..k].iter().rev() {
            let along = inverse * dot(row, v);
            for j in 0..N {
                row[j] -= along * v[j];
            }
        }
    }
    (off, q)
}

/// One step of QL with Wilkinson's shift on a block of which nothing beside the diagonal is negligible.
fn iterate<const N: usize>(values: &mut [f64], off: &mut [f64], vectors: &mut [[f64; N]]) {
    let last = values.len() - 1;
    let slope = (values[1] - values[0]) / (2.0 * off[0]);
    let shift = values[0] - off[0] / (slope + (1.0 + slope * slope).sqrt().copysign(slope));
    let (mut sine, mut cosine, mut moved) = (1.0, 1.0, 0.0);
    let mut g = values[last] - shift;
    for i in (0..last).rev() {
        let (f, b) = (sine * off[i], cosine * off[i]);
        let length = (f * f + g * g).sqrt();
        if i + 1 < last {
            off[i + 1] = length;
        }
        if length == 0.0 {
            // The block has fallen apart.
            values[i + 1] -= moved;
            return;
        }
        let inverse = 1.0 / length;
        (sine, cosine) = (f * inverse, g * inverse);
        let g_i = values[i + 1] - moved;
        let sum = (values[i] - g_i) * sine + 2.0 * cosine * b;
        moved = sine * sum;
        values[i + 1] = g_i + moved;
        g = cosine * sum - b;
        let (upper, lower) = vectors.split_at_mut(i + 1);
        rotate(&mut upper[i], &mut lower[0], sine, cosine);
    }
    values[0] -= moved;
    off[0] = g;
}

#[inline]
fn rotate<const N: usize>(x: &mut [f64; N], y: &mut [f64; N], sine: f64, cosine: f64) {
    for k in 0..N {
        (x[k], y[k]) = (cosine * x[k] - sine * y[k], sine * x[k] + cosine * y[k]);
    }
}

/// In two sums that do not wait for each other.
#[inline]
fn dot<const N: usize>(x: &[f64; N], y: &[f64; N]) -> f64 {
    let ((xs, x_rest), (ys, y_rest)) = (x.as_chunks::<2>(), y.as_chunks::<2>());
    let mut sums = [0.0; 2];
    for (x, y) in xs.iter().zip(ys) {
        sums[0] += x[0] * y[0];
        sums[1] += x[1] * y[1];
    }
    x_rest.iter().zip(y_rest).map(|(x, y)| x * y).sum::<f64>() + sums[0] + sums[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SMatrix;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn vectors_diagonalise_whatever_the_rank() {
        let mut rng = ChaCha8Rng::seed_from_u64(15);
        for round in 0..1000 {
            // Of rank 0 to 9, with eigenvalues that may repeat or differ by many powers of ten.
            let (rank, steep) = (round % 10, [1.0_f64, 1e-1, 1e-4][round % 3]);
            let random = SMatrix::<f64, 9, 9>::from_fn(|_, _| rng.random_range(-1.0..1.0));
            let q = random.qr().q();
            let planted: [f64; 9] =
                std::array::from_fn(|k| if k < rank { steep.powf(k as f64) } else { 0.0 });
            let m = q * SMatrix::from_diagonal(&planted.into()) * q.transpose();
            let (values, vectors) = eigen::<9>(std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)])));
            let v = SMatrix::<f64, 9, 9>::from_fn(|i, j| vectors[j][i]);
            assert!((v.transpose() * v - SMatrix::identity()).norm() < 1e-13, "{round}");
            let left = m * v - v * SMatrix::from_diagonal(&values.into());
            assert!(left.norm() < 1e-13, "{round}: {:e}", left.norm());
            assert!(values.windows(2).all(|pair| pair[0] >= pair[1]));
            assert!(values.iter().zip(planted).all(|(found, planted)| (found - planted).abs() < 1e-14));
        }
    }

    #[test]
    fn diagonal_matrices_and_those_of_one_entry_are_their_own() {
        let (values, _) = eigen([[1.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 2.0]]);
        assert!(values.iter().zip([3.0, 2.0, 1.0]).all(|(found, planted)| (found - planted).abs() < 1e-15));
        let (values, _) = eigen([[0.0, 2.0], [2.0, 0.0]]);
        assert!((values[0] - 2.0).abs() < 1e-15 && (values[1] + 2.0).abs() < 1e-15);
    }

    #[test]
    fn a_block_of_entries_whose_squares_vanish_falls_apart() {
        let (mut values, mut off) = ([0.0; 2], [1e-200]);
        let mut vectors = [[1.0, 0.0], [0.0, 1.0]];
        iterate(&mut values, &mut off, &mut vectors);
        assert!(values.iter().all(|value| value.abs() < 1e-100), "{values:?}");
        assert!(vectors.as_flattened().iter().all(|x| x.is_finite()), "{vectors:?}");
    }
}
