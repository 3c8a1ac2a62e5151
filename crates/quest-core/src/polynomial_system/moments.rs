//! The null space of the relinearised system, as functionals.
//!
//! A null vector `ȳ` of `D̄` gives a number to every product of two directions `s_i s_j`, and (11) says that the number
//! depends on the product of the monomials alone: it is a linear functional on the polynomials of twice the degree,
//! and it vanishes on every equation times every monomial. So the null space of `D̄` is that of the matrix whose rows are
//! those multiples, whose columns are the monomials: for five matches 396 × 201 instead of 465 × 325, and for more
//! factors `s_i s_j s_k` and more unknowns smaller by far more.
//!
//! The functionals are the moments of the solutions: the one of a single solution has there the values of the monomials.

use faer::Mat;

use super::monomials::{Grading, Table, of_degree, product};
use super::rank::{RankDecision, Ranked, Rule};
use super::system::{Polynomial, System};
use super::{Options, SolveError};

/// Functionals on the polynomials up to a degree, in columns, by their weighted values at the monomials.
pub(super) struct Functionals {
    pub(super) grading: Grading,
    /// The highest degree.
    pub(super) degree: usize,
    table: Table,
    values: Mat<f64>,
}

impl Functionals {
    /// All functionals that vanish on the multiples of the equations up to a degree, and how their number was decided.
    pub(super) fn of_system(
        system: &System,
        grading: Grading,
        degree: usize,
        options: &Options,
    ) -> Result<(Self, RankDecision), SolveError> {
        let table = Table::new(grading, degree);
        let matrix = multiples(system, grading, &table, degree);
        let rule = match options.solutions {
            Some(count) => Rule::Given(table.len().saturating_sub(count)),
            None => Rule::drop_below(options.zero),
        };
        let ranked = Ranked::new(matrix.as_ref(), rule)?;
        let values = ranked.null_space();
        Ok((Self { grading, degree, table, values }, ranked.decision))
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.values.ncols()
    }

    /// As many as differ on the polynomials up to a lower degree, restricted to these.
    pub(super) fn restricted(&self, degree: usize, zero: f64) -> Result<(Self, RankDecision), SolveError> {
        let table = Table::new(self.grading, degree);
        let places = self.places(&table.monomials, &vec![0; self.grading.unknowns])?;
        let scale = |i: usize| table.weights[i] / self.table.weights[places[i]];
        let lower = Mat::from_fn(places.len(), self.count(), |i, k| self.values[(places[i], k)] * scale(i));
        // The values of a functional at all monomials are a vector of norm 1.
        let ranked = Ranked::new(lower.as_ref(), Rule::DropBelow(zero, 1.0))?;
        let values = &lower * ranked.row_space();
        Ok((Self { grading: self.grading, degree, table, values }, ranked.decision))
    }

    /// The values at the monomials of the next lower degree times each generator: `W_0` and `W_l` are combinations of
    /// these.
    pub(super) fn shifts(&self) -> Result<Vec<Mat<f64>>, SolveError> {
        let lower = Table::new(self.grading, self.degree - self.grading.rise());
        let shift = |generator: &Vec<u8>| {
            let places = self.places(&lower.monomials, generator)?;
            let scale = |i: usize| lower.weights[i] / self.table.weights[places[i]];
            Ok(Mat::from_fn(places.len(), self.count(), |i, k| self.values[(places[i], k)] * scale(i)))
        };
        self.grading.generators().iter().map(shift).collect()
    }

    fn places(&self, monomials: &[Vec<u8>], factor: &[u8]) -> Result<Vec<usize>, SolveError> {
        let place = |m: &Vec<u8>| self.table.place(&product(m, factor)).ok_or(SolveError::NoConvergence);
        monomials.iter().map(place).collect()
    }
}

/// The monomials that an equation may be multiplied by without leaving the degrees of a grading up to `degree`.
pub(super) fn multipliers(f: &Polynomial, grading: Grading, degree: usize) -> Vec<Vec<u8>> {
    let Some(room) = degree.checked_sub(f.degree()) else { return Vec::new() };
    // The degrees of the grading up to `degree` differ from it by multiples of the step, and so do those of the terms.
    grading.degrees(room).into_iter().flat_map(|d| of_degree(grading.unknowns, d)).collect()
}

/// The coefficients of the equations times all their multipliers, in rows, each of about the size 1.
pub(super) fn multiples(system: &System, grading: Grading, table: &Table, degree: usize) -> Mat<f64> {
    let mut rows = Vec::new();
    for f in system.equations() {
        for multiplier in multipliers(f, grading, degree) {
            let entry = |(c, e): (f64, &[u8])| {
                table.place(&product(e, &multiplier)).map(|place| (place, c / table.weights[place]))
            };
            let mut row: Vec<_> = f.terms().filter_map(entry).collect();
            let norm = row.iter().map(|(_, c)| c * c).sum::<f64>().sqrt();
            for (_, c) in &mut row {
                *c /= norm;
            }
            rows.push(row);
        }
    }
    let mut matrix = Mat::zeros(rows.len(), table.len());
    for (i, row) in rows.into_iter().enumerate() {
        for (place, c) in row {
            matrix[(i, place)] = c;
        }
    }
    matrix
}
