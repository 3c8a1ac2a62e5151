//! The smallest eigenvalue of a symmetric 3 × 3 or 4 × 4 matrix, and its vector.
//!
//! All roots of the characteristic polynomial are real, so that Newton's iteration from below the smallest one rises
//! to it monotonically. The eigenvector is the longest column of the adjugate of the shifted matrix.

use nalgebra::{Matrix3, Matrix4, SMatrix, Vector3, Vector4};

use super::number::Number;
use crate::algebra::vectors::two::{Two, TwoVectors, cross, dot};

/// Enough for a double root, where the convergence is linear.
const MAX_STEPS: usize = 60;

/// Sweeps of Jacobi's rotations; a matrix that is not finite takes them all.
const MAX_SWEEPS: usize = 10;

/// A symmetric matrix by the rows of its upper triangle.
#[inline]
pub(crate) fn symmetric<const N: usize>(upper: &[f64]) -> SMatrix<f64, N, N> {
    let mut matrix = SMatrix::zeros();
    let mut upper = upper.iter();
    for a in 0..N {
        for b in a..N {
            let Some(&entry) = upper.next() else { return matrix };
            matrix[(a, b)] = entry;
            matrix[(b, a)] = entry;
        }
    }
    matrix
}

/// The root that Newton's iteration reaches from `below`, for `f(x) = (value, derivative)`.
fn smallest_root(below: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let mut x = below;
    for _ in 0..MAX_STEPS {
        let (value, slope) = f(x);
        let step = value / slope;
        // At the root rounding turns the step round, or leaves no slope.
        if !step.is_finite() || step >= 0.0 {
            break;
        }
        x -= step;
        if -step <= f64::EPSILON * x.abs() {
            break;
        }
    }
    x
}

/// The unit eigenvector of a positive semidefinite matrix with the smallest eigenvalue.
///
/// One of its eigenvectors where the eigenvalue is multiple; `None` where no direction is left of the matrix.
pub(crate) fn smallest_eigenvector_3(m: &Matrix3<f64>) -> Option<Vector3<f64>> {
    let entries = [m[(0, 0)], m[(1, 1)], m[(2, 2)], m[(0, 1)], m[(0, 2)], m[(1, 2)]];
    let vector = Vector3::from(smallest_eigenvectors_3(&entries.map(Two::splat)).map(|x| x.to_array()[0]));
    vector.sum().is_finite().then_some(vector)
}

/// The same of two matrices side by side, of each `[xx, yy, zz, xy, xz, yz]`; not finite where there is none.
#[inline]
pub(crate) fn smallest_eigenvectors_3(m: &[Two; 6]) -> TwoVectors {
    let one = Two::splat(1.0);
    let scale = one / (m[0] + m[1] + m[2]);
    let [x, y, z, xy, xz, yz] = m.map(|entry| entry * scale);
    // λ³ − λ² + second λ − determinant, the trace being one; Halley's iteration rises to its smallest root as Newton's does.
    let second = x * y + x * z + y * z - xy * xy - xz * xz - yz * yz;
    let determinant = x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz);
    let (mut value, mut is_over) = (Two::ZERO, Two::ZERO);
    for _ in 0..MAX_STEPS {
        let f = ((value - one) * value + second) * value - determinant;
        let slope = (value * 3.0 - Two::splat(2.0)) * value + second;
        let step = f * slope / (slope * slope - f * (value * 3.0 - one));
        // At the root rounding turns the step round, or leaves no slope.
        is_over |= !(step.simd_lt(Two::ZERO) & step.simd_gt(-one));
        value = is_over.select(value, value - step);
        is_over |= (-step).simd_le(value * 1e-8);
        if is_over.all() {
            break;
        }
    }
    let rows = [[x - value, xy, xz], [xy, y - value, yz], [xz, yz, z - value]];
    let two_of = Two::longer(&cross(&rows[1], &rows[2]), &cross(&rows[2], &rows[0]));
    let longest = Two::longer(&two_of, &cross(&rows[0], &rows[1]));
    let inverse = one / dot(&longest, &longest).sqrt();
    longest.map(|x| x * inverse)
}

/// The unit eigenvector of a symmetric matrix without trace whose eigenvalues are at least `below`, for its
/// smallest one; otherwise as [`smallest_eigenvector_3`].
pub(crate) fn smallest_eigenvector_4(m: &Matrix4<f64>, below: f64) -> Option<Vector4<f64>> {
    let m = m / -below;
    // λ⁴ + b λ² + c λ + d, by the traces of powers.
    let square = m * m;
    let b = -0.5 * square.trace();
    let c = -square.dot(&m) / 3.0;
    let d = 0.5 * b * b - 0.25 * square.norm_squared();
    let value = smallest_root(-1.0, |l| (((l * l + b) * l + c) * l + d, (4.0 * l * l + 2.0 * b) * l + c));
    let shifted = m - Matrix4::from_diagonal_element(value);
    let adjugate = adjugate(&shifted);
    let longest = longest(&std::array::from_fn::<_, 4, _>(|k| adjugate.column(k).norm_squared()))?;
    Some(adjugate.column(longest).normalize())
}

/// Eigenvalues, largest first, and unit eigenvectors of a symmetric matrix, by Jacobi's rotations: exact to the rounding of the
/// matrix however close the eigenvalues are.
pub(crate) fn eigen_3(m: &Matrix3<f64>) -> ([f64; 3], [Vector3<f64>; 3]) {
    let mut m = *m;
    let mut v = [Vector3::x(), Vector3::y(), Vector3::z()];
    let negligible = f64::EPSILON * m.norm();
    // Convergence is quadratic: three or four sweeps.
    for _ in 0..MAX_SWEEPS {
        let [xy, xz, yz] = [m[(0, 1)], m[(0, 2)], m[(1, 2)]];
        if xy.abs().max(xz.abs()).max(yz.abs()) <= negligible {
            break;
        }
        for (i, j, k) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            let off = m[(i, j)];
            if off == 0.0 {
                continue;
            }
            let half = 0.5 * (m[(j, j)] - m[(i, i)]);
            // The smaller of the two tangents that annihilate the entry.
            let t = off / (half + (half * half + off * off).sqrt().copysign(half));
            let c = 1.0 / (1.0 + t * t).sqrt();
            let s = t * c;
            m[(i, i)] -= t * off;
            m[(j, j)] += t * off;
            (m[(i, j)], m[(j, i)]) = (0.0, 0.0);
            let (ik, jk) = (c * m[(i, k)] - s * m[(j, k)], s * m[(i, k)] + c * m[(j, k)]);
            (m[(i, k)], m[(k, i)], m[(j, k)], m[(k, j)]) = (ik, ik, jk, jk);
            (v[i], v[j]) = (v[i] * c - v[j] * s, v[i] * s + v[j] * c);
        }
    }
    let mut order = [0, 1, 2];
    order.sort_unstable_by(|&i, &j| m[(j, j)].total_cmp(&m[(i, i)]));
    (order.map(|k| m[(k, k)]), order.map(|k| v[k]))
}

/// The index of the largest entry, where it is positive.
fn longest<const N: usize>(squares: &[f64; N]) -> Option<usize> {
    let largest = (0..N).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    (squares[largest] > 0.0).then_some(largest)
}

/// The adjugate of a symmetric 4 × 4 matrix by its 2 × 2 minors.
fn adjugate(m: &Matrix4<f64>) -> Matrix4<f64> {
    let minor = |r: usize, s: usize, i: usize, j: usize| m[(r, i)] * m[(s, j)] - m[(r, j)] * m[(s, i)];
    let columns = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    let [upper, lower] = [(0, 1), (2, 3)].map(|(r, s)| columns.map(|(i, j)| minor(r, s, i, j)));
    let e = |i: usize, j: usize| m[(i, j)];
    let mut a = Matrix4::zeros();
    a[(0, 0)] = e(1, 1) * lower[5] - e(1, 2) * lower[4] + e(1, 3) * lower[3];
    a[(1, 0)] = -(e(1, 0) * lower[5] - e(1, 2) * lower[2] + e(1, 3) * lower[1]);
    a[(2, 0)] = e(1, 0) * lower[4] - e(1, 1) * lower[2] + e(1, 3) * lower[0];
    a[(3, 0)] = -(e(1, 0) * lower[3] - e(1, 1) * lower[1] + e(1, 2) * lower[0]);
    a[(1, 1)] = e(0, 0) * lower[5] - e(0, 2) * lower[2] + e(0, 3) * lower[1];
    a[(2, 1)] = -(e(0, 0) * lower[4] - e(0, 1) * lower[2] + e(0, 3) * lower[0]);
    a[(3, 1)] = e(0, 0) * lower[3] - e(0, 1) * lower[1] + e(0, 2) * lower[0];
    a[(2, 2)] = e(3, 0) * upper[4] - e(3, 1) * upper[2] + e(3, 3) * upper[0];
    a[(3, 2)] = -(e(3, 0) * upper[3] - e(3, 1) * upper[1] + e(3, 2) * upper[0]);
    a[(3, 3)] = e(2, 0) * upper[3] - e(2, 1) * upper[1] + e(2, 2) * upper[0];
    for i in 0..4 {
        for j in i + 1..4 {
            a[(i, j)] = a[(j, i)];
        }
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SymmetricEigen;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn adjugate_times_matrix_is_the_determinant() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let m = Matrix4::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let m = m + m.transpose();
        let expected = Matrix4::from_diagonal_element(m.determinant());
        assert!((adjugate(&m) * m - expected).norm() < 1e-12);
    }

    #[test]
    fn eigenvectors_agree_with_nalgebra() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for _ in 0..1000 {
            let m = Matrix4::from_fn(|_, _| rng.random_range(-1.0..1.0));
            let mut m = m + m.transpose();
            m -= Matrix4::from_diagonal_element(m.trace() / 4.0);
            let eigen = SymmetricEigen::new(m);
            let mut values: Vec<_> = eigen.eigenvalues.iter().copied().collect();
            values.sort_by(f64::total_cmp);
            let expected = eigen.eigenvectors.column(eigen.eigenvalues.imin());
            let found = smallest_eigenvector_4(&m, -m.norm()).unwrap();
            // The adjugate shrinks with the gap to the next eigenvalue, and the root loses digits to it as well.
            let gap = (values[1] - values[0]) / m.norm();
            assert!(1.0 - found.dot(&expected).abs() < 1e-13 / gap.powi(4), "gap {gap:e}");

            let b = Matrix3::from_fn(|_, _| rng.random_range(-1.0..1.0));
            let m = b * b.transpose();
            let eigen = SymmetricEigen::new(m);
            let expected = eigen.eigenvectors.column(eigen.eigenvalues.imin());
            let mut values: Vec<_> = eigen.eigenvalues.iter().copied().collect();
            values.sort_by(f64::total_cmp);
            let gap = (values[1] - values[0]) / m.trace();
            let found = smallest_eigenvector_3(&m).unwrap();
            assert!(1.0 - found.dot(&expected).abs() < 1e-13 / gap.powi(4), "gap {gap:e}");
        }
    }

    #[test]
    fn jacobi_diagonalises_also_equal_eigenvalues() {
        let mut rng = ChaCha8Rng::seed_from_u64(14);
        for round in 0..1000 {
            let b = Matrix3::from_fn(|_, _| rng.random_range(-1.0..1.0));
            let gap = [1.0, 1e-9, 0.0][round % 3];
            let m = b.qr().q();
            let m = m * Matrix3::from_diagonal(&Vector3::new(2.0 + gap, 2.0, 0.5)) * m.transpose();
            let m = if round % 2 == 0 { (m + m.transpose()) * 0.5 } else { b + b.transpose() };
            let (values, vectors) = eigen_3(&m);
            let v = Matrix3::from_columns(&vectors);
            assert!((v.transpose() * v - Matrix3::identity()).norm() < 1e-14);
            assert!((m * v - v * Matrix3::from_diagonal(&values.into())).norm() < 1e-14);
            assert!(values[0] >= values[1] && values[1] >= values[2]);
        }
    }

    #[test]
    fn matrices_without_a_direction_have_none() {
        assert_eq!(smallest_eigenvector_3(&Matrix3::zeros()), None);
        assert_eq!(smallest_eigenvector_3(&Matrix3::from_element(f64::NAN)), None);
    }

    #[test]
    fn the_search_for_a_root_ends_where_there_is_no_slope() {
        assert!((smallest_root(-2.0, |_| (0.0, 0.0)) + 2.0).abs() < 1e-15);
        assert!((smallest_root(-2.0, |_| (1.0, 0.0)) + 2.0).abs() < 1e-15);
        assert!((smallest_root(-2.0, |x| (x * x - 2.0, 2.0 * x)) + 2.0_f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_triangle_makes_both_halves() {
        let m = symmetric::<3>(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(m, Matrix3::new(1.0, 2.0, 3.0, 2.0, 4.0, 5.0, 3.0, 5.0, 6.0));
        // What is missing of it is zero.
        assert_eq!(symmetric::<3>(&[1.0, 2.0]), Matrix3::new(1.0, 2.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0));
    }
}
