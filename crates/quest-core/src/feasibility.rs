//! Which poses a real pair of cameras can have: positive depths, and theorem 2 of the paper's appendix B.

use std::str::FromStr;

use nalgebra::{UnitQuaternion, Vector2};

use crate::{Candidate, Correspondence, RelativePose};

/// Which test decides whether a candidate is feasible.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Feasibility {
    /// Every match has positive depth in both views, as [`Candidate::in_front`] counts them: exact.
    #[default]
    PositiveDepth,
    /// Theorem 2 of appendix B, [`theorem_2`]. It keeps fewer candidates, and none of cameras that look back at the points from
    /// their far side.
    Theorem2,
}

impl Feasibility {
    /// Every choice, the default first.
    pub const CHOICES: [Self; 2] = [Self::PositiveDepth, Self::Theorem2];

    /// The name on the command line, in Python and in files: `positive-depth`, `theorem-2`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::PositiveDepth => "positive-depth",
            Self::Theorem2 => "theorem-2",
        }
    }

    /// Whether a candidate for these matches is feasible.
    #[must_use]
    pub fn accepts(self, candidate: &Candidate, matches: &[Correspondence]) -> bool {
        match self {
            Self::PositiveDepth => candidate.in_front == matches.len(),
            Self::Theorem2 => theorem_2(&candidate.pose, matches),
        }
    }
}

/// No test of feasibility has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("feasibility is {found:?}, expected one of {}", Feasibility::CHOICES.map(Feasibility::name).join(", "))]
pub struct UnknownFeasibility {
    /// The name that was asked for.
    pub found: String,
}

impl FromStr for Feasibility {
    type Err = UnknownFeasibility;

    fn from_str(name: &str) -> Result<Self, UnknownFeasibility> {
        let found = Self::CHOICES.into_iter().find(|choice| choice.name() == name);
        found.ok_or_else(|| UnknownFeasibility { found: name.to_owned() })
    }
}

/// How many matches have positive depth in both views: the exact test, and the default.
///
/// A match whose rays are parallel to rounding has no depth. It counts if the rays point the same way.
#[must_use]
pub fn in_front(pose: &RelativePose, matches: &[Correspondence]) -> usize {
    let positive = |m: &&Correspondence| match pose.depths(m) {
        Some((z1, z2)) => z1 > 0.0 && z2 > 0.0,
        None => (pose.q_21 * m.bearing1()).dot(m.bearing2()) > 0.0,
    };
    matches.iter().filter(positive).count()
}

/// Theorem 2 (appendix B) as the paper states it, with `t_xy` pointing from `O2` to `O1` as in the text at (B.2):
/// the printed "from O1 to O2" rejects every true pose.
///
/// It compares directions in the image plane of camera 1 alone. Condition (a) is a heuristic: it also rejects
/// a camera that looks back at the points from their far side. [`in_front`] is the exact test.
#[must_use]
pub fn theorem_2(pose: &RelativePose, matches: &[Correspondence]) -> bool {
    let compared = Compared::new(pose);
    matches.iter().all(|m| compared.verdict(m).is_feasible())
}

/// The conditions of [`theorem_2`], each over all matches.
#[must_use]
pub fn verdict(pose: &RelativePose, matches: &[Correspondence]) -> Verdict {
    let compared = Compared::new(pose);
    matches.iter().map(|m| compared.verdict(m)).fold(Verdict::FEASIBLE, Verdict::and)
}

/// What theorem 2 says of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// (a): the points that view 2 sees lie ahead of camera 1 too, `2z̃ > 0`.
    pub is_ahead: bool,
    /// (b): in the image plane of camera 1 the points are turned away from `t_xy` at least as far in view 1 as in view 2.
    pub turns_away: bool,
    /// (c): on the same side of it.
    pub stays_on_its_side: bool,
}

impl Verdict {
    const FEASIBLE: Self = Self { is_ahead: true, turns_away: true, stays_on_its_side: true };

    /// Whether all three conditions hold.
    #[must_use]
    pub fn is_feasible(&self) -> bool {
        self.is_ahead && self.turns_away && self.stays_on_its_side
    }

    fn and(self, other: Self) -> Self {
        Self {
            is_ahead: self.is_ahead && other.is_ahead,
            turns_away: self.turns_away && other.turns_away,
            stays_on_its_side: self.stays_on_its_side && other.stays_on_its_side,
        }
    }
}

/// What does not depend on the match.
struct Compared {
    to_frame_1: UnitQuaternion<f64>,
    t_xy: Vector2<f64>,
}

impl Compared {
    fn new(pose: &RelativePose) -> Self {
        let to_frame_1 = pose.q_21.inverse();
        Self { to_frame_1, t_xy: (to_frame_1 * pose.t_21).xy() }
    }

    fn verdict(&self, m: &Correspondence) -> Verdict {
        // Rounding of unit vectors: equality must not be lost where a point does not move.
        const SLACK: f64 = 1e-12;
        let s2 = self.to_frame_1 * m.bearing2();
        let (v1, v2, t_xy) = (m.bearing1().xy(), s2.xy(), &self.t_xy);
        let (side1, side2) = (t_xy.perp(&v1), t_xy.perp(&v2));
        let angle1 = side1.abs().atan2(t_xy.dot(&v1));
        let angle2 = side2.abs().atan2(t_xy.dot(&v2));
        let rounding = SLACK * t_xy.norm();
        Verdict {
            is_ahead: s2.z > 0.0,
            turns_away: angle2 <= angle1 + SLACK / v1.norm().min(v2.norm()).max(SLACK),
            stays_on_its_side: side1.signum() == side2.signum()
                || side1.abs() <= rounding
                || side2.abs() <= rounding,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Candidates;
    use crate::simulate::{Scene, SceneOptions};
    use crate::solver::{Kinds, PoseSolver, Quest};
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Points in front of two cameras that look the same way, up to half a radian.
    fn scene(rng: &mut ChaCha8Rng) -> (RelativePose, Vec<Correspondence>) {
        let mut vector = |s: f64| Vector3::from_fn(|_, _| rng.random_range(-s..s));
        loop {
            let pose = RelativePose::new(UnitQuaternion::new(vector(0.5)), vector(1.0));
            let points: Vec<_> = (0..5).map(|_| vector(1.0) + Vector3::new(0.0, 0.0, 3.0)).collect();
            let matches: Option<Vec<_>> = points.iter().map(|x1| seen(&pose, x1)).collect();
            if let Some(matches) = matches {
                return (pose, matches);
            }
        }
    }

    /// The match of a point, where the point is in front of both cameras and camera 2 does not look back at it.
    fn seen(pose: &RelativePose, x1: &Vector3<f64>) -> Option<Correspondence> {
        let x2 = pose.q_21 * x1 + pose.t_21;
        let forward = (pose.q_21.inverse() * x2).z > 0.0;
        (x2.z > 0.0 && forward).then(|| Correspondence::from_bearings((*x1).into(), x2.into()).unwrap())
    }

    #[test]
    fn true_poses_are_feasible() {
        let mut rng = ChaCha8Rng::seed_from_u64(10_000);
        for k in 0..10_000 {
            let (pose, matches) = scene(&mut rng);
            assert!(theorem_2(&pose, &matches), "scene {k}");
            assert_eq!(in_front(&pose, &matches), 5, "scene {k}");
        }
    }

    #[test]
    fn reversed_translations_are_not() {
        let mut rng = ChaCha8Rng::seed_from_u64(10_001);
        for k in 0..1_000 {
            let (pose, matches) = scene(&mut rng);
            let reversed = RelativePose::new(pose.q_21, -pose.t_21);
            assert_eq!(in_front(&reversed, &matches), 0, "scene {k}");
            assert!(!theorem_2(&reversed, &matches), "scene {k}");
        }
    }

    #[test]
    fn theorem_2_keeps_fewer_candidates_and_not_one_true_pose_less() {
        const SCENES: u64 = 1_000;
        let (mut kept, mut true_ones, mut all) = ([0; 2], [0; 2], 0);
        for index in 0..SCENES {
            let scene = Scene::generate(&SceneOptions::realistic(), 10_002, index).unwrap();
            let mut found = Candidates::new();
            Quest { kinds: Kinds::Exact }.solve(&scene.matches, &mut found);
            all += found.len();
            for (k, test) in Feasibility::CHOICES.into_iter().enumerate() {
                let feasible: Vec<_> = found.iter().filter(|c| test.accepts(c, &scene.matches)).collect();
                kept[k] += feasible.len();
                let is_true = |c: &&Candidate| {
                    c.pose.rotation_error(&scene.truth) < 1e-6
                        && (c.pose.t_21 - scene.truth.t_21).norm() < 1e-5
                };
                true_ones[k] += usize::from(feasible.iter().any(is_true));
            }
        }
        let mean = |count: usize| count as f64 / SCENES as f64;
        assert_eq!(true_ones, [1_000; 2]);
        // Counts: only rounding at the edge of a condition may change one of them.
        assert!((mean(all) - 9.708).abs() < 0.02, "{}", mean(all));
        assert!((mean(kept[0]) - 3.076).abs() < 0.01 && (mean(kept[1]) - 2.292).abs() < 0.01, "{kept:?}");
    }

    #[test]
    fn names_are_read_back() {
        for choice in Feasibility::CHOICES {
            assert_eq!(choice.name().parse(), Ok(choice));
        }
        let error = "theorem-3".parse::<Feasibility>().unwrap_err().to_string();
        assert_eq!(error, "feasibility is \"theorem-3\", expected one of positive-depth, theorem-2");
    }

    #[test]
    fn theorem_2_rejects_a_camera_that_looks_back() {
        // Camera 2 stands behind the points and looks back at camera 1.
        let half_turn = UnitQuaternion::new(Vector3::new(0.0, std::f64::consts::PI, 0.0));
        let pose = RelativePose::new(half_turn, Vector3::new(0.1, 0.0, 8.0));
        let points =
            [[0.3, 0.1, 3.0], [-0.5, 0.4, 4.0], [0.2, -0.6, 3.5], [-0.4, -0.3, 5.0], [0.7, 0.5, 4.5]];
        let matches = points.map(|x1| {
            let x2 = pose.q_21 * Vector3::from(x1) + pose.t_21;
            Correspondence::from_bearings(x1, x2.into()).unwrap()
        });
        assert_eq!(in_front(&pose, &matches), 5);
        assert!(!theorem_2(&pose, &matches));
    }

    #[test]
    fn every_condition_of_theorem_2_is_over_all_matches() {
        let pose = RelativePose::new(UnitQuaternion::identity(), Vector3::new(1.0, 0.0, 0.0));
        let good = seen(&pose, &Vector3::new(0.3, 0.4, 3.0)).unwrap();
        // Along the translation a point is on neither side.
        let along = seen(&pose, &Vector3::new(0.5, 0.0, 3.0)).unwrap();
        let behind = Correspondence::from_bearings([0.1, 0.2, 1.0], [0.1, 0.2, -1.0]).unwrap();
        let turned_back = Correspondence::from_image_points([0.3, 0.1], [0.1, 0.1]).unwrap();
        let across = Correspondence::from_image_points([0.1, 0.2], [0.4, -0.2]).unwrap();
        let conditions = |matches: &[Correspondence]| {
            let Verdict { is_ahead, turns_away, stays_on_its_side } = verdict(&pose, matches);
            [is_ahead, turns_away, stays_on_its_side]
        };
        assert_eq!(verdict(&pose, &[good, along]), Verdict::FEASIBLE);
        assert!(verdict(&pose, &[]).is_feasible());
        for (bad, which) in [(behind, 0), (turned_back, 1), (across, 2)] {
            // Wherever it stands among the others.
            for matches in [[bad, good, along], [good, bad, along], [good, along, bad]] {
                assert!(!conditions(&matches)[which], "condition {which}");
                assert!(!theorem_2(&pose, &matches));
            }
        }
        let all = [behind, turned_back, across, good];
        assert_eq!(conditions(&all), [false; 3]);
    }
}
