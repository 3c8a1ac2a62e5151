//! Results as they stand in files.

use nalgebra::{Matrix3, Vector3};
use quest_core::feasibility::Feasibility;
use quest_core::simulate::{rotation_metric, translation_metric};
use quest_core::{Candidate, Candidates, Correspondence, RelativePose};
use serde::Serialize;

use crate::{ThirdViewRecord, Truth};

/// The result of one solve, candidates best first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SolveRecord {
    /// What the input calls the pair.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The name of the solver.
    pub solver: &'static str,
    /// How many matches were solved.
    pub matches: usize,
    /// Why there is nothing but this: the pair could not be read, or its matches cannot be solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Why the matches determine no pose, or only a part of one: a name of [`quest_core::Degeneracy`].
    pub degeneracy: Option<&'static str>,
    /// What decides whether a candidate is feasible, where it is not positive depth: a name of
    /// [`quest_core::feasibility::Feasibility`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feasibility: Option<&'static str>,
    /// What a third view says, where there is one: the first candidate is its choice.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub third_view: Option<ThirdViewRecord>,
    /// The poses that may be the true one.
    pub candidates: Vec<CandidateRecord>,
}

/// One candidate. Numbers that are not determined are `None`, or `null` in files.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CandidateRecord {
    /// A name of [`quest_core::CandidateKind`].
    pub kind: &'static str,
    /// The rotation as a unit quaternion `w, x, y, z` with `w >= 0`: `X2 = R_21 X1 + t_21`.
    pub q_21: [f64; 4],
    /// The rows of the rotation matrix.
    #[serde(rename = "R_21")]
    pub r_21: [[f64; 3]; 3],
    /// The translation. The mean absolute depth over both views is 1, so its length is the parallax.
    pub t_21: [f64; 3],
    /// The depth of each match in view 1.
    pub depths1: Vec<Option<f64>>,
    /// The depth of each match in view 2.
    pub depths2: Vec<Option<f64>>,
    /// Root mean square angle in radians by which bearings would have to turn to satisfy the pose.
    pub residual: f64,
    /// How many matches have positive depth in both views.
    pub in_front: usize,
    /// Whether all of them have, or, where another test was chosen, whether the candidate passes it.
    pub feasible: bool,
    /// The angle in degrees to the true rotation, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_error_deg: Option<f64>,
    /// The angle in degrees to the true direction of translation, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translation_error_deg: Option<f64>,
    /// The paper's metric (61) in radians: half the angle to the true rotation, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_metric_rad: Option<f64>,
    /// The paper's metric (62) in radians: the angle between the translations whatever their signs, where the true one is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translation_metric_rad: Option<f64>,
}

impl SolveRecord {
    /// The record of what `solver` found for `matches`.
    #[must_use]
    pub fn new(
        name: Option<String>,
        solver: &'static str,
        matches: &[Correspondence],
        found: &Candidates,
        truth: &Truth,
    ) -> Self {
        Self {
            name,
            solver,
            matches: matches.len(),
            reason: None,
            degeneracy: found.degeneracy().map(quest_core::Degeneracy::name),
            feasibility: None,
            third_view: None,
            candidates: found.iter().map(|c| CandidateRecord::new(c, matches, truth)).collect(),
        }
    }

    /// The record of a pair that could not be read, or not be solved, and why.
    #[must_use]
    pub fn unanswered(name: Option<String>, solver: &'static str, reason: String) -> Self {
        Self {
            name,
            solver,
            matches: 0,
            reason: Some(reason),
            degeneracy: None,
            feasibility: None,
            third_view: None,
            candidates: Vec::new(),
        }
    }

    /// The same with another test of feasibility. `found` are the candidates of the record, in its order.
    #[must_use]
    pub fn judged_by(
        mut self,
        feasibility: Feasibility,
        found: &[Candidate],
        matches: &[Correspondence],
    ) -> Self {
        for (record, candidate) in self.candidates.iter_mut().zip(found) {
            record.feasible = feasibility.accepts(candidate, matches);
        }
        self.feasibility = (feasibility != Feasibility::default()).then_some(feasibility.name());
        self
    }

    /// Removes the candidates that are not feasible and returns how many there were.
    pub fn drop_unfeasible(&mut self) -> usize {
        let before = self.candidates.len();
        self.candidates.retain(|c| c.feasible);
        before - self.candidates.len()
    }
}

impl CandidateRecord {
    /// The record of one candidate for `matches`.
    #[must_use]
    pub fn new(candidate: &Candidate, matches: &[Correspondence], truth: &Truth) -> Self {
        let pose = &candidate.pose;
        let (depths1, depths2) = matches.iter().map(|m| depths(pose, m)).unzip();
        Self {
            kind: candidate.kind.name(),
            q_21: pose.wxyz().map(unsigned_zero),
            r_21: rows(&pose.r_21()),
            t_21: <[f64; 3]>::from(pose.t_21).map(unsigned_zero),
            depths1,
            depths2,
            residual: candidate.residual,
            in_front: candidate.in_front,
            feasible: candidate.in_front == matches.len(),
            rotation_error_deg: truth.rotation_error_deg(pose),
            translation_error_deg: truth.translation_error_deg(pose),
            rotation_metric_rad: truth.q_21.map(|q| rotation_metric(&q, &pose.q_21)),
            translation_metric_rad: truth.t_21.map(|t| translation_metric(&of_usual_length(t), &pose.t_21)),
        }
    }
}

/// A vector whose length can be squared; zero stays zero.
fn of_usual_length(t: Vector3<f64>) -> Vector3<f64> {
    if t.amax() > 0.0 { t.unscale(t.amax()) } else { t }
}

fn depths(pose: &RelativePose, m: &Correspondence) -> (Option<f64>, Option<f64>) {
    let finite = |z: f64| z.is_finite().then_some(z);
    pose.depths(m).map_or((None, None), |(z1, z2)| (finite(z1), finite(z2)))
}

pub(crate) fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    let columns: [[f64; 3]; 3] = m.transpose().into();
    columns.map(|row| row.map(unsigned_zero))
}

/// Writes `-0.0` as `0.0`.
pub(crate) fn unsigned_zero(x: f64) -> f64 {
    x + 0.0
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use quest_core::{CandidateKind, correspondence};

    use super::*;

    fn record(t_21: Vector3<f64>, truth: Truth) -> CandidateRecord {
        let x1 = [[0.0, 0.0], [0.1, 0.0]];
        let x2 = [[0.0, 0.0], [0.2, 0.1]];
        let matches = correspondence::from_image_points(&x1, &x2).unwrap();
        let pose = RelativePose::new(UnitQuaternion::identity(), t_21);
        let candidate = Candidate { kind: CandidateKind::Exact, pose, residual: 0.0, in_front: 1 };
        CandidateRecord::new(&candidate, &matches, &truth)
    }

    #[test]
    fn depths_that_are_not_determined_are_none() {
        let moved = record(Vector3::new(1.0, 0.0, 0.0), Truth::default());
        // The first two rays are parallel.
        assert_eq!((moved.depths1[0], moved.depths1[1].is_some()), (None, true));
        let turned = record(Vector3::zeros(), Truth::default());
        assert_eq!((turned.depths1, turned.depths2), (vec![None; 2], vec![None; 2]));
    }

    #[test]
    fn errors_are_there_where_the_truth_is() {
        let t = Vector3::new(1.0, 0.0, 0.0);
        let none = record(t, Truth::default());
        assert_eq!((none.rotation_error_deg, none.translation_error_deg), (None, None));
        // Also lengths that cannot be squared have a direction.
        for length in [1e-200, 1.0, 1e200] {
            let q_21 = Some(UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0_f64.to_radians()));
            let known = record(t, Truth { q_21, t_21: Some(Vector3::new(0.0, length, 0.0)) });
            assert!((known.rotation_error_deg.unwrap() - 1.0).abs() < 1e-12);
            assert!((known.translation_error_deg.unwrap() - 90.0).abs() < 1e-12);
            // (61) is half the angle; (62) ignores the sign.
            assert!((known.rotation_metric_rad.unwrap() - 0.5_f64.to_radians()).abs() < 1e-12);
            assert!((known.translation_metric_rad.unwrap() - 90.0_f64.to_radians()).abs() < 1e-12);
        }
        let standing = record(t, Truth { q_21: None, t_21: Some(Vector3::zeros()) });
        assert_eq!(standing.translation_error_deg, None);
    }

    #[test]
    fn feasible_is_all_in_front() {
        assert!(!record(Vector3::zeros(), Truth::default()).feasible);
    }
}
