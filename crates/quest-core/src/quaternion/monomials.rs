//! The 35 quartic monomials in `q1, q2, q3, q4`, and the tables that multiply polynomials over them.

/// Exponents of `(q1, q2, q3, q4)` in the columns of the constraint matrix, in the order of (45):
/// `q1⁴, q1³q2, q1³q3, …, q4⁴`.
pub const MONOMIALS: [[u8; 4]; 35] = homogeneous::<35>(4);

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

/// All exponents of `degree` in four variables, from the first variable's highest power down.
const fn homogeneous<const N: usize>(degree: u8) -> [[u8; 4]; N] {
    let mut list = [[0; 4]; N];
    let mut n = 0;
    // What is left for the variables after the first, after the second, and for the last alone.
    let mut after_1 = 0;
    while after_1 <= degree {
        let mut after_2 = 0;
        while after_2 <= after_1 {
            let mut last = 0;
            while last <= after_2 {
                list[n] = [degree - after_1, after_1 - after_2, after_2 - last, last];
                n += 1;
                last += 1;
            }
            after_2 += 1;
        }
        after_1 += 1;
    }
    assert!(n == N);
    list
}

/// The index of a monomial in a list that contains it.
pub(crate) const fn position<const N: usize>(list: &[[u8; 4]; N], wanted: [u8; 4]) -> usize {
    let mut k = 0;
    while k < N {
        let e = list[k];
        if e[0] == wanted[0] && e[1] == wanted[1] && e[2] == wanted[2] && e[3] == wanted[3] {
            return k;
        }
        k += 1;
    }
    panic!("the monomial is not in the list");
}

const fn sum(a: [u8; 4], b: [u8; 4]) -> [u8; 4] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

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

/// The value of a form over `list` at `q`.
#[cfg(test)]
pub(crate) fn evaluate<const N: usize>(list: &[[u8; 4]; N], form: &[f64; N], q: [f64; 4]) -> f64 {
    let monomial = |e: &[u8; 4]| (0..4).map(|k| q[k].powi(e[k].into())).product::<f64>();
    list.iter().zip(form).map(|(e, c)| c * monomial(e)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

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
