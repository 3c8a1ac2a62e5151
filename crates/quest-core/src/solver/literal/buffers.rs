//! Decompositions of faer in memory that is kept: one set of buffers a thread, which grow to the largest problem seen.

use std::ops::{Deref, DerefMut};

use faer::diag::{Diag, DiagMut};
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::evd::{ComputeEigenvectors, evd_real, evd_scratch};
use faer::linalg::householder::{
    apply_block_householder_sequence_on_the_left_in_place_scratch as apply_scratch,
    apply_block_householder_sequence_on_the_left_in_place_with_conj as apply,
    apply_block_householder_sequence_transpose_on_the_left_in_place_with_conj as apply_transpose,
};
use faer::linalg::qr::col_pivoting;
use faer::linalg::qr::no_pivoting::factor::{qr_in_place, qr_in_place_scratch, recommended_block_size};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::{Conj, Mat, MatRef, Par, Spec};
use nalgebra::Complex;

/// Memory that faer works in.
struct Scratch {
    buffer: MemBuffer,
    size: StackReq,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { buffer: MemBuffer::new(StackReq::empty()), size: StackReq::empty() }
    }
}

impl Scratch {
    fn of(&mut self, size: StackReq) -> &mut MemStack {
        let both = self.size.or(size);
        if both != self.size {
            *self = Self { buffer: MemBuffer::new(both), size: both };
        }
        MemStack::new(&mut self.buffer)
    }
}

/// A matrix, at first of no size.
pub(super) struct Matrix(Mat<f64>);

impl Default for Matrix {
    fn default() -> Self {
        Self(Mat::new())
    }
}

impl Deref for Matrix {
    type Target = Mat<f64>;

    fn deref(&self) -> &Mat<f64> {
        &self.0
    }
}

impl DerefMut for Matrix {
    fn deref_mut(&mut self) -> &mut Mat<f64> {
        &mut self.0
    }
}

/// Numbers on a diagonal, at first none.
pub(super) struct Values(Diag<f64>);

impl Default for Values {
    fn default() -> Self {
        Self(Diag::zeros(0))
    }
}

impl Values {
    fn of_size(&mut self, n: usize) -> DiagMut<'_, f64> {
        if self.0.dim() != n {
            self.0 = Diag::zeros(n);
        }
        self.0.as_mut()
    }

    pub(super) fn at(&self, k: usize) -> f64 {
        self.0.column_vector()[k]
    }
}

/// Makes a matrix one of zeros of a shape, in its memory if that suffices.
pub(super) fn zeros(matrix: &mut Matrix, rows: usize, columns: usize) {
    matrix.resize_with(rows, columns, |_, _| 0.0);
    matrix.fill(0.0);
}

/// A QR decomposition in place: what the matrix was is gone.
#[derive(Default)]
pub(super) struct Factored {
    coefficients: Matrix,
    forward: Vec<usize>,
    backward: Vec<usize>,
    scratch: Scratch,
}

impl Factored {
    /// `A = Q R`.
    pub(super) fn factor(&mut self, a: &mut Mat<f64>) {
        let (rows, columns) = a.shape();
        let block = recommended_block_size::<f64>(rows, columns);
        zeros(&mut self.coefficients, block, rows.min(columns));
        let size = qr_in_place_scratch::<f64>(rows, columns, block, Par::Seq, Spec::default());
        let stack = self.scratch.of(size);
        qr_in_place(a.as_mut(), self.coefficients.as_mut(), Par::Seq, stack, Spec::default());
    }

    /// `A P = Q R` with the pivots of falling size.
    pub(super) fn factor_pivoted(&mut self, a: &mut Mat<f64>) {
        let (rows, columns) = a.shape();
        let block = recommended_block_size::<f64>(rows, columns);
        zeros(&mut self.coefficients, block, rows.min(columns));
        self.forward.resize(columns, 0);
        self.backward.resize(columns, 0);
        let size = col_pivoting::factor::qr_in_place_scratch::<usize, f64>(
            rows,
            columns,
            block,
            Par::Seq,
            Spec::default(),
        );
        let stack = self.scratch.of(size);
        col_pivoting::factor::qr_in_place(
            a.as_mut(),
            self.coefficients.as_mut(),
            &mut self.forward,
            &mut self.backward,
            Par::Seq,
            stack,
            Spec::default(),
        );
    }

    /// `Q X` in the place of `X`.
    pub(super) fn apply(&mut self, factored: MatRef<'_, f64>, x: &mut Mat<f64>) {
        let block = self.coefficients.nrows();
        let stack = self.scratch.of(apply_scratch::<f64>(factored.nrows(), block, x.ncols()));
        let basis = factored.subcols(0, factored.nrows().min(factored.ncols()));
        apply(basis, self.coefficients.as_ref(), Conj::No, x.as_mut(), Par::Seq, stack);
    }

    /// `Qᵀ X` in the place of `X`.
    pub(super) fn apply_transpose(&mut self, factored: MatRef<'_, f64>, x: &mut Mat<f64>) {
        let block = self.coefficients.nrows();
        let stack = self.scratch.of(apply_scratch::<f64>(factored.nrows(), block, x.ncols()));
        let basis = factored.subcols(0, factored.nrows().min(factored.ncols()));
        apply_transpose(basis, self.coefficients.as_ref(), Conj::No, x.as_mut(), Par::Seq, stack);
    }
}

/// The eigenvectors of a real matrix.
#[derive(Default)]
pub(super) struct Eigen {
    re: Values,
    im: Values,
    vectors: Matrix,
    scratch: Scratch,
}

impl Eigen {
    /// Whether the iteration converged.
    pub(super) fn decompose(&mut self, a: MatRef<'_, f64>) -> bool {
        let n = a.nrows();
        zeros(&mut self.vectors, n, n);
        let (no, yes) = (ComputeEigenvectors::No, ComputeEigenvectors::Yes);
        let stack = self.scratch.of(evd_scratch::<f64>(n, no, yes, Par::Seq, Spec::default()));
        let vectors = Some(self.vectors.as_mut());
        let (re, im) = (self.re.of_size(n), self.im.of_size(n));
        evd_real(a, re, im, None, vectors, Par::Seq, stack, Spec::default()).is_ok()
    }

    /// The places of the eigenvectors of which each real one and one of each conjugate pair is there; whether it is real.
    pub(super) fn places(&self) -> impl Iterator<Item = (usize, bool)> + '_ {
        // Of a pair the first has the positive imaginary part, its real and imaginary parts two columns.
        (0..self.vectors.ncols()).filter(|&k| self.im.at(k) >= 0.0).map(|k| (k, self.im.at(k) == 0.0))
    }

    /// Entry `i` of the eigenvector at a place.
    pub(super) fn entry(&self, i: usize, (k, is_real): (usize, bool)) -> Complex<f64> {
        Complex::new(self.vectors[(i, k)], if is_real { 0.0 } else { self.vectors[(i, k + 1)] })
    }
}

/// The right singular vectors of a matrix with at least as many rows as columns.
#[derive(Default)]
pub(super) struct Singular {
    pub(super) values: Values,
    pub(super) u: Matrix,
    pub(super) v: Matrix,
    scratch: Scratch,
}

impl Singular {
    /// Whether the iteration converged.
    pub(super) fn decompose(&mut self, a: MatRef<'_, f64>) -> bool {
        let (m, n) = a.shape();
        zeros(&mut self.u, m, n);
        zeros(&mut self.v, n, n);
        let thin = ComputeSvdVectors::Thin;
        let stack = self.scratch.of(svd_scratch::<f64>(m, n, thin, thin, Par::Seq, Spec::default()));
        let (u, v) = (Some(self.u.as_mut()), Some(self.v.as_mut()));
        svd(a, self.values.of_size(n), u, v, Par::Seq, stack, Spec::default()).is_ok()
    }
}
