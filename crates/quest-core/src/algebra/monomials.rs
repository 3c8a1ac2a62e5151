//! Monomials in four variables by their exponents, for tables made while compiling.

/// The exponents of all monomials of `degree` in four variables, from the first variable's highest power down.
pub(crate) const fn homogeneous<const N: usize>(degree: u8) -> [[u8; 4]; N] {
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

/// The exponents of a product.
pub(crate) const fn sum(a: [u8; 4], b: [u8; 4]) -> [u8; 4] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

/// The value of a form over `list` at `q`.
#[cfg(test)]
pub(crate) fn evaluate<const N: usize>(list: &[[u8; 4]; N], form: &[f64; N], q: [f64; 4]) -> f64 {
    let monomial = |e: &[u8; 4]| (0..4).map(|k| q[k].powi(e[k].into())).product::<f64>();
    list.iter().zip(form).map(|(e, c)| c * monomial(e)).sum()
}
