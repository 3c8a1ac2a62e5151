//! Section 7.1 word for word, (41) to (44): quartics times q1 … q4, pseudo-inverse, 35 × 35 eigenvalues.
//!
//! Slow and transparent, and sharing nothing with the library but the paper. One thing is not in the paper: the
//! bearings may be rotated first and the solutions rotated back, because (43) divides by q1, which vanishes for
//! half turns and for the twisted partner of every pure translation.

use faer::{Mat, c64};
use nalgebra::{Complex, SMatrix, SVector, UnitQuaternion};

use crate::polynomial::{Exponents, Polynomial, monomial_value, monomials};
use crate::quartics::{Match, quartics};

/// A solution: a complex quaternion `(q1, q2, q3, q4)` of norm 1 whose largest component is real and positive.
pub type Solution = [c64; 4];

/// An eigenvector whose quaternion satisfies the quartics (of norm 1) no better than this is one of the fifteen
/// that are no solution. No bound tells the two apart for certain: in 2,000 problems the twenty leave 1e-9 at the
/// most, one of the fifteen once 1e-9 and eleven times less than 1e-7. Better a few too many here: polishing moves
/// those to a solution that is known already, or shows that there is none.
const ACCEPTED: f64 = 1e-7;

/// The matrix of the coefficients of polynomials (rows) of monomials (columns), the rows scaled to norm 1.
#[must_use]
pub fn coefficient_matrix(rows: &[Polynomial], columns: &[Exponents]) -> Mat<f64> {
    let rows: Vec<_> = rows.iter().map(|p| p.coefficients(columns)).collect();
    let norms: Vec<_> = rows.iter().map(|r| r.iter().map(|c| c * c).sum::<f64>().sqrt()).collect();
    Mat::from_fn(rows.len(), columns.len(), |i, j| rows[i][j] / norms[i])
}

/// The forty quintics: every quartic times q1, q2, q3, q4.
#[must_use]
pub fn quintics(quartics: &[Polynomial]) -> Vec<Polynomial> {
    quartics.iter().flat_map(|p| (0..4).map(|k| p.times(&Polynomial::unknown(k)))).collect()
}

/// The matrix B of (44), 35 × 35, over the 35 quartic monomials `v = x1 / q1`.
#[must_use]
pub fn eigenvalue_matrix(quartics: &[Polynomial]) -> Mat<f64> {
    let (x1, x2): (Vec<_>, Vec<_>) = monomials(5).into_iter().partition(|m| m[0] > 0);
    let rows = quintics(quartics);
    // Each row of A is scaled as a whole.
    let a = coefficient_matrix(&rows, &[x1.clone(), x2.clone()].concat());
    let (a1, a2) = (a.subcols(0, x1.len()), a.subcols(x1.len(), x2.len()));
    // (42), (43): x2 = q1 B̄ v with B̄ = −A2† A1.
    let b_bar = -(a2.thin_svd().expect("the SVD of A2").pseudoinverse() * a1);
    let v = monomials(4);
    let mut b = Mat::zeros(35, 35);
    for (i, monomial) in v.iter().enumerate() {
        // (44): the entry q2 v_i is an entry of x2, or q1 times an entry of v.
        let mut product = *monomial;
        product[1] += 1;
        if let Some(row) = x2.iter().position(|m| *m == product) {
            b.row_mut(i).copy_from(b_bar.row(row));
        } else {
            product[0] -= 1;
            let j = v.iter().position(|m| *m == product).expect("a quartic monomial");
            b[(i, j)] = 1.0;
        }
    }
    b
}

/// All solutions of the five-point problem by section 7.1, complex ones included.
///
/// The bearings of camera 1 are rotated by `before.0` and those of camera 2 by `before.1`; the solutions belong to
/// the bearings as given.
#[must_use]
pub fn solve(matches: &[Match; 5], before: (UnitQuaternion<f64>, UnitQuaternion<f64>)) -> Vec<Solution> {
    let rotated = matches.map(|(m1, m2)| (before.0 * m1, before.1 * m2));
    let quartics = quartics(&rotated);
    let eigen = eigenvalue_matrix(&quartics).eigen().expect("the eigenvectors of B");
    let v = monomials(4);
    let system = System::new(&quartics);
    let mut solutions = Vec::new();
    for column in eigen.U().col_iter() {
        let q = scaled(quaternion_of_eigenvector(&v, |i| column[i]));
        if system.residual(q) < ACCEPTED {
            // R(q') = R(before.1) R(q) R(before.0)ᵀ, so q = conj(before.1) ⊗ q' ⊗ before.0.
            solutions.push(scaled(hamilton(constant(before.1.inverse()), hamilton(q, constant(before.0)))));
        }
    }
    solutions
}

/// q from an eigenvector, the values of the quartic monomials: relative to the largest fourth power `q_k⁴`, the
/// component `q_j` is the value of `q_k³ q_j`.
fn quaternion_of_eigenvector(v: &[Exponents], value: impl Fn(usize) -> c64) -> Solution {
    let at = |monomial: Exponents| value(v.iter().position(|m| *m == monomial).expect("a quartic monomial"));
    let fourth_power = |k: usize| {
        let mut monomial = [0; 4];
        monomial[k] = 4;
        monomial
    };
    let largest = (0..4).max_by(|&a, &b| at(fourth_power(a)).norm().total_cmp(&at(fourth_power(b)).norm()));
    let k = largest.expect("one of four");
    [0, 1, 2, 3].map(|j| {
        let mut monomial = fourth_power(k);
        monomial[k] -= 1;
        monomial[j] += 1;
        at(monomial)
    })
}

/// Scales to norm 1 with the largest component real and positive.
#[must_use]
pub fn scaled(q: Solution) -> Solution {
    let norm = q.iter().map(Complex::norm_sqr).sum::<f64>().sqrt();
    let largest = q.iter().fold(c64::new(0.0, 0.0), |a, b| if b.norm() > a.norm() { *b } else { a });
    let phase = largest.conj() / largest.norm();
    q.map(|c| c * phase / norm)
}

/// A quaternion as a solution with real components.
#[must_use]
pub fn constant(q: UnitQuaternion<f64>) -> Solution {
    [q.w, q.i, q.j, q.k].map(|c| c64::new(c, 0.0))
}

/// The Hamilton product, scalar first.
#[must_use]
pub fn hamilton(a: Solution, b: Solution) -> Solution {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// The sine of the angle between two solutions as complex vectors: zero where they differ by a phase alone.
#[must_use]
pub fn distance(p: &Solution, q: &Solution) -> f64 {
    let inner = (0..4).fold(c64::new(0.0, 0.0), |sum, k| sum + p[k].conj() * q[k]);
    (0..4).map(|k| (q[k] - p[k] * inner).norm_sqr()).sum::<f64>().sqrt()
}

/// The quartics of a problem, ready to be evaluated: for accepting and for polishing solutions.
#[derive(Clone, Debug)]
pub struct System {
    monomials: Vec<Exponents>,
    c: Mat<f64>,
}

impl System {
    /// The system of these quartics, each scaled to norm 1.
    #[must_use]
    pub fn new(quartics: &[Polynomial]) -> Self {
        let monomials = monomials(4);
        let c = coefficient_matrix(quartics, &monomials);
        Self { monomials, c }
    }

    /// The largest absolute value of a quartic at a solution of norm 1.
    #[must_use]
    pub fn residual(&self, q: Solution) -> f64 {
        self.values(q).iter().fold(0.0, |largest, r| largest.max(r.norm()))
    }

    fn values(&self, q: Solution) -> Vec<c64> {
        self.combine(|m| monomial_value(m, q))
    }

    fn derivatives(&self, q: Solution, k: usize) -> Vec<c64> {
        self.combine(|mut m| {
            let power = m[k];
            m[k] = power.saturating_sub(1);
            monomial_value(m, q) * f64::from(power)
        })
    }

    fn combine(&self, value: impl Fn(Exponents) -> c64) -> Vec<c64> {
        let values: Vec<_> = self.monomials.iter().map(|m| value(*m)).collect();
        let row =
            |i: usize| (0..values.len()).fold(c64::new(0.0, 0.0), |sum, j| sum + values[j] * self.c[(i, j)]);
        (0..self.c.nrows()).map(row).collect()
    }

    /// The derivatives of the quartics at a solution, with `qᴴ` as the last row: 4 unknowns and one scale.
    fn jacobian(&self, q: Solution) -> (SMatrix<c64, 11, 4>, SVector<c64, 11>) {
        let mut jacobian = SMatrix::<c64, 11, 4>::zeros();
        for k in 0..4 {
            for (i, d) in self.derivatives(q, k).into_iter().enumerate() {
                jacobian[(i, k)] = d;
            }
            jacobian[(10, k)] = q[k].conj();
        }
        let values = self.values(q);
        let residuals = SVector::from_fn(|i, _| values.get(i).copied().unwrap_or(c64::new(0.0, 0.0)));
        (jacobian, residuals)
    }

    /// Newton steps from a solution (Gauss–Newton, since there are ten equations): not in the paper, but its
    /// eigenvectors carry 1e-8 or so, and sets of solutions have to be compared more finely than that.
    #[must_use]
    pub fn polished(&self, mut q: Solution) -> Solution {
        for _ in 0..8 {
            let (jacobian, residuals) = self.jacobian(q);
            let Ok(step) = jacobian.svd(true, true).solve(&residuals, 0.0) else { break };
            let next = scaled([0, 1, 2, 3].map(|k| q[k] - step[k]));
            if self.residual(next) >= self.residual(q) {
                break;
            }
            q = next;
        }
        q
    }

    /// The solutions polished, each once.
    #[must_use]
    pub fn distinct(&self, solutions: &[Solution]) -> Vec<Solution> {
        let mut distinct: Vec<Solution> = Vec::new();
        for q in solutions.iter().map(|q| self.polished(*q)) {
            if self.residual(q) < 1e-12 && !distinct.iter().any(|p| distance(p, &q) < 1e-8) {
                distinct.push(q);
            }
        }
        distinct
    }
}
