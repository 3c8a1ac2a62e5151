//! Real solutions, and comparing sets of rotations.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use quest_core::Correspondence;

use crate::literal_quest::{Solution, System, solve};
use crate::quartics::{Match, quartics};

/// A solution counts as real below this imaginary part. Polished simple solutions have 1e-12 or less.
const REAL: f64 = 1e-7;

/// The matches as pairs of unit bearings.
///
/// # Panics
/// If there are not five.
#[must_use]
pub fn five_bearings(matches: &[Correspondence]) -> [Match; 5] {
    assert_eq!(matches.len(), 5);
    [0, 1, 2, 3, 4].map(|i| (*matches[i].bearing1(), *matches[i].bearing2()))
}

/// A fixed pair of generic rotations, so that no solution of an everyday problem has q1 = 0.
#[must_use]
pub fn generic_rotations() -> (UnitQuaternion<f64>, UnitQuaternion<f64>) {
    (
        UnitQuaternion::from_scaled_axis(Vector3::new(0.61, -0.23, 0.47)),
        UnitQuaternion::from_scaled_axis(Vector3::new(-0.35, 0.83, 0.19)),
    )
}

/// What the literal method finds for a problem.
#[derive(Clone, Debug)]
pub struct Literal {
    /// Every solution, polished, each once.
    pub all: Vec<Solution>,
    /// The rotations of the real ones among them, each once.
    pub real: Vec<UnitQuaternion<f64>>,
    /// The quartics.
    pub system: System,
}

/// Solves a problem by section 7.1 and sorts out the real solutions.
#[must_use]
pub fn literal(matches: &[Match; 5]) -> Literal {
    let system = System::new(&quartics(matches));
    let all = system.distinct(&solve(matches, generic_rotations()));
    let mut real: Vec<UnitQuaternion<f64>> = Vec::new();
    for q in &all {
        let imaginary = q.iter().fold(0.0_f64, |largest, c| largest.max(c.im.abs()));
        let [w, x, y, z] = q.map(|c| c.re);
        let q_21 = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        if imaginary < REAL && !real.iter().any(|r| angle_between(r, &q_21) < 1e-9) {
            real.push(q_21);
        }
    }
    Literal { all, real, system }
}

/// The angle of the rotation from one to the other, accurate where it is small.
#[must_use]
pub fn angle_between(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    let d = a.inverse() * b;
    2.0 * d.imag().norm().atan2(d.w.abs())
}

/// The angle to the nearest of a set of rotations; infinite for an empty set.
pub fn nearest<'a>(q: &UnitQuaternion<f64>, set: impl IntoIterator<Item = &'a UnitQuaternion<f64>>) -> f64 {
    set.into_iter().map(|other| angle_between(q, other)).fold(f64::INFINITY, f64::min)
}
