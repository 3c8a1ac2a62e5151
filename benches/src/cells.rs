//! What is measured: each solver with each of its two sets of candidates.

use quest_core::solver::{Kinds, SolverName};
use quest_core::{Candidates, Correspondence};

/// A solver and the kinds of candidates that it returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell {
    /// The solver.
    pub solver: SolverName,
    /// Which candidates it returns.
    pub kinds: Kinds,
}

impl Cell {
    /// Both sets of candidates of those solvers to which this many matches are enough.
    #[must_use]
    pub fn of(solvers: &[SolverName], matches: usize) -> Vec<Self> {
        let both = |&solver| [Kinds::Exact, Kinds::All].map(|kinds| Self { solver, kinds });
        solvers.iter().filter(|s| s.info().min_matches <= matches).flat_map(both).collect()
    }

    /// The name of the solver.
    #[must_use]
    pub fn solver_name(self) -> &'static str {
        self.solver.info().name
    }

    /// The name of the kinds.
    #[must_use]
    pub fn kinds_name(self) -> &'static str {
        self.kinds.name()
    }

    /// Solves.
    pub fn solve(self, matches: &[Correspondence], out: &mut Candidates) {
        self.solver.solve(self.kinds, matches, out);
    }
}
