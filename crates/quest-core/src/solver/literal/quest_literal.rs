//! `quest-literal`: the algorithm QuEst as section 7.1 prints it, (41) to (44), in
//!
//! K. Fathian, J. Jin, S.-G. Wee, D.-H. Lee, Y.-G. Kim, N. R. Gans, *Camera relative pose estimation for visual
//! servoing using quaternions*, Robotics and Autonomous Systems (2018), doi 10.1016/j.robot.2018.05.014.
//!
//! **Problem.** The quaternions at which the quartics (39) of five matches vanish: twenty complex ones.
//!
//! **Steps** of the paper:
//! 1. The ten quartics times `q1, q2, q3, q4`: `A x = 0`, 40 × 56, over the quintic monomials.
//! 2. `x1` are the 35 monomials with `q1`, `x2` the 21 others: `A1 x1 + A2 x2 = 0`, (41), so `x2 = −A2† A1 x1`, (42).
//! 3. With `v = x1 / q1`, the 35 quartic monomials, `x2 = q1 B̄ v`, (43).
//! 4. `q2 v = q1 B v`, (44): the rows of `B` are rows of `B̄` or of the unit matrix. Its 35 eigenvectors are found by faer.
//! 5. Each gives a quaternion, relative to its largest component. Fifteen fail the quartics and are discarded.
//!
//! Not in the paper: the last digits of real solutions (`candidates.rs`); and, for more than five matches, of which the paper
//! says nothing here, all triples in the same steps: the two eigenvectors that fail the quartics least are kept.
//!
//! **What is lost.** `q1` is divided by, and where a solution has `q1 = 0` the matrix `A2` loses a rank, at which the others
//! suffer too: of 50 half turns 25 were lost and the twisted partner of all; of 50 pure translations, of which every twisted partner
//! has `q1 = 0`, 8 were lost and 19 partners. With little parallax the solutions run together: of 100 scenes over all
//! angles 2 true poses were lost at a parallax of 0.01, 32 at 0.001 and 85 at 0.0001; of 100 realistic ones 0, 14 and 61. Of general
//! scenes none of 400 true poses, and under noise none of 4,608 solutions. `quest-eigen` is the same idea without
//! these losses. More than five matches with noise fit badly: with 0.1 px half of the poses from twenty matches are off by more than
//! 0.3°, where `relinearization` has 0.05°.
//!
//! **Degenerate**: fewer than five independent constraints; an exact pure rotation.
//!
//! **Solutions**: up to twenty rotations, counting complex ones, a conjugate pair of which is one candidate.

use std::cell::RefCell;

use nalgebra::Complex;

use super::buffers::{Eigen, Factored, Matrix, zeros};
use super::candidates::{Driver, Found, MIN_MATCHES, Steps};
use crate::algebra::monomials::{homogeneous, position, sum};
use crate::quaternion::monomials::{MONOMIALS, Quartic};
use crate::solver::{Kinds, PoseSolver};
use crate::{Candidates, Correspondence};

/// The algorithm QuEst of section 7.1 as printed; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct QuestLiteral {
    /// Which candidates are returned.
    pub kinds: Kinds,
}

impl PoseSolver for QuestLiteral {
    const NAME: &'static str = "quest-literal";
    const MIN_MATCHES: usize = MIN_MATCHES;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        DRIVER.with_borrow_mut(|driver| driver.solve(self.kinds, matches, out));
    }
}

/// What the tests count (`what_the_printed_form_loses`).
pub(crate) const LOST: &str = "25 of 50 half turns, 8 of 50 pure translations, and 2, 32 and 85 of 100 poses at a parallax of 0.01, 0.001 and \
                               0.0001, without noise";

thread_local! {
    static DRIVER: RefCell<Driver<Buffers>> = RefCell::default();
}

/// Of five matches no more than this many solve the quartics.
const SOLUTIONS: usize = 20;

/// An eigenvector whose quaternion satisfies the quartics (of norm 1) no better than this is one of the fifteen that are no
/// solution. No bound tells the two apart for certain: in 2,000 problems with noise the twenty leave 1e-9 at the most, and of the
/// fifteen one in three thousand less than 1e-7.
const SATISFIED: f64 = 1e-6;

/// The quintic monomials with `q1`, as those of [`MONOMIALS`] that are left after dividing by it, and those without.
const WITHOUT_Q1: [[u8; 4]; 21] = {
    let quintic = homogeneous::<56>(5);
    let mut list = [[0; 4]; 21];
    let (mut n, mut k) = (0, 0);
    while k < 56 {
        if quintic[k][0] == 0 {
            list[n] = quintic[k];
            n += 1;
        }
        k += 1;
    }
    list
};

/// Where the product of a monomial and `q_{k+1}` stands: below 35 in `x1`, from there on in `x2`.
const TIMES: [[usize; 4]; 35] = {
    let mut table = [[0; 4]; 35];
    let mut i = 0;
    while i < 35 {
        let mut k = 0;
        while k < 4 {
            let mut unknown = [0; 4];
            unknown[k] = 1;
            let product = sum(MONOMIALS[i], unknown);
            table[i][k] = if product[0] > 0 {
                position(&MONOMIALS, [product[0] - 1, product[1], product[2], product[3]])
            } else {
                35 + position(&WITHOUT_Q1, product)
            };
            k += 1;
        }
        i += 1;
    }
    table
};

/// `CUBES[k][j]`: where `q_{k+1}³ q_{j+1}` stands among the quartic monomials.
pub(super) const CUBES: [[usize; 4]; 4] = {
    let mut table = [[0; 4]; 4];
    let mut k = 0;
    while k < 4 {
        let mut j = 0;
        while j < 4 {
            let mut monomial = [0; 4];
            monomial[k] = 3;
            monomial[j] += 1;
            table[k][j] = position(&MONOMIALS, monomial);
            j += 1;
        }
        k += 1;
    }
    table
};

/// The quaternion, of any scale, from the values of the quartic monomials: relative to the largest fourth power `q_k⁴`, the
/// component `q_j` is the value of `q_k³ q_j`.
pub(super) fn quaternion(value: impl Fn(usize) -> Complex<f64>) -> [Complex<f64>; 4] {
    let size = |k: usize| value(CUBES[k][k]).norm_sqr();
    let k = (1..4).fold(0, |best, k| if size(k) > size(best) { k } else { best });
    CUBES[k].map(value)
}

#[derive(Default)]
struct Buffers {
    a1: Matrix,
    a2: Matrix,
    b: Matrix,
    factored: Factored,
    eigen: Eigen,
}

impl Steps for Buffers {
    fn solve(&mut self, matches: usize, quartics: &[Quartic], push: &mut dyn FnMut(Found)) -> bool {
        let most = if matches == MIN_MATCHES { SOLUTIONS } else { 2 };
        self.fill(quartics);
        if !self.eigenvalue_matrix() || !self.eigen.decompose(self.b.as_ref()) {
            return false;
        }
        let mut best: [(f64, Found); SOLUTIONS] = [(f64::INFINITY, ([Complex::ZERO; 4], true)); SOLUTIONS];
        let mut kept = 0;
        for place in self.eigen.places() {
            let q = scaled(quaternion(|i| self.eigen.entry(i, place)));
            let residual = largest(quartics, &q);
            // Not a number fails as well.
            if residual < SATISFIED || (most == 2 && residual.is_finite()) {
                insert(&mut best[..most], &mut kept, (residual, (q, place.1)));
            }
        }
        best[..kept.min(most)].iter().for_each(|(_, found)| push(*found));
        true
    }
}

impl Buffers {
    /// `A1` and `A2` of (41).
    fn fill(&mut self, quartics: &[Quartic]) {
        zeros(&mut self.a1, 4 * quartics.len(), 35);
        zeros(&mut self.a2, 4 * quartics.len(), 21);
        for (i, quartic) in quartics.iter().enumerate() {
            for k in 0..4 {
                for (j, c) in quartic.iter().enumerate() {
                    match TIMES[j][k] {
                        column @ ..35 => self.a1[(4 * i + k, column)] = *c,
                        column => self.a2[(4 * i + k, column - 35)] = *c,
                    }
                }
            }
        }
    }

    /// `B` of (44), from `B̄ = −A2† A1`: `A2` has full column rank, so that its pseudo-inverse is `R⁻¹ Qᵀ`. `false` where it has
    /// not.
    fn eigenvalue_matrix(&mut self) -> bool {
        self.factored.factor(&mut self.a2);
        let r = self.a2.as_ref().subrows(0, 21);
        let diagonal = |i: usize| r[(i, i)].abs();
        let largest = (0..21).map(diagonal).fold(0.0, f64::max);
        if !(0..21).all(|i| diagonal(i) > f64::EPSILON * largest) {
            return false;
        }
        self.factored.apply_transpose(self.a2.as_ref(), &mut self.a1);
        let mut top = self.a1.as_mut().subrows_mut(0, 21);
        faer::linalg::triangular_solve::solve_upper_triangular_in_place(r, top.as_mut(), faer::Par::Seq);
        zeros(&mut self.b, 35, 35);
        for (i, products) in TIMES.iter().enumerate() {
            // (44): q2 v_i is an entry of x2, or q1 times an entry of v.
            match products[1] {
                row @ ..35 => self.b[(i, row)] = 1.0,
                row => (0..35).for_each(|j| self.b[(i, j)] = -top[(row - 35, j)]),
            }
        }
        (0..35).all(|j| (0..35).all(|i| self.b[(i, j)].is_finite()))
    }
}

fn scaled(q: [Complex<f64>; 4]) -> [Complex<f64>; 4] {
    let norm = q.iter().map(Complex::norm_sqr).sum::<f64>().sqrt();
    q.map(|c| c / norm)
}

/// The largest absolute value of a quartic.
fn largest(quartics: &[Quartic], q: &[Complex<f64>; 4]) -> f64 {
    let powers = q.map(|c| [Complex::ONE, c, c * c, c * c * c, c * c * c * c]);
    let values =
        MONOMIALS.map(|m| (0..4).fold(Complex::ONE, |product, k| product * powers[k][usize::from(m[k])]));
    let value = |quartic: &Quartic| {
        quartic.iter().zip(&values).fold(Complex::<f64>::ZERO, |sum, (c, v)| sum + *v * *c).norm()
    };
    quartics
        .iter()
        .map(value)
        .fold(0.0, |largest, value| if value > largest || value.is_nan() { value } else { largest })
}

/// Keeps the entries with the smallest residuals, in order.
fn insert(best: &mut [(f64, Found)], kept: &mut usize, entry: (f64, Found)) {
    let place = best.partition_point(|(residual, _)| *residual <= entry.0);
    if place < best.len() {
        best[place..].rotate_right(1);
        best[place] = entry;
        *kept += 1;
    }
}
