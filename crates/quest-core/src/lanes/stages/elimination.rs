//! The ten cubics reduced to six rows by Gaussian elimination.
//!
//! Pivoting would choose other rows in every lane. The rows stay in their order instead, which is as good as any other where the
//! basis of the null space has no preferred direction. A lane whose pivots differ too much is flagged. Householder reflections need
//! no pivots either, but take twice the products. Only the rows of the reduced matrix that are led by `x²z, x²w, y²z, y²w, xyz,
//! xyw` are used, so that back substitution stops there.
//!
//! A column is loaded once, takes all steps of the elimination in registers, and its pivot makes the next step.

use crate::algebra::vectors::lane::{F, Float, Lanes};
use crate::lanes::stages::cubics::Column;

/// The first of the reduced rows that are used.
const FIRST: usize = 4;
/// How many rows are used.
pub(crate) const ROWS: usize = 10 - FIRST;

/// The steps of the elimination: the triangular factors of the first ten columns.
struct Factors<L: Lanes<f64>> {
    /// By how much row `K` is to be subtracted from those behind it.
    lower: [Column<L>; 10],
    /// What is left of the columns.
    upper: [Column<L>; 10],
    /// Of what is left on the diagonal.
    inverse: Column<L>,
    smallest: F<L>,
    largest: F<L>,
}

impl<L: Lanes<f64>> Factors<L> {
    #[inline(always)]
    fn new(lanes: L, m: &[Column<L>; 20]) -> Self {
        let none = [lanes.splat(0.0); 10];
        let (lower, upper) = ([none; 10], [none; 10]);
        let (smallest, largest) = (lanes.splat(f64::MAX), lanes.splat(0.0));
        let mut out = Self { lower, upper, inverse: none, smallest, largest };
        out.add::<0>(lanes, &m[0]);
        out.add::<1>(lanes, &m[1]);
        out.add::<2>(lanes, &m[2]);
        out.add::<3>(lanes, &m[3]);
        out.add::<4>(lanes, &m[4]);
        out.add::<5>(lanes, &m[5]);
        out.add::<6>(lanes, &m[6]);
        out.add::<7>(lanes, &m[7]);
        out.add::<8>(lanes, &m[8]);
        out.add::<9>(lanes, &m[9]);
        out
    }

    /// Eliminates column `K`.
    #[inline(always)]
    fn add<const K: usize>(&mut self, lanes: L, column: &Column<L>) {
        let x = self.eliminated::<K>(column);
        let (pivot, inverse) = (x[K].abs(), lanes.splat(1.0) / x[K]);
        self.smallest = pivot.select(pivot.less(self.smallest), self.smallest);
        self.largest = pivot.select(self.largest.less(pivot), self.largest);
        self.inverse[K] = inverse;
        self.upper[K] = x;
        for i in K + 1..10 {
            self.lower[K][i] = x[i] * inverse;
        }
    }

    /// A column after the first `COUNT` steps.
    #[inline(always)]
    fn eliminated<const COUNT: usize>(&self, column: &Column<L>) -> Column<L> {
        let mut x = *column;
        self.step::<0, COUNT>(&mut x);
        self.step::<1, COUNT>(&mut x);
        self.step::<2, COUNT>(&mut x);
        self.step::<3, COUNT>(&mut x);
        self.step::<4, COUNT>(&mut x);
        self.step::<5, COUNT>(&mut x);
        self.step::<6, COUNT>(&mut x);
        self.step::<7, COUNT>(&mut x);
        self.step::<8, COUNT>(&mut x);
        x
    }

    /// Step `K`, where it is one of `COUNT`.
    #[inline(always)]
    fn step<const K: usize, const COUNT: usize>(&self, x: &mut Column<L>) {
        if K < COUNT {
            for i in K + 1..10 {
                x[i] = self.lower[K][i].neg_mul_add(x[K], x[i]);
            }
        }
    }
}

/// The six rows' coefficients of the ten monomials that are left, and the smallest pivot over the largest.
#[inline(always)]
pub(crate) fn reduce<L: Lanes<f64>>(lanes: L, m: &[Column<L>; 20]) -> ([[F<L>; 10]; ROWS], F<L>) {
    let factors = Factors::<L>::new(lanes, m);
    let mut out = [[lanes.splat(0.0); 10]; ROWS];
    for (j, column) in m[10..].iter().enumerate() {
        let mut x = factors.eliminated::<9>(column);
        for k in (FIRST..10).rev() {
            x[k] = x[k] * factors.inverse[k];
            out[k - FIRST][j] = x[k];
            for i in FIRST..k {
                x[i] = factors.upper[k][i].neg_mul_add(x[k], x[i]);
            }
        }
    }
    (out, factors.smallest / factors.largest)
}
