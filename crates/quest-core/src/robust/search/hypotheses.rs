//! Essential matrices of samples: what the search asks of a solver.

use nalgebra::{Matrix3, Vector3};

use crate::lanes::{BatchSolver, Essentials, Tolerance};
use crate::robust::search::sampling::{MAX_SAMPLE, Sample};
use crate::robust::search::search_score::MANY;
use crate::solver::SolverName;
use crate::{Candidates, Correspondence, alignment::best_rotation, solver};

/// Bearings this close after a rotation are turned into each other to rounding.
const EXACT: f64 = 1e-12;

/// The product of two essential matrices is this close to two where they are the same but for the sign.
const SAME: f64 = 1e-12;

/// Makes essential matrices from samples of matches.
pub(crate) trait HypothesisSource: std::fmt::Debug {
    /// Appends the essential matrices of each sample, in order. A sample of fewer than [`MAX_SAMPLE`] matches names them
    /// first.
    fn hypotheses(&mut self, matches: &[Correspondence], samples: &[Sample], out: &mut Hypotheses);
}

/// The source that solves samples of so many matches by the solver of this name. Few matches leave the refinement little to do, and may
/// be exact: their hypotheses are as well.
pub(crate) fn of_solver(solver: SolverName, matches: usize) -> Box<dyn HypothesisSource> {
    let tolerance = if matches < MANY { Tolerance::Tight } else { Tolerance::Loop };
    match solver {
        SolverName::Quest => Box::new(Lanes {
            solver: BatchSolver::new(tolerance),
            are_few: matches < MANY,
            samples: Vec::new(),
            found: Essentials::new(),
        }),
        other => Box::new(OneByOne(other)),
    }
}

/// Essential matrices `E = [t]× R_21` with `|t| = 1`, one sample after the other.
#[derive(Debug, Default)]
pub(crate) struct Hypotheses {
    matrices: Vec<Matrix3<f64>>,
    /// Where those of each sample end.
    ends: Vec<usize>,
}

impl Hypotheses {
    pub(crate) fn clear(&mut self) {
        self.matrices.clear();
        self.ends.clear();
    }

    /// Those of all samples.
    pub(crate) fn matrices(&self) -> &[Matrix3<f64>] {
        &self.matrices
    }

    /// Those of the sample with this index.
    pub(crate) fn of(&self, sample: usize) -> &[Matrix3<f64>] {
        let begin = if sample == 0 { 0 } else { self.ends[sample - 1] };
        &self.matrices[begin..self.ends[sample]]
    }

    /// Appends those of one more sample.
    pub(crate) fn push_sample(&mut self, matrices: impl IntoIterator<Item = Matrix3<f64>>) {
        self.matrices.extend(matrices);
        self.ends.push(self.matrices.len());
    }
}

/// Samples of five matches, several at a time.
#[derive(Debug)]
struct Lanes {
    solver: BatchSolver,
    /// With few matches every hypothesis is looked at.
    are_few: bool,
    samples: Vec<[u32; 5]>,
    found: Essentials,
}

impl HypothesisSource for Lanes {
    fn hypotheses(&mut self, matches: &[Correspondence], samples: &[Sample], out: &mut Hypotheses) {
        self.samples.clear();
        #[expect(clippy::cast_possible_truncation, reason = "matches are counted by u32")]
        self.samples
            .extend(samples.iter().map(|sample| -> [u32; 5] { std::array::from_fn(|k| sample[k] as u32) }));
        // Every index is one of a match: there is no error.
        let solved = if self.are_few {
            self.solver.solve(matches, &self.samples, &mut self.found)
        } else {
            self.solver.solve_oriented(matches, &self.samples, &mut self.found)
        };
        if solved.is_err() {
            return;
        }
        for (k, sample) in self.samples.iter().enumerate() {
            let own = &self.found.matrices()[self.found.of(k)];
            let is_degenerate = own.is_empty() && !self.found.is_complete(k);
            let turned =
                is_degenerate.then(|| turned_in_place(&sample.map(|i| matches[i as usize]))).flatten();
            out.push_sample(own.iter().map(|e| Matrix3::from_row_slice(e)).chain(turned));
        }
    }
}

/// Samples one after the other, by any solver.
#[derive(Debug)]
struct OneByOne(SolverName);

impl HypothesisSource for OneByOne {
    fn hypotheses(&mut self, matches: &[Correspondence], samples: &[Sample], out: &mut Hypotheses) {
        let size = self.0.info().min_matches;
        let mut candidates = Candidates::new();
        for sample in samples {
            let all = sample.map(|i| matches[i]);
            self.0.solve(solver::Kinds::Exact, &all[..size], &mut candidates);
            let mut own: Vec<Matrix3<f64>> = Vec::new();
            for candidate in candidates.iter() {
                let pose = &candidate.pose;
                let t = pose.t_21.try_normalize(0.0).unwrap_or_else(Vector3::x);
                let e = t.cross_matrix() * pose.r_21();
                // Twisted pairs have one essential matrix, of either sign.
                let is_new = |other: &Matrix3<f64>| e.dot(other).abs() < 2.0 - SAME;
                if e.iter().all(|x| x.is_finite()) && own.iter().all(is_new) {
                    own.push(e);
                }
            }
            out.push_sample(own);
        }
    }
}

/// The essential matrix of matches that a rotation alone explains to the last digit, with one of the translations that they
/// leave open.
fn turned_in_place(matches: &[Correspondence]) -> Option<Matrix3<f64>> {
    let q_21 = best_rotation(matches);
    let is_exact = matches.iter().all(|m| (q_21 * m.bearing1()).cross(m.bearing2()).norm() < EXACT);
    is_exact.then(|| Vector3::<f64>::x().cross_matrix() * q_21.to_rotation_matrix().into_inner())
}

const _: () = assert!(MAX_SAMPLE >= 5, "a sample holds the matches of the solver in lanes");
