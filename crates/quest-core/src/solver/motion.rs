//! A rotation and a direction of translation, refined on their manifold: five parameters.
//!
//! The residual of a match is the epipolar constraint `r = t · (b × c)`, `c = R a`, with unit `t`. For a rotation by
//! a small vector `ω` after `R`, and a move of `t` by `δ1 e1 + δ2 e2` in its tangent plane,
//!
//! ```text
//! dr = ω · (c × (t × b)) + δ1 n · e1 + δ2 n · e2,   n = b × c
//! ```

use nalgebra::{Matrix3, Matrix5, Quaternion, UnitQuaternion, Vector3, Vector5};

use super::aligned::{Alignment, Gram};
use crate::Correspondence;
use crate::algebra::elimination;
use crate::pose::sampson_square;

/// A step shorter than this (radians) is rounding.
const CONVERGED: f64 = 1e-13;

/// Newton's iteration takes one or two; a double root takes them all.
const MAX_NEWTON_STEPS: usize = 10;

/// A relative pose without the length of its translation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    /// The rotation.
    pub(crate) q_21: UnitQuaternion<f64>,
    /// The direction of the translation, a unit vector of either sign.
    pub(crate) direction: Vector3<f64>,
}

/// How an iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The last step was rounding.
    Converged,
    /// The steps ran out, or led away.
    Stalled,
}

impl Motion {
    /// The other rotation with the same essential matrix: turned by 180° about the translation, `q' = t ⊗ q`.
    pub(crate) fn twisted(&self) -> Self {
        let q = Quaternion::from_imag(self.direction) * self.q_21.into_inner();
        Self { q_21: UnitQuaternion::new_normalize(q), direction: self.direction }
    }

    /// Whether two motions have the same essential matrix and rotation, to `tolerance` in radians. Both parts
    /// are needed: with little parallax all solutions have nearly the same rotation.
    #[inline]
    pub(crate) fn is_close(&self, other: &Self, tolerance: f64) -> bool {
        let near = |cosine: f64, angle: f64| 1.0 - cosine * cosine < angle * angle + 4.0 * f64::EPSILON;
        near(self.direction.dot(&other.direction), tolerance)
            && near(self.q_21.coords.dot(&other.q_21.coords), 0.5 * tolerance)
    }

    /// The essential matrix `[t]× R`.
    pub(crate) fn essential(&self) -> Matrix3<f64> {
        self.direction.cross_matrix() * self.q_21.to_rotation_matrix().into_inner()
    }

    /// The derivatives of the essential matrix by the five parameters.
    pub(crate) fn essential_derivatives(&self, tangent: &[Vector3<f64>; 2]) -> [Matrix3<f64>; 5] {
        let r_21 = self.q_21.to_rotation_matrix().into_inner();
        let cross = self.direction.cross_matrix();
        std::array::from_fn(|k| match k {
            0..3 => cross * Vector3::ith(k, 1.0).cross_matrix() * r_21,
            _ => tangent[k - 3].cross_matrix() * r_21,
        })
    }

    fn moved(&self, tangent: &[Vector3<f64>; 2], step: &[f64; 5]) -> Self {
        // To first order a rotation by ω; any step of the iteration may differ from it to second order.
        let turn = Quaternion::new(1.0, 0.5 * step[0], 0.5 * step[1], 0.5 * step[2]);
        let direction = self.direction + tangent[0] * step[3] + tangent[1] * step[4];
        Self {
            q_21: UnitQuaternion::new_normalize(turn * self.q_21.into_inner()),
            direction: direction.normalize(),
        }
    }

    /// By how much the motion misses the constraints of five matches: the largest `|t · (b × c)|`.
    pub(crate) fn largest_sine(&self, matches: &[Correspondence; 5]) -> f64 {
        let essential = self.essential();
        let sines = matches.each_ref().map(|m| m.bearing2().dot(&(essential * m.bearing1())).abs());
        sines.into_iter().fold(0.0, f64::max)
    }

    /// Newton's iteration to the solution of five constraints.
    pub(crate) fn solve_five(&mut self, alignment: &Alignment, matches: &[Correspondence; 5]) -> Outcome {
        let resolution = alignment.direction_resolution();
        for _ in 0..MAX_NEWTON_STEPS {
            let tangent = tangent_basis(&self.direction);
            let r_21 = self.q_21.to_rotation_matrix();
            let mut equations = [[0.0; 6]; 5];
            for (i, m) in matches.iter().enumerate() {
                let row = Row::new(m.bearing2(), &(r_21 * m.bearing1()), &self.direction, &tangent);
                let [g0, g1, g2, g3, g4]: [f64; 5] = row.gradient.into();
                equations[i] = [g0, g1, g2, g3, g4, -row.residual];
            }
            let Some(step) = elimination::solve(&mut equations) else { return Outcome::Stalled };
            let length = step.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length > 1.0 {
                return Outcome::Stalled;
            }
            *self = self.moved(&tangent, &step);
            // Quadratic: the error left is the square of the step.
            if length < resolution.max(1e-7) {
                return Outcome::Converged;
            }
        }
        Outcome::Stalled
    }

    /// Levenberg–Marquardt to a local minimum of the summed squares of the constraints, by their Gram matrix: the
    /// cost of a step does not depend on the number of matches.
    pub(crate) fn minimise_gram(&mut self, gram: &Gram, max_steps: usize) {
        let (mut damping, mut cost) = (1e-4, gram.cost(self));
        for _ in 0..max_steps {
            let tangent = tangent_basis(&self.direction);
            let (hessian, gradient) = gram.normal_equations(self, &tangent);
            let mut length = 0.0;
            for _ in 0..8 {
                let Some(step) = damped_step(&hessian, &gradient, damping) else { break };
                let trial = self.moved(&tangent, &step.into());
                let trial_cost = gram.cost(&trial);
                if trial_cost <= cost {
                    length = step.norm();
                    (*self, cost) = (trial, trial_cost);
                    damping *= 0.1;
                    break;
                }
                damping *= 10.0;
            }
            // The squared cost resolves half the digits; the residuals themselves finish the work.
            if length < 1e-7 {
                break;
            }
        }
    }

    /// Levenberg–Marquardt to a local minimum of the summed squares of the Sampson errors. Matches further than `cutoff`
    /// (radians) from the epipolar constraint weigh nothing.
    pub(crate) fn minimise_sampson(&mut self, matches: &[Correspondence], cutoff: f64, max_steps: usize) {
        let mut damping = 0.0;
        let mut current = self.sampson_equations(matches, cutoff);
        for _ in 0..max_steps {
            let Some(step) = damped_step(&current.hessian, &current.gradient, damping) else { break };
            let trial = self.moved(&current.tangent, &step.into());
            let next = trial.sampson_equations(matches, cutoff);
            let gain = current.cost - next.cost;
            if gain > 0.0 {
                (*self, current) = (trial, next);
                damping *= 0.1;
            } else {
                damping = (10.0 * damping).max(1e-3);
            }
            if step.norm() < CONVERGED || damping > 1e3 || (0.0..1e-12 * current.cost).contains(&gain) {
                break;
            }
        }
    }

    /// The sum of the squared Sampson errors, none of them counted beyond `cutoff`, and the equations of a step.
    fn sampson_equations(&self, matches: &[Correspondence], cutoff: f64) -> Equations {
        let tangent = tangent_basis(&self.direction);
        let r_21 = self.q_21.to_rotation_matrix();
        let (mut cost, mut hessian, mut gradient) = (0.0, Matrix5::zeros(), Vector5::zeros());
        let limit = cutoff * cutoff;
        for m in matches {
            let (b, c) = (m.bearing2(), r_21 * m.bearing1());
            let row = Row::new(b, &c, &self.direction, &tangent);
            let (tb, tc) = (self.direction.dot(b), self.direction.dot(&c));
            let square = sampson_square(row.residual, tb, tc);
            cost += square.min(limit);
            if square < limit && row.residual != 0.0 {
                // r = e / √g with g = 2 − (t·b)² − (t·c)² − 2 e², so that
                // dr = ((1 + 2 e²/g) de + (e/g) (t·b d(t·b) + t·c d(t·c))) / √g.
                let over_g = square / (row.residual * row.residual);
                let turned = c.cross(&self.direction) * tc;
                let moved = b * tb + c * tc;
                let [along1, along2] = tangent.map(|e| e.dot(&moved));
                let bend = Vector5::new(turned.x, turned.y, turned.z, along1, along2);
                let slope = row.gradient * (1.0 + 2.0 * square) + bend * (row.residual * over_g);
                hessian += slope * slope.transpose() * over_g;
                gradient += slope * (row.residual * over_g);
            }
        }
        Equations { tangent, cost, hessian, gradient }
    }

    /// The sum of the squared Sampson errors, none of them counted beyond `cutoff`.
    pub(crate) fn truncated_cost(&self, matches: &[Correspondence], cutoff: f64) -> f64 {
        self.sampson_equations(matches, cutoff).cost
    }
}

/// The normal equations of a step from a motion.
struct Equations {
    tangent: [Vector3<f64>; 2],
    cost: f64,
    hessian: Matrix5<f64>,
    gradient: Vector5<f64>,
}

/// The residual of one match and its derivative by the five parameters.
struct Row {
    residual: f64,
    gradient: Vector5<f64>,
}

impl Row {
    #[inline]
    fn new(b: &Vector3<f64>, c: &Vector3<f64>, t: &Vector3<f64>, tangent: &[Vector3<f64>; 2]) -> Self {
        let n = b.cross(c);
        let g = c.cross(&t.cross(b));
        Self {
            residual: n.dot(t),
            gradient: Vector5::new(g.x, g.y, g.z, n.dot(&tangent[0]), n.dot(&tangent[1])),
        }
    }
}

/// Two unit vectors that complete `t` to a right-handed frame (Duff et al., JCGT 2017): no branch that fails.
pub(crate) fn tangent_basis(t: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let sign = 1.0_f64.copysign(t.z);
    let a = -1.0 / (sign + t.z);
    let b = t.x * t.y * a;
    [
        Vector3::new(1.0 + sign * t.x * t.x * a, sign * b, -sign * t.x),
        Vector3::new(b, sign + t.y * t.y * a, -t.y),
    ]
}

/// The step `−(H + damping · diag H)⁻¹ g`, where it exists.
fn damped_step(hessian: &Matrix5<f64>, gradient: &Vector5<f64>, damping: f64) -> Option<Vector5<f64>> {
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
    fn tangent_basis_is_orthonormal_everywhere() {
        for t in [Vector3::z(), -Vector3::z(), Vector3::x(), Vector3::new(0.6, 0.0, -0.8)] {
            let [e1, e2] = tangent_basis(&t);
            assert!((e1.cross(&e2) - t).norm() < 1e-15 && e1.dot(&e2).abs() < 1e-15);
        }
    }

    #[test]
    fn gradient_is_the_limit_of_differences() {
        let m = motion();
        let tangent = tangent_basis(&m.direction);
        let (b, a) = (Vector3::new(0.2, 0.5, 0.8).normalize(), Vector3::new(-0.1, 0.4, 0.9).normalize());
        let at =
            |m: &Motion| Row::new(&b, &(m.q_21 * a), &m.direction, &tangent_basis(&m.direction)).residual;
        let row = Row::new(&b, &(m.q_21 * a), &m.direction, &tangent);
        let derivatives = m.essential_derivatives(&tangent);
        let h = 1e-6;
        for k in 0..5 {
            let mut step = [0.0; 5];
            step[k] = h;
            let plus = m.moved(&tangent, &step);
            step[k] = -h;
            let minus = m.moved(&tangent, &step);
            // Central differences: h² of truncation, ε / h of rounding.
            assert!((row.gradient[k] - (at(&plus) - at(&minus)) / (2.0 * h)).abs() < 1e-9);
            let difference = (plus.essential() - minus.essential()) / (2.0 * h);
            assert!((derivatives[k] - difference).amax() < 1e-9);
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
            let plus = at(&m.moved(&at(&m).tangent, &step)).cost;
            step[k] = -h;
            let minus = at(&m.moved(&at(&m).tangent, &step)).cost;
            // Half the gradient of the squares; h² of truncation, ε / h of rounding.
            assert!((at(&m).gradient[k] - (plus - minus) / (4.0 * h)).abs() < 1e-9);
        }
    }
}
