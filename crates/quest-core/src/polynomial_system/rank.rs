//! Ranks as decisions on singular values, with what was decided on kept.

use faer::linalg::solvers::Svd;
use faer::{Mat, MatRef};

use super::SolveError;

/// Singular values are known up to this part of the largest one: rounding, of some hundred operations.
const ROUNDING: f64 = 1e-15;

/// The rank that was given to a matrix, and the singular values on both sides of the decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RankDecision {
    /// Rows of the matrix.
    pub rows: usize,
    /// Columns of the matrix.
    pub columns: usize,
    /// Its rank.
    pub rank: usize,
    /// The smallest singular value that counts as different from zero, relative to the largest one; 1 where the rank is
    /// zero.
    pub kept: f64,
    /// The largest singular value that counts as zero, relative to the largest one; zero where there is none.
    pub dropped: f64,
}

impl RankDecision {
    /// The dimension of the null space.
    #[must_use]
    pub fn nullity(&self) -> usize {
        self.columns - self.rank
    }

    /// Decides on singular values in falling order.
    fn new((rows, columns): (usize, usize), values: impl Iterator<Item = f64>, rule: Rule) -> Self {
        let mut values: Vec<f64> = values.take(columns).collect();
        values.resize(columns, 0.0);
        let first = values.first().copied().unwrap_or(0.0);
        let largest = if let Rule::DropBelow(_, least) = rule { first.max(least) } else { first };
        let relative = |k: usize| if largest > 0.0 { values[k] / largest } else { 0.0 };
        // Below rounding a drop means nothing.
        let drop = |k: usize| {
            let above = if k == 0 { 1.0 } else { relative(k - 1) };
            above / relative(k).max(ROUNDING)
        };
        let rank = match rule {
            Rule::Given(rank) => rank.min(columns),
            Rule::DropBelow(zero, _) => (0..columns)
                .filter(|&k| relative(k) < zero)
                .fold(columns, |best, k| if best == columns || drop(k) > drop(best) { k } else { best }),
        };
        Self {
            rows,
            columns,
            rank,
            kept: if rank == 0 { 1.0 } else { relative(rank - 1) },
            dropped: if rank == columns { 0.0 } else { relative(rank) },
        }
    }
}

/// How a rank is decided.
#[derive(Clone, Copy, Debug)]
pub(super) enum Rule {
    /// At the largest drop of the singular values to one below this part of the largest one, or of a number that the largest
    /// one could have reached.
    DropBelow(f64, f64),
    /// It is known.
    Given(usize),
}

impl Rule {
    /// Relative to the largest singular value.
    pub(super) fn drop_below(zero: f64) -> Self {
        Self::DropBelow(zero, 0.0)
    }
}

/// A singular value decomposition with all right vectors, and the rank.
pub(super) struct Ranked {
    svd: Svd<f64>,
    pub(super) decision: RankDecision,
}

impl Ranked {
    /// Decomposes, and decides on the rank.
    pub(super) fn new(a: MatRef<'_, f64>, rule: Rule) -> Result<Self, SolveError> {
        let (rows, columns) = a.shape();
        // Rows of zeros, so that the thin decomposition has all right singular vectors.
        let padded = Mat::from_fn(rows.max(columns), columns, |i, j| if i < rows { a[(i, j)] } else { 0.0 });
        let svd = padded.thin_svd().map_err(|_| SolveError::NoConvergence)?;
        let values = svd.S().column_vector().iter().copied();
        let decision = RankDecision::new((rows, columns), values, rule);
        Ok(Self { svd, decision })
    }

    /// An orthonormal basis of the null space, in columns.
    pub(super) fn null_space(&self) -> Mat<f64> {
        self.svd.V().subcols(self.decision.rank, self.decision.nullity()).to_owned()
    }

    /// An orthonormal basis of the row space, in columns.
    pub(super) fn row_space(&self) -> Mat<f64> {
        self.svd.V().subcols(0, self.decision.rank).to_owned()
    }

    /// The pseudo-inverse, of that rank, times a matrix of as many rows.
    pub(super) fn solve(&self, rhs: &Mat<f64>) -> Mat<f64> {
        let rank = self.decision.rank;
        let rows = rhs.nrows();
        let u = self.svd.U().subcols(0, rank).subrows(0, rows);
        let s = self.svd.S().column_vector();
        let mut coordinates = u.transpose() * rhs;
        for i in 0..rank {
            for j in 0..coordinates.ncols() {
                coordinates[(i, j)] /= s[i];
            }
        }
        self.svd.V().subcols(0, rank) * coordinates
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decide(values: &[f64]) -> usize {
        RankDecision::new((9, values.len()), values.iter().copied(), Rule::drop_below(1e-7)).rank
    }

    #[test]
    fn ranks_are_decided_at_the_largest_drop() {
        assert_eq!(decide(&[1.0, 0.3, 1e-5]), 3);
        assert_eq!(decide(&[1.0, 0.3, 1e-5, 3e-16]), 3);
        assert_eq!(decide(&[1.0, 1e-3, 3e-8, 1e-16, 1e-22]), 3);
        assert_eq!(decide(&[1.0, 1e-12, 1e-16]), 1);
        assert_eq!(decide(&[0.0, 0.0]), 0);
        // Nothing but rounding of what could have been 1.
        assert_eq!(RankDecision::new((9, 1), [1e-16].into_iter(), Rule::DropBelow(1e-7, 1.0)).rank, 0);
        let given = RankDecision::new((9, 3), [4.0, 2.0, 1.0].into_iter(), Rule::Given(1));
        assert_eq!((given.rank, given.nullity(), given.kept, given.dropped), (1, 2, 1.0, 0.5));
    }

    #[test]
    fn null_space_and_row_space_are_complements() {
        let a = Mat::from_fn(2, 4, |i, j| ((3 * i + j) as f64).sin());
        let ranked = Ranked::new(a.as_ref(), Rule::drop_below(1e-7)).unwrap();
        let (null, rows) = (ranked.null_space(), ranked.row_space());
        assert_eq!((null.ncols(), rows.ncols()), (2, 2));
        assert!((&a * &null).norm_max() < 1e-15);
        assert!((rows.transpose() * &null).norm_max() < 1e-15);
        let rhs = Mat::from_fn(2, 1, |i, _| i as f64 + 1.0);
        assert!((&a * ranked.solve(&rhs) - &rhs).norm_max() < 1e-14);
    }
}
