//! All constraints of any number of matches in one matrix: what the search for local minima works with, at a cost that does
//! not depend on their number.

use nalgebra::{Matrix3, Matrix5, UnitQuaternion, Vector3, Vector5};

use crate::algebra::symmetric::smallest_eigenvector_3;
use crate::algebra::tridiagonal::eigen;
use crate::algebra::vectors::two::{self, Two, side_by_side};
use crate::alignment::rotation_of_outer_sum;
use crate::degeneracy::diagnose;
use crate::epipolar_frame::EpipolarFrame;
use crate::solver::shared::motion::{COARSE, Equations, Motion};
use crate::solver::shared::parallax_frame::{Alignment, Coordinates, GRAM_DEPENDENT};
use crate::{Correspondence, Degeneracy};

/// `Σ y yᵀ` over the rows `y` of any number of matches: the summed squares of their constraints, divided by the parallax, are
/// a quadratic form in the coordinates of the essential matrix.
///
/// Divided by the mean of `|t × b|² + |t × c|²` that is nearly the sum of the squared Sampson errors: the *cost* of a motion.
/// Without, noise pulls the translation towards the middle of the image.
#[derive(Clone, Debug)]
pub(crate) struct Gram {
    /// The frame of the coordinates.
    pub(crate) alignment: Alignment,
    sum: [[f64; 9]; 9],
    /// `Σ b bᵀ / n` and `Σ c cᵀ / n`.
    scatter: [Matrix3<f64>; 2],
    /// How many matches.
    pub(crate) count: f64,
    /// Whether the rows were summed one by one, so that no digits are lost however small the parallax.
    by_rows: bool,
}

/// With less parallax than this (root mean square of the sine) moments of the bearings leave too few digits of it.
const PARALLAX_OF_MOMENTS: f64 = 1e-2;

/// Constraints closer to dependent than this by moments of the bearings are summed row by row: the rounding of the moments
/// divided by the square of [`PARALLAX_OF_MOMENTS`], a hundred times.
const DOUBTFUL: f64 = 1e-10;

impl Gram {
    /// The best alignment of any number of matches and their constraints, in one pass over the matches where there is
    /// parallax enough.
    pub(crate) fn aligned(matches: &[Correspondence]) -> Self {
        Self::from_moments(matches).unwrap_or_else(|| Self::new(&Alignment::new(matches), matches))
    }

    /// The constraints in the frame of an alignment.
    pub(crate) fn new(alignment: &Alignment, matches: &[Correspondence]) -> Self {
        let turned = alignment.turned();
        let mut lower = [[0.0; 9]; 9];
        for m in matches {
            let y = alignment.row(m.bearing2(), &turned(m));
            for i in 0..9 {
                for j in 0..=i {
                    lower[i][j] += y[i] * y[j];
                }
            }
        }
        let sum = std::array::from_fn(|i| std::array::from_fn(|j| lower[i.max(j)][i.min(j)]));
        let unscaled = scaled(&sum, alignment.parallax);
        let count = matches.len() as f64;
        Self { alignment: *alignment, sum, scatter: scatter(&unscaled), count, by_rows: true }
    }

    /// `None` where bearings are opposite to the rotated ones, or the parallax is small.
    fn from_moments(matches: &[Correspondence]) -> Option<Self> {
        let moments = Moments::new(matches)?;
        let q0_21 = rotation_of_outer_sum(&moments.outer, matches.len());
        let unscaled = moments.aligned(&q0_21);
        let count = matches.len() as f64;
        let parallax = ((unscaled[0][0] + unscaled[1][1] + unscaled[2][2]) / count).sqrt();
        if parallax.is_nan() || parallax < PARALLAX_OF_MOMENTS {
            return None;
        }
        let alignment = Alignment { q0_21, parallax };
        let (sum, scatter) = (scaled(&unscaled, 1.0 / parallax), scatter(&unscaled));
        Some(Self { alignment, sum, scatter, count, by_rows: false })
    }

    /// An orthonormal basis of the nine coordinates, those that the matches constrain most first: the first five
    /// stand for the constraints of all matches, the last four span the essential matrices that fit them best.
    pub(crate) fn principal_basis(
        &mut self,
        matches: &[Correspondence],
    ) -> Result<[Coordinates; 9], Degeneracy> {
        let (squares, basis) = eigen(self.sum);
        if !self.by_rows && squares[4] < DOUBTFUL * squares[0] {
            *self = Self::new(&Alignment::new(matches), matches);
            return self.principal_basis(matches);
        }
        if squares[4] < GRAM_DEPENDENT * squares[0] { Err(diagnose(matches)) } else { Ok(basis) }
    }

    /// The direction of the translation that fits a rotation best; see
    /// [`translation_direction`](crate::structure::translation_direction).
    pub(crate) fn direction(&self, q_21: &UnitQuaternion<f64>) -> Vector3<f64> {
        let r = self.alignment.after_alignment(q_21);
        let columns =
            [0, 1, 2].map(|k| self.alignment.coordinates(&(Vector3::ith(k, 1.0).cross_matrix() * r)));
        let weighted = columns.map(|column| self.times(&column));
        let squares = Matrix3::from_fn(|i, j| dot(&columns[i], &weighted[j]));
        smallest_eigenvector_3(&squares).unwrap_or_else(Vector3::z)
    }

    /// The matches beyond the five that any motion fits, at least one.
    pub(crate) fn beyond_five(&self) -> f64 {
        (self.count - 5.0).max(1.0)
    }

    /// From a motion to near a local minimum of the cost: what the Sampson errors are to decide is left to these.
    pub(crate) fn minimise(&self, motion: &mut Motion) {
        motion.descend(|motion| self.equations(motion), self.beyond_five(), &COARSE);
    }

    /// The cost of a motion.
    pub(crate) fn cost(&self, motion: &Motion) -> f64 {
        let frame = motion.frame();
        let turned = self.turned(&frame);
        let value = self.alignment.coordinates(&essential(&frame, &turned));
        dot(&value, &self.times(&value)) / self.gradient(&frame, &turned).0
    }

    /// The mean of `g = |t × b|² + |t × c|²` over the matches, and half its derivatives by the five parameters.
    fn gradient(&self, frame: &EpipolarFrame, turned: &Matrix3<f64>) -> (f64, [f64; 5]) {
        let along_b: [f64; 3] = (frame.from_2 * self.scatter[0] * frame.from_2.row(2).transpose()).into();
        let along_c: [f64; 3] = (turned * self.scatter[1] * turned.row(2).transpose()).into();
        let g = 2.0 - along_b[2] - along_c[2];
        let by_move = [-along_b[0] - along_c[0], -along_b[1] - along_c[1]];
        (g, [-along_c[1], along_c[0], 0.0, by_move[0], by_move[1]])
    }

    /// The cost of a motion and the equations of a Gauss–Newton step.
    fn equations(&self, motion: &Motion) -> Equations {
        let frame = motion.frame();
        let turned = self.turned(&frame);
        let [d0, d1, d2, d3, d4] = derivatives(&frame, &turned).map(|e| self.alignment.coordinates(&e));
        let value = self.alignment.coordinates(&essential(&frame, &turned));
        // With r = e / √g: dr = (de − e dg / (2 g)) / √g.
        let (g, half) = self.gradient(&frame, &turned);
        let [h0, h1, _, h3, h4] = half.map(|derivative| derivative / g);
        // The derivatives and the value side by side.
        let columns: [[Two; 3]; 9] = std::array::from_fn(|k| {
            let v = value[k];
            [[d0[k] - h0 * v, d1[k] - h1 * v], [d2[k], d3[k] - h3 * v], [d4[k] - h4 * v, v]].map(Two::new)
        });
        let over_g = 1.0 / g;
        let mut products = [[Two::ZERO; 3]; 6];
        for (row, column) in self.sum.iter().zip(&columns) {
            let mut weighted = [Two::ZERO; 3];
            for (factor, other) in row.iter().zip(&columns) {
                for j in 0..3 {
                    weighted[j] += other[j] * *factor;
                }
            }
            let column = column.map(|pair| (pair * over_g).to_array());
            for (i, factor) in column.as_flattened().iter().enumerate() {
                // The upper triangle.
                for j in i / 2..3 {
                    products[i][j] += weighted[j] * *factor;
                }
            }
        }
        let products = products.map(|row| row.map(Two::to_array));
        let product = |i: usize, j: usize| products[i.min(j)].as_flattened()[i.max(j)];
        Equations {
            frame,
            cost: product(5, 5),
            hessian: Matrix5::from_fn(product),
            gradient: Vector5::from_fn(|i, _| product(i, 5)),
        }
    }

    /// From the aligned view 1 into the frame of a motion.
    fn turned(&self, frame: &EpipolarFrame) -> Matrix3<f64> {
        frame.from_1 * self.alignment.q0_21.to_rotation_matrix().into_inner().transpose()
    }

    fn times(&self, x: &Coordinates) -> Coordinates {
        let mut out = [0.0; 9];
        for (row, factor) in self.sum.iter().zip(x) {
            for (value, entry) in out.iter_mut().zip(row) {
                *value += factor * entry;
            }
        }
        out
    }
}

fn dot(x: &Coordinates, y: &Coordinates) -> f64 {
    let mut sum = 0.0;
    for k in 0..9 {
        sum += x[k] * y[k];
    }
    sum
}

/// `[t]× R` for `R = Fᵀ turned`, the translation being the third axis of the frame `F`.
fn essential(frame: &EpipolarFrame, turned: &Matrix3<f64>) -> Matrix3<f64> {
    let [f1, f2, _] = axes(frame);
    f2 * turned.row(0) - f1 * turned.row(1)
}

/// The derivatives of the essential matrix by the five parameters of [`Motion`]: `[t]× [f]×  R = f (tᵀ R) − (t · f) R` for a
/// rotation about an axis `f` of the frame, `[f]× R` for a move of `t`.
fn derivatives(frame: &EpipolarFrame, turned: &Matrix3<f64>) -> [Matrix3<f64>; 5] {
    let [f1, f2, t] = axes(frame);
    let [u, v, w] = [turned.row(0), turned.row(1), turned.row(2)];
    [f1 * w, f2 * w, -(f1 * u + f2 * v), t * v - f2 * w, f1 * w - t * u]
}

fn axes(frame: &EpipolarFrame) -> [Vector3<f64>; 3] {
    [0, 1, 2].map(|k| frame.from_2.row(k).transpose())
}

/// The places of the products `xx, yy, zz, xy, xz, yz` of a vector with itself.
const PRODUCTS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// Where the product of two coordinates stands among [`PRODUCTS`].
const PLACE: [[usize; 3]; 3] = [[0, 3, 4], [3, 1, 5], [4, 5, 2]];

/// Sums over the matches that a rotation of view 1 can be applied to afterwards.
struct Moments {
    /// `Σ b aᵀ`.
    outer: Matrix3<f64>,
    /// `Σ (b b)(a a)`, over [`PRODUCTS`].
    products: [[f64; 6]; 6],
}

impl Moments {
    /// `None` where bearings seem to be opposite to the rotated ones: a rotation keeps the angles to the first bearing,
    /// and the orientation.
    fn new(matches: &[Correspondence]) -> Option<Self> {
        let first = matches.first()?;
        let ahead1 = side_by_side(first.bearing1(), Some(first.bearing1()));
        let ahead2 = side_by_side(first.bearing2(), Some(first.bearing2()));
        let (mut outer, mut products) = ([[Two::ZERO; 3]; 3], [[Two::ZERO; 6]; 6]);
        let mut opposite = Two::ZERO;
        for pair in matches.chunks(2) {
            let second = pair.get(1);
            let a = side_by_side(pair[0].bearing1(), second.map(Correspondence::bearing1));
            let b = side_by_side(pair[0].bearing2(), second.map(Correspondence::bearing2));
            let signs = two::dot(&ahead1, &a) * two::dot(&ahead2, &b);
            opposite |= signs.simd_lt(Two::ZERO);
            for i in 0..3 {
                for j in 0..3 {
                    outer[i][j] += b[i] * a[j];
                }
            }
            let [bb, aa] = [b, a].map(|x| PRODUCTS.map(|(i, j)| x[i] * x[j]));
            for i in 0..6 {
                for j in 0..6 {
                    products[i][j] += bb[i] * aa[j];
                }
            }
        }
        let outer = Matrix3::from_fn(|i, j| outer[i][j].reduce_add());
        let products = products.map(|row| row.map(Two::reduce_add));
        (!opposite.any() && outer.determinant() >= 0.0).then_some(Self { outer, products })
    }

    /// `Σ y yᵀ` over the rows `y = [c × b, sym(b cᵀ)]`, `c = R0 a`.
    fn aligned(&self, q0_21: &UnitQuaternion<f64>) -> [[f64; 9]; 9] {
        let r0_21 = q0_21.to_rotation_matrix().into_inner();
        let turned = self.products.map(|row| {
            let squares = Matrix3::from_fn(|i, j| row[PLACE[i][j]]);
            let squares = r0_21 * squares * r0_21.transpose();
            PRODUCTS.map(|(i, j)| squares[(i, j)])
        });
        // Products of two entries of b cᵀ, row by row; then combinations of their rows, and of their columns.
        let entry = |m: usize, n: usize| turned[PLACE[m / 3][n / 3]][PLACE[m % 3][n % 3]];
        let all: [[f64; 9]; 9] = std::array::from_fn(|m| std::array::from_fn(|n| entry(m, n)));
        let half = transposed(&all.map(|row| row_of_products(&row)));
        transposed(&half.map(|row| row_of_products(&row)))
    }
}

/// `[c × b, sym(b cᵀ)]` by the products `b cᵀ`, row by row.
fn row_of_products(p: &[f64; 9]) -> Coordinates {
    let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = *p;
    [zy - yz, xz - zx, yx - xy, xx, yy, zz, xy + yx, xz + zx, yz + zy]
}

/// The same with the first three coordinates multiplied by a factor.
fn scaled(sum: &[[f64; 9]; 9], factor: f64) -> [[f64; 9]; 9] {
    let of = |k: usize| if k < 3 { factor } else { 1.0 };
    std::array::from_fn(|i| std::array::from_fn(|j| sum[i][j] * of(i) * of(j)))
}

/// `Σ b bᵀ` and `Σ c cᵀ` divided by their trace, by the sum over rows `[c × b, sym(b cᵀ)]`.
fn scatter(sum: &[[f64; 9]; 9]) -> [Matrix3<f64>; 2] {
    let products = |y: &Coordinates| {
        let [nx, ny, nz, xx, yy, zz, xy, xz, yz] = *y;
        [2.0 * xx, xy - nz, xz + ny, xy + nz, 2.0 * yy, yz - nx, xz - ny, yz + nx, 2.0 * zz]
    };
    let half = transposed(&sum.map(|row| products(&row)));
    let all = transposed(&half.map(|row| products(&row)));
    let squares = [
        Matrix3::from_fn(|i, j| (0..3).map(|k| all[3 * i + k][3 * j + k]).sum::<f64>()),
        Matrix3::from_fn(|i, j| (0..3).map(|k| all[3 * k + i][3 * k + j]).sum::<f64>()),
    ];
    squares.map(|s| s / s.trace())
}

fn transposed(a: &[[f64; 9]; 9]) -> [[f64; 9]; 9] {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}
