//! A rotation and a direction of translation, refined on their manifold: five parameters.
//!
//! The residual of a match is the epipolar constraint `r = t · (b × c)`, `c = R a`, with unit `t`. The parameters are a
//! rotation by a small vector `ω` after `R`, and a move of `t` by `δ1, δ2` in its tangent plane. In the
//! [`EpipolarFrame`], where `t = (0, 0, 1)`,
//!
//! ```text
//! r = b1 c2 − b2 c1
//! dr = ω · (c × (t × b)) + δ1 (b × c)1 + δ2 (b × c)2,   c × (t × b) = t (b · c) − b (t · c)
//! ```

use nalgebra::{Matrix5, Quaternion, UnitQuaternion, Vector3, Vector5};

use crate::Correspondence;
use crate::algebra::descent::{Descent, Outcome, Schedule, Singular, descend};
use crate::algebra::vectors::two::{Two, TwoVectors, side_by_side};
use crate::epipolar_frame::EpipolarFrame;
use crate::pose::{RIGHT_ANGLE, sampson_square};

/// When a descent is at its end: its last step needs no check.
pub(crate) struct Until {
    /// A step this short (radians).
    pub(crate) step: f64,
    /// A step with a square this small in units of the variance that the noise leaves in its direction.
    pub(crate) within_noise: f64,
    /// Steps at most.
    pub(crate) steps: usize,
}

/// At a local minimum, to rounding or well within what the noise leaves undetermined.
pub(crate) const FINE: Until = Until { step: 1e-13, within_noise: 1e-3, steps: 15 };

/// Near enough to a local minimum to tell it from others.
pub(crate) const COARSE: Until = Until { step: 1e-3, within_noise: 1e-2, steps: 12 };

/// A relative pose without the length of its translation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    /// The rotation.
    pub(crate) q_21: UnitQuaternion<f64>,
    /// The direction of the translation, a unit vector of either sign.
    pub(crate) direction: Vector3<f64>,
}

impl Motion {
    /// The other rotation with the same essential matrix: turned by 180° about the translation, `q' = t ⊗ q`.
    pub(crate) fn twisted(&self) -> Self {
        let q = Quaternion::from_imag(self.direction) * self.q_21.into_inner();
        Self { q_21: UnitQuaternion::new_normalize(q), direction: self.direction }
    }

    /// Whether two translations lie along the same line, to `tolerance` in radians.
    #[inline]
    pub(crate) fn has_direction_of(&self, other: &Self, tolerance: f64) -> bool {
        is_near(self.direction.dot(&other.direction), tolerance)
    }

    /// Whether two rotations are the same, to `tolerance` in radians. That alone does not make two motions one: with
    /// little parallax all solutions have nearly the same rotation.
    #[inline]
    pub(crate) fn has_rotation_of(&self, other: &Self, tolerance: f64) -> bool {
        is_near(self.q_21.coords.dot(&other.q_21.coords), 0.5 * tolerance)
    }

    /// Whether two motions are the same but for the sign of the translation, to `tolerance` in radians.
    #[cfg(test)]
    pub(crate) fn is_close(&self, other: &Self, tolerance: f64) -> bool {
        self.has_direction_of(other, tolerance) && self.has_rotation_of(other, tolerance)
    }

    /// The essential matrix `[t]× R`.
    pub(crate) fn essential(&self) -> nalgebra::Matrix3<f64> {
        self.direction.cross_matrix() * self.q_21.to_rotation_matrix().into_inner()
    }

    /// The derivatives of the essential matrix by a small rotation and by steps along a basis of the tangent plane.
    pub(crate) fn essential_derivatives(&self, tangent: &[Vector3<f64>; 2]) -> [nalgebra::Matrix3<f64>; 5] {
        let r_21 = self.q_21.to_rotation_matrix().into_inner();
        let cross = self.direction.cross_matrix();
        std::array::from_fn(|k| match k {
            0..3 => cross * Vector3::ith(k, 1.0).cross_matrix() * r_21,
            _ => tangent[k - 3].cross_matrix() * r_21,
        })
    }

    /// The frame of its essential matrix.
    pub(crate) fn frame(&self) -> EpipolarFrame {
        EpipolarFrame::new(&self.q_21.to_rotation_matrix().into_inner(), &self.direction)
    }

    /// After a small step in the parameters of [`Self::essential_derivatives`].
    pub(crate) fn stepped(&self, tangent: &[Vector3<f64>; 2], step: &[f64; 5]) -> Self {
        let turn = Vector3::new(step[0], step[1], step[2]);
        self.turned_and_moved(&turn, &(tangent[0] * step[3] + tangent[1] * step[4]))
    }

    /// After a small step in the five parameters of the frame.
    pub(crate) fn moved(&self, frame: &EpipolarFrame, step: &[f64; 5]) -> Self {
        let [turn1, turn2, turn3, move1, move2] = *step;
        self.turned_and_moved(
            &frame.to_2(&Vector3::new(turn1, turn2, turn3)),
            &frame.to_2(&Vector3::new(move1, move2, 0.0)),
        )
    }

    /// After a small rotation, and with a small vector added to the translation.
    fn turned_and_moved(&self, turn: &Vector3<f64>, by: &Vector3<f64>) -> Self {
        // To first order a rotation by ω; any step of the iteration may differ from it to second order.
        let q = Quaternion::from_parts(1.0, turn * 0.5) * self.q_21.into_inner();
        Self { q_21: UnitQuaternion::new_normalize(q), direction: (self.direction + by).normalize() }
    }

    /// By how much the motion misses the constraints of five matches: the largest `|t · (b × c)|`.
    pub(crate) fn largest_sine(&self, matches: &[Correspondence; 5]) -> f64 {
        let essential = self.essential();
        let sines = matches.each_ref().map(|m| m.bearing2().dot(&(essential * m.bearing1())).abs());
        sines.into_iter().fold(0.0, f64::max)
    }

    /// Levenberg–Marquardt to a local minimum of the summed squares of the Sampson errors. Matches further than `cutoff`
    /// (radians) from the epipolar constraint weigh nothing. Returns the sum before the last step.
    pub(crate) fn minimise_sampson(&mut self, matches: &[Correspondence], cutoff: f64, until: &Until) -> f64 {
        let beyond_five = matches.len().saturating_sub(5).max(1) as f64;
        self.descend(|motion| motion.sampson_equations(matches, cutoff), beyond_five, until)
    }

    /// Levenberg–Marquardt to a local minimum of a cost that is a sum of squares. Returns the cost before the last step.
    pub(crate) fn descend(
        &mut self,
        equations: impl Fn(&Self) -> Equations,
        beyond_five: f64,
        until: &Until,
    ) -> f64 {
        let current = equations(self);
        let mut descending = Descending { motion: self, equations, beyond_five, until, current };
        descend(&mut descending, &SCHEDULE, until.steps);
        descending.current.cost
    }

    /// The sum of the squared Sampson errors, none of them counted beyond `cutoff`, and the equations of a step.
    fn sampson_equations(&self, matches: &[Correspondence], cutoff: f64) -> Equations {
        let frame = self.frame();
        let limit = cutoff.min(RIGHT_ANGLE).powi(2);
        let (mut cost, mut sums) = (0.0, [[Two::ZERO; 6]; 5]);
        for pair in matches.chunks(2) {
            let second = pair.get(1);
            let b = frame.of_view2(&side_by_side(pair[0].bearing2(), second.map(Correspondence::bearing2)));
            let c = frame.of_view1(&side_by_side(pair[0].bearing1(), second.map(Correspondence::bearing1)));
            let (e, along) = constraint(&b, &c);
            let g = Two::splat(2.0) - b[2] * b[2] - c[2] * c[2] - Two::splat(2.0) * e * e;
            let over_g = Two::splat(1.0) / g;
            let square = e * e * over_g;
            let counts = square.simd_lt(Two::splat(limit)) & g.simd_gt(Two::splat(AT_EPIPOLE));
            let over_g = over_g & counts;
            cost += (square & counts).reduce_add();
            if !counts.all() {
                cost += beyond(e & !counts, b[2], c[2], limit);
            }
            let row = sampson_row(&b, &c, e, &along, square, over_g);
            for i in 0..5 {
                let weighted = over_g * row[i];
                for j in i..6 {
                    sums[i][j] += weighted * row[j];
                }
            }
        }
        let hessian = Matrix5::from_fn(|i, j| sums[i.min(j)][i.max(j)].reduce_add());
        Equations { frame, cost, hessian, gradient: Vector5::from_fn(|i, _| sums[i][5].reduce_add()) }
    }

    /// The sum of the squared Sampson errors, none of them counted beyond `cutoff`.
    pub(crate) fn truncated_cost(&self, matches: &[Correspondence], cutoff: f64) -> f64 {
        let frame = self.frame();
        let limit = cutoff * cutoff;
        let square = |m: &Correspondence| {
            let (b, c) = frame.bearings(m);
            sampson_square(b[0] * c[1] - b[1] * c[0], b[2], c[2]).min(limit)
        };
        matches.iter().map(square).sum()
    }
}

/// A start is a solution of some or all of the constraints: the first step is Gauss–Newton's own.
pub(crate) const SCHEDULE: Schedule =
    Schedule { first: 0.0, least: 0.0, negligible: 0.0, refused: 1e-3, most: 1e3, singular: Singular::Ends };

/// A motion on its way.
struct Descending<'a, F> {
    motion: &'a mut Motion,
    equations: F,
    beyond_five: f64,
    until: &'a Until,
    /// At the motion.
    current: Equations,
}

impl<F: Fn(&Motion) -> Equations> Descent for Descending<'_, F> {
    type Step = Vector5<f64>;

    fn step(&mut self, damping: f64) -> Option<Vector5<f64>> {
        damped_step(&self.current.hessian, &self.current.gradient, damping)
    }

    fn attempt(&mut self, step: &Vector5<f64>) -> Outcome {
        let Self { current, until, .. } = self;
        let trial = self.motion.moved(&current.frame, &(*step).into());
        // To first order the cost falls by the step's square in units of the noise times its variance.
        let fall = -step.dot(&current.gradient);
        if step.norm() < until.step || fall * self.beyond_five < until.within_noise * current.cost {
            *self.motion = trial;
            return Outcome::Over;
        }
        let next = (self.equations)(&trial);
        if next.cost < current.cost {
            (*self.motion, self.current) = (trial, next);
            Outcome::Lower
        } else {
            Outcome::Refused
        }
    }
}

/// Whether two unit vectors with this product are the same line, to a small `angle`.
#[inline]
fn is_near(cosine: f64, angle: f64) -> bool {
    1.0 - cosine * cosine < angle * angle + 4.0 * f64::EPSILON
}

/// A match with both rays closer than the square root of this to the baseline says nothing about the motion.
pub(crate) const AT_EPIPOLE: f64 = 1e-20;

/// The normal equations of a step from a motion, in the parameters of its frame.
pub(crate) struct Equations {
    pub(crate) frame: EpipolarFrame,
    pub(crate) cost: f64,
    pub(crate) hessian: Matrix5<f64>,
    pub(crate) gradient: Vector5<f64>,
}

/// The squared Sampson errors of two constraints, none of them counted beyond `limit`.
#[cold]
fn beyond(e: Two, tb: Two, tc: Two, limit: f64) -> f64 {
    let [e, tb, tc] = [e, tb, tc].map(Two::to_array);
    (0..2).map(|k| sampson_square(e[k], tb[k], tc[k]).min(limit)).sum()
}

/// The residuals of two matches by their bearings in the epipolar frame, and their derivatives by the five parameters.
#[inline]
pub(crate) fn constraint(b: &TwoVectors, c: &TwoVectors) -> (Two, [Two; 5]) {
    let derivative = [
        -b[0] * c[2],
        -b[1] * c[2],
        b[0] * c[0] + b[1] * c[1],
        b[1] * c[2] - b[2] * c[1],
        b[2] * c[0] - b[0] * c[2],
    ];
    (b[0] * c[1] - b[1] * c[0], derivative)
}

/// `√g` times the derivatives of the Sampson errors `r = e / √g` of two constraints, and `e` itself:
///
/// ```text
/// g = 2 − (t·b)² − (t·c)² − 2 e²
/// dr = ((1 + 2 e²/g) de + (e/g) (t·b d(t·b) + t·c d(t·c))) / √g
/// ```
#[inline]
pub(crate) fn sampson_row(
    b: &TwoVectors,
    c: &TwoVectors,
    e: Two,
    along: &[Two; 5],
    square: Two,
    over_g: Two,
) -> [Two; 6] {
    let (scale, bend) = (Two::splat(1.0) + Two::splat(2.0) * square, e * over_g);
    [
        scale * along[0] + bend * (c[2] * c[1]),
        scale * along[1] - bend * (c[2] * c[0]),
        scale * along[2],
        scale * along[3] + bend * (b[2] * b[0] + c[2] * c[0]),
        scale * along[4] + bend * (b[2] * b[1] + c[2] * c[1]),
        e,
    ]
}

/// The step `−(H + damping · diag H)⁻¹ g`, where it exists.
pub(crate) fn damped_step(
    hessian: &Matrix5<f64>,
    gradient: &Vector5<f64>,
    damping: f64,
) -> Option<Vector5<f64>> {
    let mut damped = *hessian;
    for k in 0..5 {
        damped[(k, k)] *= 1.0 + damping;
    }
    let step = -damped.cholesky()?.solve(gradient);
    step.iter().all(|x| x.is_finite()).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion() -> Motion {
        let q_21 = UnitQuaternion::new(Vector3::new(0.3, -0.2, 0.5));
        Motion { q_21, direction: Vector3::new(0.6, 0.0, -0.8) }
    }

    #[test]
    fn gradient_is_the_limit_of_differences() {
        let motion = motion();
        let m = Correspondence::from_bearings([-0.1, 0.4, 0.9], [0.2, 0.5, 0.8]).unwrap();
        let frame = motion.frame();
        let residual = |motion: &Motion| {
            let c = motion.q_21 * m.bearing1();
            motion.direction.dot(&m.bearing2().cross(&c))
        };
        let (b, c) = (side_by_side(m.bearing2(), None), side_by_side(m.bearing1(), None));
        let (at, gradient) = constraint(&frame.of_view2(&b), &frame.of_view1(&c));
        let (at, gradient) = (at.to_array()[0], gradient.map(|g| g.to_array()[0]));
        assert!((at - residual(&motion)).abs() < 1e-15);
        let h = 1e-6;
        for k in 0..5 {
            let mut step = [0.0; 5];
            step[k] = h;
            let plus = motion.moved(&frame, &step);
            step[k] = -h;
            let minus = motion.moved(&frame, &step);
            // Central differences: h² of truncation, ε / h of rounding.
            assert!((gradient[k] - (residual(&plus) - residual(&minus)) / (2.0 * h)).abs() < 1e-9);
        }
    }

    #[test]
    fn twisted_motions_share_the_essential_matrix() {
        let m = motion();
        assert!((m.essential() + m.twisted().essential()).norm() < 1e-15);
        assert!(m.is_close(&m.twisted().twisted(), 1e-12) && !m.is_close(&m.twisted(), 0.1));
    }

    #[test]
    fn sampson_gradient_is_the_limit_of_differences() {
        let m = motion();
        let pairs = [([0.2, 0.5, 0.8], [-0.1, 0.4, 0.9]), ([-0.3, 0.1, 0.7], [0.5, -0.2, 0.6])];
        let matches = pairs.map(|(a, b)| Correspondence::from_bearings(a, b).unwrap());
        let at = |m: &Motion| m.sampson_equations(&matches, f64::INFINITY);
        let h = 1e-6;
        for k in 0..5 {
            let mut step = [0.0; 5];
            step[k] = h;
            let plus = at(&m.moved(&at(&m).frame, &step)).cost;
            step[k] = -h;
            let minus = at(&m.moved(&at(&m).frame, &step)).cost;
            // Half the gradient of the squares; h² of truncation, ε / h of rounding.
            assert!((at(&m).gradient[k] - (plus - minus) / (4.0 * h)).abs() < 1e-9);
        }
    }
}
