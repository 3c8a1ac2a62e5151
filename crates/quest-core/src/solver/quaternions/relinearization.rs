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
//! divided by: with that, all is homogeneous.
//! - *Five matches*. The minors of [`quaternion`](crate::quaternion) that the paper does not have leave no more directions `v_i`
//!   than there are solutions, 20, so that `W_0` is square. `D̄` is 465 × 210, and its null space comes from an elimination
//!   of 15 × 35 (`moments.rs`).
//! - *More*. Two solutions are left, a quaternion `q` and its twisted partner `q'`, and the first unknowns are
//!   products of these two instead of four factors `q`: `X = q q'ᵀ + q' qᵀ`, of trace zero, has nine, and a match is one linear
//!   equation `q'ᵀ M_i q = 0` in them. They are the entries of the essential matrix in another basis, whose constraints are
//!   kept from vanishing with the parallax (`parallax_frame.rs`). Six matches leave three directions, `X = Σ s_i V_i`; of more the three
//!   that they determine least. That products commute is that `X` has rank two (Fløystad, Kileel, Ottaviani, *The Chow form of
//!   the essential variety in computer vision*, Journal of Symbolic Computation 86, 2018): ten cubics (`cubics.rs`), linear
//!   in the ten products `y = (s_i s_j s_k)`. So `D̄` is 10 × 10, and has one null vector where the paper's has two, as `X`
//!   is both solutions. With noise it has none, and what it comes nearest to is often not the nearest to the truth. So only the
//!   four products of `s_1` and `s_2` alone are eliminated, in the least-squares sense of all ten cubics; the other
//!   six are `W_0`, with `s_3` for `s_0`, and the true solution one of six, complex ones included.
//!
//! All are refined over all matches. Noise hides the solution of points near a plane: where a homography explains the
//! matches its two motions are refined as well. Where nothing fits, the motion on which most matches agree is added
//! (`consensus.rs`).
//!
//! **Degenerate**: fewer than five independent constraints; an exact pure rotation. Of five matches with little parallax all
//! solutions run together and the eigenvalues lose their digits: at a parallax of 1e-7 next to none of the true poses is
//! lost, at 1e-8 one in twenty.
//!
//! **Solutions**: twenty rotations for five matches, counting complex ones, a pair of which is one candidate; for more two, and
//! other local minima that were found beside them; and the rotation-only candidate.

use nalgebra::{Complex, ComplexField, Quaternion, UnitQuaternion};

use crate::algebra::eigenvalues::Hessenberg;
use crate::algebra::elimination;
use crate::algebra::monomials::position;
use crate::algebra::number::Number;
use crate::solver::many_matches::consensus::AGREEMENT;
use crate::solver::many_matches::driver;
use crate::solver::published::homography::motions_of_plane;
use crate::solver::quaternions::moments::Pencil;
use crate::solver::quaternions::twenty_zeros::from_five;
use crate::solver::quest::cubics::{combine, ten_cubics};
use crate::solver::shared::essential::{decompose, real_part, twisted};
use crate::solver::shared::forms::{CUBIC, Cubic};
use crate::solver::shared::gram::Gram;
use crate::solver::shared::motion::Motion;
use crate::solver::shared::parallax_frame::Coordinates;
use crate::solver::shared::shortlist::Shortlist;
use crate::solver::{Kinds, PoseSolver};
use crate::{CandidateKind, Candidates, Correspondence};

/// The relinearisation of sections 4.2 and 7.2 of the paper; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Relinearization {
    /// Which candidates are returned.
    pub kinds: Kinds,
}

impl PoseSolver for Relinearization {
    const NAME: &'static str = "relinearization";
    const MIN_MATCHES: usize = driver::MIN_MATCHES;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        driver::solve(self.kinds, matches, out, from_five::<Pencil>, |gram, basis| {
            starts(gram, basis, matches)
        });
    }
}

/// The solutions of the six constraints that stand for all matches, and the motions of a plane.
fn starts(gram: &Gram, [.., v1, v2, v3]: &[Coordinates; 9], matches: &[Correspondence]) -> Shortlist {
    let mut starts = Shortlist::new();
    // The cubics have four variables, the first of them for five matches alone.
    let basis = [[0.0; 9], *v1, *v2, *v3];
    let p = gram.alignment.parallax;
    // The squares of the entries of the trace constraint, where those off the diagonal stand twice, and the antisymmetric part has
    // the factor p: without it, noise of the direction of the translation would count most.
    let (twice, antisymmetric) = (8.0, 2.0 * p * p);
    let weights = [twice, twice, 4.0, 4.0, twice, 4.0, antisymmetric, antisymmetric, antisymmetric, 1.0];
    if let Some(factors) = eliminated(&ten_cubics(&basis, p), &weights) {
        add_solutions(&factors, gram, &basis, &mut starts);
    }
    for motion in motions_of_plane(matches, AGREEMENT).into_iter().flatten() {
        starts.push(CandidateKind::Exact, motion);
    }
    starts
}

/// Where the ten products of `s_1, s_2, s_3` stand in a cubic: first the four without `s_3`, by falling powers of `s_1`, then
/// `s_3` times `s_1², s_1 s_2, s_2², s_1 s_3, s_2 s_3, s_3²`.
const PRODUCTS: [usize; 10] = {
    const EXPONENTS: [[u8; 4]; 10] = [
        [0, 3, 0, 0],
        [0, 2, 1, 0],
        [0, 1, 2, 0],
        [0, 0, 3, 0],
        [0, 2, 0, 1],
        [0, 1, 1, 1],
        [0, 0, 2, 1],
        [0, 1, 0, 2],
        [0, 0, 1, 2],
        [0, 0, 0, 3],
    ];
    let mut places = [0; 10];
    let mut k = 0;
    while k < 10 {
        places[k] = position(&CUBIC, EXPONENTS[k]);
        k += 1;
    }
    places
};

/// The four products without `s_3` by the six with it, in the least-squares sense of the cubics with weights; `None` where
/// they do not determine these.
fn eliminated(cubics: &[Cubic; 10], weights: &[f64; 10]) -> Option<[[f64; 6]; 4]> {
    let mut normal = [[0.0; 10]; 4];
    for (cubic, weight) in cubics.iter().zip(weights) {
        let row = PRODUCTS.map(|place| cubic[place]);
        for (sums, factor) in normal.iter_mut().zip(row) {
            for (sum, x) in sums.iter_mut().zip(row) {
                *sum += weight * factor * x;
            }
        }
    }
    let pivot = elimination::reduce(&mut normal, 0);
    (pivot > 0.0).then(|| normal.map(|row| std::array::from_fn(|k| -row[4 + k])))
}

/// `W_l W_0⁻¹`: the six products with `s_3`, multiplied by `s_l / s_3` for a generic `s_l` of `s_1` and `s_2`.
fn action([a, b, c, d]: &[[f64; 6]; 4]) -> [[f64; 6]; 6] {
    const FORM: [f64; 2] = [0.6, 0.8];
    let product = |k: usize| std::array::from_fn(|j| if j == k { 1.0 } else { 0.0 });
    let by_first = [*a, *b, *c, product(0), product(1), product(3)];
    let by_second = [*b, *c, *d, product(1), product(2), product(4)];
    std::array::from_fn(|i| std::array::from_fn(|j| FORM[0] * by_first[i][j] + FORM[1] * by_second[i][j]))
}

/// The motions of the eigenvectors: of a real one the two that are twisted partners, of a complex pair the real parts of both
/// quaternions.
fn add_solutions(factors: &[[f64; 6]; 4], gram: &Gram, basis: &[Coordinates; 4], starts: &mut Shortlist) {
    let Some(action) = Hessenberg::new(action(factors)) else { return };
    let Some(values) = action.eigenvalues() else { return };
    let q0_21 = gram.alignment.q0_21;
    for value in values {
        if value.im == 0.0 {
            let y = action.eigenvector(value.re);
            let Some((q, t)) = y.and_then(|y| quaternion_and_direction(&y, gram, basis)) else { continue };
            starts.push_pair(CandidateKind::Exact, Motion { q_21: rotation(q) * q0_21, direction: t.into() });
        } else if value.im > 0.0 {
            let y: Option<[Complex<f64>; 6]> = action.eigenvector(value);
            let Some((q, t)) = y.and_then(|y| quaternion_and_direction(&y, gram, basis)) else { continue };
            for q in [q, twisted(&q, &t)] {
                let q_21 = rotation(real_part(q)) * q0_21;
                starts.push(CandidateKind::FromComplex, Motion { q_21, direction: gram.direction(&q_21) });
            }
        }
    }
}

/// One of the two quaternions, after the alignment, and the translation, by the products with `s_3`.
fn quaternion_and_direction<T: Number + ComplexField>(
    [.., s1, s2, s3]: &[T; 6],
    gram: &Gram,
    basis: &[Coordinates; 4],
) -> Option<([T; 4], [T; 3])> {
    decompose(&gram.alignment.essential(&combine(basis, &[<T as Number>::real(0.0), *s1, *s2, *s3])))
}

fn rotation([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quaternion::bilinear;
    use crate::simulate::{Motion as SceneMotion, Scene, SceneOptions};
    use nalgebra::{Matrix4, Vector3, Vector4};

    const SEED: u64 = 110;

    #[test]
    fn products_with_the_twisted_partner_are_the_essential_matrix() {
        let motion = Motion {
            q_21: UnitQuaternion::new(Vector3::new(0.3, -0.2, 0.9)),
            direction: Vector3::new(0.6, 0.0, -0.8),
        };
        let wxyz = |m: &Motion| Vector4::new(m.q_21.w, m.q_21.i, m.q_21.j, m.q_21.k);
        let (q, twin) = (wxyz(&motion), wxyz(&motion.twisted()));
        let x: Matrix4<f64> = q * twin.transpose() + twin * q.transpose();
        assert!(x.trace().abs() < 1e-15 && x.determinant().abs() < 1e-15);
        for k in 0..9 {
            let (a, b) = (Vector3::ith(k % 3, 1.0), Vector3::ith(k / 3, 1.0));
            let expected = b.dot(&(motion.essential() * a));
            assert!((bilinear(&(b * a.transpose())).dot(&x) + 2.0 * expected).abs() < 1e-14);
        }
    }

    #[test]
    fn products_of_coefficients_are_multiplied() {
        // Cubics that vanish at a point and nowhere else.
        let s = [0.3, -0.8, 0.5];
        let cubic: Cubic = CUBIC
            .map(|e| if e[0] > 0 { 0.0 } else { (0..3).map(|k| f64::powi(s[k], e[k + 1].into())).product() });
        let square: f64 = cubic.iter().map(|x| x * x).sum();
        let cubics: [Cubic; 10] = std::array::from_fn(|i| {
            let row: Cubic = std::array::from_fn(|j| (((i + 2) * (j + 3)) as f64 * 1.3).sin());
            let along = row.iter().zip(&cubic).map(|(x, y)| x * y).sum::<f64>() / square;
            std::array::from_fn(|j| row[j] - along * cubic[j])
        });
        let y: [f64; 6] = std::array::from_fn(|k| cubic[PRODUCTS[4 + k]]);
        let value = (0.6 * s[0] + 0.8 * s[1]) / s[2];
        for (row, y_i) in action(&eliminated(&cubics, &[1.0; 10]).unwrap()).iter().zip(y) {
            let image: f64 = row.iter().zip(y).map(|(a, y)| a * y).sum();
            assert!((image - value * y_i).abs() < 1e-12);
        }
    }

    #[test]
    fn the_true_motion_is_among_the_starts() {
        let general = SceneOptions::default();
        let kinds = [general, SceneOptions { motion: SceneMotion::Parallax(1e-3), ..general }];
        for points in [6, 7, 20] {
            for options in kinds {
                for index in 0..100 {
                    let scene = Scene::generate(&SceneOptions { points, ..options }, SEED, index).unwrap();
                    let mut gram = Gram::aligned(&scene.matches);
                    let basis = gram.principal_basis(&scene.matches).unwrap();
                    let starts = starts(&gram, &basis, &[]);
                    let truth = Motion { q_21: scene.truth.q_21, direction: scene.truth.t_21.normalize() };
                    let is_true = |m: &Motion| m.is_close(&truth, 1e-5) || m.twisted().is_close(&truth, 1e-5);
                    assert!(starts.iter().any(|item| is_true(&item.motion)), "{options:?}, scene {index}");
                }
            }
        }
    }
}
