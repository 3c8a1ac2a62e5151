//! Linear, quadratic and cubic forms in `(x, y, z, w)`, two side by side, and their products.

use crate::algebra::monomials::{homogeneous, position, sum};
use crate::algebra::vectors::two::Two;

/// Exponents of `(x, y, z, w)` of the ten quadratic monomials.
const QUADRATIC: [[u8; 4]; 10] = homogeneous::<10>(2);

/// Exponents of the twenty cubic monomials: ten to eliminate, the rest with `x`, with `y` and with neither, by falling
/// powers of `z`.
pub(crate) const CUBIC: [[u8; 4]; 20] = [
    [3, 0, 0, 0],
    [0, 3, 0, 0],
    [2, 1, 0, 0],
    [1, 2, 0, 0],
    [2, 0, 1, 0],
    [2, 0, 0, 1],
    [0, 2, 1, 0],
    [0, 2, 0, 1],
    [1, 1, 1, 0],
    [1, 1, 0, 1],
    [1, 0, 2, 0],
    [1, 0, 1, 1],
    [1, 0, 0, 2],
    [0, 1, 2, 0],
    [0, 1, 1, 1],
    [0, 1, 0, 2],
    [0, 0, 3, 0],
    [0, 0, 2, 1],
    [0, 0, 1, 2],
    [0, 0, 0, 3],
];

const VARIABLES: [[u8; 4]; 4] = homogeneous::<4>(1);

/// The quadratic monomial of two variables.
pub(crate) const SQUARE: [[usize; 4]; 4] = {
    let mut table = [[0; 4]; 4];
    let mut a = 0;
    while a < 16 {
        table[a / 4][a % 4] = position(&QUADRATIC, sum(VARIABLES[a / 4], VARIABLES[a % 4]));
        a += 1;
    }
    table
};

/// The cubic monomial of a quadratic one and a variable.
pub(crate) const PRODUCT: [[usize; 4]; 10] = {
    let mut table = [[0; 4]; 10];
    let mut a = 0;
    while a < 40 {
        table[a / 4][a % 4] = position(&CUBIC, sum(QUADRATIC[a / 4], VARIABLES[a % 4]));
        a += 1;
    }
    table
};

pub(crate) type Cubic = [f64; 20];

/// Two linear forms in `(x, y, z, w)` side by side, and two quadratic ones.
pub(crate) type Linears = [Two; 4];
pub(crate) type Quadratics = [Two; 10];

/// The sums of products of linear forms, by [`QUADRATIC`].
///
/// Not in line: a few forms fit into the registers, all of those that are needed do not.
#[inline(never)]
pub(crate) fn quadratics<const N: usize>(terms: [(&Linears, &Linears); N]) -> Quadratics {
    let product = |i: usize, j: usize| {
        let (a, b) = terms[0];
        terms[1..].iter().fold(a[i] * b[j], |sum, (a, b)| sum + a[i] * b[j])
    };
    let mut out = [Two::ZERO; 10];
    for i in 0..4 {
        out[SQUARE[i][i]] = product(i, i);
        for j in 0..i {
            out[SQUARE[i][j]] = product(i, j) + product(j, i);
        }
    }
    out
}

/// Ten cubics over [`CUBIC`], and room to compute them in.
pub(crate) struct Cubics {
    pub(crate) rows: [Cubic; 10],
    /// The quadratic factors of the four variables in two cubics.
    factors: [Quadratics; 4],
}

impl Cubics {
    pub(crate) fn new() -> Self {
        Self { rows: [[0.0; 20]; 10], factors: [[Two::ZERO; 10]; 4] }
    }

    /// Pair `pair` of the cubics, two rows, as sums of products of quadratic and linear forms.
    ///
    /// Summed variable by variable of the linear forms: the registers do not hold twenty coefficients.
    pub(crate) fn set<const N: usize>(&mut self, pair: usize, terms: [(&Quadratics, &Linears); N]) {
        let (a, b) = terms[0];
        for (v, factor) in self.factors.iter_mut().enumerate() {
            for i in 0..10 {
                factor[i] = terms[1..].iter().fold(a[i] * b[v], |sum, (a, b)| sum + a[i] * b[v]);
            }
        }
        let mut sums = [Two::ZERO; 20];
        for v in 0..4 {
            for i in 0..10 {
                sums[PRODUCT[i][v]] += self.factors[v][i];
            }
        }
        let (first, second) = self.rows[2 * pair..][..2].split_at_mut(1);
        let rows = first[0].as_chunks_mut::<2>().0.iter_mut().zip(second[0].as_chunks_mut::<2>().0);
        for ((first, second), sums) in rows.zip(sums.as_chunks::<2>().0) {
            [*first, *second] = Two::transpose(*sums).map(Two::to_array);
        }
    }
}

/// The first lane of `x` beside the first of `y`.
///
/// By the compiler's shuffles: what is put together from numbers goes through memory, and waits there.
#[inline]
pub(crate) fn firsts<const N: usize>(x: &[Two; N], y: &[Two; N]) -> [Two; N] {
    std::array::from_fn(|k| Two::transpose([x[k], y[k]])[0])
}

/// The second lane of `x` beside the second of `y`.
#[inline]
pub(crate) fn seconds<const N: usize>(x: &[Two; N], y: &[Two; N]) -> [Two; N] {
    std::array::from_fn(|k| Two::transpose([x[k], y[k]])[1])
}

/// The first of two on both lanes.
#[inline]
pub(crate) fn first<const N: usize>(x: &[Two; N]) -> [Two; N] {
    firsts(x, x)
}

/// The second of two on both lanes.
#[inline]
pub(crate) fn second<const N: usize>(x: &[Two; N]) -> [Two; N] {
    seconds(x, x)
}

/// The second lane of `x` beside the first of `y`.
#[inline]
pub(crate) fn crossed<const N: usize>(x: &[Two; N], y: &[Two; N]) -> [Two; N] {
    firsts(&second(x), y)
}

#[inline]
pub(crate) fn swapped<const N: usize>(x: &[Two; N]) -> [Two; N] {
    crossed(x, x)
}

#[inline]
pub(crate) fn negative(x: &Linears) -> Linears {
    x.map(|x| -x)
}
