//! The quartics (39) in closed form.
//!
//! With `c = R a`, `n = b × c` and a pivot `k` in the triple `i, j, k`,
//!
//! ```text
//! n_j × n_k = b_k (n_j · c_k) − c_k (n_j · b_k)
//! n_j · c_k = b_j · (c_j × c_k) = (q·q) b_j · R (a_j × a_k) = (q·q) P_jk
//! n_j · b_k = (b_k × b_j) · R a_j                                = Q_jk
//! det[n_i n_j n_k] / (q·q) = Q_ik P_jk − P_ik Q_jk
//! ```
//!
//! where `R` is the matrix (3) without its normalisation, quadratic in `q`. The factor `q·q` of the degree-6
//! determinant never appears, and a quartic costs two products of quadratic forms.

use nalgebra::Vector3;

use super::monomials::{Quadratic, Quartic, SQUARE, commutator};
use crate::{Correspondence, InputError};

/// The quadratic form `u · R(q) v`, with `R` of (3) not normalised.
fn rotation_form(u: &Vector3<f64>, v: &Vector3<f64>) -> Quadratic {
    let mut form = [0.0; 10];
    let (xx, yy, zz) = (u.x * v.x, u.y * v.y, u.z * v.z);
    form[SQUARE[0][0]] = xx + yy + zz;
    form[SQUARE[1][1]] = xx - yy - zz;
    form[SQUARE[2][2]] = yy - xx - zz;
    form[SQUARE[3][3]] = zz - xx - yy;
    form[SQUARE[1][2]] = 2.0 * (u.x * v.y + u.y * v.x);
    form[SQUARE[1][3]] = 2.0 * (u.x * v.z + u.z * v.x);
    form[SQUARE[2][3]] = 2.0 * (u.y * v.z + u.z * v.y);
    form[SQUARE[0][1]] = 2.0 * (u.z * v.y - u.y * v.z);
    form[SQUARE[0][2]] = 2.0 * (u.x * v.z - u.z * v.x);
    form[SQUARE[0][3]] = 2.0 * (u.y * v.x - u.x * v.y);
    form
}

/// `P_jk` and `Q_jk`.
fn pair_forms(j: &Correspondence, k: &Correspondence) -> (Quadratic, Quadratic) {
    let p = rotation_form(j.bearing2(), &j.bearing1().cross(k.bearing1()));
    let q = rotation_form(&k.bearing2().cross(j.bearing2()), j.bearing1());
    (p, q)
}

/// From the quartic of unit bearings to that of the vectors as they were given.
fn triple_scale(triple: [&Correspondence; 3]) -> f64 {
    triple.iter().map(|m| m.length1() * m.length2()).product()
}

/// The ten quartics of the unit bearings of five matches, the triples in lexicographic order.
pub(crate) fn ten_quartics(matches: &[Correspondence; 5]) -> [Quartic; 10] {
    let mut forms = [[([0.0; 10], [0.0; 10]); 5]; 5];
    for k in 2..5 {
        for j in 0..k {
            forms[j][k] = pair_forms(&matches[j], &matches[k]);
        }
    }
    let mut out = [[0.0; 35]; 10];
    let mut row = 0;
    for i in 0..3 {
        for j in i + 1..4 {
            for k in j + 1..5 {
                let ((p_ik, q_ik), (p_jk, q_jk)) = (&forms[i][k], &forms[j][k]);
                out[row] = commutator(q_ik, p_jk, p_ik, q_jk);
                row += 1;
            }
        }
    }
    out
}

/// The matrix `C` of five matches, 10 × 35, without heap; otherwise as [`constraint_matrix`].
#[must_use]
pub fn constraint_matrix_5(matches: &[Correspondence; 5]) -> [[f64; 35]; 10] {
    let mut c = ten_quartics(matches);
    let mut row = 0;
    for i in 0..3 {
        for j in i + 1..4 {
            for k in j + 1..5 {
                let scale = triple_scale([&matches[i], &matches[j], &matches[k]]);
                c[row] = c[row].map(|x| x * scale);
                row += 1;
            }
        }
    }
    c
}

/// The coefficients of the quartics (39): the matrix `C` of theorem 1 without its last row, 10 × 35 for five
/// matches and `C(N,3)` × 35 for `N`.
///
/// The rows are the triples `i < j < k` in lexicographic order, each `det[n_i n_j n_k] / (q·q)` with
/// `n = x2 × R x1` and `x1`, `x2` the vectors as they were given to [`Correspondence`]; the columns are
/// [`MONOMIALS`](super::MONOMIALS).
///
/// # Errors
/// [`InputError::TooFewMatches`] for fewer than three, [`InputError::TooManyMatches`] where the rows cannot be
/// allocated: they grow with the cube of `N`, 45 MB for 100 matches and 46 GB for 1,000.
pub fn constraint_matrix(matches: &[Correspondence]) -> Result<Vec<[f64; 35]>, InputError> {
    let n = matches.len();
    if n < 3 {
        return Err(InputError::TooFewMatches { found: n, needed: 3 });
    }
    let mut rows = reserved(n)?;
    for i in 0..n {
        for j in i + 1..n {
            for k in j + 1..n {
                let (p_ik, q_ik) = pair_forms(&matches[i], &matches[k]);
                let (p_jk, q_jk) = pair_forms(&matches[j], &matches[k]);
                let scale = triple_scale([&matches[i], &matches[j], &matches[k]]);
                rows.push(commutator(&q_ik, &p_jk, &p_ik, &q_jk).map(|c| c * scale));
            }
        }
    }
    Ok(rows)
}

/// An empty list with room for every triple of `n` matches.
fn reserved(n: usize) -> Result<Vec<[f64; 35]>, InputError> {
    let wide = n as u128;
    // Saturating: past 2^42 matches the product no longer fits, and neither do the rows.
    let count = wide.saturating_mul(wide - 1).saturating_mul(wide - 2) / 6;
    let mut rows = Vec::new();
    match usize::try_from(count).map(|count| rows.try_reserve_exact(count)) {
        Ok(Ok(())) => Ok(rows),
        _ => Err(InputError::TooManyMatches { found: n, rows: count }),
    }
}

#[cfg(test)]
mod tests {
    use super::super::monomials::MONOMIALS;
    use super::*;
    use crate::algebra::monomials::evaluate;
    use nalgebra::{Matrix3, Quaternion};

    /// Example 3 of the paper as far as its printed points allow.
    fn example_3() -> Vec<Correspondence> {
        let left = [[-0.1, -1.5], [-2.3, 1.6], [0.6, 0.9]];
        let right = [[0.2, -1.2], [-2.0, 1.8], [0.9, 1.1]];
        crate::correspondence::from_image_points(&left, &right).unwrap()
    }

    #[test]
    fn example_3_has_its_coefficients() {
        let rows = constraint_matrix(&example_3()).unwrap();
        assert_eq!(rows.len(), 1);
        // Exact arithmetic on the printed points, to the digits given.
        let expected = [
            ([4, 0, 0, 0], 0.0237, 5e-5),
            ([3, 1, 0, 0], 2.71764, 5e-6),
            ([2, 2, 0, 0], 31.6139, 5e-5),
            ([1, 3, 0, 0], -18.7080, 5e-5),
            ([0, 4, 0, 0], 1.0217, 5e-5),
            ([0, 0, 2, 2], -17.9427, 5e-5),
            ([1, 0, 0, 3], -148.882, 5e-4),
            ([0, 1, 0, 3], 9.11756, 5e-6),
            ([0, 0, 1, 3], -16.2528, 5e-5),
            ([0, 0, 0, 4], -0.0685, 5e-5),
        ];
        let at = |e| rows[0][MONOMIALS.iter().position(|m| *m == e).unwrap()];
        let sign = at([2, 2, 0, 0]).signum();
        for (e, value, rounding) in expected {
            assert!((sign * at(e) - value).abs() <= rounding, "{e:?}: {} for {value}", sign * at(e));
        }
    }

    #[test]
    fn quartic_is_the_determinant_divided_by_q_squared() {
        let matches = example_3();
        let q = [0.7, -0.4, 1.2, 0.3];
        let norm2: f64 = q.iter().map(|x| x * x).sum();
        let quaternion = Quaternion::new(q[0], q[1], q[2], q[3]);
        let rotate =
            |v: Vector3<f64>| (quaternion * Quaternion::from_imag(v) * quaternion.conjugate()).imag();
        let n = |m: &Correspondence| (m.bearing2() * m.length2()).cross(&rotate(m.bearing1() * m.length1()));
        let determinant =
            Matrix3::from_columns(&[n(&matches[0]), n(&matches[1]), n(&matches[2])]).determinant();
        let quartic = evaluate(&MONOMIALS, &constraint_matrix(&matches).unwrap()[0], q);
        // Coefficients of up to 150, some tens of terms.
        assert!((quartic - determinant / norm2).abs() < 1e-11, "{quartic} {}", determinant / norm2);
    }

    #[test]
    fn five_matches_have_ten_rows_and_two_have_none() {
        let x1 = [[0.1, 0.2], [-0.3, 0.1], [0.2, -0.2], [-0.1, -0.3], [0.3, 0.3]];
        let x2 = [[0.16, 0.2], [-0.22, 0.1], [0.25, -0.19], [-0.06, -0.28], [0.35, 0.31]];
        let matches = crate::correspondence::from_image_points(&x1, &x2).unwrap();
        let rows = constraint_matrix(&matches).unwrap();
        assert_eq!(rows.as_slice(), constraint_matrix_5(matches.first_chunk().unwrap()));
        let found = constraint_matrix(&matches[..2]).unwrap_err();
        assert_eq!(found, InputError::TooFewMatches { found: 2, needed: 3 });
    }

    #[test]
    fn too_many_matches_are_an_error() {
        // 1e7 matches: 1.7e20 rows; the third does not even fit a number of 128 bits.
        for n in [10_000_000, u32::MAX as usize, usize::MAX] {
            assert!(matches!(reserved(n), Err(InputError::TooManyMatches { found, .. }) if found == n));
        }
        assert_eq!(reserved(5).unwrap().capacity(), 10);
    }
}
