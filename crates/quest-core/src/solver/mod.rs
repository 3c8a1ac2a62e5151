//! The pose solvers, one file each, behind one small trait.

#[cfg(feature = "faer")]
mod literal;
mod many_matches;
mod published;
mod quaternions;
pub mod quest;
pub(crate) mod shared;

use std::str::FromStr;

#[cfg(feature = "faer")]
pub use literal::{quest_literal, relinearization_literal};
pub use published::{eight_point, homography, kneip, kukelova, li_hartley, nister, stewenius};
pub use quaternions::{quest_eigen, relinearization};

pub use eight_point::EightPoint;
pub use homography::Homography;
pub use kneip::Kneip;
pub use kukelova::Kukelova;
pub use li_hartley::LiHartley;
pub use nister::Nister;
pub use quest::Quest;
pub use quest_eigen::QuestEigen;
#[cfg(feature = "faer")]
pub use quest_literal::QuestLiteral;
pub use relinearization::Relinearization;
#[cfg(feature = "faer")]
pub use relinearization_literal::RelinearizationLiteral;
pub use stewenius::Stewenius;

use crate::{Candidates, Correspondence};

/// Which candidates a solver returns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Kinds {
    /// Every kind that the solver has: real solutions, real parts of complex ones, the rotation-only candidate.
    #[default]
    All,
    /// The real solutions alone.
    Exact,
    /// Every kind, and the motions of a plane if one explains the matches: for scenes that may be flat. [`Quest`],
    /// [`QuestEigen`] and [`Relinearization`] have them. For the other solvers this is the same as [`Kinds::All`].
    Planar,
}

impl Kinds {
    /// Every choice, the default first.
    pub const CHOICES: [Self; 3] = [Self::All, Self::Exact, Self::Planar];

    /// The name on the command line, in Python and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Exact => "exact",
            Self::Planar => "planar",
        }
    }

    /// The kinds that remain for a solver after the motions of a plane were added.
    pub(crate) fn without_plane(self) -> Self {
        if self == Self::Planar { Self::All } else { self }
    }
}

/// No choice of candidates has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("kinds is {found:?}, expected one of {}", Kinds::CHOICES.map(Kinds::name).join(", "))]
pub struct UnknownKinds {
    /// The name that was asked for.
    pub found: String,
}

impl FromStr for Kinds {
    type Err = UnknownKinds;

    fn from_str(name: &str) -> Result<Self, UnknownKinds> {
        let found = Self::CHOICES.into_iter().find(|kinds| kinds.name() == name);
        found.ok_or_else(|| UnknownKinds { found: name.to_owned() })
    }
}

/// A solver: candidate poses from matches.
pub trait PoseSolver {
    /// The name on the command line and in files.
    const NAME: &'static str;
    /// The smallest number of matches it works with.
    const MIN_MATCHES: usize;

    /// Fills `out` with the candidates, best first. With no pose to be found `out` is left empty and says
    /// why in [`Candidates::degeneracy`].
    fn solve(&self, matches: &[Correspondence], out: &mut Candidates);
}

/// A solver chosen at run time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum SolverName {
    /// [`Quest`].
    Quest,
    /// [`QuestEigen`].
    QuestEigen,
    /// [`Relinearization`].
    Relinearization,
    /// [`Nister`].
    Nister,
    /// [`Stewenius`].
    Stewenius,
    /// [`LiHartley`].
    LiHartley,
    /// [`Kukelova`].
    Kukelova,
    /// [`Kneip`].
    Kneip,
    /// [`Homography`].
    Homography,
    /// [`EightPoint`].
    EightPoint,
    /// [`QuestLiteral`].
    #[cfg(feature = "faer")]
    QuestLiteral,
    /// [`RelinearizationLiteral`].
    #[cfg(feature = "faer")]
    RelinearizationLiteral,
}

/// What the table of solvers says of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SolverInfo {
    /// The name on the command line and in files.
    pub name: &'static str,
    /// The smallest number of matches.
    pub min_matches: usize,
    /// The largest number of candidates of [`Kinds::All`]; [`SolverName::most_candidates`] tells it for the other kinds.
    pub max_candidates: usize,
    /// Where the method was published.
    pub reference: &'static str,
    /// What the method as published is known to lose, counted; empty where it finds every pose of the tests.
    pub lost: &'static str,
}

/// No solver has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no solver {found:?}, expected one of {}", SolverName::named().map(|s| s.info().name).collect::<Vec<_>>().join(", "))]
pub struct UnknownSolver {
    /// The name that was asked for.
    pub found: String,
}

impl SolverName {
    /// Every solver of the table, in its order; the first is the default.
    pub const ALL: [Self; 10] = [
        Self::Quest,
        Self::QuestEigen,
        Self::Relinearization,
        Self::Nister,
        Self::Stewenius,
        Self::LiHartley,
        Self::Kukelova,
        Self::Kneip,
        Self::Homography,
        Self::EightPoint,
    ];

    /// The paper's two algorithms as it prints them: slow, for comparing with it. They have to be asked for by name.
    #[cfg(feature = "faer")]
    pub const LITERAL: [Self; 2] = [Self::QuestLiteral, Self::RelinearizationLiteral];

    /// Every solver that has a name: [`Self::ALL`], and those of the feature `faer`.
    pub fn named() -> impl Iterator<Item = Self> {
        #[cfg(feature = "faer")]
        let literal = Self::LITERAL;
        #[cfg(not(feature = "faer"))]
        let literal = [];
        Self::ALL.into_iter().chain(literal)
    }

    /// The table's row.
    #[must_use]
    pub fn info(self) -> SolverInfo {
        fn of<S: PoseSolver>(max_candidates: usize, reference: &'static str) -> SolverInfo {
            SolverInfo { name: S::NAME, min_matches: S::MIN_MATCHES, max_candidates, reference, lost: "" }
        }
        match self {
            Self::Quest => of::<Quest>(21, "this project; elimination of Nistér, PAMI 2004"),
            Self::QuestEigen => of::<QuestEigen>(21, "Fathian et al., RAS 2018, section 7.1"),
            Self::Relinearization => of::<Relinearization>(21, "Fathian et al., RAS 2018, section 7.2"),
            Self::Nister => of::<Nister>(20, "Nistér, PAMI 2004"),
            Self::Stewenius => of::<Stewenius>(20, "Stewénius, Engels, Nistér, ISPRS 2006"),
            Self::LiHartley => of::<LiHartley>(20, "Li, Hartley, ICPR 2006"),
            Self::Kukelova => of::<Kukelova>(20, "Kukelova, Bujnak, Pajdla, PAMI 2012"),
            Self::Kneip => of::<Kneip>(20, "Kneip, Siegwart, Pollefeys, ECCV 2012"),
            Self::Homography => of::<Homography>(4, "Ma, Soatto, Košecká, Sastry, 2004, section 5.3"),
            Self::EightPoint => of::<EightPoint>(2, "Hartley, PAMI 1997"),
            #[cfg(feature = "faer")]
            Self::QuestLiteral => SolverInfo {
                lost: quest_literal::LOST,
                ..of::<QuestLiteral>(20, "Fathian et al., RAS 2018, (41) to (44) as printed")
            },
            #[cfg(feature = "faer")]
            Self::RelinearizationLiteral => SolverInfo {
                lost: relinearization_literal::LOST,
                ..of::<RelinearizationLiteral>(20, "Fathian et al., RAS 2018, (45) to (55) as printed")
            },
        }
    }

    /// The largest number of candidates of these kinds: a plane may add the four motions of its homography.
    #[must_use]
    pub fn most_candidates(self, kinds: Kinds) -> usize {
        let all = self.info().max_candidates;
        if kinds == Kinds::Planar { (all + 4).min(Candidates::CAPACITY) } else { all }
    }

    /// Solves with this solver; see [`PoseSolver::solve`].
    pub fn solve(self, kinds: Kinds, matches: &[Correspondence], out: &mut Candidates) {
        match self {
            Self::Quest => Quest { kinds }.solve(matches, out),
            Self::QuestEigen => QuestEigen { kinds }.solve(matches, out),
            Self::Relinearization => Relinearization { kinds }.solve(matches, out),
            Self::Nister => Nister.solve(matches, out),
            Self::Stewenius => Stewenius { kinds }.solve(matches, out),
            Self::LiHartley => LiHartley { kinds }.solve(matches, out),
            Self::Kukelova => Kukelova { kinds }.solve(matches, out),
            Self::Kneip => Kneip { kinds }.solve(matches, out),
            Self::Homography => Homography.solve(matches, out),
            Self::EightPoint => EightPoint.solve(matches, out),
            #[cfg(feature = "faer")]
            Self::QuestLiteral => QuestLiteral { kinds }.solve(matches, out),
            #[cfg(feature = "faer")]
            Self::RelinearizationLiteral => RelinearizationLiteral { kinds }.solve(matches, out),
        }
    }
}

impl Default for SolverName {
    fn default() -> Self {
        Self::ALL[0]
    }
}

impl FromStr for SolverName {
    type Err = UnknownSolver;

    fn from_str(name: &str) -> Result<Self, UnknownSolver> {
        let found = Self::named().find(|s| s.info().name == name);
        found.ok_or_else(|| UnknownSolver { found: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Scene, SceneOptions};
    use crate::{CandidateKind, Degeneracy};

    fn solved(solver: SolverName, kinds: Kinds, matches: &[Correspondence]) -> Candidates {
        let mut found = Candidates::new();
        // What was in the list before has no say.
        found.set_degeneracy(Degeneracy::PureRotation);
        solver.solve(kinds, matches, &mut found);
        found
    }

    #[test]
    fn every_solver_says_why_it_has_no_pose() {
        let scene =
            Scene::generate(&SceneOptions { points: 12, ..SceneOptions::realistic() }, 31, 0).unwrap();
        for solver in SolverName::named() {
            let least = solver.info().min_matches;
            for kinds in Kinds::CHOICES {
                let name = format!("{}, {}", solver.info().name, kinds.name());
                for few in 0..least {
                    let found = solved(solver, kinds, &scene.matches[..few]);
                    assert_eq!(found.degeneracy(), Some(Degeneracy::TooFewMatches), "{name}: {few}");
                    assert!(found.is_empty(), "{name}: {few}");
                }
                // One match and the same again.
                let found = solved(solver, kinds, &[scene.matches[0]; 12]);
                assert!(found.is_empty() && found.degeneracy().is_some(), "{name}: {found:?}");
                // One match less than it takes, and one of them again.
                let mut doubled = scene.matches[..least].to_vec();
                doubled[least - 1] = doubled[0];
                let found = solved(solver, kinds, &doubled);
                assert!(found.is_empty() && found.degeneracy().is_some(), "{name}: {found:?}");
            }
        }
    }

    #[test]
    fn the_motions_of_a_plane_are_added_where_they_are_asked_for() {
        let plane = SceneOptions {
            points: 12,
            layout: crate::simulate::Layout::Coplanar,
            ..SceneOptions::realistic()
        };
        for index in 0..10 {
            let scene = Scene::generate(&plane, 32, index).unwrap();
            for solver in SolverName::named() {
                for kinds in Kinds::CHOICES {
                    let found = solved(solver, kinds, &scene.matches[..5]);
                    let name = format!("{}, {}, scene {index}", solver.info().name, kinds.name());
                    assert!(found.len() <= solver.most_candidates(kinds), "{name}: {}", found.len());
                    let planar = found.iter().filter(|c| c.kind == CandidateKind::Planar);
                    assert!(
                        kinds == Kinds::Planar || solver == SolverName::Homography || planar.count() == 0,
                        "{name}"
                    );
                }
                assert!(solver.most_candidates(Kinds::Planar) >= solver.most_candidates(Kinds::All));
                assert!(solver.most_candidates(Kinds::Planar) <= Candidates::CAPACITY);
            }
            let found = solved(SolverName::Quest, Kinds::Planar, &scene.matches[..5]);
            let is_true = |c: &crate::Candidate| c.pose.rotation_error(&scene.truth) < 1e-5;
            assert!(found.iter().any(is_true), "scene {index}");
        }
    }

    #[test]
    fn cameras_that_only_turn_have_their_rotation_and_no_translation() {
        let turn = nalgebra::UnitQuaternion::new(nalgebra::Vector3::new(0.2, -0.3, 0.4));
        let scene =
            Scene::generate(&SceneOptions { points: 12, ..SceneOptions::realistic() }, 33, 0).unwrap();
        let turned = |m: &Correspondence| {
            Correspondence::from_bearings((*m.bearing1()).into(), (turn * m.bearing1()).into()).unwrap()
        };
        let all: Vec<_> = scene.matches.iter().map(turned).collect();
        for solver in SolverName::named() {
            for kinds in Kinds::CHOICES {
                for count in [solver.info().min_matches, 12] {
                    let found = solved(solver, kinds, &all[..count]);
                    let name = format!("{}, {}, {count}", solver.info().name, kinds.name());
                    assert_eq!(found.degeneracy(), Some(Degeneracy::PureRotation), "{name}");
                    assert_eq!(found.len(), 1, "{name}");
                    assert_eq!(
                        (found[0].kind, found[0].in_front),
                        (CandidateKind::RotationOnly, count),
                        "{name}"
                    );
                    assert!(found[0].pose.q_21.angle_to(&turn) < 1e-12, "{name}");
                    assert!(found[0].pose.t_21.norm() <= 0.0, "{name}");
                }
            }
        }
        // Where four points of five are at infinity, the direction of the translation is open: whichever is the near one.
        for near in 0..5 {
            let mut five = all[..5].to_vec();
            five[near] = Correspondence::from_bearings([0.1, 0.2, 1.0], [0.5, -0.3, 1.0]).unwrap();
            let found = solved(SolverName::Quest, Kinds::All, &five);
            assert_eq!(found.degeneracy(), Some(Degeneracy::RankDeficient), "{near}: {found:?}");
            assert!(found.is_empty(), "{near}");
        }
    }

    #[test]
    fn the_true_pose_of_a_symmetric_scene_is_found() {
        use nalgebra::{UnitQuaternion, Vector3};
        // Corners of a square and a point on its axis: solutions come in groups, and some of them run together.
        let points =
            [[1.0, 1.0, 4.0], [-1.0, 1.0, 4.0], [-1.0, -1.0, 4.0], [1.0, -1.0, 4.0], [0.0, 0.0, 3.0]];
        let quarter = std::f64::consts::FRAC_PI_2;
        for turn in [[0.0; 3], [0.0, 0.2, 0.0], [0.0, 0.0, quarter], [0.1, 0.1, 0.0]] {
            for t_21 in [[0.5, 0.0, 0.0], [0.0, 0.4, 0.0], [0.3, -0.2, 0.4]] {
                let truth = crate::RelativePose::new(UnitQuaternion::new(turn.into()), t_21.into());
                let matches = points.map(|x1| {
                    let x2 = truth.q_21 * Vector3::from(x1) + truth.t_21;
                    Correspondence::from_bearings(x1, x2.into()).unwrap()
                });
                for solver in
                    [SolverName::Quest, SolverName::Nister, SolverName::Stewenius, SolverName::LiHartley]
                {
                    let found = solved(solver, Kinds::All, &matches);
                    let off = |c: &crate::Candidate| c.pose.rotation_error(&truth);
                    let least = found.iter().map(off).fold(f64::INFINITY, f64::min);
                    // A double solution has half of the digits.
                    assert!(least < 1e-5, "{}, {turn:?}, {t_21:?}: {least}", solver.info().name);
                    assert!(found.iter().all(|c| c.pose.q_21.coords.iter().all(|x| x.is_finite())));
                }
            }
        }
    }

    #[test]
    fn points_on_a_line_of_both_views_have_no_pose() {
        let on_line = |k: u32| {
            let s = 0.1 * f64::from(k) - 0.3;
            Correspondence::from_image_points([s, 0.5 * s + 0.1], [0.8 * s + 0.1 * s * s, 0.2]).unwrap()
        };
        let matches: Vec<_> = (0..12).map(on_line).collect();
        for solver in SolverName::named() {
            for count in [solver.info().min_matches, 12] {
                let found = solved(solver, Kinds::All, &matches[..count]);
                let name = solver.info().name;
                assert!(found.is_empty(), "{name}, {count}: {found:?}");
                assert_eq!(found.degeneracy(), Some(Degeneracy::Collinear), "{name}, {count}");
            }
        }
    }

    #[test]
    fn a_solver_is_found_by_its_name() {
        for solver in SolverName::named() {
            assert_eq!(solver.info().name.parse(), Ok(solver));
        }
        assert_eq!("none".parse::<SolverName>(), Err(UnknownSolver { found: "none".to_owned() }));
    }
}
