//! The ten cubics of an essential matrix in the space of four: nine trace constraints and the determinant.
//!
//! With `E = x E1 + y E2 + z E3 + w E4`
//!
//! ```text
//! (E Eᵀ − ½ tr(E Eᵀ) I) E = 0                                     nine cubics
//! det E = 0                                                       the tenth
//! ```
//!
//! (Demazure 1988; the form of Nistér, PAMI 2004, equations (4) and (5)). `cubics.rs` has the same variety in a form that
//! survives a vanishing parallax; this is the one that was published, and eliminated in different ways.

use super::cubics::{Cubic, Linear, Quadratic, add_linear_product, matrix_of_cubics, scaled, upper_rows};

/// Four essential matrices, row by row.
pub(crate) type Basis = [[f64; 9]; 4];

/// The ten cubics over [`CUBIC`](super::cubics::CUBIC): the trace constraint row by row, then the determinant.
pub(crate) fn trace_cubics(basis: &Basis) -> [Cubic; 10] {
    let e: [[Linear; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| std::array::from_fn(|m| basis[m][3 * i + j])));
    let product = half_traceless_square(&e);
    let rows = upper_rows(&product);
    matrix_of_cubics(
        |i, j| [(rows[i][0], &e[0][j]), (rows[i][1], &e[1][j]), (rows[i][2], &e[2][j])],
        &determinant(&e),
    )
}

/// `E Eᵀ − ½ tr(E Eᵀ) I`, by its upper triangle.
#[inline]
fn half_traceless_square(e: &[[Linear; 3]; 3]) -> [[Quadratic; 3]; 3] {
    let mut product = [[[0.0; 10]; 3]; 3];
    for i in 0..3 {
        for j in i..3 {
            for m in 0..3 {
                add_linear_product(&mut product[i][j], &e[i][m], &e[j][m]);
            }
        }
    }
    let half: Quadratic =
        std::array::from_fn(|q| 0.5 * (product[0][0][q] + product[1][1][q] + product[2][2][q]));
    for i in 0..3 {
        for q in 0..10 {
            product[i][i][q] -= half[q];
        }
    }
    product
}

/// `det E`, as products whose sum it is.
#[inline]
fn determinant(e: &[[Linear; 3]; 3]) -> [(Quadratic, Linear); 3] {
    std::array::from_fn(|j| {
        let (a, b) = ((j + 1) % 3, (j + 2) % 3);
        let mut minor = [0.0; 10];
        add_linear_product(&mut minor, &e[1][a], &e[2][b]);
        add_linear_product(&mut minor, &scaled(&e[1][b], -1.0), &e[2][a]);
        (minor, e[0][j])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::monomials::evaluate;
    use crate::solver::cubics::{CUBIC, combine};
    use nalgebra::Matrix3;

    #[test]
    fn cubics_are_the_trace_constraint_and_the_determinant() {
        let basis: Basis =
            std::array::from_fn(|m| std::array::from_fn(|k| ((3 * m + 7 * k) as f64 * 1.3 + 0.2).sin()));
        let v = [0.3, -0.8, 0.5, 1.1];
        let e = Matrix3::from_row_slice(&combine(&basis, &v));
        let eet = e * e.transpose();
        let expected = (eet - Matrix3::from_diagonal_element(0.5 * eet.trace())) * e;
        let cubics = trace_cubics(&basis);
        for i in 0..3 {
            for j in 0..3 {
                assert!((evaluate(&CUBIC, &cubics[3 * i + j], v) - expected[(i, j)]).abs() < 1e-13);
            }
        }
        assert!((evaluate(&CUBIC, &cubics[9], v) - e.determinant()).abs() < 1e-13);
    }
}
