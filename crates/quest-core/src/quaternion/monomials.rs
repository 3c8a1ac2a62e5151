//! The 35 quartic monomials in `q1, q2, q3, q4`, and the tables that multiply polynomials over them.

use crate::algebra::monomials::{homogeneous, position, sum};

/// Exponents of `(q1, q2, q3, q4)` in the columns of the constraint matrix, in the order of (45):
/// `q1⁴, q1³q2, q1³q3, …, q4⁴`.
pub const MONOMIALS: [[u8; 4]; 35] = homogeneous::<35>(4);

/// The row (40) of `C`: the coefficients of `(q·q)²` over [`MONOMIALS`], which a unit quaternion makes 1.
pub const NORM_ROW: [f64; 35] = {
    let mut row = [0.0; 35];
    let mut k = 0;
    while k < 35 {
        let [a, b, c, d] = MONOMIALS[k];
        if a % 2 == 0 && b % 2 == 0 && c % 2 == 0 && d % 2 == 0 {
            row[k] = if a == 4 || b == 4 || c == 4 || d == 4 { 1.0 } else { 2.0 };
        }
        k += 1;
    }
    row
};

/// The names of [`MONOMIALS`]: `q1^4`, `q1^3 q2`, …, `q4^4`.
#[must_use]
pub fn monomial_names() -> [String; 35] {
    MONOMIALS.map(|exponents| {
        let factors = exponents.into_iter().enumerate().filter(|(_, e)| *e > 0);
        let factors = factors.map(|(k, e)| match e {
            1 => format!("q{}", k + 1),
            e => format!("q{}^{e}", k + 1),
        });
        factors.collect::<Vec<_>>().join(" ")
    })
}

/// Exponents of the ten quadratic monomials in the same order.
pub(crate) const QUADRATIC: [[u8; 4]; 10] = homogeneous::<10>(2);

/// `PRODUCT[i][j]`: the column of the product of the quadratic monomials `i` and `j`.
pub(crate) const PRODUCT: [[usize; 10]; 10] = {
    let mut table = [[0; 10]; 10];
    let mut i = 0;
    while i < 10 {
        let mut j = 0;
        while j < 10 {
            table[i][j] = position(&MONOMIALS, sum(QUADRATIC[i], QUADRATIC[j]));
            j += 1;
        }
        i += 1;
    }
    table
};

/// `SQUARE[a][b]`: the quadratic monomial `q_a q_b`.
pub(crate) const SQUARE: [[usize; 4]; 4] = {
    let mut table = [[0; 4]; 4];
    let mut a = 0;
    while a < 4 {
        let mut b = 0;
        while b < 4 {
            let mut exponents = [0; 4];
            exponents[a] += 1;
            exponents[b] += 1;
            table[a][b] = position(&QUADRATIC, exponents);
            b += 1;
        }
        a += 1;
    }
    table
};

/// A quadratic form in the quaternion, its coefficients over [`QUADRATIC`].
pub(crate) type Quadratic = [f64; 10];

/// A quartic form in the quaternion, its coefficients over [`MONOMIALS`].
pub(crate) type Quartic = [f64; 35];

/// `a b − c d`.
#[inline]
pub(crate) fn commutator(a: &Quadratic, b: &Quadratic, c: &Quadratic, d: &Quadratic) -> Quartic {
    let mut out = [0.0; 35];
    for i in 0..10 {
        for j in 0..10 {
            out[PRODUCT[i][j]] += a[i] * b[j] - c[i] * d[j];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::monomials::evaluate;

    #[test]
    fn products_evaluate_to_products() {
        let form = |s: f64| std::array::from_fn::<f64, 10, _>(|k| (s * (k as f64 + 1.3)).sin());
        let (a, b, c, d) = (form(1.0), form(2.0), form(3.0), form(5.0));
        let q = [0.3, -0.7, 1.1, 0.4];
        let [a0, b0, c0, d0] = [&a, &b, &c, &d].map(|f| evaluate(&QUADRATIC, f, q));
        let found = evaluate(&MONOMIALS, &commutator(&a, &b, &c, &d), q);
        assert!((found - (a0 * b0 - c0 * d0)).abs() < 1e-13);
    }

    #[test]
    fn the_norm_row_is_the_square_of_the_norm() {
        let q = [0.3, -0.7, 1.1, 0.4];
        let square: f64 = q.iter().map(|x| x * x).sum();
        assert!((evaluate(&MONOMIALS, &NORM_ROW, q) - square * square).abs() < 1e-13);
        let names = monomial_names();
        assert_eq!([&names[0], &names[1], &names[34]], ["q1^4", "q1^3 q2", "q4^4"]);
        assert!(names.contains(&"q1 q2 q3 q4".to_owned()) && names.contains(&"q1^2 q3^2".to_owned()));
    }

    #[test]
    fn squares_name_the_quadratic_monomials() {
        for a in 0..4 {
            for b in 0..4 {
                let mut e = [0; 4];
                e[a] += 1;
                e[b] += 1;
                assert_eq!(QUADRATIC[SQUARE[a][b]], e);
            }
        }
    }
}
