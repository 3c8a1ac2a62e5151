//! Every solver from outside: one list of laws, one line a solver.
//!
//! Against planted truth, under the symmetries of the problem, with bad input, against the literal method of section 7.1,
//! and against each other.
#![expect(clippy::unwrap_used, reason = "laws are tests, and fail as tests do")]

mod agreement;
mod bad_input;
mod candidates;
mod planes;
mod planted;
mod symmetries;

use nalgebra::UnitQuaternion;
use quest_core::simulate::{Layout, SceneOptions, View};
use quest_core::solver::{Kinds, SolverName};
use quest_core::{Candidate, CandidateKind, Candidates, Correspondence, RelativePose};
use quest_tests::scenes::solve;
use quest_tests::solution_sets::nearest;

/// A solver under test, and what it is known not to do: of the five-point solvers every solution comes to rounding, and
/// what else is lost is counted and bounded, at about twice what was found.
#[derive(Clone, Copy)]
struct Subject {
    solver: SolverName,
    /// The scenes that it is made for.
    scenes: SceneOptions,
    /// How many of 10,000 true poses without noise it may lose, over all angles and in realistic scenes.
    most_lost: [usize; 2],
    /// How many of 1,000 noisy problems may have other solutions after a change that should not matter, in number or
    /// by more than [`SAME`]: those with nearly double ones.
    most_different: usize,
    /// The smallest parallax at which it finds the true pose.
    smallest_parallax: f64,
    /// Scenes with little parallax of which it misses the true pose, out of 1,000 at each of eight parallaxes. In 391
    /// a second solution lies within 1.4e-4 of the parallax at every parallax, and rounding makes a complex
    /// pair of the two.
    missed_at_small_parallax: &'static [(View, usize)],
    /// One of so many scenes of each law is looked at: more than one for solvers that take a hundred times as long.
    one_of: u64,
    /// What else it may miss.
    missed: Missed,
}

/// How many scenes a solver may miss, of those that it looks at. Only the forms as the paper prints them miss any.
#[derive(Clone, Copy, Debug)]
struct Missed {
    /// True poses of coplanar points, over all angles and in realistic scenes.
    coplanar: [usize; 2],
    /// True poses of half turns.
    half_turns: usize,
    /// True poses of translations.
    translations: usize,
    /// Twisted partners with `q1 = 0`, or the poses that they belong to.
    partners: usize,
    /// True poses of more matches than five, of each number and view.
    more_matches: usize,
    /// Sets of real solutions of noisy problems, of each view.
    solution_sets: usize,
    /// Noisy problems that it has no candidate for, of each layout and view.
    unanswered: usize,
    /// The median error of the rotation for twenty matches with 0.1 px of noise, in radians.
    median_of_twenty: f64,
}

impl Missed {
    /// Nothing; 0.1 px are 0.1 mrad, and linear estimates of twenty points magnify them by some ten.
    const NOTHING: Self = Self {
        coplanar: [0, 0],
        half_turns: 0,
        translations: 0,
        partners: 0,
        more_matches: 0,
        solution_sets: 0,
        unanswered: 0,
        median_of_twenty: 5e-3,
    };
}

impl Subject {
    fn new(solver: SolverName) -> Self {
        Self {
            solver,
            scenes: SceneOptions { points: solver.info().min_matches, ..SceneOptions::default() },
            most_lost: [0, 0],
            most_different: 0,
            smallest_parallax: f64::INFINITY,
            missed_at_small_parallax: &[],
            one_of: 1,
            missed: Missed::NOTHING,
        }
    }

    /// How many scenes of `count` it looks at.
    fn share(&self, count: u64) -> u64 {
        count.div_ceil(self.one_of)
    }

    fn solve(&self, kinds: Kinds, matches: &[Correspondence]) -> Candidates {
        solve(self.solver, kinds, matches)
    }

    fn exact(&self, matches: &[Correspondence]) -> Vec<RelativePose> {
        exact_poses(&self.solve(Kinds::Exact, matches))
    }

    /// Its scenes over all angles, and as a camera sees them.
    fn views(&self) -> [SceneOptions; 2] {
        let SceneOptions { layout, points, .. } = self.scenes;
        [self.scenes, SceneOptions { layout, points, ..SceneOptions::realistic() }]
    }
}

/// The laws, each a test of the solver's own.
macro_rules! laws {
    ($module:ident: $subject:expr; $($file:ident::$law:ident,)*) => {
        mod $module {
            #[allow(clippy::allow_attributes, unused_imports, reason = "most subjects need a few of them")]
            use super::{Layout, Missed, SceneOptions, SolverName, Subject, View};
            $(
                #[test]
                fn $law() {
                    crate::$file::$law(&$subject);
                }
            )*
        }
    };
    (any $module:ident: $subject:expr; $($file:ident::$law:ident,)*) => {
        laws! { $module: $subject;
            planted::true_poses_are_found,
            planted::more_matches_find_the_truth,
            symmetries::the_order_of_the_matches_does_not_matter,
            symmetries::rotating_the_cameras_rotates_the_poses,
            symmetries::exchanging_the_views_inverts_the_poses,
            symmetries::the_length_of_bearings_does_not_matter_to_the_rotation,
            candidates::candidates_are_finite_and_ranked,
            candidates::a_used_list_is_emptied_first,
            candidates::points_in_front_are_counted,
            candidates::noise_moves_the_pose_a_little,
            bad_input::bad_input_has_its_reason,
            bad_input::coarse_points_give_finite_candidates,
            bad_input::pure_rotations_are_named,
            $($file::$law,)*
        }
    };
    (five_point $module:ident: $subject:expr; $($file:ident::$law:ident,)*) => {
        laws! { any $module: $subject;
            planted::coplanar_scenes_are_found,
            planted::half_turns_are_found,
            planted::pure_translations_are_found,
            planted::twisted_partners_at_q1_zero_are_found,
            candidates::exact_candidates_are_the_real_solutions_of_section_7_1,
            candidates::exact_candidates_satisfy_the_quartics,
            candidates::exact_candidates_fit_to_rounding,
            $($file::$law,)*
        }
    };
    (any $module:ident: $subject:expr) => { laws! { any $module: $subject; } };
    (five_point $module:ident: $subject:expr) => { laws! { five_point $module: $subject; } };
    (parallax_safe $module:ident: $subject:expr) => {
        laws! { five_point $module: $subject; planted::the_length_of_t_is_the_parallax, }
    };
}

laws!(parallax_safe quest: Subject {
    smallest_parallax: 1e-8,
    ..Subject::new(SolverName::Quest)
});
laws!(parallax_safe quest_eigen: Subject {
    smallest_parallax: 1e-8,
    ..Subject::new(SolverName::QuestEigen)
});
laws!(parallax_safe relinearization: Subject {
    // At 1e-8 it misses one in twenty.
    smallest_parallax: 1e-7,
    missed_at_small_parallax: &[(View::Everywhere, 391)],
    ..Subject::new(SolverName::Relinearization)
});
laws!(five_point nister: Subject::new(SolverName::Nister));
laws!(five_point stewenius: Subject::new(SolverName::Stewenius));
laws!(five_point li_hartley: Subject::new(SolverName::LiHartley));
laws!(five_point kukelova: Subject::new(SolverName::Kukelova));
laws!(five_point kneip: Subject::new(SolverName::Kneip));
// The paper's own steps. (43) divides by q1: of 250 scenes each, 104 half turns were lost, 45 translations, and 249 of the partners
// with q1 = 0. With noise and more than five matches they fit another sum of squares than that of the image.
laws!(five_point quest_literal: Subject {
    one_of: 4,
    missed: Missed { half_turns: 150, translations: 90, partners: 250, ..Missed::NOTHING },
    ..Subject::new(SolverName::QuestLiteral)
});
laws!(five_point relinearization_literal: Subject {
    one_of: 40,
    missed: Missed { median_of_twenty: 6e-2, ..Missed::NOTHING },
    ..Subject::new(SolverName::RelinearizationLiteral)
});
laws!(any eight_point: Subject {
    most_lost: [1, 1],
    most_different: 1,
    ..Subject::new(SolverName::EightPoint)
});
laws!(any homography: Subject {
    scenes: SceneOptions { points: 4, layout: Layout::Coplanar, ..SceneOptions::default() },
    most_lost: [1, 1],
    most_different: 6,
    ..Subject::new(SolverName::Homography)
});

#[test]
fn every_solver_has_its_laws() {
    let without = SolverName::named().filter(|solver| {
        let subject = format!("Subject::new(SolverName::{solver:?})");
        !include_str!("main.rs").contains(&subject)
    });
    assert_eq!(without.collect::<Vec<_>>(), [], "expected a line `laws!(…)` for each in this file");
}

const SEED_LITERAL: u64 = 100;
const SEED_PLANTED: u64 = 101;
const SEED_SYMMETRIES: u64 = 102;
const SEED_PARALLAX: u64 = 103;
const SEED_NOISY: u64 = 105;
const SEED_DEGENERATE: u64 = 106;

/// Two sets of solutions of the same problem agree this well, in radians. Rounding is magnified by the nearness of
/// other solutions; in 2,000 problems with 0.75 px of noise no two of 18,104 solutions came close enough to matter.
const SAME: f64 = 1e-6;

/// No scene failed; compared with lists of failed scenes, so that a test that fails names them.
const NONE: [usize; 0] = [];

fn noisy(base: SceneOptions) -> SceneOptions {
    SceneOptions { noise_px: 0.75, ..base }
}

fn exact_poses(candidates: &Candidates) -> Vec<RelativePose> {
    candidates.iter().filter(|c| c.kind == CandidateKind::Exact).map(|c| c.pose).collect()
}

fn rotations(poses: &[RelativePose]) -> Vec<UnitQuaternion<f64>> {
    poses.iter().map(|pose| pose.q_21).collect()
}

/// The same number of rotations, each with one of the other set within [`SAME`].
fn same_rotations(a: &[UnitQuaternion<f64>], b: &[UnitQuaternion<f64>]) -> bool {
    a.len() == b.len() && a.iter().all(|q| nearest(q, b) < SAME) && b.iter().all(|q| nearest(q, a) < SAME)
}

/// The larger of the angles between the rotations and between the lines of translation, to the nearest of some poses.
fn distance(pose: &RelativePose, among: &[RelativePose]) -> f64 {
    let to = |other: &RelativePose| {
        let sine = pose.t_21.normalize().cross(&other.t_21.normalize()).norm();
        pose.rotation_error(other).max(sine)
    };
    among.iter().map(to).fold(f64::INFINITY, f64::min)
}

/// The same number of poses, each with one of the other set within [`SAME`].
fn same_poses(a: &[RelativePose], b: &[RelativePose]) -> bool {
    let within = |a: &[RelativePose], b: &[RelativePose]| a.iter().all(|pose| distance(pose, b) < SAME);
    a.len() == b.len() && within(a, b) && within(b, a)
}

fn closest<'a>(candidates: &'a Candidates, pose: &RelativePose) -> Option<&'a Candidate> {
    candidates.iter().min_by(|a, b| a.pose.rotation_error(pose).total_cmp(&b.pose.rotation_error(pose)))
}
