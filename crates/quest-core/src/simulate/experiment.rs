//! The grids of section 9: what figures 4 to 8 vary, and how many scenes they take of which kind.

use super::{Layout, Motion, PoseErrors, Scene, SceneError, SceneOptions, View, choose};
use crate::solver::{Kinds, SolverName};
use crate::{CandidateKind, Candidates, Correspondence, Degeneracy};

/// The number of further points that choose the candidate of [`Reading::Selected`].
pub const FURTHER_POINTS: usize = 30;

/// The figures of section 9 that compare solvers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Figure {
    /// Noise from 0 to 10 px, general points.
    Four,
    /// Noise from 0 to 10 px, coplanar points.
    Five,
    /// Parallax from 0 to 0.1 with 0.75 px of noise, general and coplanar points by turns.
    Six,
    /// Noise from 0 to 10 px, rotation alone, general and coplanar points by turns.
    Seven,
    /// Noise from 0 to 10 px, translation alone, general and coplanar points by turns.
    Eight,
}

impl Figure {
    /// All of them, in the paper's order.
    pub const ALL: [Self; 5] = [Self::Four, Self::Five, Self::Six, Self::Seven, Self::Eight];

    /// The number in the paper.
    #[must_use]
    pub fn number(self) -> u8 {
        match self {
            Self::Four => 4,
            Self::Five => 5,
            Self::Six => 6,
            Self::Seven => 7,
            Self::Eight => 8,
        }
    }

    /// The scenes of each value of what is varied in the paper.
    #[must_use]
    pub fn trials(self) -> u32 {
        if self == Self::Six { 40 } else { 100 }
    }

    /// Whether the parallax is varied, and not the noise.
    #[must_use]
    pub fn varies_parallax(self) -> bool {
        self == Self::Six
    }

    /// The grid of the figure. `base` gives the angle, the view, the number of points and the rounding of the scenes; the
    /// figure gives the layout, the motion and the noise.
    #[must_use]
    pub fn cells(self, base: &SceneOptions) -> Vec<Cell> {
        (0..=100_u16).map(|step| self.cell(base, step)).collect()
    }

    fn cell(self, base: &SceneOptions, step: u16) -> Cell {
        let (parallax, noise_px) = (f64::from(step) / 1000.0, f64::from(step) / 10.0);
        let (motion, noise_px) = match self {
            Self::Four | Self::Five => (Motion::General, noise_px),
            Self::Six => (Motion::Parallax(parallax), 0.75),
            Self::Seven => (Motion::PureRotation, noise_px),
            Self::Eight => (Motion::PureTranslation, noise_px),
        };
        let layouts: &[Layout] = match self {
            Self::Four => &[Layout::General],
            Self::Five => &[Layout::Coplanar],
            _ => &[Layout::General, Layout::Coplanar],
        };
        let scenes = layouts.iter().map(|&layout| SceneOptions { layout, motion, noise_px, ..*base });
        Cell {
            x: if self.varies_parallax() { parallax } else { noise_px },
            scenes: scenes.collect(),
            stream: u64::from(self.number()) << 48 | u64::from(step) << 32,
        }
    }
}

/// One value of what a figure varies.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// The value: the noise in pixels, or the parallax.
    pub x: f64,
    /// The kinds of scenes, which take turns.
    pub scenes: Vec<SceneOptions>,
    /// The first of its 2³² indices of scenes. No other cell of any figure has the same indices.
    pub stream: u64,
}

impl Cell {
    /// Trial number `trial` of the sequence `seed`: the same problem for every solver, whatever else is run.
    ///
    /// # Errors
    /// Those of [`Scene::generate`].
    pub fn problem(&self, seed: u64, trial: u32) -> Result<Problem, SceneError> {
        let options = self.scenes[trial as usize % self.scenes.len()];
        let index = self.stream + u64::from(trial);
        let (scene, further) = Scene::with_further(&options, FURTHER_POINTS, seed, index)?;
        Ok(Problem { scene, further, view: options.view })
    }
}

/// A scene to solve, and further points of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// What is solved.
    pub scene: Scene,
    /// What a candidate is chosen by.
    pub further: Vec<Correspondence>,
    /// What is known of the points' depths.
    pub view: View,
}

/// Which of a solver's candidates is judged. Compare solvers only within one reading: a solver that keeps the real parts of
/// complex solutions has more candidates, and so more chances to be near the truth, than one that drops them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// The exact candidate that is closest to the truth, which is the paper's choice.
    Exact,
    /// The closest to the truth among candidates of all requested kinds.
    All,
    /// The candidate that explains further points best. It can be chosen without knowing the truth.
    Selected,
}

impl Reading {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Exact, Self::All, Self::Selected];

    /// The name in files: `exact`, `all`, `selected`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::All => "all",
            Self::Selected => "selected",
        }
    }
}

impl Problem {
    /// The errors of a solver by each reading, in the order of [`Reading::ALL`]; `None` where there is no candidate.
    #[must_use]
    pub fn judge(&self, solver: SolverName, kinds: Kinds) -> [Option<PoseErrors>; 3] {
        let mut candidates = Candidates::new();
        solver.solve(kinds, &self.scene.matches, &mut candidates);
        self.judge_candidates(&candidates)
    }

    /// The same of candidates found elsewhere.
    #[must_use]
    pub fn judge_candidates(&self, candidates: &Candidates) -> [Option<PoseErrors>; 3] {
        let truth = &self.scene.truth;
        // Where a rotation alone explains the matches to the last digit, it is the exact solution.
        let is_rotation = candidates.degeneracy() == Some(Degeneracy::PureRotation);
        let exact = candidates.iter().filter(|c| is_rotation || c.kind == CandidateKind::Exact);
        let selected = choose(candidates.iter(), &self.further, self.view);
        [
            PoseErrors::smallest(truth, exact),
            PoseErrors::smallest(truth, candidates.iter()),
            selected.map(|c| PoseErrors::of(truth, &c.pose)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grids_are_those_of_the_paper() {
        let paper = SceneOptions::default();
        for figure in Figure::ALL {
            let cells = figure.cells(&paper);
            assert_eq!(cells.len(), 101);
            let last = if figure.varies_parallax() { 0.1 } else { 10.0 };
            assert!(cells[0].x == 0.0 && (cells[100].x - last).abs() < 1e-12);
            for cell in &cells {
                for options in &cell.scenes {
                    let noise_px = if figure.varies_parallax() { 0.75 } else { cell.x };
                    assert!((options.noise_px - noise_px).abs() < 1e-12);
                    let parallax = match options.motion {
                        Motion::Parallax(parallax) => parallax,
                        _ => cell.x,
                    };
                    assert!((parallax - cell.x).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn no_two_trials_share_a_scene() {
        let mut streams: Vec<u64> =
            Figure::ALL.iter().flat_map(|f| f.cells(&SceneOptions::default())).map(|c| c.stream).collect();
        streams.sort_unstable();
        assert!(streams.windows(2).all(|w| w[1] - w[0] >= 1 << 32));
        let cell = &Figure::Six.cells(&SceneOptions::default())[10];
        let [a, b, again] = [0, 1, 0].map(|trial| cell.problem(1, trial).unwrap());
        assert!(a == again && a != b);
        assert_eq!((a.scene.matches.len(), a.further.len()), (5, FURTHER_POINTS));
    }

    #[test]
    fn without_noise_every_reading_finds_the_truth() {
        for base in [SceneOptions::default(), SceneOptions::realistic()] {
            let cell = &Figure::Four.cells(&base)[0];
            for trial in 0..50 {
                let readings = cell.problem(2, trial).unwrap().judge(SolverName::Quest, Kinds::All);
                for errors in readings {
                    // The rounding of the images, times the condition of five points.
                    let errors = errors.unwrap();
                    assert!(errors.rotation < 1e-9 && errors.translation < 1e-9, "{trial}: {errors:?}");
                }
            }
        }
    }

    #[test]
    fn at_zero_parallax_nothing_is_said_of_the_translation() {
        for figure in [Figure::Six, Figure::Seven] {
            let cell = &figure.cells(&SceneOptions::default())[0];
            for trial in 0..50 {
                for errors in cell.problem(2, trial).unwrap().judge(SolverName::Quest, Kinds::All) {
                    let errors = errors.unwrap();
                    assert!(errors.rotation.is_finite() && errors.translation == 0.0);
                }
            }
        }
    }
}
