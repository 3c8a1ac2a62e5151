//! Samples in, essential matrices out.

use super::cubics::cubics;
use super::elimination::reduce;
use super::essentials::Essentials;
use super::frame::{Frame, frame};
use super::geometry::{Vector3, dot, product, scaled};
use super::instructions::{Instructions, Task, Token};
use super::lane::{F, Float, Lanes, Mask, WordLanes};
use super::motion::Motion;
use super::null_space::{Basis, null_space};
use super::resultant::Resultant;
use super::roots::{self, MAX_ROOTS, Tables};
use crate::solver::{Kinds, PoseSolver, Quest};
use crate::{Candidates, Correspondence};

/// How accurate the essential matrices of a [`BatchSolver`] are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tolerance {
    /// To rounding: Newton's iteration on the motion itself, as in [`Quest`].
    Tight,
    /// For a robust loop: as the roots of the polynomial give them, which is far below the noise of any image. The constraints
    /// `x2ᵀ E x1 = 0` of the sample hold to rounding, and the two singular values are equal to about 1e-6.
    Loop,
}

/// A sample names a match that is not there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("sample {sample} names match {index}, expected an index below the number of matches, {matches}")]
pub struct SampleError {
    /// The sample, counted from zero.
    pub sample: usize,
    /// What it names.
    pub index: u32,
    /// How many matches there are.
    pub matches: usize,
}

/// Solves many samples of five matches, several at a time.
///
/// No memory is taken from the heap once the output has grown to the largest batch.
#[derive(Clone, Copy, Debug)]
pub struct BatchSolver {
    tolerance: Tolerance,
    token: Token,
}

impl BatchSolver {
    /// A solver with the fastest instructions of this processor.
    #[must_use]
    pub fn new(tolerance: Tolerance) -> Self {
        Self { tolerance, token: Token::best() }
    }

    /// A solver with these instructions; `None` where the processor does not have them.
    #[must_use]
    pub fn with_instructions(tolerance: Tolerance, instructions: Instructions) -> Option<Self> {
        Token::new(instructions).map(|token| Self { tolerance, token })
    }

    /// The instructions that are used.
    #[must_use]
    pub fn instructions(&self) -> Instructions {
        self.token.instructions()
    }

    /// Fills `out` with the essential matrices of each sample of `matches`, given by indices.
    ///
    /// Where [`Essentials::is_complete`] is false for a sample some of its matrices may be missing: a robust loop takes another
    /// sample, and who needs them all calls [`solve_all`](Self::solve_all).
    ///
    /// # Errors
    /// [`SampleError`] for an index beyond the matches; `out` is empty then.
    pub fn solve(
        &self,
        matches: &[Correspondence],
        samples: &[[u32; 5]],
        out: &mut Essentials,
    ) -> Result<(), SampleError> {
        out.clear();
        let batch = Batch { tolerance: self.tolerance, matches, samples, out };
        let result = self.token.run(batch);
        if result.is_err() {
            out.clear();
        }
        result
    }

    /// The same, with the samples that are not complete solved again by [`Quest`]. Every sample is complete then; one without
    /// a matrix has no real solution, or is degenerate.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_all(
        &self,
        matches: &[Correspondence],
        samples: &[[u32; 5]],
        out: &mut Essentials,
    ) -> Result<(), SampleError> {
        self.solve(matches, samples, out)?;
        if (0..out.samples()).all(|sample| out.is_complete(sample)) {
            return Ok(());
        }
        let lanes = std::mem::take(out);
        for (sample, indices) in samples.iter().enumerate() {
            if lanes.is_complete(sample) {
                out.push_sample(true, lanes.matrices()[lanes.of(sample)].iter().copied());
            } else {
                out.push_sample(true, alone(&indices.map(|i| matches[i as usize])));
            }
        }
        Ok(())
    }
}

/// The essential matrices of five matches by the scalar solver.
fn alone(matches: &[Correspondence; 5]) -> impl Iterator<Item = [f64; 9]> {
    let mut candidates = Candidates::new();
    Quest { kinds: Kinds::Exact }.solve(matches, &mut candidates);
    let mut found: [Option<[f64; 9]>; MAX_ROOTS] = [None; MAX_ROOTS];
    let mut count = 0;
    for pose in candidates.iter().map(|c| c.pose) {
        let Some(direction) = pose.t_21.try_normalize(0.0) else { continue };
        let e = (direction.cross_matrix() * pose.r_21()).transpose();
        // A pose and its twisted partner have the same matrix, but for the sign.
        let is_there = found.iter().flatten().any(|f| {
            let product: f64 = f.iter().zip(e.iter()).map(|(x, y)| x * y).sum();
            2.0 - product.abs() < 1e-14
        });
        if !is_there && count < MAX_ROOTS {
            found[count] = e.as_slice().try_into().ok();
            count += 1;
        }
    }
    found.into_iter().flatten()
}

/// One call's work.
struct Batch<'a> {
    tolerance: Tolerance,
    matches: &'a [Correspondence],
    samples: &'a [[u32; 5]],
    out: &'a mut Essentials,
}

/// The most lanes of `f64`.
pub(super) const MAX_LANES: usize = 8;

/// The bearings of a group of samples: of each match three columns for view 1, of each match three for view 2.
type Bearings = [[[f64; MAX_LANES]; 15]; 2];

impl Task for Batch<'_> {
    type Output = Result<(), SampleError>;

    #[inline(always)]
    fn run<L: WordLanes + Lanes<f32>>(self, lanes: L) -> Self::Output {
        self.solve(lanes)
    }
}

impl Batch<'_> {
    #[inline(always)]
    fn solve<L: WordLanes>(self, lanes: L) -> Result<(), SampleError> {
        let tables = Tables::get();
        let mut bearings: Bearings = [[[0.0; MAX_LANES]; 15]; 2];
        let mut found = Found::new();
        for (group, samples) in self.samples.chunks(L::COUNT).enumerate() {
            gather::<L>(self.matches, samples, &mut bearings)
                .map_err(|error| SampleError { sample: error.sample + group * L::COUNT, ..error })?;
            solve_group(lanes, tables, self.tolerance, &bearings, &mut found);
            for lane in 0..samples.len() {
                let slots = found.slots[..found.most].iter();
                let kept = slots.filter(|slot| slot.is_kept[lane]);
                let matrix = |slot: &Slot| slot.matrix.map(|entry| entry[lane]);
                self.out.push_sample(found.is_complete[lane], kept.map(matrix));
            }
        }
        Ok(())
    }
}

/// Loads the bearings of as many samples as there are lanes; what is left of the lanes repeats the last.
#[inline(always)]
fn gather<L: Lanes<f64>>(
    matches: &[Correspondence],
    samples: &[[u32; 5]],
    out: &mut Bearings,
) -> Result<(), SampleError> {
    for lane in 0..L::COUNT {
        let sample = lane.min(samples.len() - 1);
        for (i, &index) in samples[sample].iter().enumerate() {
            let Some(m) = matches.get(index as usize) else {
                return Err(SampleError { sample, index, matches: matches.len() });
            };
            for k in 0..3 {
                out[0][3 * i + k][lane] = m.bearing1()[k];
                out[1][3 * i + k][lane] = m.bearing2()[k];
            }
        }
    }
    Ok(())
}

/// What a group of samples has for solutions.
struct Found {
    slots: [Slot; MAX_ROOTS],
    /// How many of the slots are in use.
    most: usize,
    is_complete: [bool; MAX_LANES],
}

/// At most one solution of each sample.
#[derive(Clone, Copy)]
struct Slot {
    matrix: [[f64; MAX_LANES]; 9],
    is_kept: [bool; MAX_LANES],
}

impl Found {
    fn new() -> Self {
        let slot = Slot { matrix: [[0.0; MAX_LANES]; 9], is_kept: [false; MAX_LANES] };
        Self { slots: [slot; MAX_ROOTS], most: 0, is_complete: [false; MAX_LANES] }
    }
}

/// Bearings closer to aligned than this, or rows closer to dependent, are left to the scalar solver.
const NO_PARALLAX: f64 = 1e-12;
const DEPENDENT: f64 = 1e-8;
/// An elimination that comes this close to singular has lost half of its digits.
const SMALL_PIVOT: f64 = 1e-8;

/// The last of Newton's steps, squared. Their convergence is quadratic.
const SHORT_STEP: f64 = 1e-14;
const MAX_NEWTON_STEPS: usize = 4;

#[inline(always)]
fn solve_group<L: WordLanes>(
    lanes: L,
    tables: &Tables,
    tolerance: Tolerance,
    bearings: &Bearings,
    found: &mut Found,
) {
    let (zero, one) = (lanes.splat(0.0), lanes.splat(1.0));
    let a = load(lanes, &bearings[0]);
    let b = load(lanes, &bearings[1]);
    let (frame, mut rows) = frame(lanes, &a, &b);
    let (basis, independence) = null_space(lanes, &mut rows);
    let (reduced, pivot) = reduce(lanes, &cubics(lanes, &basis, frame.parallax));
    let resultant = Resultant::<L>::new(lanes, &reduced);
    let polynomial = resultant.polynomial(lanes);
    let mirrored = roots::mirrored::<L>(&polynomial);
    let cells = roots::isolate(lanes, tables, &polynomial, &mirrored);
    let count = lanes.load(&cells.count.map(|n| n as f64));
    let essentials = essential_basis(lanes, &frame, &basis);

    let mut is_complete = lanes.splat(NO_PARALLAX).less(frame.parallax);
    is_complete = is_complete.and(lanes.splat(DEPENDENT).less(independence));
    is_complete = is_complete.and(lanes.splat(SMALL_PIVOT).less(pivot));
    let difference = (roots::count(lanes, &polynomial) - count).abs();
    is_complete = is_complete.and(difference.less(lanes.splat(0.5)));

    found.most = cells.count[..L::COUNT].iter().copied().max().unwrap_or(0);
    let mut k = 0;
    while k < found.most {
        const TOGETHER: usize = 2;
        let slot = [lanes.splat(k as f64), lanes.splat((k + 1) as f64)];
        let is_there = slot.map(|s| s.less(count));
        let accuracy = if tolerance == Tolerance::Tight { 1e-8 } else { 1e-6 };
        let roots =
            roots::refine::<L, TOGETHER>(lanes, &polynomial, &mirrored, &cells, k, &is_there, accuracy);
        for i in 0..TOGETHER.min(found.most - k) {
            let point = resultant.point(roots[i].z, roots[i].w);
            let mut e = combination::<L>(&essentials, &point);
            let mut is_good = roots[i].is_certain;
            if tolerance == Tolerance::Tight {
                let mut motion = Motion::new(lanes, &e);
                let short = lanes.splat(SHORT_STEP);
                let mut last = one.select(is_there[i], zero);
                for _ in 0..MAX_NEWTON_STEPS {
                    let (next, length) = motion.step(lanes, &a, &b);
                    let active = short.less(last);
                    motion = next.select(active, motion);
                    last = length.select(active, last);
                    if !short.less(last).any() {
                        break;
                    }
                }
                is_good = is_good.and(last.less(short + short));
                e = motion.essential(lanes);
            } else {
                e = scaled::<L, 9>(e, (lanes.splat(2.0) / dot::<L, 9>(&e, &e)).sqrt());
            }
            let bad = is_there[i];
            let flags = one.select(is_good, zero);
            is_complete = is_complete.and(lanes.splat(0.5).less(flags.select(bad, one)));
            let keep = one.select(is_good, zero).select(is_there[i], zero);
            let out = &mut found.slots[k + i];
            for j in 0..9 {
                e[j].store(&mut out.matrix[j]);
            }
            let mut kept = [0.0; MAX_LANES];
            keep.store(&mut kept);
            out.is_kept = kept.map(|x| x > 0.5);
        }
        k += TOGETHER;
    }
    let mut complete = [0.0; MAX_LANES];
    one.select(is_complete, zero).store(&mut complete);
    found.is_complete = complete.map(|x| x > 0.5);
}

#[inline(always)]
fn load<L: Lanes<f64>>(lanes: L, columns: &[[f64; MAX_LANES]; 15]) -> [Vector3<L>; 5] {
    let mut out = [[lanes.splat(0.0); 3]; 5];
    for i in 0..5 {
        for k in 0..3 {
            out[i][k] = lanes.load(&columns[3 * i + k]);
        }
    }
    out
}

/// The essential matrices between the views as given that span the solutions: `([t]× + p S) R0` of each basis vector.
#[inline(always)]
fn essential_basis<L: Lanes<f64>>(lanes: L, frame: &Frame<L>, basis: &Basis<L>) -> [[F<L>; 4]; 9] {
    let mut out = *basis;
    let r = &frame.r0_21;
    let columns = [[r[0][0], r[1][0], r[2][0]], [r[0][1], r[1][1], r[2][1]], [r[0][2], r[1][2], r[2][2]]];
    for m in 0..4 {
        let [t0, t1, t2, xx, yy, zz, xy, xz, yz] = basis.map(|form| form[m]);
        let p = frame.parallax;
        let e = [
            [p * xx, p.mul_add(xy, -t2), p.mul_add(xz, t1)],
            [p.mul_add(xy, t2), p * yy, p.mul_add(yz, -t0)],
            [p.mul_add(xz, -t1), p.mul_add(yz, t0), p * zz],
        ];
        for j in 0..3 {
            let column = product::<L>(&e, &columns[j]);
            for i in 0..3 {
                out[3 * i + j][m] = column[i];
            }
        }
    }
    let _ = lanes;
    out
}

/// `x N1 + y N2 + z N3 + w N4`.
#[inline(always)]
fn combination<L: Lanes<f64>>(basis: &[[F<L>; 4]; 9], point: &[F<L>; 4]) -> [F<L>; 9] {
    let mut out = [point[0]; 9];
    for i in 0..9 {
        out[i] = dot::<L, 4>(&basis[i], point);
    }
    out
}
