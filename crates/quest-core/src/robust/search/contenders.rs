//! Hypotheses that score nearly as well as the best of those that were refined. Where a few matches decide between two minima of the
//! cost, the search may have refined but one of them.

use nalgebra::Matrix3;

/// A hypothesis contends if its cost is at most this multiple of the best one's. Five noisy matches make a hypothesis; what
/// refinement changes of its cost is of that order.
pub(crate) const CONTENDS: f64 = 1.2;

/// Essential matrices closer than this, as angles in their space, lead to the same minimum. Not sensitive between 0.02 and
/// 0.05.
const APART: f64 = 0.05;

/// So many are kept, and so many of these refined. Both bound the time. Measured: with two refined the AUC of the recorded pairs is 0.07
/// lower.
const KEPT: usize = 48;
const REFINED: usize = 4;

/// The best hypotheses that were not refined.
#[derive(Debug, Default)]
pub(crate) struct Contenders(Vec<(f64, Matrix3<f64>)>);

impl Contenders {
    /// Remembers a hypothesis with its cost.
    pub(crate) fn offer(&mut self, cost: f64, e: &Matrix3<f64>) {
        self.0.push((cost, *e));
        if self.0.len() == 2 * KEPT {
            self.sort();
            self.0.truncate(KEPT);
        }
    }

    /// The best of those whose cost is at most `most`, none of them close to another or to one of the `known`.
    pub(crate) fn distinct(mut self, most: f64, mut known: Vec<Matrix3<f64>>) -> Vec<Matrix3<f64>> {
        self.sort();
        let before = known.len();
        for (_, e) in self.0.iter().take_while(|(cost, _)| *cost <= most) {
            if known.len() == before + REFINED {
                break;
            }
            if known.iter().all(|other| are_apart(e, other)) {
                known.push(*e);
            }
        }
        known.split_off(before)
    }

    fn sort(&mut self) {
        self.0.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
}

/// Essential matrices have the norm √2, and any sign.
fn are_apart(a: &Matrix3<f64>, b: &Matrix3<f64>) -> bool {
    0.5 * a.dot(b).abs() < APART.cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Vector3};

    /// An essential matrix whose translation is turned by this.
    fn turned(angle: f64) -> Matrix3<f64> {
        let t = Rotation3::new(Vector3::z() * angle) * Vector3::x();
        t.cross_matrix() * Rotation3::new(Vector3::new(0.1, 0.2, -0.1))
    }

    #[test]
    fn the_best_are_refined_that_differ() {
        let mut contenders = Contenders::default();
        for (cost, angle) in [(3.0, 0.5), (1.0, 0.11), (2.0, 0.12), (1.5, 0.01), (4.0, 0.9)] {
            contenders.offer(cost, &turned(angle));
        }
        // One is close to what is known, one to a better one, one costs too much. The sign of a matrix says nothing.
        let found = contenders.distinct(3.5, vec![-turned(0.0)]);
        assert_eq!(found, [turned(0.11), turned(0.5)]);
    }

    #[test]
    fn the_best_of_many_are_kept() {
        let mut contenders = Contenders::default();
        for k in 0..1_000_u32 {
            // In no order: 7 and 1,000 have no common divisor.
            let place = f64::from(7 * k % 1_000);
            contenders.offer(place, &turned(2.0 * APART * place));
        }
        let found = contenders.distinct(f64::INFINITY, Vec::new());
        let expected: Vec<_> = [0.0, 1.0, 2.0, 3.0].map(|place| turned(2.0 * APART * place)).into();
        assert_eq!(found, expected);
    }
}
