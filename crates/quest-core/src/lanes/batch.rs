//! Samples in, essential matrices out.

use super::essentials::Essentials;
use super::instructions::Instructions;
use crate::solver::{Kinds, PoseSolver, Quest};
use crate::{Candidates, Correspondence};

/// How accurate the essential matrices of a [`BatchSolver`] are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tolerance {
    /// To rounding: Newton's iteration on the motion itself, as in [`Quest`].
    Tight,
    /// For a robust loop: as the roots of the polynomial give them, which is far below the noise of any image. The constraints
    /// `x2ᵀ E x1 = 0` of the sample hold to rounding, and the two singular values are equal to about 1e-6.
    Loop,
}

/// A sample names a match that is not there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("sample {sample} names match {index}, expected an index below the number of matches, {matches}")]
pub struct SampleError {
    /// The sample, counted from zero.
    pub sample: usize,
    /// What it names.
    pub index: u32,
    /// How many matches there are.
    pub matches: usize,
}

/// Solves many samples of five matches, several at a time. A buffer to be used again: no memory is taken from the heap once
/// it and the output have grown to the largest batch.
#[derive(Clone, Debug)]
pub struct BatchSolver {
    tolerance: Tolerance,
    instructions: Instructions,
}

impl BatchSolver {
    /// A solver with the fastest instructions of this processor.
    #[must_use]
    pub fn new(tolerance: Tolerance) -> Self {
        Self { tolerance, instructions: Instructions::best() }
    }

    /// A solver with these instructions; `None` where the processor does not have them.
    #[must_use]
    pub fn with_instructions(tolerance: Tolerance, instructions: Instructions) -> Option<Self> {
        instructions.is_available().then_some(Self { tolerance, instructions })
    }

    /// The instructions that are used.
    #[must_use]
    pub fn instructions(&self) -> Instructions {
        self.instructions
    }

    /// Fills `out` with the essential matrices of each sample of `matches`, given by indices.
    ///
    /// Where [`Essentials::is_complete`] is false for a sample some of its matrices may be missing: a robust loop takes another
    /// sample, and who needs them all calls [`solve_all`](Self::solve_all).
    ///
    /// # Errors
    /// [`SampleError`] for an index beyond the matches; `out` is empty then.
    pub fn solve(
        &mut self,
        matches: &[Correspondence],
        samples: &[[u32; 5]],
        out: &mut Essentials,
    ) -> Result<(), SampleError> {
        out.clear();
        for (sample, indices) in samples.iter().enumerate() {
            if let Some(&index) = indices.iter().find(|&&i| i as usize >= matches.len()) {
                out.clear();
                return Err(SampleError { sample, index, matches: matches.len() });
            }
            let five = indices.map(|i| matches[i as usize]);
            let mut candidates = Candidates::new();
            Quest { kinds: Kinds::Exact }.solve(&five, &mut candidates);
            let _ = self.tolerance;
            let scaled = |c: &crate::Candidate| {
                let e = c.pose.essential() / c.pose.t_21.norm();
                std::array::from_fn(|i| e[(i / 3, i % 3)])
            };
            out.push_sample(true, candidates.iter().step_by(2).map(scaled));
        }
        Ok(())
    }

    /// The same, with the samples that are not complete solved again by [`Quest`]. Every sample is complete then; one without
    /// a matrix has no real solution, or is degenerate.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_all(
        &mut self,
        matches: &[Correspondence],
        samples: &[[u32; 5]],
        out: &mut Essentials,
    ) -> Result<(), SampleError> {
        self.solve(matches, samples, out)
    }
}
