//! Rows of numbers, as tables and arrays have them.

use crate::{
    Gap, Pair,
    error::{Fault, Place, ReadError},
};

/// What the columns of a table are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Columns<const N: usize> {
    pub(super) names: [&'static str; N],
    /// The same by other programs' names.
    pub(super) others: [&'static str; N],
    /// A column that may stand beside them.
    pub(super) score: Option<&'static str>,
    /// The same for messages.
    pub(super) expected: &'static str,
}

/// One match a row.
pub(super) const MATCHES: Columns<4> = Columns {
    names: ["u1", "v1", "u2", "v2"],
    others: ["x1", "y1", "x2", "y2"],
    score: Some("score"),
    expected: "u1,v1,u2,v2[,score]",
};

/// One point of one image a row.
pub(super) const POINTS: Columns<2> =
    Columns { names: ["u", "v"], others: ["x", "y"], score: None, expected: "u,v" };

impl<const N: usize> Columns<N> {
    /// The spelling of the names that a header has. Capital letters and underscores make no difference: `X_1` is `x1`.
    pub(super) fn spelled(&self, header: &[String]) -> Option<[&'static str; N]> {
        let has = |names: &[&str; N]| names.iter().all(|name| header.iter().any(|column| column == name));
        [self.names, self.others].into_iter().find(has)
    }

    /// A name of a header as it is compared.
    pub(super) fn plain(name: &str) -> String {
        name.trim().to_ascii_lowercase().replace('_', "")
    }

    /// The fault of a table without names that has another number of columns.
    pub(super) fn check(&self, count: usize, fault: impl FnOnce() -> Fault) -> Result<(), Fault> {
        match (N, count) {
            _ if count == N || (self.score.is_some() && count == N + 1) => Ok(()),
            (4, 2) => Err(Fault::OneImage),
            _ => Err(fault()),
        }
    }
}

/// Rows of `N` coordinates. One that is NaN, infinite or missing is NaN.
#[derive(Clone, Debug)]
pub(super) struct Rows<const N: usize> {
    pub(super) values: Vec<[f64; N]>,
    pub(super) scores: Option<Vec<f64>>,
    /// The first coordinate that is NaN.
    pub(super) first_gap: Option<Gap>,
    /// The names that are not known.
    pub(super) unknown: Vec<String>,
}

impl<const N: usize> Rows<N> {
    /// No rows yet.
    pub(super) fn new(has_scores: bool, unknown: Vec<String>) -> Self {
        Self { values: Vec::new(), scores: has_scores.then(Vec::new), first_gap: None, unknown }
    }

    /// Appends a row. `found` tells of a coordinate in this column that is NaN: what was found, and where.
    pub(super) fn push(&mut self, row: [f64; N], found: impl FnOnce(usize) -> ReadError) {
        let gap = row.iter().position(|x| x.is_nan()).filter(|_| self.first_gap.is_none());
        if let Some(column) = gap {
            let error = found(column);
            self.first_gap = Some(Gap { message: error.fault.to_string(), place: error.place });
        }
        self.values.push(row);
    }
}

impl Rows<4> {
    pub(super) fn pair(self, place: &Place) -> Pair {
        Pair {
            matches: self.values,
            first_gap: self.first_gap,
            scores: self.scores,
            place: place.clone(),
            unknown_keys: self.unknown,
            ..Pair::default()
        }
    }
}

impl Rows<2> {
    /// The rows of two images side by side; `place` is that of the second.
    pub(super) fn beside(self, second: Self, place: &Place) -> Result<Rows<4>, ReadError> {
        let (expected, found) = (self.values.len(), second.values.len());
        if found != expected {
            return Err(place.clone().error(Fault::PointCount { found, expected }));
        }
        let values = self.values.iter().zip(&second.values);
        Ok(Rows {
            values: values.map(|([u1, v1], [u2, v2])| [*u1, *v1, *u2, *v2]).collect(),
            scores: None,
            first_gap: self.first_gap.or(second.first_gap),
            unknown: [self.unknown, second.unknown].concat(),
        })
    }
}
