//! The essential matrices of many samples.

use std::ops::Range;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::solver::shared::essential::{decompose, twisted};
use crate::solver::shared::shortlist::rank;
use crate::structure::with_depths;
use crate::{Candidate, CandidateKind, Candidates, Correspondence};

/// The essential matrices of many samples, in structure of arrays.
///
/// They stand one sample after the other; [`of`](Self::of) gives the range of each. It is a buffer: use it again for the next
/// batch.
#[derive(Clone, Debug)]
pub struct Essentials {
    /// Where the matrices of each sample begin, and the end of the last.
    first: Vec<u32>,
    complete: Vec<bool>,
    /// Row by row.
    matrices: Vec<[f64; 9]>,
}

impl Essentials {
    /// The largest number of essential matrices of one sample.
    pub const MAX_OF_SAMPLE: usize = 10;

    /// An empty list.
    #[must_use]
    pub fn new() -> Self {
        Self { first: vec![0], complete: Vec::new(), matrices: Vec::new() }
    }

    /// Empties the list, and keeps its memory.
    pub fn clear(&mut self) {
        self.first.truncate(1);
        self.complete.clear();
        self.matrices.clear();
    }

    /// How many samples there are.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.complete.len()
    }

    /// How many essential matrices all samples have together.
    #[must_use]
    pub fn len(&self) -> usize {
        self.matrices.len()
    }

    /// Whether no sample has an essential matrix.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The indices of the essential matrices of a sample; none for a sample that is not there.
    #[must_use]
    pub fn of(&self, sample: usize) -> Range<usize> {
        let end = |k: usize| self.first.get(k).map_or(self.len(), |&i| i as usize);
        end(sample)..end(sample + 1)
    }

    /// Whether all essential matrices of a sample are known to be there.
    ///
    /// If not, some may be missing, or the sample may be degenerate.
    #[must_use]
    pub fn is_complete(&self, sample: usize) -> bool {
        self.complete.get(sample).copied().unwrap_or(false)
    }

    /// All matrices, row by row: `E = [t]× R_21` with a unit vector `t` of either sign, `x2ᵀ E x1 = 0`.
    #[must_use]
    pub fn matrices(&self) -> &[[f64; 9]] {
        &self.matrices
    }

    /// The two rotations `R_21` of matrix `k` and the direction of its translation, a unit vector of either sign; `None`
    /// for a matrix that is not there.
    #[must_use]
    pub fn motions(&self, k: usize) -> Option<([UnitQuaternion<f64>; 2], Vector3<f64>)> {
        let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = *self.matrices.get(k)?;
        let (q, t) = decompose(&[[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]])?;
        let unit = |[w, x, y, z]: [f64; 4]| UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        Some(([unit(q), unit(twisted(&q, &t))], Vector3::from(t).normalize()))
    }

    /// Fills `out` with both poses of each essential matrix of a sample. `matches` are the sample's. The candidates and their order
    /// are those of a solver with [`Kinds::Exact`](crate::solver::Kinds::Exact).
    pub fn candidates(&self, sample: usize, matches: &[Correspondence], out: &mut Candidates) {
        out.clear();
        for (rotations, direction) in self.of(sample).filter_map(|k| self.motions(k)) {
            for q_21 in rotations {
                let found = with_depths(q_21, &direction, matches);
                let (kind, pose) = (CandidateKind::Exact, found.pose);
                out.push(Candidate { kind, pose, residual: found.residual, in_front: found.in_front });
            }
        }
        rank(out);
    }

    /// Appends the essential matrices of one more sample.
    pub(super) fn push_sample(&mut self, complete: bool, matrices: impl Iterator<Item = [f64; 9]>) {
        self.matrices.extend(matrices);
        self.complete.push(complete);
        self.first.push(index(self.len()));
    }
}

/// An index of a matrix: ten of each of 2³² / 10 samples fit.
fn index(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(u32::MAX)
}

impl Default for Essentials {
    fn default() -> Self {
        Self::new()
    }
}
