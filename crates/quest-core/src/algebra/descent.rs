//! Levenberg–Marquardt: every descent of the crate to a least sum of squares runs here, each with a [`Schedule`] of its own.
//!
//! ```text
//! step = −(H + damping · diag H)⁻¹ g
//! ```
//!
//! A step that lowers the cost is kept, and the damping falls tenfold. A step that does not is refused, and the damping rises
//! tenfold: the step becomes shorter and turns to the steepest descent. Ten is Marquardt's own factor (D. W. Marquardt, *An
//! algorithm for least-squares estimation of nonlinear parameters*, SIAM J. 1963).

/// By how much a refused step raises the damping, and a kept one lowers it.
pub(crate) const RISE: f64 = 10.0;
pub(crate) const FALL: f64 = 0.1;

/// How a descent is damped: what share of the Hessian's diagonal is added to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Schedule {
    /// The damping of the first step.
    pub(crate) first: f64,
    /// A step that lowers the cost leaves at least this damping.
    pub(crate) least: f64,
    /// A damping up to this falls to the least at once.
    pub(crate) negligible: f64,
    /// A refused step leaves at least this damping.
    pub(crate) refused: f64,
    /// The descent ends once the damping is above this: it is at its minimum, to rounding.
    pub(crate) most: f64,
    /// What is done where the damped Hessian is singular.
    pub(crate) singular: Singular,
}

/// What a descent does where its damped Hessian is singular, so that there is no step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Singular {
    /// It ends where it is.
    Ends,
    /// It raises the damping and tries again.
    IsDamped,
}

impl Schedule {
    /// The damping after a step that lowered the cost.
    #[inline]
    pub(crate) fn lowered(&self, damping: f64) -> f64 {
        if damping > self.negligible { (FALL * damping).max(self.least) } else { self.least }
    }

    /// The damping after a step that was refused.
    #[inline]
    pub(crate) fn raised(&self, damping: f64) -> f64 {
        (RISE * damping).max(self.refused)
    }
}

/// What became of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// It lowered the cost and was made.
    Lower,
    /// It did not lower the cost and was refused.
    Refused,
    /// The descent is at its end, with this step or without it.
    Over,
}

/// A sum of squares, and where its descent is.
pub(crate) trait Descent {
    /// A change of the parameters.
    type Step;

    /// The damped step from where the descent is; `None` where the damped Hessian is singular.
    fn step(&mut self, damping: f64) -> Option<Self::Step>;

    /// Makes the step if it lowers the cost, or if it is the last.
    fn attempt(&mut self, step: &Self::Step) -> Outcome;
}

/// Descends by at most so many steps.
#[inline]
pub(crate) fn descend(descent: &mut impl Descent, schedule: &Schedule, max_steps: usize) {
    let mut damping = schedule.first;
    for _ in 0..max_steps {
        let outcome = match (descent.step(damping), schedule.singular) {
            (Some(step), _) => descent.attempt(&step),
            (None, Singular::IsDamped) => Outcome::Refused,
            (None, Singular::Ends) => Outcome::Over,
        };
        match outcome {
            Outcome::Lower => damping = schedule.lowered(damping),
            Outcome::Refused => damping = schedule.raised(damping),
            Outcome::Over => break,
        }
        if damping > schedule.most {
            break;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCHEDULE: Schedule = Schedule {
        first: 1e-3,
        least: 1e-9,
        negligible: 1e-9,
        refused: 0.0,
        most: 1e5,
        singular: Singular::IsDamped,
    };

    /// Rosenbrock's valley, `(1 − x)² + 100 (y − x²)²`, as two residuals.
    struct Valley {
        at: [f64; 2],
        refused: usize,
    }

    impl Valley {
        fn residuals([x, y]: [f64; 2]) -> [f64; 2] {
            [1.0 - x, 10.0 * (y - x * x)]
        }

        fn cost(at: [f64; 2]) -> f64 {
            Self::residuals(at).iter().map(|r| r * r).sum()
        }
    }

    impl Descent for Valley {
        type Step = [f64; 2];

        fn step(&mut self, damping: f64) -> Option<[f64; 2]> {
            let (x, [r, s]) = (self.at[0], Self::residuals(self.at));
            let (a, b, c) = (1.0 + 400.0 * x * x, -200.0 * x, 100.0);
            let (g, h) = (-r - 20.0 * x * s, 10.0 * s);
            let (a, c) = (a * (1.0 + damping), c * (1.0 + damping));
            let det = a * c - b * b;
            (det > 0.0).then(|| [-(c * g - b * h) / det, -(a * h - b * g) / det])
        }

        fn attempt(&mut self, step: &[f64; 2]) -> Outcome {
            let trial = [self.at[0] + step[0], self.at[1] + step[1]];
            if step[0].hypot(step[1]) < 1e-12 {
                return Outcome::Over;
            }
            if Self::cost(trial) < Self::cost(self.at) {
                self.at = trial;
                Outcome::Lower
            } else {
                self.refused += 1;
                Outcome::Refused
            }
        }
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_minimum() {
        let mut valley = Valley { at: [-1.2, 1.0], refused: 0 };
        descend(&mut valley, &SCHEDULE, 100);
        assert!((valley.at[0] - 1.0).abs() < 1e-9 && (valley.at[1] - 1.0).abs() < 1e-9, "{:?}", valley.at);
        assert!(valley.refused > 0, "the valley is curved: a step of full length must have been refused");
    }

    /// Nothing that it tries is any better, and nothing can be solved below a damping of 1.
    struct Stuck {
        tried: Vec<f64>,
    }

    impl Descent for Stuck {
        type Step = f64;

        fn step(&mut self, damping: f64) -> Option<f64> {
            self.tried.push(damping);
            (damping >= 1.0).then_some(damping)
        }

        fn attempt(&mut self, _: &f64) -> Outcome {
            Outcome::Refused
        }
    }

    #[test]
    fn a_descent_ends_where_its_schedule_says() {
        let mut stuck = Stuck { tried: Vec::new() };
        descend(&mut stuck, &Schedule { first: 0.0, refused: 1e-2, most: 50.0, ..SCHEDULE }, 100);
        assert_eq!(stuck.tried.len(), 5, "0, 0.01, 0.1, 1, 10; 100 is above 50: {:?}", stuck.tried);
        stuck.tried.clear();
        descend(&mut stuck, &Schedule { singular: Singular::Ends, ..SCHEDULE }, 100);
        assert!(
            stuck.tried.len() == 1 && stuck.tried[0].to_bits() == 1e-3_f64.to_bits(),
            "{:?}",
            stuck.tried
        );
        stuck.tried.clear();
        descend(&mut stuck, &SCHEDULE, 3);
        assert_eq!(stuck.tried.len(), 3);
    }

    #[test]
    fn a_kept_step_lowers_the_damping_to_the_least() {
        let schedule = Schedule { least: 1e-9, negligible: 1e-9, ..SCHEDULE };
        assert!((schedule.lowered(1e-3) - 1e-4).abs() < 1e-18);
        let least = |damping| schedule.lowered(damping).to_bits() == schedule.least.to_bits();
        assert!(least(1e-9) && least(2e-9));
        let schedule = Schedule { least: 0.0, negligible: 1e-6, ..SCHEDULE };
        let least = |damping| schedule.lowered(damping).to_bits() == schedule.least.to_bits();
        assert!(least(1e-6) && least(0.0) && !least(1e-5));
    }
}
