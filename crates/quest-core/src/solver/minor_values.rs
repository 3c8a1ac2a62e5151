//! The 35 minors of `[q, M_1 q, …, M_6 q]` by their values at 35 points: determinants of numbers are found faster than polynomials.
//!
//! A quartic is given by its values at points at which no quartic but zero vanishes. With weights `w` of the points that
//! no minor adds up to anything, `Σ_p w_p minor(p) = 0`, the monomials `x = Σ_p w_p monomials(p)` are in the null space of
//! the matrix of their coefficients; so that no coefficient is needed.

use std::array::from_fn;

use nalgebra::Matrix4;

use crate::algebra::two::Two;
use crate::quaternion::monomials::{MONOMIALS, Quartic};

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
    for (k, points) in POINTS.chunks(2).enumerate() {
        let second = points.get(1).unwrap_or(&points[0]);
        let q: [Two; 4] = from_fn(|i| Two::new([points[0][i], second[i]]));
        for (row, minor) in out.iter_mut().zip(&minors(&columns(m, &q))) {
            row[2 * k..][..points.len()].copy_from_slice(&minor.to_array()[..points.len()]);
        }
    }
    out
}

/// The columns `q, M_1 q, …, M_6 q` at two points.
fn columns(m: &[Matrix4<f64>; 6], q: &[Two; 4]) -> [[Two; 4]; 7] {
    let times = |m: &Matrix4<f64>| -> [Two; 4] {
        from_fn(|i| (1..4).fold(q[0] * m[(i, 0)], |sum, j| sum + q[j] * m[(i, j)]))
    };
    from_fn(|n| if n == 0 { *q } else { times(&m[n - 1]) })
}

/// Pairs of seven columns.
const PAIRS: [[usize; 2]; 21] = {
    let mut pairs = [[0; 2]; 21];
    let (mut n, mut i, mut j) = (0, 0, 1);
    while n < 21 {
        pairs[n] = [i, j];
        n += 1;
        j += 1;
        if j == 7 {
            i += 1;
            j = i + 1;
        }
    }
    pairs
};

/// The quadruples of columns, in lexicographic order, as places of two [`PAIRS`].
const QUADRUPLES: [[usize; 2]; 35] = {
    let mut quadruples = [[0; 2]; 35];
    let (mut n, mut first) = (0, 0);
    while first < 21 {
        let mut second = first;
        while second < 21 {
            if PAIRS[second][0] > PAIRS[first][1] {
                quadruples[n] = [first, second];
                n += 1;
            }
            second += 1;
        }
        first += 1;
    }
    assert!(n == 35);
    quadruples
};

/// All 4 × 4 minors of seven columns, by Laplace expansion along the first two of them.
fn minors(columns: &[[Two; 4]; 7]) -> [Two; 35] {
    // 2 × 2 minors, of the rows 01, 02, 03, 12, 13, 23; those of the other two rows stand at the mirrored place.
    let wedges = PAIRS.map(|[i, j]| {
        let (x, y) = (&columns[i], &columns[j]);
        let minor = |a: usize, b: usize| x[a] * y[b] - x[b] * y[a];
        [minor(0, 1), minor(0, 2), minor(0, 3), minor(1, 2), minor(1, 3), minor(2, 3)]
    });
    QUADRUPLES.map(|[first, second]| {
        let (x, y) = (&wedges[first], &wedges[second]);
        x[0] * y[5] - x[1] * y[4] + x[2] * y[3] + x[3] * y[2] - x[4] * y[1] + x[5] * y[0]
    })
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
        let m: [Matrix4<f64>; 6] = from_fn(|n| Matrix4::from_fn(|i, j| entry(n, i, j)));
        let minors = minors_at_points(&m);
        for (p, point) in POINTS.iter().enumerate() {
            let q = Vector4::from(*point);
            let columns: [Vector4<f64>; 7] = from_fn(|n| if n == 0 { q } else { m[n - 1] * q });
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
