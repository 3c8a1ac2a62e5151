//! The maximal minors of the 4 × 6 matrix `[q, M_1 q, …, M_5 q]` by Laplace expansion along two columns.

use nalgebra::Matrix4;

use super::monomials::{PRODUCT, Quadratic, Quartic, SQUARE};

/// The 2 × 2 minors of two columns, quadratic in `q`, for the row pairs 01, 02, 03, 12, 13, 23; the pair of the
/// other two rows stands at the mirrored place.
type Wedge = [Quadratic; 6];

const ROW_PAIRS: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

/// The sign of the permutation (row pair, other rows).
const SIGNS: [f64; 6] = [1.0, -1.0, 1.0, 1.0, -1.0, 1.0];

/// The 2 × 2 minors of `[u q, v q]`.
fn wedge(u: &Matrix4<f64>, v: &Matrix4<f64>) -> Wedge {
    let mut out = [[0.0; 10]; 6];
    for (form, (a, b)) in out.iter_mut().zip(ROW_PAIRS) {
        for c in 0..4 {
            for d in 0..4 {
                form[SQUARE[c][d]] += u[(a, c)] * v[(b, d)] - u[(b, c)] * v[(a, d)];
            }
        }
    }
    out
}

/// The determinant of the four columns of two wedges.
fn determinant(left: &Wedge, right: &Wedge) -> Quartic {
    let mut out = [0.0; 35];
    for pair in 0..6 {
        for i in 0..10 {
            let factor = SIGNS[pair] * left[pair][i];
            for j in 0..10 {
                out[PRODUCT[i][j]] += factor * right[5 - pair][j];
            }
        }
    }
    out
}

/// The five minors `det[M_i q, M_j q, M_k q, M_l q]`; the one that leaves out match `s` stands at `s`.
pub(crate) fn minors_without_q(m: &[Matrix4<f64>; 5]) -> [Quartic; 5] {
    let neighbours: [Wedge; 5] = std::array::from_fn(|i| wedge(&m[i], &m[(i + 1) % 5]));
    std::array::from_fn(|s| determinant(&neighbours[(s + 1) % 5], &neighbours[(s + 3) % 5]))
}

/// The ten minors `det[q, M_i q, M_j q, M_k q]`, the triples in lexicographic order.
///
/// For matrices `M` that are sums over several matches; for single ones
/// [`ten_quartics`](super::ten_quartics) is five times as fast.
pub(crate) fn minors_with_q(m: &[Matrix4<f64>; 5]) -> [Quartic; 10] {
    let identity = Matrix4::identity();
    let mut out = [[0.0; 35]; 10];
    let mut row = 0;
    for i in 0..3 {
        let with_q = wedge(&identity, &m[i]);
        for j in i + 1..4 {
            for k in j + 1..5 {
                out[row] = determinant(&with_q, &wedge(&m[j], &m[k]));
                row += 1;
            }
        }
    }
    out
}

/// The minor `det[q, M_i q, M_j q, M_k q]` of one triple.
#[cfg(feature = "faer")]
pub(crate) fn minor_with_q(triple: [&Matrix4<f64>; 3]) -> Quartic {
    let [i, j, k] = triple;
    determinant(&wedge(&Matrix4::identity(), i), &wedge(j, k))
}

#[cfg(test)]
mod tests {
    use super::super::monomials::MONOMIALS;
    use super::super::{bilinear, ten_quartics};
    use super::*;
    use crate::Correspondence;
    use crate::algebra::monomials::evaluate;
    use nalgebra::{SMatrix, Vector4};

    fn five() -> [Correspondence; 5] {
        std::array::from_fn(|k| {
            let s = k as f64 + 1.0;
            let x1 = [(1.7 * s).sin(), (2.9 * s).cos(), 1.0];
            let x2 = [(0.6 * s).cos(), (4.1 * s).sin(), 1.0];
            Correspondence::from_bearings(x1, x2).unwrap()
        })
    }

    #[test]
    fn minors_evaluate_to_determinants() {
        let m = five().map(|c| bilinear(&(c.bearing2() * c.bearing1().transpose())));
        let q = Vector4::new(0.3, -0.9, 0.5, 0.7);
        let columns = m.map(|m| m * q);
        let det = |c: [&Vector4<f64>; 4]| Matrix4::from_columns(&c.map(Clone::clone)).determinant();
        let value = |f: &Quartic| evaluate(&MONOMIALS, f, q.into());
        for (s, minor) in minors_without_q(&m).iter().enumerate() {
            let expected = det(std::array::from_fn(|i| &columns[(s + 1 + i) % 5]));
            assert!((value(minor) - expected).abs() < 1e-13);
        }
        let first = minors_with_q(&m)[0];
        let expected = det([&q, &columns[0], &columns[1], &columns[2]]);
        assert!((value(&first) - expected).abs() < 1e-13);
    }

    #[test]
    fn minors_with_q_are_the_quartics_up_to_sign() {
        let matches = five();
        let m = matches.map(|c| bilinear(&(c.bearing2() * c.bearing1().transpose())));
        for (minor, quartic) in minors_with_q(&m).iter().zip(ten_quartics(&matches)) {
            let largest = (0..35).fold(0, |b, k| if quartic[k].abs() > quartic[b].abs() { k } else { b });
            let sign = (minor[largest] / quartic[largest]).signum();
            assert!((0..35).all(|k| (minor[k] - sign * quartic[k]).abs() < 1e-13));
        }
    }

    #[test]
    fn fifteen_minors_are_independent() {
        let matches = five();
        let m = matches.map(|c| bilinear(&(c.bearing2() * c.bearing1().transpose())));
        let (ten, five) = (ten_quartics(&matches), minors_without_q(&m));
        let all = SMatrix::<f64, 15, 35>::from_fn(|i, j| if i < 10 { ten[i][j] } else { five[i - 10][j] });
        assert_eq!(all.rank(1e-9), 15);
        assert_eq!(all.fixed_view::<10, 35>(0, 0).rank(1e-9), 10);
    }
}
