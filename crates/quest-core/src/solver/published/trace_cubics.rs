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

use crate::algebra::vectors::two::Two;
use crate::solver::shared::forms::{
    Cubic, Cubics, Linears, crossed, first, firsts, negative, quadratics, second,
};

/// Four essential matrices, row by row.
pub(crate) type Basis = [[f64; 9]; 4];

/// The ten cubics over [`CUBIC`](crate::solver::shared::forms::CUBIC): the trace constraint row by row, of each row the first two columns, then
/// the last column, then the determinant.
pub(crate) fn trace_cubics(basis: &Basis) -> [Cubic; 10] {
    // Two entries of E, by their places in its rows.
    let e = |i: usize, j: usize| -> Linears { std::array::from_fn(|m| Two::new([basis[m][i], basis[m][j]])) };
    let product = |[a, b]: [usize; 2], [c, d]: [usize; 2]| {
        let [x, y] = [[0, 1, 2].map(|k| e(3 * a + k, 3 * b + k)), [0, 1, 2].map(|k| e(3 * c + k, 3 * d + k))];
        quadratics([(&x[0], &y[0]), (&x[1], &y[1]), (&x[2], &y[2])])
    };
    // E Eᵀ − ½ tr(E Eᵀ) I.
    let (mut p00_01, mut p11_22) = (product([0, 0], [0, 1]), product([1, 2], [1, 2]));
    let p02_12 = product([0, 1], [2, 2]);
    for k in 0..10 {
        let ([p00, p01], [p11, p22]) = (p00_01[k].to_array(), p11_22[k].to_array());
        let half = 0.5 * (p00 + p11 + p22);
        p00_01[k] = Two::new([p00 - half, p01]);
        p11_22[k] -= Two::splat(half);
    }
    let (p00, p01, p02) = (first(&p00_01), second(&p00_01), first(&p02_12));
    let (p11, p12, p22) = (first(&p11_22), second(&p02_12), second(&p11_22));
    // The cofactors of the first row.
    let m0_1 = quadratics([(&e(4, 5), &e(8, 6)), (&negative(&e(5, 3)), &e(7, 8))]);
    let m2 = quadratics([(&e(3, 3), &e(7, 7)), (&negative(&e(4, 4)), &e(6, 6))]);
    let [e0, e1, e2] = [e(0, 1), e(3, 4), e(6, 7)];
    let mut out = Cubics::new();
    out.set(0, [(&p00, &e0), (&p01, &e1), (&p02, &e2)]);
    out.set(1, [(&p01, &e0), (&p11, &e1), (&p12, &e2)]);
    out.set(2, [(&p02, &e0), (&p12, &e1), (&p22, &e2)]);
    out.set(3, [(&p00_01, &e(2, 2)), (&crossed(&p00_01, &p11_22), &e(5, 5)), (&p02_12, &e(8, 8))]);
    out.set(
        4,
        [
            (&firsts(&p02, &m0_1), &e(2, 0)),
            (&firsts(&p12, &second(&m0_1)), &e(5, 1)),
            (&firsts(&p22, &m2), &e(8, 2)),
        ],
    );
    out.rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::monomials::evaluate;
    use crate::solver::quest::cubics::combine;
    use crate::solver::shared::forms::CUBIC;
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
            for (j, place) in [2 * i, 2 * i + 1, 6 + i].into_iter().enumerate() {
                assert!((evaluate(&CUBIC, &cubics[place], v) - expected[(i, j)]).abs() < 1e-13);
            }
        }
        assert!((evaluate(&CUBIC, &cubics[9], v) - e.determinant()).abs() < 1e-13);
    }
}
