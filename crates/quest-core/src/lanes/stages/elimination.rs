//! The ten cubics reduced to six rows by Householder reflections.
//!
//! Gauss–Jordan elimination with pivoting would choose other rows in every lane; reflections need no choice and are more
//! accurate. Only the rows of the reduced matrix that are led by `x²z, x²w, y²z, y²w, xyz, xyw` are used, so that back substitution
//! stops there.
//!
//! A reflection waits for the square root and the division that make it. So the next one is begun first, with the column
//! that it needs, and meanwhile the other columns, which do not wait for each other, are reflected by this one.

use crate::algebra::vectors::lane::{F, Float, Lanes};
use crate::lanes::stages::cubics::Column;

/// The first of the reduced rows that are used.
const FIRST: usize = 4;
/// How many rows are used.
pub(crate) const ROWS: usize = 10 - FIRST;

/// `I − v vᵀ · factor`, with `v` zero ahead of entry `K`.
struct Reflection<L: Lanes<f64>, const K: usize> {
    v: Column<L>,
    factor: F<L>,
}

impl<L: Lanes<f64>, const K: usize> Reflection<L, K> {
    /// The reflection that makes the entries of column `x` behind `K` zero. It is applied to the column.
    #[inline(always)]
    fn new(lanes: L, x: &mut Column<L>, pivots: &mut Pivots<L>) -> Self {
        let mut v = *x;
        let length = square::<L, K>(x).sqrt();
        pivots.add(length);
        x[K] = (-length).select(lanes.splat(0.0).less(x[K]), length);
        v[K] = v[K] - x[K];
        Self { v, factor: lanes.splat(-1.0) / (x[K] * v[K]) }
    }

    #[inline(always)]
    fn apply(&self, x: &mut Column<L>) {
        let v = &self.v;
        // Two sums: additions wait for each other.
        let (mut even, mut odd) = (v[K] * x[K], v[K + 1] * x[K + 1]);
        for i in K + 2..10 {
            let sum = if (i - K).is_multiple_of(2) { &mut even } else { &mut odd };
            *sum = v[i].mul_add(x[i], *sum);
        }
        let dot = (even + odd) * self.factor;
        // Row `K` has no further use where it is ahead of those that are used.
        let from = if K < FIRST { K + 1 } else { K };
        for i in from..10 {
            x[i] = dot.neg_mul_add(v[i], x[i]);
        }
    }

    /// Applies it to the columns behind its own, and makes the next.
    #[inline(always)]
    fn step<const NEXT: usize>(
        &self,
        lanes: L,
        m: &mut [Column<L>; 20],
        pivots: &mut Pivots<L>,
    ) -> Reflection<L, NEXT> {
        self.apply(&mut m[NEXT]);
        let next = Reflection::new(lanes, &mut m[NEXT], pivots);
        for x in &mut m[NEXT + 1..] {
            self.apply(x);
        }
        next
    }
}

/// The squared length of a column from entry `K` on.
#[inline(always)]
fn square<L: Lanes<f64>, const K: usize>(x: &Column<L>) -> F<L> {
    let mut square = x[K] * x[K];
    for i in K + 1..10 {
        square = x[i].mul_add(x[i], square);
    }
    square
}

/// The smallest and the largest pivot.
struct Pivots<L: Lanes<f64>>(F<L>, F<L>);

impl<L: Lanes<f64>> Pivots<L> {
    #[inline(always)]
    fn add(&mut self, pivot: F<L>) {
        self.0 = pivot.select(pivot.less(self.0), self.0);
        self.1 = pivot.select(self.1.less(pivot), self.1);
    }
}

/// The six rows' coefficients of the ten monomials that are left, and the smallest pivot over the largest. The columns are
/// overwritten.
#[inline(always)]
pub(crate) fn reduce<L: Lanes<f64>>(lanes: L, m: &mut [Column<L>; 20]) -> ([[F<L>; 10]; ROWS], F<L>) {
    let mut pivots = Pivots::<L>(lanes.splat(f64::MAX), lanes.splat(0.0));
    let first = Reflection::<L, 0>::new(lanes, &mut m[0], &mut pivots);
    let second = first.step::<1>(lanes, m, &mut pivots);
    let third = second.step::<2>(lanes, m, &mut pivots);
    let fourth = third.step::<3>(lanes, m, &mut pivots);
    let fifth = fourth.step::<4>(lanes, m, &mut pivots);
    let sixth = fifth.step::<5>(lanes, m, &mut pivots);
    let seventh = sixth.step::<6>(lanes, m, &mut pivots);
    let eighth = seventh.step::<7>(lanes, m, &mut pivots);
    let ninth = eighth.step::<8>(lanes, m, &mut pivots);
    for x in &mut m[9..] {
        ninth.apply(x);
    }
    pivots.add(m[9][9].abs());

    let (triangle, columns) = m[FIRST..].split_at(ROWS);
    let mut inverse = [lanes.splat(1.0); ROWS];
    for k in 0..ROWS {
        inverse[k] = inverse[k] / triangle[k][FIRST + k];
    }
    let mut out = [[lanes.splat(0.0); 10]; ROWS];
    for (j, column) in columns.iter().enumerate() {
        let mut x = *column;
        for k in (0..ROWS).rev() {
            let solved = x[FIRST + k] * inverse[k];
            out[k][j] = solved;
            for i in 0..k {
                x[FIRST + i] = triangle[k][FIRST + i].neg_mul_add(solved, x[FIRST + i]);
            }
        }
    }
    (out, pivots.0 / pivots.1)
}
