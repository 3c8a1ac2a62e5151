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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn monomials_stand_where_they_are_found() {
        let list = homogeneous::<35>(4);
        assert!(list.iter().enumerate().all(|(k, e)| position(&list, *e) == k));
        assert!(list.iter().all(|e| e.iter().sum::<u8>() == 4));
        // Of different degrees, where the last exponent alone tells them apart.
        assert_eq!(position(&[[1, 0, 0, 2], [1, 0, 0, 3]], [1, 0, 0, 3]), 1);
        assert_eq!(sum([1, 0, 0, 2], [0, 1, 0, 3]), [1, 1, 0, 5]);
    }

    #[test]
    #[should_panic(expected = "the monomial is not in the list")]
    fn a_monomial_that_is_not_in_the_list_has_no_place() {
        position(&homogeneous::<4>(1), [2, 0, 0, 0]);
    }
}
