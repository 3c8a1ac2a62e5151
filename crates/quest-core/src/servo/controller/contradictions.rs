//! Whether the motion that was commanded confirms what the estimator says.

use crate::servo::controller::state::State;
use crate::servo::controller::watchdog::LEAST;

/// How often the estimator has begun anew because the motion contradicted it, without a pose that the motion confirmed in between. An
/// estimator may be wrong once. One that is wrong again and again sees a robot that does not do what it is told.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Contradictions {
    in_a_row: u8,
    /// The restarts of the estimator that have been counted.
    restarts: usize,
    /// Images followed at full speed since the last one.
    tracked: usize,
}

impl Contradictions {
    /// So many images at full speed are no chance.
    const ENOUGH: usize = 15;
    /// So many in a row are a divergence.
    const MOST: u8 = 4;

    /// Counts what the estimator did at this image, unless the goal is so near that noise may contradict the motion.
    pub(crate) fn count(&mut self, restarts: usize, state: State, potential: Option<f64>) {
        if !potential.is_some_and(|value| value > LEAST) {
            self.expect(restarts);
        }
        if restarts > self.restarts {
            (self.restarts, self.tracked) = (restarts, 0);
            self.in_a_row = self.in_a_row.saturating_add(1);
        }
        self.tracked += usize::from(state == State::Tracking);
        if self.tracked >= Self::ENOUGH {
            self.in_a_row = 0;
        }
    }

    /// The estimator has begun anew for another reason.
    pub(crate) fn expect(&mut self, restarts: usize) {
        self.restarts = restarts;
    }

    /// Whether there have been as many in a row as make a divergence. The next one then is the second in a row.
    pub(crate) fn are_a_divergence(&mut self) -> bool {
        let are = self.in_a_row >= Self::MOST;
        if are {
            self.in_a_row = 1;
        }
        are
    }

    /// The share of its speed that a camera is trusted with until the motion confirms the pose: each contradiction halves it, so that
    /// a camera that goes astray does not go far.
    pub(crate) fn trust(self) -> f64 {
        0.5_f64.powi(i32::from(self.in_a_row.min(Self::MOST)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_at_full_speed_clear_a_contradiction() {
        for (state, trust) in [(State::Tracking, 1.0), (State::Confirming, 0.5)] {
            let mut contradictions = Contradictions::default();
            contradictions.count(1, State::Confirming, Some(1.0));
            for _ in 1..Contradictions::ENOUGH {
                contradictions.count(1, state, Some(1.0));
                assert!((contradictions.trust() - 0.5).abs() <= 0.0);
            }
            contradictions.count(1, state, Some(1.0));
            assert!((contradictions.trust() - trust).abs() <= 0.0, "{state:?}");
        }
    }
}
