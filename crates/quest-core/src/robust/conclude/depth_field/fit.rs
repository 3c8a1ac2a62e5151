//! The likeliest pose with a field of depths: steps of Gauss and Newton, and rounds of EM of the spread and of the near points.

use nalgebra::UnitQuaternion;

use crate::algebra::vectors::exponential::{exp, ln};
use crate::robust::conclude::depth_field::field::{
    DepthField, Equations, Field, PARAMETERS, Parameters, TERMS, Terms, precisions,
};
use crate::robust::conclude::depth_field::sums::Sums;
use crate::robust::conclude::evidence::{Likelihood, without_two};

/// The deviation of all inverse depths over their mean is about the first, and its logarithm is known to the second. Depths that are uniform
/// from 4 to 9 have 0.24, logarithms of depths that are uniform from 2 to 40 have 0.8. Measured, lengths at a parallax of 0.01:
/// with 0.7 in place of 0.5 they are a twentieth worse.
const USUAL_SPREAD: f64 = 0.32;
const FACTOR: f64 = 0.5;

/// The least spread of the inverse depths, squared.
const LEAST_SPREAD: f64 = 1e-8;

/// A round changes the square of the spread by what EM says, to this power: that goes nearly twice as fast to the same limit, and
/// any power below two converges. What EM says counts as at most this factor.
const RELAXED: f64 = 1.8;
const MOST_CHANGE: f64 = 3.0;

/// The bounds of the share of near points, which keep both explanations possible.
const LEAST_NEAR: f64 = 1e-6;
const MOST_NEAR: f64 = 0.9;

/// So many near points are chance: the direction of the translation is free to fit two false matches, and among thirty false matches
/// a third and a fourth agree with some two.
const FREE: f64 = 4.0;

/// A step may lower the likelihood by so many nats: one that is longer than that of EM overshoots a little near the limit.
const LOST: f64 = 1.0;

/// A fit is at its end when its step gains about this many nats. That step is made.
const NEGLIGIBLE: f64 = 0.01;

/// This share of the diagonal is added to the normal equations, which are singular without a translation: the field moves no point.
const RIDGE: f64 = 1e-9;

type Factor = nalgebra::Cholesky<f64, nalgebra::Const<PARAMETERS>>;

/// The logarithm of the likelihood over that without a translation, in nats, and the covariance of all parameters: the turn, the
/// translation and the field.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub(crate) at: DepthField,
    pub(crate) nats: f64,
    pub(crate) covariance: Equations,
}

impl DepthField {
    /// Whether two are the same as far as the covariance of one tells.
    pub(crate) fn is_near(&self, other: &Fit) -> bool {
        // In standard deviations: a mixture of two modes so near each other is hardly wider than one.
        const NEAR: f64 = 0.5;
        let turn = (self.q_21 * other.at.q_21.inverse()).scaled_axis();
        let by = self.t_21 - other.at.t_21;
        let apart = |x: f64, k: usize| x * x / other.covariance[(k, k)];
        let sum: f64 = (0..3).map(|k| apart(turn[k], k) + apart(by[k], k + 3)).sum();
        sum < NEAR * NEAR
    }

    /// So many rounds, and the likelihood of what they lead to. `None` where the matches do not determine the rotation.
    ///
    /// A step that lowers the likelihood is halved: behind the translation without length lies the one of the opposite sign,
    /// which puts near points behind the cameras.
    pub(crate) fn fit(mut self, terms: &[Terms], likelihood: &Likelihood, rounds: usize) -> Option<Fit> {
        let precisions = precisions();
        let (mut sums, mut from) = (Sums::new(&self, terms, likelihood), None);
        for _ in 0..rounds {
            let worth = self.worth(&sums, &precisions);
            let mut gain = f64::INFINITY;
            match from.take() {
                Some((before, step, before_worth)) if worth < before_worth - LOST => {
                    let step: Parameters = step * 0.5;
                    self = Self::stepped(&before, &step);
                    from = Some((before, step, before_worth));
                }
                _ => {
                    let factor = regularised(&sums, &precisions)?;
                    let step = self.step(&sums, &precisions, &factor)?;
                    let next = Self::stepped(&self, &step).with_shares(&sums, &factor);
                    let spread = ln(next.square_spread / self.square_spread);
                    gain =
                        0.5 * factor.l().tr_mul(&step).norm_squared() + 0.25 * sums.usual * spread * spread;
                    from = Some((std::mem::replace(&mut self, next), step, worth));
                }
            }
            sums = Sums::new(&self, terms, likelihood);
            if gain < NEGLIGIBLE {
                break;
            }
        }
        if let Some((before, ..)) = from.filter(|from| self.worth(&sums, &precisions) < from.2 - LOST) {
            self = before;
            sums = Sums::new(&self, terms, likelihood);
        }
        let covariance = regularised(&sums, &precisions)?.inverse();
        let nats = without_two(&sums.nats) - self.surprise(&precisions);
        let is_finite = nats.is_finite() && covariance.iter().all(|x| x.is_finite());
        is_finite.then_some(Fit { at: self, nats, covariance })
    }

    /// The logarithm of the likelihood and of what is known of the field before any match is seen, which the rounds increase.
    fn worth(&self, sums: &Sums, precisions: &Field) -> f64 {
        sums.nats.iter().sum::<f64>() - self.surprise(precisions)
    }

    /// The step of Gauss and Newton.
    ///
    /// The matches tell the product of the translation and the spread of the inverse depths better than either. What is known of the
    /// field beforehand says nothing of the length of the translation, but a flat field, which is likelier, would make it longer.
    /// This is taken back: the derivative by the length is that with the product held. What is known of the spread is put in its place.
    fn step(&self, sums: &Sums, precisions: &Field, factor: &Factor) -> Option<Parameters> {
        let mut gradient = sums.gradient;
        for (k, precision) in precisions.iter().enumerate() {
            gradient[6 + k] += precision * self.field[k];
        }
        let mut by_length = Parameters::zeros();
        let square = self.t_21.norm_squared();
        if square > 0.0 {
            by_length.fixed_rows_mut::<3>(3).copy_from(&(self.t_21 / square));
            let all = self.square_spread + self.field.norm_squared();
            let pull =
                2.0 * self.surprise(precisions) - 0.5 * ln(all / USUAL_SPREAD.powi(2)) / FACTOR.powi(2);
            // A translation that is about its noise changes by less, or it would turn around.
            let variance = by_length.dot(&factor.solve(&by_length));
            gradient += by_length * (pull / (1.0 + pull.abs() * variance));
        }
        let step = -factor.solve(&gradient);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }

    fn stepped(&self, step: &Parameters) -> Self {
        Self {
            q_21: UnitQuaternion::new(step.fixed_rows::<3>(0).into_owned()) * self.q_21,
            t_21: self.t_21 + step.fixed_rows::<3>(3),
            field: self.field + step.fixed_rows::<TERMS>(6),
            ..*self
        }
    }

    /// The same with the spread and the share of near points that a round of EM says. The field and the pose have taken up a part of
    /// the spread, `tr(H⁻¹ A)` of its squares where `A` are the equations along the lines: 20 parameters of 70 matches would make
    /// the spread 15 % too small, and so the translation, of which often only its product with the spread is known, too long.
    fn with_shares(mut self, sums: &Sums, factor: &Factor) -> Self {
        if sums.usual > 0.0 {
            let taken = factor.solve(&sums.along).trace() * sums.share / sums.usual;
            let ratio = (sums.square_spread / self.square_spread + taken) / sums.usual;
            let ratio = exp(RELAXED * ln(ratio.clamp(1.0 / MOST_CHANGE, MOST_CHANGE)));
            self.square_spread = (self.square_spread * ratio).max(LEAST_SPREAD);
            let near = (sums.near - FREE).max(0.0);
            self.near = (near / (sums.usual + near)).clamp(LEAST_NEAR, MOST_NEAR);
        }
        self
    }
}

/// The normal equations with what is known of the field before any match is seen, factored.
fn regularised(sums: &Sums, precisions: &Field) -> Option<Factor> {
    let mut equations = sums.along;
    let mut pose = equations.fixed_view_mut::<6, 6>(0, 0);
    pose += sums.across;
    for (k, precision) in precisions.iter().enumerate() {
        equations[(6 + k, 6 + k)] += precision;
    }
    for k in 0..PARAMETERS {
        equations[(k, k)] *= 1.0 + RIDGE;
    }
    equations.cholesky()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Vector3};
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::robust::conclude::depth_field::field::terms;
    use crate::robust::conclude::depth_field::planted::{likelihood, of_field, turn};
    use crate::robust::search::sampling;

    const SEED: u64 = 0xf1e1d;
    const SIGMA: f64 = 0.5;

    /// Half a corridor: its right side is twice as near.
    fn corridor() -> Field {
        let mut field = Field::zeros();
        // The degrees (1, 0) and (2, 0) come after the four of the second variable alone.
        field[4] = 0.25;
        field[8] = 0.1;
        field
    }

    #[test]
    fn a_fit_finds_the_pose_and_the_field() {
        let t_21 = Vector3::new(0.02, -0.01, 0.015);
        let mut all = 0.0;
        for index in 0..10 {
            let rng = &mut sampling::generator(SEED, index);
            let mut normal = || Distribution::<f64>::sample(&StandardNormal, rng);
            let mut rhos = of_field(&corridor(), 200);
            for (k, rho) in rhos.iter_mut().enumerate() {
                *rho = if k >= 180 { 5.0 } else { *rho + 0.1 * normal() };
            }
            // Both views have the noise, and all of it is in the second.
            let off: Vec<[f64; 2]> =
                (0..200).map(|_| [0; 2].map(|_| 2_f64.sqrt() * SIGMA * normal())).collect();
            let likelihood = likelihood(&rhos, &t_21, |k| off[k], SIGMA);
            let terms = terms(&likelihood);
            let start = DepthField::start(turn(), t_21 * 0.8, 0.2);
            let before = start.worth(&Sums::new(&start, &terms, &likelihood), &precisions());
            let found = start.fit(&terms, &likelihood, 20).unwrap();
            let sums = Sums::new(&found.at, &terms, &likelihood);
            assert!(found.at.worth(&sums, &precisions()) > before, "{index}");
            // Another step would gain nothing.
            let factor = regularised(&sums, &precisions()).unwrap();
            let step = found.at.step(&sums, &precisions(), &factor).unwrap();
            assert!(factor.l().tr_mul(&step).norm_squared() < 0.1, "{index}: {step}");
            let surprise = found.at.surprise(&precisions());
            assert!((found.nats - (without_two(&sums.nats) - surprise)).abs() < 1e-9 && surprise > 0.0);
            // Twenty near points less those that are chance, of two hundred.
            assert!((found.at.near - 0.08).abs() < 0.02, "{index}: {}", found.at.near);
            assert!(
                (found.at.square_spread.sqrt() - 0.1).abs() < 0.06,
                "{index}: {}",
                found.at.square_spread
            );
            assert!(found.at.t_21.angle(&t_21) < 0.15, "{index}: {}", found.at.t_21);
            assert!((found.at.field - corridor()).norm() < 0.35, "{index}: {}", found.at.field);
            // The unit of length is the mean inverse depth, which the field tells as well as its own size.
            let turn = (turn() * found.at.q_21.inverse()).scaled_axis();
            let by = t_21 * (found.at.t_21.norm() / t_21.norm()) - found.at.t_21;
            let by = nalgebra::Vector6::new(turn.x, turn.y, turn.z, by.x, by.y, by.z);
            let covariance: Matrix6<f64> = found.covariance.fixed_view::<6, 6>(0, 0).into_owned();
            all += by.dot(&covariance.cholesky().unwrap().solve(&by)) / 10.0;
        }
        // Five degrees of freedom, of which the mean of ten scatters by one.
        assert!((1.5..9.0).contains(&all), "{all}");
    }

    #[test]
    fn without_near_points_their_share_is_the_least() {
        let t_21 = Vector3::new(0.02, -0.01, 0.015);
        let likelihood = likelihood(&of_field(&corridor(), 100), &t_21, |_| [0.0; 2], SIGMA);
        let terms = terms(&likelihood);
        let found = DepthField::start(turn(), t_21, 0.2).fit(&terms, &likelihood, 10).unwrap();
        assert!((found.at.near - LEAST_NEAR).abs() <= 0.0, "{}", found.at.near);
        // Two that are the same as far as they tell, and two that are not.
        let deviation = found.covariance[(3, 3)].sqrt();
        let moved = |by: f64| DepthField {
            t_21: found.at.t_21 + Vector3::x() * (by * deviation),
            ..found.at.clone()
        };
        assert!(moved(0.4).is_near(&found) && !moved(0.6).is_near(&found));
    }

    /// Where the matches say nothing more, a length is what makes the spread the usual one.
    #[test]
    fn a_length_goes_where_the_spread_is_usual() {
        let sums = Sums {
            across: Matrix6::identity(),
            along: Equations::identity(),
            gradient: Parameters::zeros(),
            usual: 100.0,
            near: 0.0,
            square_spread: 0.0,
            share: 0.0,
            nats: Vec::new(),
        };
        let precisions = precisions();
        let along = |spread: f64| {
            let at = DepthField::start(turn(), Vector3::new(0.0, 2.0, 0.0), spread);
            let step = at.step(&sums, &precisions, &regularised(&sums, &precisions).unwrap()).unwrap();
            assert!(step.iter().enumerate().all(|(k, x)| k == 4 || x.abs() <= 1e-15), "{step}");
            step[4]
        };
        assert!(along(USUAL_SPREAD).abs() < 1e-12);
        // ln(e²) / 2 / 0.5² = 4 along t/|t|², of which the variance is half of a quarter; the step is half of it.
        let expected = 0.5 * 0.5 * 4.0 / (1.0 + 4.0 * 0.125);
        assert!(
            (along(USUAL_SPREAD * 1_f64.exp()) - expected).abs() < 1e-6,
            "{}",
            along(USUAL_SPREAD * 1_f64.exp())
        );
        assert!((along(USUAL_SPREAD * (-1_f64).exp()) + expected).abs() < 1e-6);
    }
}
