//! Polynomials as lists of terms, and systems of them.

use std::collections::BTreeMap;

use faer::c64;

use super::monomials::power;

/// One equation `f(x) = 0`: terms of a coefficient and the exponents of the unknowns, each monomial once.
#[derive(Clone, Debug, PartialEq)]
pub struct Polynomial {
    terms: Vec<(Vec<u8>, f64)>,
}

impl Polynomial {
    /// Coefficients with the exponents of their monomials, one exponent an unknown; no coefficient is zero.
    pub fn terms(&self) -> impl Iterator<Item = (f64, &[u8])> {
        self.terms.iter().map(|(exponents, c)| (*c, exponents.as_slice()))
    }

    /// The degrees of the terms.
    pub(super) fn degrees(&self) -> impl Iterator<Item = usize> {
        self.terms.iter().map(|(exponents, _)| super::monomials::degree(exponents))
    }

    /// The largest degree of a term.
    #[must_use]
    pub fn degree(&self) -> usize {
        self.degrees().max().unwrap_or(0)
    }

    /// The value at a point.
    #[must_use]
    pub fn evaluate(&self, x: &[c64]) -> c64 {
        self.terms().fold(c64::ZERO, |sum, (c, e)| sum + monomial(e, x) * c)
    }

    /// The absolute value at a point, relative to the sum of the absolute values of the terms: what rounding of the
    /// coefficients would explain. Zero where every term vanishes.
    #[must_use]
    pub fn relative_residual(&self, x: &[c64]) -> f64 {
        let size: f64 = self.terms().map(|(c, e)| c.abs() * monomial(e, x).norm()).sum();
        if size > 0.0 { self.evaluate(x).norm() / size } else { 0.0 }
    }

    /// The derivatives by every unknown.
    pub(super) fn gradient(&self, x: &[c64]) -> Vec<c64> {
        let mut gradient = vec![c64::ZERO; x.len()];
        for (c, e) in self.terms() {
            for k in (0..x.len()).filter(|&k| e[k] > 0) {
                let lower = |j: usize| power(x[j], if j == k { e[j] - 1 } else { e[j] });
                let product = (0..x.len()).fold(c64::ONE, |product, j| product * lower(j));
                gradient[k] += product * (c * f64::from(e[k]));
            }
        }
        gradient
    }
}

fn monomial(exponents: &[u8], x: &[c64]) -> c64 {
    exponents.iter().zip(x).fold(c64::ONE, |product, (e, x)| product * power(*x, *e))
}

/// A system of polynomial equations `f(x) = 0` in any number of unknowns, of any degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct System {
    unknowns: usize,
    equations: Vec<Polynomial>,
}

/// What is wrong with a system as it was written down. Equations and terms are counted from 0.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SystemError {
    /// There is nothing to solve for.
    #[error("the system has no unknowns")]
    NoUnknowns,
    /// There is nothing to solve.
    #[error("the system has no equations")]
    NoEquations,
    /// A term that does not have one exponent for each unknown.
    #[error(
        "equation {equation}, term {term} has {found} exponents, expected one for each of the {expected} unknowns"
    )]
    WrongExponents {
        /// The equation.
        equation: usize,
        /// The term in it.
        term: usize,
        /// How many exponents it has.
        found: usize,
        /// How many unknowns there are.
        expected: usize,
    },
    /// A coefficient that is not a number, or infinite.
    #[error("equation {equation}, term {term} has the coefficient {found}, expected a finite number")]
    NotFinite {
        /// The equation.
        equation: usize,
        /// The term in it.
        term: usize,
        /// The coefficient.
        found: f64,
    },
    /// An equation without any term other than zero.
    #[error("equation {equation} is 0 = 0: every coefficient is zero, or there is none")]
    Empty {
        /// The equation.
        equation: usize,
    },
    /// An equation without unknowns that cannot hold.
    #[error("equation {equation} is {value} = 0: it contains no unknown and never holds")]
    Contradiction {
        /// The equation.
        equation: usize,
        /// Its constant term.
        value: f64,
    },
}

impl System {
    /// A system from its equations `Σ c x^e = 0`, each a list of terms `(c, e)`: a coefficient and the exponents of the
    /// unknowns. Terms with the same exponents are added.
    ///
    /// # Errors
    /// [`SystemError`]: no unknowns or equations, a wrong number of exponents, a coefficient that is not finite, an
    /// equation that says nothing, or one that cannot hold.
    pub fn new<E, X>(unknowns: usize, equations: impl IntoIterator<Item = E>) -> Result<Self, SystemError>
    where
        E: IntoIterator<Item = (f64, X)>,
        X: AsRef<[u8]>,
    {
        if unknowns == 0 {
            return Err(SystemError::NoUnknowns);
        }
        let numbered = equations.into_iter().enumerate();
        let equations = numbered.map(|(k, e)| polynomial(k, e, unknowns)).collect::<Result<Vec<_>, _>>()?;
        if equations.is_empty() {
            return Err(SystemError::NoEquations);
        }
        Ok(Self { unknowns, equations })
    }

    /// How many unknowns there are.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// The equations.
    #[must_use]
    pub fn equations(&self) -> &[Polynomial] {
        &self.equations
    }

    /// The largest degree of an equation.
    #[must_use]
    pub fn degree(&self) -> usize {
        self.equations.iter().map(Polynomial::degree).max().unwrap_or(0)
    }

    /// The largest [`Polynomial::relative_residual`] of an equation.
    #[must_use]
    pub fn residual(&self, x: &[c64]) -> f64 {
        self.equations.iter().map(|f| f.relative_residual(x)).fold(0.0, f64::max)
    }

    /// The greatest common divisor of the differences between the degrees of the terms of an equation, over all
    /// equations: zero where every equation is homogeneous. With a divisor `g`, the solutions times a `g`-th root of
    /// unity are solutions.
    #[must_use]
    pub(super) fn grading(&self) -> usize {
        self.equations.iter().fold(0, |gcd, f| {
            let highest = f.degree();
            f.degrees().fold(gcd, |gcd, degree| greatest_common_divisor(gcd, highest - degree))
        })
    }
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

fn polynomial<X: AsRef<[u8]>>(
    equation: usize,
    terms: impl IntoIterator<Item = (f64, X)>,
    unknowns: usize,
) -> Result<Polynomial, SystemError> {
    let mut sums: BTreeMap<Vec<u8>, f64> = BTreeMap::new();
    for (term, (c, exponents)) in terms.into_iter().enumerate() {
        let exponents = exponents.as_ref();
        if exponents.len() != unknowns {
            let found = exponents.len();
            return Err(SystemError::WrongExponents { equation, term, found, expected: unknowns });
        }
        if !c.is_finite() {
            return Err(SystemError::NotFinite { equation, term, found: c });
        }
        *sums.entry(exponents.to_vec()).or_default() += c;
    }
    let terms: Vec<_> = sums.into_iter().filter(|(_, c)| *c != 0.0).collect();
    match &terms[..] {
        [] => Err(SystemError::Empty { equation }),
        [(exponents, value)] if exponents.iter().all(|e| *e == 0) => {
            Err(SystemError::Contradiction { equation, value: *value })
        }
        _ => Ok(Polynomial { terms }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_said() {
        let none: [[(f64, [u8; 1]); 0]; 0] = [];
        assert_eq!(System::new(0, none).unwrap_err(), SystemError::NoUnknowns);
        assert_eq!(System::new(1, none).unwrap_err(), SystemError::NoEquations);
        let one = |terms: &[(f64, &[u8])]| System::new(2, [terms.to_vec()]).unwrap_err();
        assert_eq!(
            one(&[(1.0, &[1, 0]), (1.0, &[1])]),
            SystemError::WrongExponents { equation: 0, term: 1, found: 1, expected: 2 }
        );
        assert!(matches!(one(&[(f64::NAN, &[1, 0])]), SystemError::NotFinite { equation: 0, term: 0, .. }));
        assert_eq!(one(&[]), SystemError::Empty { equation: 0 });
        assert_eq!(one(&[(1.0, &[1, 0]), (-1.0, &[1, 0])]), SystemError::Empty { equation: 0 });
        assert_eq!(one(&[(2.0, &[0, 0])]), SystemError::Contradiction { equation: 0, value: 2.0 });
    }

    #[test]
    fn the_gradient_is_the_derivative() {
        // 3 x² y³ − x + 2.
        let f: [(f64, [u8; 2]); 3] = [(3.0, [2, 3]), (-1.0, [1, 0]), (2.0, [0, 0])];
        let system = System::new(2, [f]).unwrap();
        let f = &system.equations()[0];
        let x = [c64::new(0.4, 0.3), c64::new(-0.7, 1.1)];
        let h = 1e-6;
        for (k, derivative) in f.gradient(&x).into_iter().enumerate() {
            let at = |step: f64| {
                let mut moved = x;
                moved[k] += step;
                f.evaluate(&moved)
            };
            // Central differences err by h² times the third derivative, and by rounding over h.
            assert!((derivative - (at(h) - at(-h)) / (2.0 * h)).norm() < 1e-8);
        }
    }

    #[test]
    fn gradings() {
        let grading = |equations: &[&[&[u8; 2]]]| {
            let terms = equations.iter().map(|f| f.iter().map(|e| (1.0, **e)).collect::<Vec<_>>());
            System::new(2, terms).unwrap().grading()
        };
        assert_eq!(grading(&[&[&[4, 0], &[2, 2]], &[&[1, 3], &[0, 0]]]), 4);
        assert_eq!(grading(&[&[&[4, 0], &[2, 2]], &[&[1, 0], &[0, 1]]]), 0);
        assert_eq!(grading(&[&[&[4, 0], &[2, 0]], &[&[1, 1], &[0, 0]]]), 2);
        assert_eq!(grading(&[&[&[4, 0], &[2, 0]], &[&[1, 0], &[0, 0]]]), 1);
    }
}
