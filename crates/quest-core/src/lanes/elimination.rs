//! The ten cubics reduced to six rows by Householder reflections.
//!
//! Gauss–Jordan elimination with pivoting would choose other rows in every lane; reflections need no choice and are more
//! accurate. Of the reduced matrix only the rows led by `x²z, x²w, y²z, y²w, xyz, xyw` are used, so that back substitution
//! stops there.
//!
//! Column by column: a column passes through all reflections before it, which keeps it in registers.

use super::lane::{F, Float, Lanes};

/// The first of the reduced rows that are used.
const FIRST: usize = 4;
/// How many rows are used.
pub(super) const ROWS: usize = 10 - FIRST;

type Column<L> = [F<L>; 10];

/// Reflection `K` is `I − v vᵀ · factor`, with `v` zero ahead of entry `K`.
struct Reflections<L: Lanes<f64>> {
    v: [Column<L>; 9],
    factor: [F<L>; 9],
}

/// Of the columns before `J` the reflections in turn.
macro_rules! reflect {
    ($reflections:expr, $x:expr, below $end:expr) => {
        reflect!(@each $reflections, $x, $end, 0 1 2 3 4 5 6 7 8)
    };
    (@each $reflections:expr, $x:expr, $end:expr, $($k:literal)*) => {
        $(if $k < $end {
            $reflections.apply::<$k>($x);
        })*
    };
}

impl<L: Lanes<f64>> Reflections<L> {
    #[inline(always)]
    fn apply<const K: usize>(&self, x: &mut Column<L>) {
        let v = &self.v[K];
        // Two sums: additions wait for each other.
        let (mut even, mut odd) = (v[K] * x[K], v[K + 1] * x[K + 1]);
        for i in K + 2..10 {
            let sum = if (i - K).is_multiple_of(2) { &mut even } else { &mut odd };
            *sum = v[i].mul_add(x[i], *sum);
        }
        let dot = (even + odd) * self.factor[K];
        for i in K..10 {
            x[i] = dot.neg_mul_add(v[i], x[i]);
        }
    }

    /// Reduces column `J` by the reflections before it, adds that which makes it triangular, and returns it with the pivot.
    #[inline(always)]
    fn add<const J: usize>(&mut self, lanes: L, m: &[[F<L>; 20]; 10], pivots: &mut Pivots<L>) -> Column<L> {
        let zero = lanes.splat(0.0);
        let mut x = column::<L>(m, J);
        reflect!(self, &mut x, below J);
        if J == 9 {
            pivots.add(x[J].abs());
            return x;
        }
        let mut square = x[J] * x[J];
        for i in J + 1..10 {
            square = x[i].mul_add(x[i], square);
        }
        let length = square.sqrt();
        pivots.add(length);
        let image = (-length).select(zero.less(x[J]), length);
        self.v[J] = x;
        self.v[J][J] = x[J] - image;
        self.factor[J] = lanes.splat(-1.0) / (image * self.v[J][J]);
        x[J] = image;
        x
    }
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

#[inline(always)]
fn column<L: Lanes<f64>>(m: &[[F<L>; 20]; 10], j: usize) -> Column<L> {
    let mut x = [m[0][j]; 10];
    for i in 1..10 {
        x[i] = m[i][j];
    }
    x
}

/// The six rows' coefficients of the ten monomials that are left, and the smallest pivot over the largest.
#[inline(always)]
pub(super) fn reduce<L: Lanes<f64>>(lanes: L, m: &[[F<L>; 20]; 10]) -> ([[F<L>; 10]; ROWS], F<L>) {
    let zero = lanes.splat(0.0);
    let mut reflections = Reflections::<L> { v: [[zero; 10]; 9], factor: [zero; 9] };
    let mut pivots = Pivots::<L>(lanes.splat(f64::MAX), zero);
    reflections.add::<0>(lanes, m, &mut pivots);
    reflections.add::<1>(lanes, m, &mut pivots);
    reflections.add::<2>(lanes, m, &mut pivots);
    reflections.add::<3>(lanes, m, &mut pivots);
    let triangle = [
        reflections.add::<4>(lanes, m, &mut pivots),
        reflections.add::<5>(lanes, m, &mut pivots),
        reflections.add::<6>(lanes, m, &mut pivots),
        reflections.add::<7>(lanes, m, &mut pivots),
        reflections.add::<8>(lanes, m, &mut pivots),
        reflections.add::<9>(lanes, m, &mut pivots),
    ];
    let mut inverse = [zero; ROWS];
    for k in 0..ROWS {
        inverse[k] = lanes.splat(1.0) / triangle[k][FIRST + k];
    }
    let mut out = [[zero; 10]; ROWS];
    for j in 0..10 {
        let mut x = column::<L>(m, 10 + j);
        reflect!(reflections, &mut x, below 9);
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
