//! `quest-eigen`: rotations as eigenvalues, section 7.1 of
//!
//! K. Fathian, J. Jin, S.-G. Wee, D.-H. Lee, Y.-G. Kim, N. R. Gans, *Camera relative pose estimation for visual
//! servoing using quaternions*, Robotics and Autonomous Systems (2018), doi 10.1016/j.robot.2018.05.014.
//!
//! **Problem.** The quaternions `q` at which the quartics (39) of five matches vanish: twenty complex ones in
//! general, two for each of the ten essential matrices.
//!
//! **Steps**, and where they leave the paper:
//! 1. Rotate view 2 by a fixed generic rotation. The paper divides by `q1`, which is zero for every half turn and for
//!    the twisted partner of every pure translation.
//! 2. The fifteen quartics of [`quaternion`](crate::quaternion), in place of the ten of (39) times `q1…q4`. The
//!    40 × 56 elimination (41), (42) becomes one of 15 × 35.
//! 3. With `q1 = 1` it gives the 15 quartic monomials in `q2, q3, q4` by the 20 lower ones: multiplication by
//!    `q2 / q1` in that basis is the 20 × 20 matrix that stands for the 35 × 35 matrix `B` of (44).
//! 4. Its eigenvalues are `q2 / q1` at the twenty solutions; the other components are the null vector of ten of the
//!    equations, ten unknowns each. Complex eigenvalues give complex quaternions, of which the real part is kept.
//! 5. Newton's iteration on rotation and translation; the twisted partner comes for free.
//!
//! For more than five matches the quartics are those of the five constraints that fit all matches best, and
//! every solution is refined over all matches.
//!
//! **Degenerate**: fewer than five independent constraints; an exact pure rotation. With little parallax all
//! solutions run together and the eigenvalues lose their digits.

use nalgebra::{Complex, ComplexField, UnitQuaternion};

use crate::algebra::monomials::position;
use crate::algebra::{eigenvalues::eigenvalues, elimination};
use crate::quaternion::monomials::{MONOMIALS, Quartic};
use crate::quaternion::{bilinear, minors_with_q, minors_without_q};
use crate::solver::many_matches::driver;
use crate::solver::quaternions::twenty_zeros::{TwentySolutions, from_five, pre_rotations};
use crate::solver::shared::gram::Gram;
use crate::solver::shared::motion::Motion;
use crate::solver::shared::parallax_frame::Coordinates;
use crate::solver::shared::shortlist::Shortlist;
use crate::solver::{Kinds, PoseSolver};
use crate::{Candidates, Correspondence};

/// The eigenvalue method of section 7.1 of the paper; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct QuestEigen {
    /// Which candidates are returned.
    pub kinds: Kinds,
}

impl PoseSolver for QuestEigen {
    const NAME: &'static str = "quest-eigen";
    const MIN_MATCHES: usize = driver::MIN_MATCHES;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        driver::solve(self.kinds, matches, out, from_five::<Spectrum>, starts);
    }
}

/// The solutions of the five constraints that stand for all matches.
fn starts(gram: &Gram, [n1, n2, n3, n4, n5, ..]: &[Coordinates; 9]) -> Shortlist {
    let mut starts = Shortlist::new();
    let g = pre_rotations()[0];
    let turned = |row| bilinear(&(g.to_rotation_matrix() * gram.alignment.constraint(row)));
    let m = [n1, n2, n3, n4, n5].map(turned);
    if let Some(spectrum) = Spectrum::new(&minors_with_q(&m), &minors_without_q(&m)) {
        for &value in spectrum.values() {
            if let Some((kind, q_21)) = spectrum.rotation(value, &g) {
                starts.push(kind, Motion { q_21, direction: gram.direction(&q_21) });
            }
        }
    }
    starts
}

/// The columns of the elimination: first the 15 monomials without `q1`, those without `q2` ahead of the others, then
/// the 20 monomials with `q1`, the basis.
const COLUMNS: [usize; 35] = {
    let mut columns = [0; 35];
    let mut n = 0;
    let mut group = 0;
    while group < 3 {
        let mut k = 0;
        while k < 35 {
            let e = MONOMIALS[k];
            let of = if e[0] > 0 { 2 } else { (e[1] > 0) as usize };
            if of == group {
                columns[n] = k;
                n += 1;
            }
            k += 1;
        }
        group += 1;
    }
    columns
};

/// How many of the leading columns do not contain `q2`: their rows are not needed.
const WITHOUT_Q2: usize = 5;

/// The exponents of the basis.
const BASIS: [[u8; 4]; 20] = {
    let mut basis = [[0; 4]; 20];
    let mut k = 0;
    while k < 20 {
        basis[k] = MONOMIALS[COLUMNS[15 + k]];
        k += 1;
    }
    basis
};

/// Where `q2 / q1` takes each monomial of the basis: a position among [`COLUMNS`].
const TIMES_RATIO: [usize; 20] = {
    let mut table = [0; 20];
    let mut k = 0;
    while k < 20 {
        let [a, b, c, d] = BASIS[k];
        let wanted = position(&MONOMIALS, [a - 1, b + 1, c, d]);
        while COLUMNS[table[k]] != wanted {
            table[k] += 1;
        }
        k += 1;
    }
    table
};

/// The monomials in `q3, q4` of degree 3 and less, the constant last, by the exponents of both.
const TAIL: [[u8; 2]; 10] = [[3, 0], [2, 1], [1, 2], [0, 3], [2, 0], [1, 1], [0, 2], [1, 0], [0, 1], [0, 0]];

/// Which of [`TAIL`] each monomial of the basis contains.
const TAIL_OF: [usize; 20] = {
    let mut table = [0; 20];
    let mut k = 0;
    while k < 20 {
        while TAIL[table[k]][0] != BASIS[k][2] || TAIL[table[k]][1] != BASIS[k][3] {
            table[k] += 1;
        }
        k += 1;
    }
    table
};

/// Multiplication by `q2 / q1` modulo the quartics, and its eigenvalues.
struct Spectrum {
    action: [[f64; 20]; 20],
    values: [Complex<f64>; 20],
}

impl TwentySolutions for Spectrum {
    fn new(with_q: &[Quartic; 10], without_q: &[Quartic; 5]) -> Option<Self> {
        let mut a = [[0.0; 35]; 15];
        for (row, quartic) in a.iter_mut().zip(with_q.iter().chain(without_q)) {
            for (x, column) in row.iter_mut().zip(COLUMNS) {
                *x = quartic[column];
            }
        }
        if elimination::reduce(&mut a, WITHOUT_Q2) == 0.0 {
            return None;
        }
        let mut action = [[0.0; 20]; 20];
        for (row, target) in action.iter_mut().zip(TIMES_RATIO) {
            if target < 15 {
                for (x, reduced) in row.iter_mut().zip(&a[target][15..]) {
                    *x = -reduced;
                }
            } else {
                row[target - 15] = 1.0;
            }
        }
        let values = eigenvalues(&mut action.clone())?;
        Some(Self { action, values })
    }

    fn values(&self) -> &[Complex<f64>; 20] {
        &self.values
    }

    fn value_at(q: &UnitQuaternion<f64>) -> f64 {
        q.i / q.w
    }

    /// The quaternion `(1, q2, q3, q4)` for `q2 = value`: the null vector of the equations for the monomials that
    /// leave the basis, ten equations in the ten monomials of `q3` and `q4`.
    fn quaternion<T: ComplexField<RealField = f64> + Copy>(&self, value: T) -> Option<[T; 4]> {
        let powers = [T::one(), value, value * value, value * value * value];
        let mut a = [[T::zero(); 10]; 10];
        let leaving = (0..20).filter(|&k| TIMES_RATIO[k] < 15);
        for (row, k) in a.iter_mut().zip(leaving) {
            for j in 0..20 {
                row[TAIL_OF[j]] += powers[usize::from(BASIS[j][1])].scale(self.action[k][j]);
            }
            row[TAIL_OF[k]] -= value * powers[usize::from(BASIS[k][1])];
        }
        let x = elimination::null_vector(&mut a)?;
        Some([T::one(), value, x[7], x[8]])
    }
}
