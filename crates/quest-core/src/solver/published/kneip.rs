//! `kneip`: the rotation directly, without an essential matrix, after
//!
//! L. Kneip, R. Siegwart, M. Pollefeys, *Finding the exact rotation between two images independently of the translation*,
//! European Conference on Computer Vision (ECCV) 2012, LNCS 7577, pages 696–709, doi 10.1007/978-3-642-33783-3_50.
//!
//! **Problem.** The rotations, real and complex, at which the normals `n_i = x2_i × R x1_i` of the epipolar planes of five
//! matches lie in one plane, whatever the translation that is orthogonal to it.
//!
//! **Steps**:
//! 1. Rotate view 2 by a fixed rotation, so that no solution of an everyday problem has `1 + tr R = 0`.
//! 2. `det[n_i n_j n_k] = 0` for the ten triples, cubic in the entries of `R`. With `R (u × v) = R u × R v` they are quadratic
//!    (`quaternion/constraint.rs`).
//! 3. Ten unknowns: the nine entries and the one that makes the equations homogeneous. The paper adds their orthonormality,
//!    twenty quadratic equations, and eliminates among 197 monomials by generated code. Here the ten are the products of two entries of a
//!    quaternion, among which orthonormality holds of itself: quadratic in the entries are the 35 quartic monomials of `q`.
//! 4. The elimination, derived by hand: the ten equations times `r32 − r23`, `r13 − r31` and `r21 − r12` are thirty cubic ones, in
//!    56 monomials times `q1`. Of these 21 have no second `q1`, and are eliminated; the nine combinations that are left are
//!    `1 + tr R` times a quadratic equation each. Among these are the five that the ten lack.
//! 5. The fifteen give 15 of the 35 monomials by the 20 with `q1`: multiplication by `(r21 − r12) / (1 + tr R)` in this basis is a
//!    20 × 20 matrix. Its eigenvalues are that quotient at the twenty solutions, its eigenvectors the monomials there, and these
//!    contain the rotation.
//! 6. The translation of each rotation is the normal of the plane. The twisted partner of a real rotation comes with it.
//!
//! The thirty equations are those of section 7.1 of Fathian et al. (41), times `q1`: both methods solve the same ideal, and
//! from step 5 on [`quest_eigen`](crate::solver::quaternions::quest_eigen) does the same with a shorter way to the last five equations. The solver of the
//! authors finds real rotations alone; the real parts of complex ones, the last digits by Newton's iteration and another
//! fixed rotation where solutions may be missing are this project's (`five_point.rs`).
//!
//! For more than five matches the equations are those of five constraints that span what all matches determine best, and
//! nothing is refined.
//!
//! **Degenerate**: fewer than five independent constraints (all points on a line, repeated points); an exact pure
//! rotation. As the parallax vanishes the twenty solutions run together.
//!
//! **Solutions**: twenty rotations, counting complex ones, of which a pair is one candidate.

use nalgebra::{Complex, ComplexField, Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::algebra::monomials::{homogeneous, position, sum};
use crate::algebra::{
    eigenvalues::eigenvalues, elimination, null_space::null_space, symmetric::smallest_eigenvector_3,
};
use crate::quaternion::monomials::{MONOMIALS, Quartic};
use crate::quaternion::{bilinear, minors_with_q, ten_quartics};
use crate::solver::published::five_point;
use crate::solver::published::five_point::{Solutions, unit};
use crate::solver::shared::motion::Motion;
use crate::solver::{Kinds, PoseSolver};
use crate::{Candidates, Correspondence};

/// The rotation from the coplanarity of the normals; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Kneip {
    /// Which candidates are returned.
    pub kinds: Kinds,
}

/// Fixed rotations of view 2, as quaternions without symmetry; the others serve where the first is in doubt.
const PRE_ROTATIONS: [[f64; 4]; 3] =
    [[0.47, -0.36, 0.59, 0.55], [0.33, 0.68, 0.41, -0.51], [0.64, 0.29, -0.62, 0.35]];

impl PoseSolver for Kneip {
    const NAME: &'static str = "kneip";
    const MIN_MATCHES: usize = five_point::MIN_MATCHES;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        five_point::solve(self.kinds, matches, out, |solutions| {
            let g = unit(PRE_ROTATIONS[solutions.attempt]);
            let constraints = Constraints::new(solutions, &g);
            let Some(relations) = fifteen_relations(&constraints.quartics) else { return false };
            let action = action(&relations);
            let Some(values) = eigenvalues(&mut action.clone()) else { return false };
            solutions.expect_real(values.iter().filter(|value| value.im == 0.0).count());
            let mut twins = Twins::default();
            for value in values {
                if value.im == 0.0 && !twins.take(value.re) {
                    let Some(q) = quaternion(&action, value.re) else { continue };
                    let motion = constraints.motion(unit(q));
                    twins.push(&motion.twisted().q_21);
                    solutions.push_motion(turned_back(&g, &motion));
                } else if value.im > 0.0 && solutions.is_wanted(value) {
                    let Some(q) = quaternion(&action, value) else { continue };
                    solutions.push_real_part(value, product(&g.inverse(), &q));
                }
            }
            true
        });
    }
}

/// Five constraints `⟨Y, [t]× R⟩ = 0` on the motion, with view 2 rotated.
struct Constraints {
    y: [Matrix3<f64>; 5],
    quartics: [Quartic; 10],
}

impl Constraints {
    fn new(solutions: &Solutions, g: &UnitQuaternion<f64>) -> Self {
        if let Ok(five) = <&[Correspondence; 5]>::try_from(solutions.matches) {
            let turned = five.each_ref().map(|m| m.with_view2_rotated(g));
            let y = turned.map(|m| m.bearing2() * m.bearing1().transpose());
            return Self { y, quartics: ten_quartics(&turned) };
        }
        // What is orthogonal to the essential matrices that fit best.
        let (rows, _) = null_space::<4, 9, 5>(&solutions.basis);
        let y = rows.map(|row| g.to_rotation_matrix() * Matrix3::from_row_slice(&row));
        Self { y, quartics: minors_with_q(&y.each_ref().map(bilinear)) }
    }

    /// A rotation with its translation: orthogonal to the normals `n`, of which `Y Rᵀ` has twice the cross-product matrix in its
    /// antisymmetric part.
    fn motion(&self, q_21: UnitQuaternion<f64>) -> Motion {
        let r_12 = q_21.to_rotation_matrix().transpose();
        let normal = |y: &Matrix3<f64>| {
            let m = y * r_12;
            Vector3::new(m.m23 - m.m32, m.m31 - m.m13, m.m12 - m.m21)
        };
        let sum: Matrix3<f64> = self.y.iter().map(normal).map(|n| n * n.transpose()).sum();
        Motion { q_21, direction: smallest_eigenvector_3(&sum).unwrap_or_else(Vector3::z) }
    }
}

/// The motion before view 2 was rotated by `g`.
fn turned_back(g: &UnitQuaternion<f64>, motion: &Motion) -> Motion {
    Motion { q_21: g.inverse() * motion.q_21, direction: g.inverse() * motion.direction }
}

/// `g ⊗ q` for a complex `q`.
fn product(g: &UnitQuaternion<f64>, q: &[Complex<f64>; 4]) -> [Complex<f64>; 4] {
    let part = |f: fn(&Complex<f64>) -> f64| {
        let [w, x, y, z] = q.each_ref().map(f);
        let product = g.quaternion() * Quaternion::new(w, x, y, z);
        [product.w, product.i, product.j, product.k]
    };
    let (re, im) = (part(|x| x.re), part(|x| x.im));
    std::array::from_fn(|k| Complex::new(re[k], im[k]))
}

/// The 56 monomials of degree five: 21 without `q1`, then `q1` times each of [`MONOMIALS`].
const QUINTIC: [[u8; 4]; 56] = {
    let all = homogeneous::<56>(5);
    let mut list = [[0; 4]; 56];
    let (mut k, mut n) = (0, 0);
    while k < 56 {
        if all[k][0] == 0 {
            list[n] = all[k];
            n += 1;
        }
        k += 1;
    }
    assert!(n == WITHOUT_Q1);
    while n < 56 {
        list[n] = sum(MONOMIALS[n - WITHOUT_Q1], [1, 0, 0, 0]);
        n += 1;
    }
    list
};

const WITHOUT_Q1: usize = 21;

/// `TIMES[v][k]`: the place in [`QUINTIC`] of the quartic monomial `k` times `q2`, `q3` or `q4`.
const TIMES: [[usize; 35]; 3] = {
    let mut table = [[0; 35]; 3];
    let mut n = 0;
    while n < 105 {
        let mut variable = [0; 4];
        variable[1 + n / 35] = 1;
        table[n / 35][n % 35] = position(&QUINTIC, sum(MONOMIALS[n % 35], variable));
        n += 1;
    }
    table
};

/// The columns of the last elimination: the 15 monomials without `q1`, those without `q4` ahead of the others, then the 20
/// with it, `q1⁴` last.
const COLUMNS: [usize; 35] = {
    let mut columns = [0; 35];
    let (mut n, mut group) = (0, 0);
    while group < 3 {
        let mut k = 0;
        while k < 35 {
            // Downwards, as the first monomial is to be the last column.
            let e = MONOMIALS[34 - k];
            let of = if e[0] > 0 { 2 } else { (e[3] > 0) as usize };
            if of == group {
                columns[n] = 34 - k;
                n += 1;
            }
            k += 1;
        }
        group += 1;
    }
    columns
};

/// How many of the columns do not contain `q1` nor `q4`: their rows are not needed.
const WITHOUT_Q4: usize = 5;

/// Where multiplication by `q4 / q1` takes each monomial of the basis: a place among [`COLUMNS`].
const TIMES_RATIO: [usize; 20] = {
    let mut table = [0; 20];
    let mut k = 0;
    while k < 20 {
        let [a, b, c, d] = MONOMIALS[COLUMNS[15 + k]];
        let wanted = position(&MONOMIALS, [a - 1, b, c, d + 1]);
        while COLUMNS[table[k]] != wanted {
            table[k] += 1;
        }
        k += 1;
    }
    table
};

/// Step 4 and the elimination of step 5: the 15 monomials without `q1` by the others, over [`COLUMNS`]. The first
/// [`WITHOUT_Q4`] rows are not valid. `None` where the equations are dependent.
fn fifteen_relations(quartics: &[Quartic; 10]) -> Option<[[f64; 35]; 15]> {
    let mut thirty = [[0.0; 56]; 30];
    for (row, times) in TIMES.iter().enumerate() {
        for (i, quartic) in quartics.iter().enumerate() {
            for (place, coefficient) in times.iter().zip(quartic) {
                thirty[10 * row + i][*place] = *coefficient;
            }
        }
    }
    if !elimination::eliminate(&mut thirty, WITHOUT_Q1) {
        return None;
    }
    let nine = thirty[WITHOUT_Q1..].iter().filter_map(|row| row[WITHOUT_Q1..].first_chunk::<35>());
    let mut all = [[0.0; 35]; 19];
    for (row, quartic) in all.iter_mut().zip(quartics.iter().chain(nine)) {
        // Of one length, so that the pivots choose among like and like.
        let inverse = 1.0 / quartic.iter().map(|c| c * c).sum::<f64>().sqrt();
        *row = COLUMNS.map(|k| quartic[k] * inverse);
    }
    // Four of the nineteen are combinations of the others: zero below the fifteenth.
    elimination::eliminate(&mut all, 15).then_some(())?;
    let mut relations = *all.first_chunk::<15>()?;
    for (k, row) in relations.iter_mut().enumerate() {
        row[..k].fill(0.0);
    }
    (elimination::reduce(&mut relations, WITHOUT_Q4) > 0.0).then_some(relations)
}

/// Multiplication by `q4 / q1` of the monomials with `q1`.
fn action(relations: &[[f64; 35]; 15]) -> [[f64; 20]; 20] {
    TIMES_RATIO.map(|target| {
        std::array::from_fn(|j| {
            if target < 15 { -relations[target][15 + j] } else { f64::from(u8::from(target == 15 + j)) }
        })
    })
}

/// The quaternion of an eigenvalue, of any scale: the eigenvector is that of the monomials with `q1`, `q1³q4`, `q1³q3`, `q1³q2` and
/// `q1⁴` at its end.
fn quaternion<T: ComplexField<RealField = f64> + Copy>(action: &[[f64; 20]; 20], value: T) -> Option<[T; 4]> {
    let mut a = action.map(|row| row.map(T::from_real));
    for (k, row) in a.iter_mut().enumerate() {
        row[k] -= value;
    }
    let [.., z, y, x, w] = elimination::null_vector(&mut a)?;
    Some([w, x, y, z])
}

/// The eigenvalues of twisted partners that are still to come.
#[derive(Default)]
struct Twins {
    values: [Option<f64>; 20],
}

impl Twins {
    fn push(&mut self, q: &UnitQuaternion<f64>) {
        if let Some(free) = self.values.iter_mut().find(|value| value.is_none()) {
            *free = Some(q.k / q.w);
        }
    }

    /// Whether this eigenvalue is one of them, as far as eigenvalues are precise; it is then no longer to come.
    fn take(&mut self, value: f64) -> bool {
        let is_it = |twin: &f64| (twin - value).abs() < 1e-6 * (1.0 + value.abs());
        let found = self.values.iter_mut().find(|twin| twin.as_ref().is_some_and(is_it));
        found.is_some_and(|twin| twin.take().is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quaternion::minors_without_q;
    use crate::simulate::{Scene, SceneOptions};

    #[test]
    fn every_eigenvalue_is_a_common_zero_of_all_fifteen_quartics() {
        let scene =
            Scene::generate(&SceneOptions { noise_px: 0.75, ..SceneOptions::default() }, 112, 0).unwrap();
        let matches: [Correspondence; 5] = scene.matches.try_into().unwrap();
        let ten = ten_quartics(&matches);
        let minors = minors_without_q(&matches.map(|m| bilinear(&(m.bearing2() * m.bearing1().transpose()))));
        let action = action(&fifteen_relations(&ten).unwrap());
        for value in eigenvalues(&mut action.clone()).unwrap() {
            let q = quaternion(&action, value).unwrap();
            let size = q.iter().map(|x| x.norm()).fold(0.0, f64::max);
            assert!((q[3] - value).norm() < 1e-9 * size);
            for quartic in ten.iter().chain(&minors) {
                let term = |(e, c): (&[u8; 4], &f64)| {
                    (0..4).map(|k| q[k].powu(e[k].into())).product::<Complex<f64>>() * *c
                };
                let sum: Complex<f64> = MONOMIALS.iter().zip(quartic).map(term).sum();
                assert!(sum.norm() < 1e-9 * size.powi(4), "{value}: {:e}", sum.norm());
            }
        }
    }
}
