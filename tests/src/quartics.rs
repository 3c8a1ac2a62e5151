//! The quartics of section 6, from the definition.

use nalgebra::{Matrix4, Vector3};

use crate::polynomial::{Polynomial, determinant};

/// A match as two vectors on the viewing rays, `(¹m, ²m)`.
pub type Match = (Vector3<f64>, Vector3<f64>);

/// `R(q)` of (3), without the division by `q·q`: homogeneous of degree 2.
#[must_use]
pub fn rotation_matrix() -> [[Polynomial; 3]; 3] {
    let q = [0, 1, 2, 3].map(Polynomial::unknown);
    let square =
        |signs: [f64; 4]| (0..4).fold(Polynomial::default(), |sum, k| sum.plus(signs[k], &q[k].times(&q[k])));
    // 2 (q_a q_b ± q_c q_d), the indices as printed.
    let mixed = |a: usize, b: usize, sign: f64, c: usize, d: usize| {
        let cd = q[c - 1].times(&q[d - 1]);
        Polynomial::default().plus(2.0, &q[a - 1].times(&q[b - 1])).plus(2.0 * sign, &cd)
    };
    [
        [square([1.0, 1.0, -1.0, -1.0]), mixed(2, 3, -1.0, 1, 4), mixed(2, 4, 1.0, 1, 3)],
        [mixed(2, 3, 1.0, 1, 4), square([1.0, -1.0, 1.0, -1.0]), mixed(3, 4, -1.0, 1, 2)],
        [mixed(2, 4, -1.0, 1, 3), mixed(3, 4, 1.0, 1, 2), square([1.0, -1.0, -1.0, 1.0])],
    ]
}

/// `n(q) = ²m × (R(q) ¹m)`: the normal of the epipolar plane, orthogonal to the translation by (28).
#[must_use]
pub fn epipolar_normal((m1, m2): &Match) -> Vec<Polynomial> {
    let rotated =
        rotation_matrix().map(|row| (0..3).fold(Polynomial::default(), |sum, k| sum.plus(m1[k], &row[k])));
    let cross = m2.cross_matrix();
    let component =
        |i: usize| (0..3).fold(Polynomial::default(), |sum, k| sum.plus(cross[(i, k)], &rotated[k]));
    (0..3).map(component).collect()
}

/// The quartic (39) of three matches, `det[n_i n_j n_k] / (q·q)`, and the remainder of the division.
#[must_use]
pub fn quartic_of_triple(triple: [&Match; 3]) -> (Polynomial, Polynomial) {
    determinant(&triple.map(epipolar_normal)).divided_by_norm()
}

/// The quartics of all triples `i < j < k`, in lexicographic order.
#[must_use]
pub fn quartics(matches: &[Match]) -> Vec<Polynomial> {
    let triples = subsets(matches.len(), 3);
    triples.iter().map(|s| quartic_of_triple([0, 1, 2].map(|k| &matches[s[k]])).0).collect()
}

/// Left multiplication by a pure quaternion, scalar first: `L(v) q = v ⊗ q`.
fn left(v: &Vector3<f64>) -> Matrix4<f64> {
    let mut l = Matrix4::zeros();
    l.fixed_view_mut::<3, 3>(1, 1).copy_from(&v.cross_matrix());
    l.fixed_view_mut::<3, 1>(1, 0).copy_from(v);
    l.fixed_view_mut::<1, 3>(0, 1).copy_from(&-v.transpose());
    l
}

/// Right multiplication by a pure quaternion, scalar first: `R(v) q = q ⊗ v`.
fn right(v: &Vector3<f64>) -> Matrix4<f64> {
    let mut r = left(v);
    r.fixed_view_mut::<3, 3>(1, 1).copy_from(&-v.cross_matrix());
    r
}

/// `M = L(²m) R(¹m)`: `M q = ²m ⊗ q ⊗ ¹m`.
#[must_use]
pub fn bilinear((m1, m2): &Match) -> Matrix4<f64> {
    left(m2) * right(m1)
}

/// The 4 × 4 minors of `[q, M_1 q, …, M_N q]`: those with the column q (one a triple), then those without (one
/// for every four matches), each in lexicographic order.
#[must_use]
pub fn minors(matches: &[Match]) -> (Vec<Polynomial>, Vec<Polynomial>) {
    let q: Vec<_> = (0..4).map(Polynomial::unknown).collect();
    let column = |m: &Match| -> Vec<_> {
        bilinear(m).row_iter().map(|r| Polynomial::linear([r[0], r[1], r[2], r[3]])).collect()
    };
    let columns: Vec<_> = matches.iter().map(column).collect();
    let pick = |s: &Vec<usize>| -> Vec<_> { s.iter().map(|&i| columns[i].clone()).collect() };
    let with_q =
        subsets(matches.len(), 3).iter().map(|s| determinant(&[vec![q.clone()], pick(s)].concat())).collect();
    let without_q = subsets(matches.len(), 4).iter().map(|s| determinant(&pick(s))).collect();
    (with_q, without_q)
}

/// The subsets of `size` of the numbers below `n`, in lexicographic order.
#[must_use]
pub fn subsets(n: usize, size: usize) -> Vec<Vec<usize>> {
    let all = (0..1_u32 << n).filter(|bits| bits.count_ones() as usize == size);
    let mut all: Vec<Vec<_>> = all.map(|bits| (0..n).filter(|i| bits >> i & 1 == 1).collect()).collect();
    all.sort();
    all
}
