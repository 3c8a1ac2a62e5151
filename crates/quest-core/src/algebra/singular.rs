//! The directions that a matrix leaves shortest: its last right singular vectors.

/// An orthonormal basis of the `K` directions that a matrix leaves shortest, by Householder reflections and inverse iteration
/// with the triangle: no square of the matrix is formed. `a` is overwritten.
///
/// The null space is found in the first step. Directions that are no shorter than others are not told apart from them.
pub(crate) fn shortest_directions<const R: usize, const C: usize, const K: usize>(
    a: &mut [[f64; C]; R],
) -> [[f64; C]; K] {
    const { assert!(R >= C) }
    triangulate(a);
    // A start without symmetry.
    let mut basis: [[f64; C]; K] =
        std::array::from_fn(|k| std::array::from_fn(|i| ((1 + i + 3 * k * (i + 2)) as f64).sin()));
    let inverse = inverse_diagonal(a);
    for _ in 0..STEPS {
        solve_transposed(a, &inverse, &mut basis);
        // In between as well: one direction may grow by 1e16, and what is left of another must not drown in its rounding.
        orthonormalise(&mut basis);
        solve(a, &inverse, &mut basis);
        orthonormalise(&mut basis);
    }
    basis
}

/// Each divides what is left of the other directions by the square of the ratio of their lengths.
const STEPS: usize = 3;

/// The upper triangle `R` of `A = Q R`; below it the matrix is spent.
fn triangulate<const R: usize, const C: usize>(a: &mut [[f64; C]; R]) {
    for k in 0..C {
        let square: f64 = a[k..].iter().map(|row| row[k] * row[k]).sum();
        if square == 0.0 {
            continue;
        }
        // I − v vᵀ · inverse, with v the column down to its image.
        let image = -square.sqrt().copysign(a[k][k]);
        let first = a[k][k] - image;
        let inverse = -1.0 / (image * first);
        a[k][k] = first;
        let mut products = [0.0; C];
        for row in &a[k..] {
            let factor = row[k];
            for (sum, x) in products[k + 1..].iter_mut().zip(&row[k + 1..]) {
                *sum += factor * x;
            }
        }
        for row in &mut a[k..] {
            let factor = row[k] * inverse;
            for (x, product) in row[k + 1..].iter_mut().zip(&products[k + 1..]) {
                *x -= factor * product;
            }
        }
        a[k][k] = image;
    }
}

/// The inverse of the triangle's diagonal; what has vanished counts as rounding.
fn inverse_diagonal<const R: usize, const C: usize>(r: &[[f64; C]; R]) -> [f64; C] {
    let largest = (0..C).fold(0.0_f64, |largest, k| largest.max(r[k][k].abs()));
    let rounding = (f64::EPSILON * largest).max(f64::MIN_POSITIVE);
    std::array::from_fn(|k| 1.0 / if r[k][k].abs() < rounding { rounding } else { r[k][k] })
}

/// Solves `Rᵀ y = x` for every `x`.
fn solve_transposed<const R: usize, const C: usize, const K: usize>(
    r: &[[f64; C]; R],
    inverse: &[f64; C],
    basis: &mut [[f64; C]; K],
) {
    for x in basis {
        for k in 0..C {
            let y = x[k] * inverse[k];
            x[k] = y;
            for (x, a) in x[k + 1..].iter_mut().zip(&r[k][k + 1..]) {
                *x -= a * y;
            }
        }
    }
}

/// Solves `R y = x` for every `x`: side by side, as sums along a row wait for each other.
fn solve<const R: usize, const C: usize, const K: usize>(
    r: &[[f64; C]; R],
    inverse: &[f64; C],
    basis: &mut [[f64; C]; K],
) {
    let mut solved = [[0.0; K]; C];
    for k in (0..C).rev() {
        let mut sums: [f64; K] = std::array::from_fn(|n| basis[n][k]);
        for (a, y) in r[k][k + 1..].iter().zip(&solved[k + 1..]) {
            for (sum, y) in sums.iter_mut().zip(y) {
                *sum -= a * y;
            }
        }
        solved[k] = sums.map(|sum| sum * inverse[k]);
        for (x, y) in basis.iter_mut().zip(&solved[k]) {
            x[k] = *y;
        }
    }
}

/// Gram and Schmidt, each twice: vectors that are nearly parallel leave little of the second.
fn orthonormalise<const C: usize, const K: usize>(basis: &mut [[f64; C]; K]) {
    for k in 0..K {
        let (done, rest) = basis.split_at_mut(k);
        let x = &mut rest[0];
        for _ in 0..2 {
            normalise(x);
            for y in done.iter() {
                let along = dot(x, y);
                for (a, b) in x.iter_mut().zip(y) {
                    *a -= along * b;
                }
            }
        }
        normalise(x);
    }
}

fn normalise<const C: usize>(x: &mut [f64; C]) {
    let inverse = 1.0 / dot(x, x).sqrt();
    for a in x {
        *a *= inverse;
    }
}

/// In four sums that do not wait for each other.
fn dot<const C: usize>(x: &[f64; C], y: &[f64; C]) -> f64 {
    let mut sums = [0.0; 4];
    for (a, b) in x.chunks(4).zip(y.chunks(4)) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SMatrix;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn planted_short_directions_are_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for short in [0.0, 1e-9, 1e-3] {
            for _ in 0..50 {
                let random = SMatrix::<f64, 12, 8>::from_fn(|_, _| rng.random_range(-1.0..1.0));
                let svd = random.svd(true, true);
                let (u, v) = (svd.u.unwrap(), svd.v_t.unwrap());
                // The seventh is short, the eighth zero; the others lie between 0.1 and 4.
                let mut values = svd.singular_values.map(|s| s.max(0.1));
                (values[6], values[7]) = (short, 0.0);
                let planted = u * SMatrix::<f64, 8, 8>::from_diagonal(&values) * v;
                let mut rows: [[f64; 8]; 12] =
                    std::array::from_fn(|i| std::array::from_fn(|j| planted[(i, j)]));
                let found: [[f64; 8]; 2] = shortest_directions(&mut rows);
                for x in found.map(nalgebra::SVector::<f64, 8>::from) {
                    assert!((x.norm() - 1.0).abs() < 1e-14, "{short} {x:?}");
                    // A start of order one, divided three times by the square of 100.
                    assert!((v.fixed_rows::<6>(0) * x).norm() < 1e-9, "{short}");
                }
            }
        }
    }
}
