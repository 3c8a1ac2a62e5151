//! `relinearization`: monomials as unknowns, twice; sections 4.2 and 7.2 and appendix A of
//!
//! K. Fathian, J. Jin, S.-G. Wee, D.-H. Lee, Y.-G. Kim, N. R. Gans, *Camera relative pose estimation for visual
//! servoing using quaternions*, Robotics and Autonomous Systems (2018), doi 10.1016/j.robot.2018.05.014, after
//! A. Kipnis, A. Shamir, *Cryptanalysis of the HFE public key cryptosystem by relinearization*, CRYPTO 1999.
//!
//! **Problem.** The quaternions of norm one, (40), at which the quartics (39) vanish: twenty complex ones for five matches, two
//! for more.
//!
//! **Steps** of the paper:
//! 1. The 35 quartic monomials are unknowns `x` of a linear system; what it leaves open is `x = Σ s_i v_i`, (47).
//! 2. That monomials commute, `x_a x_b = x_c x_d`, are 465 equations, linear in the products `y = (s_i s_j)`: `D̄ y = 0`, (50).
//! 3. `D̄` has as many null vectors as there are solutions, `y = W r`, (51). With the rows of `W` for `s_0 s_i` and for
//!    `s_l s_i` the solutions are the eigenvectors of `W_l W_0⁻¹`, (52) to (55).
//! 4. `s` gives `x`, and ratios of its entries the quaternion. Newton's iteration, translation and depths as for every solver.
//!
//! **What is different here.** The paper's `x_p` is one more `v_i`, and (40) the form `s_0 = (q·q)²` that the others are
//! divided by: with that, all is homogeneous. The minors of [`quaternion`](crate::quaternion) that the paper does not have
//! leave no more directions `v_i` than there are solutions, so that `W_0` is square. Then:
//! - *Five matches*, 20 directions: `D̄` is 465 × 210, and its null space comes from an elimination of 15 × 35 (`moments.rs`).
//! - *More*: the six combinations of all constraints that the matches determine best have 35 minors, which leave two directions
//!   in the least-squares sense. `D̄` is 465 × 3, of rank one: `W_1 W_0⁻¹` has the roots of one quadratic equation as its
//!   eigenvalues. Both solutions are refined over all matches; where they do not fit, the motion on which most matches
//!   agree is added.
//!
//! **Degenerate**: fewer than five independent constraints; an exact pure rotation. With little parallax all solutions run
//! together and the eigenvalues lose their digits: at a parallax of 1e-7 next to none of the true poses is lost, at 1e-8 one
//! in twenty.
//!
//! **Solutions**: twenty rotations for five matches and two for more, counting complex ones, a pair of which is one candidate;
//! and the rotation-only candidate.

use nalgebra::{Complex, ComplexField, Matrix3, Matrix4, Quaternion, UnitQuaternion};

use super::aligned::{Alignment, Gram};
use super::essential::real_part;
use super::moments::Pencil;
use super::motion::Motion;
use super::quest::motions_of_five;
use super::shortlist::Shortlist;
use super::twenty::from_five;
use super::{Kinds, PoseSolver, consensus, refining};
use crate::algebra::monomials::{position, sum};
use crate::algebra::singular::shortest_directions;
use crate::quaternion::monomials::{MONOMIALS, Quartic};
use crate::quaternion::{bilinear, fifteen_minors_without_q, minors_with_q};
use crate::structure::translation_direction;
use crate::{CandidateKind, Candidates, Correspondence, Degeneracy};

/// The relinearisation of sections 4.2 and 7.2 of the paper; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Relinearization {
    /// Which candidates are returned.
    pub kinds: Kinds,
}

impl PoseSolver for Relinearization {
    const NAME: &'static str = "relinearization";
    const MIN_MATCHES: usize = refining::MIN_MATCHES;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        refining::solve(self.kinds, matches, out, from_five::<Pencil>, from_many);
    }
}

/// The local minima over more than five matches next to the two solutions.
fn from_many(alignment: &Alignment, matches: &[Correspondence]) -> Result<Shortlist, Degeneracy> {
    let gram = Gram::new(alignment, matches);
    let [leading @ .., _, _, _] = gram.principal_basis(matches)?;
    let rows = minors(&leading.map(|row| bilinear(&alignment.constraint(&row))));
    let mut starts = Shortlist::new();
    for (kind, q_21) in two_solutions(rows).into_iter().flatten() {
        starts.push(kind, Motion { q_21, direction: translation_direction(&q_21, matches) });
    }
    let mut refined = starts.refined(&gram, matches);
    consensus::add(&mut refined, matches, motions_of_five);
    Ok(refined)
}

/// The 35 minors of `[q, M_1 q, …, M_6 q]`.
fn minors(m: &[Matrix4<f64>; 6]) -> [Quartic; 35] {
    let with_q: [Quartic; 20] = minors_with_q(m);
    let without_q = fifteen_minors_without_q(m);
    std::array::from_fn(|k| if k < 20 { with_q[k] } else { without_q[k - 20] })
}

/// The index of a monomial of degree 8 in lexicographic order.
const fn octic([_, b, c, d]: [u8; 4]) -> usize {
    let (three, two, one) = ((b + c + d) as usize, (c + d) as usize, d as usize);
    three * (three + 1) * (three + 2) / 6 + two * (two + 1) / 2 + one
}

/// The 465 relations `x_a x_b = x_c x_d` of commutativity, as `[a, b, c, d]`.
const RELATIONS: [[u8; 4]; 465] = {
    let mut first = [[255; 2]; 165];
    let mut relations = [[0; 4]; 465];
    let mut n = 0;
    let mut a = 0;
    while a < 35 {
        let mut b = a;
        while b < 35 {
            let place = octic(sum(MONOMIALS[a as usize], MONOMIALS[b as usize]));
            let [c, d] = first[place];
            if c == 255 {
                first[place] = [a, b];
            } else {
                relations[n] = [a, b, c, d];
                n += 1;
            }
            b += 1;
        }
        a += 1;
    }
    assert!(n == 465);
    relations
};

/// The rotations of the two solutions of equations of which these are the coefficients.
fn two_solutions(mut rows: [Quartic; 35]) -> [Option<(CandidateKind, UnitQuaternion<f64>)>; 2] {
    let [v1, v2]: [Quartic; 2] = shortest_directions(&mut rows);
    let [a, b, c] = binary_quadratic(&v1, &v2);
    // a s1² + b s1 s2 + c s2² = 0.
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        let (s1, s2) = (Complex::new(-b, (-discriminant).sqrt()), Complex::from(2.0 * a));
        let x = std::array::from_fn(|k| s1 * v1[k] + s2 * v2[k]);
        return [rotation(CandidateKind::FromComplex, real_part(quaternion(&x))), None];
    }
    let t = -0.5 * (b + discriminant.sqrt().copysign(b));
    [(t, a), (c, t)].map(|(s1, s2)| {
        let x = std::array::from_fn(|k| s1 * v1[k] + s2 * v2[k]);
        rotation(CandidateKind::Exact, quaternion::<f64>(&x))
    })
}

fn rotation(kind: CandidateKind, [w, x, y, z]: [f64; 4]) -> Option<(CandidateKind, UnitQuaternion<f64>)> {
    let q = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    q.coords.iter().all(ComplexField::is_finite).then_some((kind, q))
}

/// `D y = 0` for `y = (s1², s1 s2, s2²)`: the one equation that the 465 are multiples of, in the least-squares sense.
fn binary_quadratic(v1: &Quartic, v2: &Quartic) -> [f64; 3] {
    let mut d_squared = [[0.0; 3]; 3];
    for [a, b, c, d] in RELATIONS.map(|relation| relation.map(usize::from)) {
        let row = [
            v1[a] * v1[b] - v1[c] * v1[d],
            v1[a] * v2[b] + v2[a] * v1[b] - v1[c] * v2[d] - v2[c] * v1[d],
            v2[a] * v2[b] - v2[c] * v2[d],
        ];
        for i in 0..3 {
            for j in 0..3 {
                d_squared[i][j] += row[i] * row[j];
            }
        }
    }
    // Powers of a matrix of nearly rank one: all columns become its image.
    let mut m = Matrix3::from(d_squared);
    for _ in 0..3 {
        m /= m.norm();
        m *= m;
    }
    let longest = m.column(m.diagonal().imax());
    [longest[0], longest[1], longest[2]]
}

/// The quaternion, of any scale, from the values of the quartic monomials: the row of the largest fourth power.
fn quaternion<T: ComplexField<RealField = f64> + Copy>(x: &[T; 35]) -> [T; 4] {
    const ROWS: [[usize; 4]; 4] = {
        let mut rows = [[0; 4]; 4];
        let mut k = 0;
        while k < 4 {
            let mut j = 0;
            while j < 4 {
                let mut monomial = [0; 4];
                monomial[k] = 3;
                monomial[j] += 1;
                rows[k][j] = position(&MONOMIALS, monomial);
                j += 1;
            }
            k += 1;
        }
        rows
    };
    let size = |k: usize| x[ROWS[k][k]].norm1();
    let k = (1..4).fold(0, |best, k| if size(k) > size(best) { k } else { best });
    ROWS[k].map(|place| x[place])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Scene, SceneOptions};

    const SEED: u64 = 110;

    fn veronese(q: &UnitQuaternion<f64>) -> Quartic {
        let q = [q.w, q.i, q.j, q.k];
        MONOMIALS.map(|e| (0..4).map(|k| q[k].powi(e[k].into())).product())
    }

    #[test]
    fn monomials_commute() {
        let q = UnitQuaternion::new_normalize(Quaternion::new(0.4, -0.7, 0.3, 0.9));
        let x = veronese(&q);
        for [a, b, c, d] in RELATIONS.map(|relation| relation.map(usize::from)) {
            assert!((x[a] * x[b] - x[c] * x[d]).abs() < 1e-16);
        }
        let found = rotation(CandidateKind::Exact, quaternion(&x)).unwrap().1;
        assert!(found.angle_to(&q) < 1e-7);
    }

    #[test]
    fn the_true_rotation_and_its_twisted_partner_span_the_directions() {
        for points in [6, 7, 20] {
            for index in 0..100 {
                let options = SceneOptions { points, ..SceneOptions::default() };
                let scene = Scene::generate(&options, SEED, index).unwrap();
                let rows = rows(&Alignment::new(&scene.matches), &scene.matches);
                let directions: [Quartic; 2] = shortest_directions(&mut rows.clone());
                let truth = Motion { q_21: scene.truth.q_21, direction: scene.truth.t_21.normalize() };
                for q in [truth.q_21, truth.twisted().q_21] {
                    let mut x = veronese(&q);
                    for direction in &directions {
                        let dot: f64 = x.iter().zip(direction).map(|(a, b)| a * b).sum();
                        for (a, b) in x.iter_mut().zip(direction) {
                            *a -= dot * b;
                        }
                    }
                    // 1e-15 over the 33rd singular value, which is above 1e-9 of the first.
                    assert!(x.iter().all(|a| a.abs() < 1e-6), "{points} points, scene {index}");
                    let found = two_solutions(rows);
                    let nearest = found.iter().flatten().map(|(_, p)| p.angle_to(&q)).fold(9.0, f64::min);
                    assert!(nearest < 1e-6, "{points} points, scene {index}: {nearest:e}");
                }
            }
        }
    }

    fn rows(alignment: &Alignment, matches: &[Correspondence]) -> [Quartic; 35] {
        let [leading @ .., _, _, _] = Gram::new(alignment, matches).principal_basis(matches).unwrap();
        minors(&leading.map(|row| bilinear(&alignment.constraint(&row))))
    }
}
