//! Runs experiments: trials in parallel, their numbers in order.

use quest_core::robust::STACK_SIZE;
use quest_core::{
    simulate::{Cell, Figure, PoseErrors, Reading, SceneError, SceneOptions},
    solver::{Kinds, SolverName},
};
use rayon::prelude::*;

use super::{Record, record::Quantity, statistics::Statistics, timing};
use crate::{
    Failure,
    progress::{Progress, ProgressOptions},
};

/// What is run.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) figures: Vec<Figure>,
    pub(crate) has_table: bool,
    /// The number of scenes of each value; the paper's if absent.
    pub(crate) trials: Option<u32>,
    /// The requested solvers; without a request, those of the paper's figure and ours.
    pub(crate) solvers: Vec<SolverName>,
    /// Which candidates they return.
    pub(crate) kinds: Kinds,
    pub(crate) seed: u64,
    /// The name of the kind of scenes.
    pub(crate) scenes: &'static str,
    pub(crate) base: SceneOptions,
    pub(crate) threads: usize,
    pub(crate) progress: ProgressOptions,
    pub(crate) is_quiet: bool,
}

/// The errors of one trial: of each solver, by each reading.
type Trial = Vec<[Option<PoseErrors>; 3]>;

impl Run {
    /// The scenes of each value of a figure.
    pub(crate) fn trials_of(&self, figure: Figure) -> u32 {
        self.trials.unwrap_or(figure.trials())
    }

    /// The solvers that a figure compares. The homography takes part only in figures with coplanar scenes.
    pub(crate) fn solvers_of(&self, figure: Figure) -> Vec<SolverName> {
        if !self.solvers.is_empty() {
            return self.solvers.clone();
        }
        let for_planes = matches!(figure, Figure::Five | Figure::Six | Figure::Seven);
        self.all_solvers().into_iter().filter(|&s| for_planes || s != SolverName::Homography).collect()
    }

    /// The requested solvers, or all for which the points suffice.
    pub(crate) fn all_solvers(&self) -> Vec<SolverName> {
        if !self.solvers.is_empty() {
            return self.solvers.clone();
        }
        let is_able = |s: &SolverName| s.info().min_matches <= self.base.points;
        SolverName::ALL.into_iter().filter(is_able).collect()
    }

    /// The solvers of table 1: these, and the paper's own steps.
    pub(crate) fn timed_solvers(&self) -> Vec<SolverName> {
        if !self.solvers.is_empty() {
            return self.solvers.clone();
        }
        self.all_solvers().into_iter().chain(SolverName::LITERAL).collect()
    }

    /// All numbers, figure by figure, the table last.
    pub(crate) fn execute(&self) -> Result<Vec<Record>, Failure> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).stack_size(STACK_SIZE).build();
        let pool = pool.map_err(|error| Failure::Arguments(format!("--threads: {error}")))?;
        let progress = self.progress();
        let mut records = Vec::new();
        for &figure in &self.figures {
            progress.begin(format!("figure {}", figure.number()));
            records.extend(pool.install(|| self.figure(figure, &progress))?);
        }
        if self.has_table {
            progress.begin("table 1".to_owned());
            records.extend(timing::table(self)?);
        }
        progress.finish();
        Ok(records)
    }

    fn progress(&self) -> Progress {
        let cells = |&figure: &Figure| figure.cells(&self.base).len() as u64;
        let scenes = self.figures.iter().map(|f| cells(f) * u64::from(self.trials_of(*f))).sum();
        self.progress.start("scenes", Some(scenes), self.is_quiet)
    }

    fn figure(&self, figure: Figure, progress: &Progress) -> Result<Vec<Record>, SceneError> {
        let solvers = self.solvers_of(figure);
        let cells = figure.cells(&self.base);
        let of_cell = |cell: &Cell| {
            let trials = self.trials(cell, figure, &solvers, progress)?;
            Ok(self.records(figure, cell, &solvers, &trials))
        };
        // Collected in the order of the cells, whatever thread was faster.
        let records: Result<Vec<_>, SceneError> = cells.par_iter().map(of_cell).collect();
        Ok(records?.into_iter().flatten().collect())
    }

    fn trials(
        &self,
        cell: &Cell,
        figure: Figure,
        solvers: &[SolverName],
        progress: &Progress,
    ) -> Result<Vec<Trial>, SceneError> {
        let trial = |index: u32| {
            let problem = cell.problem(self.seed, index)?;
            progress.add(1);
            Ok(solvers.iter().map(|&solver| problem.judge(solver, self.kinds)).collect())
        };
        (0..self.trials_of(figure)).into_par_iter().map(trial).collect()
    }

    fn records(&self, figure: Figure, cell: &Cell, solvers: &[SolverName], trials: &[Trial]) -> Vec<Record> {
        let mut records = Vec::new();
        for (s, solver) in solvers.iter().enumerate() {
            for (r, reading) in Reading::ALL.iter().enumerate() {
                let answers: Vec<PoseErrors> = trials.iter().filter_map(|trial| trial[s][r]).collect();
                let record = |quantity, error: fn(&PoseErrors) -> f64| {
                    let values: Vec<f64> = answers.iter().map(error).collect();
                    let beside = |trial: &Trial| Some(error(&trial[s][r]?) - error(&trial[0][r]?));
                    let differences: Vec<f64> = trials.iter().filter_map(beside).collect();
                    let record = Record {
                        experiment: format!("figure {}", figure.number()),
                        scenes: self.scenes,
                        varied: if figure.varies_parallax() { "parallax" } else { "noise_px" },
                        value: cell.x,
                        solver: solver.info().name,
                        reading: reading.name(),
                        quantity,
                        trials: trials.len(),
                        unanswered: trials.len() - answers.len(),
                        ..Record::default()
                    };
                    let differences = Statistics::of(&differences).filter(|_| s > 0);
                    record.with(Statistics::of(&values)).beside(differences)
                };
                records.push(record(Quantity::RotationRad, |e| e.rotation));
                // There is no translation to be found in a rotation.
                if figure != Figure::Seven {
                    records.push(record(Quantity::TranslationRad, |e| e.translation));
                }
            }
        }
        records
    }
}
