//! The 35 minors of `[q, M_1 q, …, M_6 q]` by their values at 35 points: determinants of numbers are found faster than polynomials.
//!
//! A quartic is given by its values at points at which no quartic but zero vanishes. With weights `w` of the points that
//! no minor adds up to anything, `Σ_p w_p minor(p) = 0`, the monomials `x = Σ_p w_p monomials(p)` are in the null space of
//! the matrix of their coefficients; so that no coefficient is needed.

use nalgebra::Matrix4;

use crate::quaternion::monomials::{MONOMIALS, Quartic};

/// How many points are taken at once: what fits into the registers.
const LANES: usize = 4;

/// Values at some of the points.
type Lanes = [f64; LANES];

/// The points, without symmetry: multiples of four numbers, less their integer parts. Among some thousand such choices that of
/// the best conditioned monomials: 271.
const POINTS: [[f64; 4]; 35] = {
    const STEPS: [f64; 4] = [1.811_867_379_352, 1.552_181_276_766, 1.329_714_715_000, 1.139_133_192_371];
    let mut points = [[0.0; 4]; 35];
    let mut k = 0;
    while k < 35 {
        let mut i = 0;
        while i < 4 {
            let multiple = STEPS[i] * (k + 1) as f64;
            points[k][i] = 2.0 * (multiple % 1.0) - 1.0;
            i += 1;
        }
        k += 1;
    }
    points
};

/// The monomials at every point.
const MONOMIALS_AT: [Quartic; 35] = {
    let mut table = [[0.0; 35]; 35];
    let mut p = 0;
    while p < 35 {
        let mut m = 0;
        while m < 35 {
            let mut product = 1.0;
            let mut i = 0;
            while i < 4 {
                let mut power = 0;
                while power < MONOMIALS[m][i] {
                    product *= POINTS[p][i];
                    power += 1;
                }
                i += 1;
            }
            table[p][m] = product;
            m += 1;
        }
        p += 1;
    }
    table
};

/// The minors (rows) at the points (columns).
pub(crate) fn minors_at_points(m: &[Matrix4<f64>; 6]) -> [[f64; 35]; 35] {
    let mut out = [[0.0; 35]; 35];
    for start in (0..35).step_by(LANES) {
        let lanes = LANES.min(35 - start);
        let points = &POINTS[start..start + lanes];
        let minors = minors(&columns(m, points));
        for (row, minor) in out.iter_mut().zip(&minors) {
            row[start..start + lanes].copy_from_slice(&minor[..lanes]);
        }
    }
    out
}

/// The columns `q, M_1 q, …, M_6 q` at up to [`LANES`] points.
fn columns(m: &[Matrix4<f64>; 6], points: &[[f64; 4]]) -> [[Lanes; 4]; 7] {
    let mut columns = [[[0.0; LANES]; 4]; 7];
    for (lane, point) in points.iter().enumerate() {
        for i in 0..4 {
            columns[0][i][lane] = point[i];
        }
    }
    for (n, m) in m.iter().enumerate() {
        for i in 0..4 {
            let mut sum = [0.0; LANES];
            for j in 0..4 {
                for lane in 0..LANES {
                    sum[lane] += m[(i, j)] * columns[0][j][lane];
                }
            }
            columns[n + 1][i] = sum;
        }
    }
    columns
}

/// All 4 × 4 minors of seven columns, by Laplace expansion along the first two of them.
fn minors(columns: &[[Lanes; 4]; 7]) -> [Lanes; 35] {
    /// Rows of a 2 × 2 minor; the other two stand at the mirrored place.
    const ROWS: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    const SIGNS: [f64; 6] = [1.0, -1.0, 1.0, 1.0, -1.0, 1.0];
    let mut wedges = [[[[0.0; LANES]; 6]; 7]; 7];
    for i in 0..6 {
        for j in i + 1..7 {
            for (wedge, (a, b)) in wedges[i][j].iter_mut().zip(ROWS) {
                for lane in 0..LANES {
                    wedge[lane] =
                        columns[i][a][lane] * columns[j][b][lane] - columns[i][b][lane] * columns[j][a][lane];
                }
            }
        }
    }
    let mut out = [[0.0; LANES]; 35];
    let mut row = 0;
    for i in 0..4 {
        for j in i + 1..5 {
            for k in j + 1..6 {
                for l in k + 1..7 {
                    for n in 0..6 {
                        for lane in 0..LANES {
                            out[row][lane] += SIGNS[n] * wedges[i][j][n][lane] * wedges[k][l][5 - n][lane];
                        }
                    }
                    row += 1;
                }
            }
        }
    }
    out
}

/// The monomials that weights of the points add up to.
pub(crate) fn monomials(weights: &[f64; 35]) -> Quartic {
    let mut x = [0.0; 35];
    for (weight, values) in weights.iter().zip(&MONOMIALS_AT) {
        for (sum, value) in x.iter_mut().zip(values) {
            *sum += weight * value;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, Vector4};

    #[test]
    fn quartics_are_known_by_their_values_at_the_points() {
        let values = SMatrix::<f64, 35, 35>::from_fn(|p, m| MONOMIALS_AT[p][m]).singular_values();
        assert!(values.max() < 300.0 * values.min());
    }

    #[test]
    fn minors_are_determinants() {
        let entry = |n: usize, i: usize, j: usize| ((n + 1) as f64 * (i * 4 + j + 1) as f64).sin();
        let m: [Matrix4<f64>; 6] = std::array::from_fn(|n| Matrix4::from_fn(|i, j| entry(n, i, j)));
        let minors = minors_at_points(&m);
        for (p, point) in POINTS.iter().enumerate() {
            let q = Vector4::from(*point);
            let columns: [Vector4<f64>; 7] = std::array::from_fn(|n| if n == 0 { q } else { m[n - 1] * q });
            let mut row = 0;
            for (i, j, k, l) in quadruples() {
                let determinant =
                    Matrix4::from_columns(&[columns[i], columns[j], columns[k], columns[l]]).determinant();
                assert!((minors[row][p] - determinant).abs() < 1e-13);
                row += 1;
            }
            assert_eq!(row, 35);
        }
    }

    fn quadruples() -> impl Iterator<Item = (usize, usize, usize, usize)> {
        let above = |k: usize| k + 1..7;
        (0..7).flat_map(move |i| {
            above(i).flat_map(move |j| above(j).flat_map(move |k| above(k).map(move |l| (i, j, k, l))))
        })
    }
}
