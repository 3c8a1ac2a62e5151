//! Two motions side by side, from two essential matrices to two solutions of the same five matches.
//!
//! Each step of one motion waits for the step before; those of two do not wait for each other. Where one takes a branch, two
//! compute both sides and select.

use nalgebra::{UnitQuaternion, Vector3};

use crate::Correspondence;
use crate::algebra::vectors::two::{
    Two, TwoLanes, TwoQuaternions, TwoVectors, both, cross, dot, product, quaternions, rotation, scaled,
    side_by_side, unit_quaternions,
};
use crate::solver::shared::double_residual::SplitEssential;
use crate::solver::shared::essential::decomposed;
use crate::solver::shared::motion::Motion;
use crate::solver::shared::parallax_frame::Alignment;
use crate::structure::translation_directions;

/// Newton's iteration takes one or two steps; a double root takes them all.
pub(crate) const MAX_NEWTON_STEPS: usize = 10;

/// The squares of five constraints whose unit bearings are rounded, with a margin.
const ROUNDING: f64 = 1e-30;

/// When Newton's iteration has converged.
pub(crate) struct Convergence {
    /// A step whose square is below this.
    pub(crate) limit: f64,
    /// What the square of the first turn is multiplied by: all solutions are within the parallax in rotation, so that it has to be small
    /// beside it.
    pub(crate) per_parallax: f64,
    /// Constraints whose squares sum up to less, where the steps come to no end.
    pub(crate) rounding: f64,
}

impl Convergence {
    pub(crate) fn new(alignment: &Alignment) -> Self {
        Self {
            limit: alignment.direction_resolution().max(1e-7).powi(2),
            per_parallax: alignment.parallax.powi(-2).max(1.0),
            rounding: ROUNDING,
        }
    }
}

/// Two relative poses without the length of their translations.
#[derive(Clone, Copy)]
pub(crate) struct TwoMotions {
    pub(crate) q_21: TwoQuaternions,
    pub(crate) direction: TwoVectors,
}

impl TwoMotions {
    /// Two motions side by side.
    #[inline]
    pub(crate) fn new(first: &Motion, second: &Motion) -> Self {
        Self {
            q_21: quaternions(&first.q_21, &second.q_21),
            direction: side_by_side(&first.direction, Some(&second.direction)),
        }
    }

    /// One of the two motions of each essential matrix of any scale, row by row; not finite for a matrix that is zero or not
    /// finite.
    #[inline]
    pub(crate) fn of_essential(e: &[TwoVectors; 3]) -> Self {
        let (q_21, direction) = decomposed(e);
        Self { q_21: normalized(&q_21), direction }
    }

    /// Unit quaternions, each with the translation that fits it best.
    #[inline]
    pub(crate) fn of_rotations(q_21: &TwoQuaternions, matches: &[Correspondence]) -> Self {
        Self { q_21: *q_21, direction: translation_directions(&rotation(q_21), matches) }
    }

    /// After another rotation `q0_21`: `R ← R R0`.
    #[inline]
    pub(crate) fn after(&self, q0_21: &UnitQuaternion<f64>) -> Self {
        Self { q_21: after(&self.q_21, q0_21), ..*self }
    }

    /// The motions; `None` for one that is not finite.
    #[inline]
    pub(crate) fn apart(&self) -> [Option<Motion>; 2] {
        let ([first, second], [tx, ty, tz]) = (apart(&self.q_21), self.direction.map(Two::to_array));
        let motion = |k: usize, q_21: UnitQuaternion<f64>| {
            let direction = Vector3::new(tx[k], ty[k], tz[k]);
            direction.sum().is_finite().then_some(Motion { q_21, direction })
        };
        [first.and_then(|q| motion(0, q)), second.and_then(|q| motion(1, q))]
    }

    /// The solutions of five constraints that Newton's iteration leads to; `None` where it does not converge.
    ///
    /// Not in the epipolar frame: its rounding would be that of the constraints, and with a parallax of 1e-8 shows. What is left of
    /// the constraints has twice the digits (`double_residual.rs`): in plain `f64` its rounding is twice that of the bearings.
    pub(crate) fn solutions(
        &self,
        alignment: &Alignment,
        matches: &[Correspondence; 5],
    ) -> [Option<Motion>; 2] {
        let Convergence { limit, per_parallax, rounding } = Convergence::new(alignment);
        let (mut motions, mut is_over, mut has_converged) = (*self, Two::ZERO, Two::ZERO);
        let mut rest = Two::splat(f64::INFINITY);
        for count in 0..MAX_NEWTON_STEPS {
            let Step { next, turn, moved, residual } = motions.stepped(matches);
            // Not a number is no step either.
            let is_step = (turn + moved).simd_le(Two::splat(1.0));
            motions.q_21 = select(is_step & !is_over, &next.q_21, &motions.q_21);
            motions.direction = select(is_step & !is_over, &next.direction, &motions.direction);
            // Quadratic: the error left is the square of the step.
            let size = if count == 0 { turn * per_parallax + moved } else { turn + moved };
            has_converged |= size.simd_lt(Two::splat(limit)) & !is_over;
            rest = residual;
            is_over |= has_converged | !is_step;
            if is_over.all() {
                break;
            }
        }
        // Near another solution the steps of rounding are longer, and come to no end.
        has_converged |= rest.simd_lt(Two::splat(rounding)) & !is_over;
        let ([first, second], converged) = (motions.apart(), has_converged.to_bitmask());
        [first.filter(|_| converged & 1 != 0), second.filter(|_| converged & 2 != 0)]
    }

    #[inline]
    fn stepped(&self, matches: &[Correspondence; 5]) -> Step {
        let t = &self.direction;
        let [e1, e2] = tangent_basis(t);
        let r_21 = rotation(&self.q_21);
        let essential = SplitEssential::new(TwoLanes, &essential(t, &r_21));
        let equations = matches.each_ref().map(|m| {
            let (a, b) = (both(m.bearing1()), both(m.bearing2()));
            let c = r_21.map(|row| dot(&row, &a));
            let (n, bc, tc) = (cross(&b, &c), dot(&b, &c), dot(t, &c));
            let [g1, g2, g3] = std::array::from_fn(|k| t[k] * bc - b[k] * tc);
            [g1, g2, g3, dot(&n, &e1), dot(&n, &e2), essential.form(TwoLanes, &b, &a)]
        });
        let residual = equations.iter().fold(Two::ZERO, |sum, row| sum + row[5] * row[5]);
        let [w1, w2, w3, move1, move2] = solve(equations);
        let (turned, moved) = (w1 * w1 + w2 * w2 + w3 * w3, move1 * move1 + move2 * move2);
        // To first order a rotation by ω; any step of the iteration may differ from it to second order.
        let turn = [Two::splat(1.0), w1 * 0.5, w2 * 0.5, w3 * 0.5];
        let direction: TwoVectors = std::array::from_fn(|k| t[k] + (e1[k] * move1 + e2[k] * move2));
        let next = Self { q_21: normalized(&product(&turn, &self.q_21)), direction: normalized(&direction) };
        Step { next, turn: turned, moved, residual }
    }
}

/// `[t]× R`.
#[inline]
fn essential(t: &TwoVectors, r_21: &[TwoVectors; 3]) -> [TwoVectors; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        std::array::from_fn(|l| t[j] * r_21[k][l] - t[k] * r_21[j][l])
    })
}

/// `q_21 ⊗ q0_21`.
#[inline]
pub(crate) fn after(q_21: &TwoQuaternions, q0_21: &UnitQuaternion<f64>) -> TwoQuaternions {
    product(q_21, &quaternions(q0_21, q0_21))
}

/// Unit quaternions one by one; `None` for one that is not finite.
#[inline]
pub(crate) fn apart(q_21: &TwoQuaternions) -> [Option<UnitQuaternion<f64>>; 2] {
    unit_quaternions(q_21).map(|q_21| q_21.coords.sum().is_finite().then_some(q_21))
}

/// A step of Newton's iteration.
struct Step {
    /// Where it leads.
    next: TwoMotions,
    /// Its squared length (radians), in rotation and in the direction of the translation.
    turn: Two,
    moved: Two,
    /// The sum of the squared constraints before it.
    residual: Two,
}

/// `x` where the mask is set, `y` elsewhere.
#[inline]
fn select<const N: usize>(mask: Two, x: &[Two; N], y: &[Two; N]) -> [Two; N] {
    std::array::from_fn(|k| mask.select(x[k], y[k]))
}

#[inline]
pub(crate) fn normalized<const N: usize>(x: &[Two; N]) -> [Two; N] {
    let square = x.iter().fold(Two::ZERO, |sum, x| sum + *x * *x);
    scaled(x, Two::splat(1.0) / square.sqrt())
}

/// Two unit vectors that complete each `t` to a right-handed frame (Duff et al., JCGT 2017).
#[inline]
fn tangent_basis(t: &TwoVectors) -> [TwoVectors; 2] {
    let [x, y, z] = *t;
    let one = Two::splat(1.0);
    let sign = z.simd_lt(Two::ZERO).select(-one, one);
    let a = -one / (sign + z);
    let b = x * y * a;
    [[one + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]]
}

/// The solutions of two times five equations, the right-hand sides last, by elimination with partial pivoting; not finite
/// where they are singular.
#[inline]
fn solve(mut m: [[Two; 6]; 5]) -> [Two; 5] {
    // The reciprocals of the pivots, kept for the way back.
    let mut x = [
        eliminate::<0>(&mut m),
        eliminate::<1>(&mut m),
        eliminate::<2>(&mut m),
        eliminate::<3>(&mut m),
        eliminate::<4>(&mut m),
    ];
    for k in (0..5).rev() {
        let mut sum = m[k][5];
        for j in k + 1..5 {
            sum -= m[k][j] * x[j];
        }
        x[k] *= sum;
    }
    x
}

/// Eliminates unknown `K` from the equations behind equation `K`; returns the reciprocal of the pivot.
///
/// A constant, so that the compiler knows the length of every loop.
#[inline]
fn eliminate<const K: usize>(m: &mut [[Two; 6]; 5]) -> Two {
    for i in K + 1..5 {
        let is_larger = m[i][K].abs().simd_gt(m[K][K].abs());
        for j in K..6 {
            let exchanged = (m[i][j] ^ m[K][j]) & is_larger;
            m[i][j] ^= exchanged;
            m[K][j] ^= exchanged;
        }
    }
    let inverse = Two::splat(1.0) / m[K][K];
    for i in K + 1..5 {
        let factor = m[i][K] * inverse;
        for j in K + 1..6 {
            m[i][j] -= factor * m[K][j];
        }
    }
    inverse
}

/// The solution of five constraints that Newton's iteration leads to from one motion; `None` where it does not converge.
pub(crate) fn solution(
    start: &Motion,
    alignment: &Alignment,
    matches: &[Correspondence; 5],
) -> Option<Motion> {
    let [solution, _] = TwoMotions::new(start, start).solutions(alignment, matches);
    solution
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::epipolar_frame;
    use nalgebra::{SMatrix, SVector};

    #[test]
    fn frames_and_rotations_are_those_of_one() {
        let motion = |x: f64, y: f64, z: f64| Motion {
            q_21: UnitQuaternion::new(Vector3::new(x, 2.0 * y, -z)),
            direction: Vector3::new(x, y, z).normalize(),
        };
        let motions = [motion(0.3, -0.2, 0.5), motion(-2.0, 1.0, -0.1)];
        let essential = motions.map(|m| m.essential());
        let e =
            std::array::from_fn(|i| std::array::from_fn(|j| Two::new(essential.map(|e| 3.0 * e[(i, j)]))));
        let turn = UnitQuaternion::new(Vector3::new(0.1, 0.7, -0.4));
        let both = TwoMotions::of_essential(&e);
        let after = both.after(&turn).apart();
        let bases = tangent_basis(&both.direction);
        for (k, (m, turned)) in motions.iter().zip(after).enumerate() {
            let turned = turned.unwrap();
            let found = Motion { q_21: turned.q_21 * turn.inverse(), ..turned };
            assert!(found.is_close(m, 1e-7) || found.twisted().is_close(m, 1e-7));
            assert!((turned.q_21.norm() - 1.0).abs() < 1e-15);
            let basis = epipolar_frame::tangent_basis(&turned.direction);
            for (one, two) in basis.iter().zip(bases) {
                assert!((0..3).all(|i| (one[i] - two[i].to_array()[k]).abs() < 1e-15));
            }
        }
        assert!(TwoMotions::of_essential(&[[Two::ZERO; 3]; 3]).apart().iter().all(Option::is_none));
    }

    #[test]
    fn solve_agrees_with_nalgebra_and_shows_singular() {
        let entry = |lane: usize, i: usize, j: usize| ((5 * i + 7 * j + 3 * lane) as f64 * 1.3 + 0.2).sin();
        let two: [[Two; 6]; 5] =
            std::array::from_fn(|i| std::array::from_fn(|j| Two::new([0, 1].map(|k| entry(k, i, j)))));
        for lane in 0..2 {
            let a = SMatrix::<f64, 5, 5>::from_fn(|i, j| entry(lane, i, j) + f64::from(u8::from(i == j)));
            let mut shifted = two;
            for (i, row) in shifted.iter_mut().enumerate() {
                row[i] += Two::splat(1.0);
            }
            let expected = a.lu().solve(&SVector::<f64, 5>::from_fn(|i, _| entry(lane, i, 5))).unwrap();
            let x = solve(shifted);
            assert!((0..5).all(|k| (x[k].to_array()[lane] - expected[k]).abs() < 1e-12));
        }
        assert!(!solve([[Two::splat(1.0); 6]; 5])[0].to_array()[0].is_finite());
    }
}
