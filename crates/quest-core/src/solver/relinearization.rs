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
//! - *More*: the six combinations of all constraints that the matches determine best have 35 minors (`minor_values.rs`). The paper
//!   has two solutions here. With noise the minors leave no direction quite open, and the four shortest hold the solutions
//!   better than the two shortest: `D̄` has ten columns, the squares of which follow from the four directions without its 465
//!   rows; its four shortest directions in place of null vectors make two
//!   solutions and two that mean nothing, and all are refined over all matches. Points of a plane leave more directions than
//!   that: where a homography explains the matches its two motions are refined as well. Where nothing fits, the motion on
//!   which most matches agree is added (`consensus.rs`).
//!
//! **Degenerate**: fewer than five independent constraints; an exact pure rotation. With little parallax all solutions run
//! together and the eigenvalues lose their digits: at a parallax of 1e-7 next to none of the true poses is lost, at 1e-8 one
//! in twenty.
//!
//! **Solutions**: twenty rotations for five matches, counting complex ones, a pair of which is one candidate; for more two, and
//! other local minima that were found beside them; and the rotation-only candidate.

use nalgebra::{ComplexField, Matrix4, Quaternion, SMatrix, UnitQuaternion};

use super::aligned::Coordinates;
use super::consensus::AGREEMENT;
use super::essential::real_part;
use super::gram::Gram;
use super::homography::motions_of_plane;
use super::minor_values::{minors_at_points, monomials};
use super::moments::Pencil;
use super::motion::Motion;
use super::shortlist::Shortlist;
use super::twenty::from_five;
use super::{Kinds, PoseSolver, refining};
use crate::algebra::eigenvalues::Hessenberg;
use crate::algebra::elimination;
use crate::algebra::monomials::{homogeneous, position};
use crate::algebra::singular::shortest_directions;
use crate::quaternion::bilinear;
use crate::quaternion::monomials::{MONOMIALS, Quartic};
use crate::{CandidateKind, Candidates, Correspondence};

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
        refining::solve(self.kinds, matches, out, from_five::<Pencil>, |gram, basis| {
            starts(gram, basis, matches)
        });
    }
}

/// The solutions of the six constraints that stand for all matches, and the motions of a plane.
fn starts(gram: &Gram, basis: &[Coordinates; 9], matches: &[Correspondence]) -> Shortlist {
    let mut starts = Shortlist::new();
    for (kind, q_21) in solutions(rows(gram, basis)).into_iter().flatten() {
        starts.push(kind, Motion { q_21, direction: gram.direction(&q_21) });
    }
    for motion in motions_of_plane(matches, AGREEMENT).into_iter().flatten() {
        starts.push(CandidateKind::Exact, motion);
    }
    starts
}

/// The minors of the six constraints, at the points.
fn rows(gram: &Gram, [n1, n2, n3, n4, n5, n6, ..]: &[Coordinates; 9]) -> [[f64; 35]; 35] {
    minors_at_points(&[n1, n2, n3, n4, n5, n6].map(|row| bilinear(&gram.alignment.constraint(row))))
}

/// `FACTORED[l][m]`: the place in `x` of `q_l` times the cubic monomial `m`.
const FACTORED: [[usize; 20]; 4] = {
    const CUBIC: [[u8; 4]; 20] = homogeneous(3);
    let mut table = [[0; 20]; 4];
    let mut l = 0;
    while l < 4 {
        let mut m = 0;
        while m < 20 {
            let mut product = CUBIC[m];
            product[l] += 1;
            table[l][m] = position(&MONOMIALS, product);
            m += 1;
        }
        l += 1;
    }
    table
};

/// `(q·q)²` as a form on `x`.
const NORM: Quartic = {
    let mut form = [0.0; 35];
    let mut k = 0;
    while k < 35 {
        let [a, b, c, d] = MONOMIALS[k];
        if a % 2 == 0 && b % 2 == 0 && c % 2 == 0 && d % 2 == 0 {
            form[k] = if a == 4 || b == 4 || c == 4 || d == 4 { 1.0 } else { 2.0 };
        }
        k += 1;
    }
    form
};

/// A generic `s_l`.
const FORM: [f64; 4] = [0.53, -0.86, 0.71, 0.37];

/// `PAIR[i][j]`: the place of `s_i s_j` in `y`.
const PAIR: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];

/// The rotations at which all minors, rows of values at the points, vanish, and as many others where they do not.
fn solutions(mut rows: [[f64; 35]; 35]) -> [Option<(CandidateKind, UnitQuaternion<f64>)>; 4] {
    let v = shortest_directions::<35, 35, 4>(&mut rows).map(|weights| monomials(&weights));
    let w: [[f64; 10]; 4] = shortest_directions(&mut relinearized(&v));
    let norm = v.map(|v| v.iter().zip(NORM).map(|(x, c)| x * c).sum::<f64>());
    // Σ_j f_j s_j s_i by the null vectors.
    let row = |f: &[f64; 4], i: usize, k: usize| (0..4).map(|j| f[j] * w[k][PAIR[i][j]]).sum::<f64>();
    let w0: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|k| row(&norm, i, k)));
    let mut pencil: [[f64; 8]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|k| if k < 4 { w0[i][k] } else { row(&FORM, i, k - 4) }));
    if elimination::reduce(&mut pencil, 0) == 0.0 {
        return [None; 4];
    }
    let action = Hessenberg::<4>::new(pencil.map(|row| std::array::from_fn(|k| row[4 + k])));
    let Some((action, values)) = action.and_then(|a| a.eigenvalues().map(|values| (a, values))) else {
        return [None; 4];
    };
    values.map(|value| {
        if value.im == 0.0 {
            rotation(CandidateKind::Exact, quaternion(&x(&v, &w0, &action.eigenvector(value.re)?)))
        } else if value.im > 0.0 {
            let q = quaternion(&x(&v, &w0, &action.eigenvector(value)?));
            rotation(CandidateKind::FromComplex, real_part(q))
        } else {
            None
        }
    })
}

/// `x = Σ s_i v_i` with `s = W_0 r`.
fn x<T: ComplexField<RealField = f64> + Copy>(v: &[Quartic; 4], w0: &[[f64; 4]; 4], r: &[T; 4]) -> [T; 35] {
    let mut x = [T::zero(); 35];
    for (v, row) in v.iter().zip(w0) {
        let mut s = T::zero();
        for (r, w) in r.iter().zip(row) {
            s += r.scale(*w);
        }
        for (x, v) in x.iter_mut().zip(v) {
            *x += s.scale(*v);
        }
    }
    x
}

fn rotation(kind: CandidateKind, [w, x, y, z]: [f64; 4]) -> Option<(CandidateKind, UnitQuaternion<f64>)> {
    let q = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    q.coords.iter().all(ComplexField::is_finite).then_some((kind, q))
}

/// `2 D̄ᵀ D̄` for four directions.
///
/// That monomials commute, `(q_l f)(q_k g) = (q_k f)(q_l g)` for cubic monomials `f` and `g`, are the 2 × 2 minors of the matrix
/// `x(q_l f)`, 4 × 20. With `A_i` that matrix of `v_i`, the products of two columns of `D̄`, summed over all minors, are
/// `(A_i · A_m)(A_j · A_n) − tr(A_i A_mᵀ A_j A_nᵀ)` and the same with `m` and `n` exchanged.
fn relinearized(v: &[Quartic; 4]) -> [[f64; 10]; 10] {
    let a = v.map(|v| SMatrix::<f64, 4, 20>::from_fn(|l, f| v[FACTORED[l][f]]));
    let g: [[Matrix4<f64>; 4]; 4] = a.map(|a_i| a.map(|a_m| a_i * a_m.transpose()));
    let trace = g.map(|row| row.map(|g| g.trace()));
    // g[n][j] is the transpose of g[j][n]: the trace of a product is a sum over entries.
    let product = |[i, m]: [usize; 2], [j, n]: [usize; 2]| trace[i][m] * trace[j][n] - g[i][m].dot(&g[n][j]);
    let mut squares = [[0.0; 10]; 10];
    for (i, row) in PAIR.iter().enumerate() {
        for (j, &left) in row.iter().enumerate() {
            for (m, row) in PAIR.iter().enumerate() {
                for (n, &right) in row.iter().enumerate() {
                    squares[left][right] += product([i, m], [j, n]);
                }
            }
        }
    }
    squares
}

/// The quaternion, of any scale, from the values of the quartic monomials: the row of the largest fourth power.
fn quaternion<T: ComplexField<RealField = f64> + Copy>(x: &[T; 35]) -> [T; 4] {
    const RATIOS: [[usize; 4]; 4] = {
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
    let size = |k: usize| x[RATIOS[k][k]].norm1();
    let k = (1..4).fold(0, |best, k| if size(k) > size(best) { k } else { best });
    RATIOS[k].map(|place| x[place])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Scene, SceneOptions};
    use nalgebra::SVector;

    const SEED: u64 = 110;

    fn veronese(q: &UnitQuaternion<f64>) -> Quartic {
        let q = [q.w, q.i, q.j, q.k];
        MONOMIALS.map(|e| (0..4).map(|k| q[k].powi(e[k].into())).product())
    }

    #[test]
    fn monomials_commute() {
        let q = UnitQuaternion::new_normalize(Quaternion::new(0.4, -0.7, 0.3, 0.9));
        let x = veronese(&q);
        assert!(relinearized(&[x; 4]).as_flattened().iter().all(|product| product.abs() < 1e-14));
        let found = rotation(CandidateKind::Exact, quaternion(&x)).unwrap().1;
        assert!(found.angle_to(&q) < 1e-7);
    }

    #[test]
    fn the_true_rotation_and_its_twisted_partner_span_the_directions() {
        for points in [6, 7, 20] {
            for index in 0..100 {
                let options = SceneOptions { points, ..SceneOptions::default() };
                let scene = Scene::generate(&options, SEED, index).unwrap();
                let mut gram = Gram::aligned(&scene.matches);
                let basis = gram.principal_basis(&scene.matches).unwrap();
                let rows = rows(&gram, &basis);
                let directions = shortest_directions::<35, 35, 2>(&mut rows.clone()).map(|w| monomials(&w));
                let directions = SMatrix::<f64, 35, 2>::from_fn(|i, j| directions[j][i]);
                let inverse = directions.pseudo_inverse(0.0).unwrap();
                let truth = Motion { q_21: scene.truth.q_21, direction: scene.truth.t_21.normalize() };
                for q in [truth.q_21, truth.twisted().q_21] {
                    let x = SVector::from(veronese(&q));
                    // 1e-15 over the 33rd singular value, which is above 1e-9 of the first.
                    let outside = x - directions * (inverse * x);
                    assert!(outside.amax() < 1e-6, "{points} points, scene {index}");
                    let found = solutions(rows);
                    let nearest = found.iter().flatten().map(|(_, p)| p.angle_to(&q)).fold(9.0, f64::min);
                    assert!(nearest < 1e-6, "{points} points, scene {index}: {nearest:e}");
                }
            }
        }
    }
}
