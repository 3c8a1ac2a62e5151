//! Samples in, essential matrices out.

use super::essentials::Essentials;
use crate::algebra::vectors::geometry::{Vector3, cross, dot, longest, product, scaled};
use crate::algebra::vectors::instructions::{Instructions, Task, Token};
use crate::algebra::vectors::lane::{F, Float, Lanes, M, MAX_F64_LANES as MAX_LANES, Mask, WordLanes};
use crate::algebra::vectors::twice::{Twice, TwiceLanes, twice};
use crate::lanes::stages::cubics::{self, Cubics};
use crate::lanes::stages::elimination::reduce;
use crate::lanes::stages::frame::{Frame, frame};
use crate::lanes::stages::isolation::{self, Cells, Grid, MAX_ROOTS, Tables};
use crate::lanes::stages::null_space::{Basis, null_space};
use crate::lanes::stages::resultant::Resultant;
use crate::lanes::stages::roots::{self, Root};
use crate::solver::shared::newton_lanes::Motion;
use crate::solver::{Kinds, PoseSolver, Quest};
use crate::{Candidates, Correspondence};

/// How accurate the essential matrices of a [`BatchSolver`] are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tolerance {
    /// To rounding: Newton's iteration on the motion itself, as in [`Quest`].
    Tight,
    /// For a robust loop: as the roots of the polynomial give them. Their errors are far below the noise of any image. The
    /// constraints `x2ᵀ E x1 = 0` of the sample hold to rounding, and the two singular values are equal to about 1e-6.
    Loop,
}

/// A sample names a match that is not there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("sample {sample} names match {index}, expected an index below the number of matches, {matches}")]
pub struct SampleError {
    /// The sample, counted from zero.
    pub sample: usize,
    /// The index that the sample names.
    pub index: u32,
    /// How many matches there are.
    pub matches: usize,
}

/// Solves many samples of five matches, several at a time.
///
/// Nothing is allocated once the output has grown to the largest batch.
#[derive(Clone, Copy, Debug)]
pub struct BatchSolver {
    tolerance: Tolerance,
    token: Token,
}

impl BatchSolver {
    /// A solver with the fastest instructions of this processor.
    #[must_use]
    pub fn new(tolerance: Tolerance) -> Self {
        Self { tolerance, token: Token::chosen() }
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

    /// Fills `out` with the essential matrices of each sample: five indices of `matches`.
    ///
    /// Some matrices of a sample may be missing where [`Essentials::is_complete`] is false for it. A robust loop takes another
    /// sample then. A caller that needs all matrices calls [`solve_all`](Self::solve_all).
    ///
    /// # Errors
    /// [`SampleError`] for an index beyond the matches; `out` is empty then.
    pub fn solve(
        &self,
        matches: &[Correspondence],
        samples: &[[u32; 5]],
        out: &mut Essentials,
    ) -> Result<(), SampleError> {
        self.run(Rest::Flagged, matches, samples, out)
    }

    /// The same for a robust loop, which wants poses and does not ask whether a sample is complete. An essential matrix is kept
    /// only if it passes the cheirality test as far as that is clear of noise: one of its poses has all five points in front of
    /// both cameras. Every root is counted once. One in ten of the matrices of false matches is left.
    pub(crate) fn solve_oriented(
        self,
        matches: &[Correspondence],
        samples: &[[u32; 5]],
        out: &mut Essentials,
    ) -> Result<(), SampleError> {
        self.run(Rest::Unasked, matches, samples, out)
    }

    /// As [`solve`](Self::solve), but [`Quest`] solves again the samples that are not complete. Every sample is complete then; one
    /// without a matrix has no real solution, or is degenerate.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_all(
        &self,
        matches: &[Correspondence],
        samples: &[[u32; 5]],
        out: &mut Essentials,
    ) -> Result<(), SampleError> {
        self.run(Rest::Solved, matches, samples, out)
    }

    fn run(
        self,
        rest: Rest,
        matches: &[Correspondence],
        samples: &[[u32; 5]],
        out: &mut Essentials,
    ) -> Result<(), SampleError> {
        out.clear();
        let result = self.token.run(Batch { tolerance: self.tolerance, rest, matches, samples, out });
        if result.is_err() {
            out.clear();
        }
        result
    }
}

/// What becomes of samples that the lanes may not have solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rest {
    /// They are not complete, and say so.
    Flagged,
    /// The scalar solver solves them.
    Solved,
    /// Nobody asks, and nobody wants matrices that no pose belongs to.
    Unasked,
}

/// The essential matrices of five matches by the scalar solver.
#[inline(never)]
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
    rest: Rest,
    matches: &'a [Correspondence],
    samples: &'a [[u32; 5]],
    out: &'a mut Essentials,
}

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
        let mut space = Space { cubics: cubics::empty(lanes), grid: Grid::new(), cells: Cells::new() };
        let mut found = Found::new();
        for (group, samples) in self.samples.chunks(L::COUNT).enumerate() {
            gather::<L>(self.matches, samples, &mut bearings)
                .map_err(|error| SampleError { sample: error.sample + group * L::COUNT, ..error })?;
            solve_group(lanes, tables, self.tolerance, self.rest, &bearings, &mut space, &mut found);
            for (lane, sample) in samples.iter().enumerate() {
                let is_complete = found.complete[lane] != 0;
                if self.rest == Rest::Solved && !is_complete {
                    self.out.push_sample(true, alone(&sample.map(|i| self.matches[i as usize])));
                } else {
                    self.out.push_sample(is_complete, found.of(lane));
                }
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
    /// The matrices of two roots of each sample: those of the second of all stand behind those of the first of all.
    pairs: [[[f64; 2 * MAX_LANES]; 9]; MAX_ROOTS / 2],
    /// A bit for each root of a sample whose matrix counts.
    kept: [u64; MAX_LANES],
    /// Not zero for a sample that is complete.
    complete: [u64; MAX_LANES],
}

impl Found {
    fn new() -> Self {
        let pair = [[0.0; 2 * MAX_LANES]; 9];
        Self { pairs: [pair; MAX_ROOTS / 2], kept: [0; MAX_LANES], complete: [0; MAX_LANES] }
    }

    /// The matrices of a sample.
    #[inline(always)]
    fn of(&self, lane: usize) -> impl Iterator<Item = [f64; 9]> {
        let mut kept = self.kept[lane];
        std::iter::from_fn(move || {
            let slot = kept.trailing_zeros() as usize;
            let pair = self.pairs.get(slot / 2)?;
            kept &= kept - 1;
            let place = lane + slot % 2 * MAX_LANES;
            Some(std::array::from_fn(|j| pair[j][place]))
        })
    }
}

/// Bearings closer to aligned than this, or rows closer to dependent, are left to the scalar solver.
const NO_PARALLAX: f64 = 1e-12;
const DEPENDENT: f64 = 1e-8;
/// An elimination that comes this close to singular has lost half of its digits.
const SMALL_PIVOT: f64 = 3e-8;

/// The product of a match's two angles from the epipoles, in square radians, below which its side may be noise: ten pixels of a
/// focal length of a thousand in both views.
const AT_EPIPOLE: f64 = 1e-4;

/// The last of Newton's steps, squared. Their convergence is quadratic.
const SHORT_STEP: f64 = 1e-14;
/// A step longer than this, squared, may lead to another solution: the root was a poor one.
const LONG_STEP: f64 = 1e-4;
const MAX_NEWTON_STEPS: usize = 7;

/// What the stages write to, large enough to be worth keeping from group to group.
struct Space<L: Lanes<f64>> {
    cubics: Cubics<L>,
    grid: Grid,
    cells: Cells,
}

/// The stages, from bearings to essential matrices.
#[inline(always)]
fn solve_group<L: WordLanes>(
    lanes: L,
    tables: &Tables,
    tolerance: Tolerance,
    rest: Rest,
    bearings: &Bearings,
    space: &mut Space<L>,
    found: &mut Found,
) {
    let a = load(lanes, &bearings[0]);
    let b = load(lanes, &bearings[1]);
    let (frame, mut rows) = frame(lanes, &a, &b);
    let (basis, independence) = null_space(lanes, &mut rows);
    cubics::fill(lanes, &basis, frame.parallax, &mut space.cubics);
    let (reduced, pivot) = reduce(lanes, &space.cubics);
    let resultant = Resultant::<L>::new(lanes, &reduced);
    let polynomial = resultant.polynomial(lanes);
    let mirrored = roots::mirrored::<L>(&polynomial);
    let cells = &mut space.cells;
    isolation::isolate(lanes, tables, &polynomial, &mirrored, &mut space.grid, cells);
    let count = lanes.load(&cells.count.map(|n| n as f64));

    let mut is_complete = lanes.splat(NO_PARALLAX).less(frame.parallax);
    is_complete = is_complete.and(lanes.splat(DEPENDENT).less(independence));
    is_complete = is_complete.and(lanes.splat(SMALL_PIVOT).less(pivot));
    if rest != Rest::Unasked {
        let difference = (roots::count(lanes, &polynomial) - count).abs();
        is_complete = is_complete.and(difference.less(lanes.splat(0.5)));
    }

    let essentials = essential_basis(&frame, &basis);
    let back = Back { lanes, tolerance, a: &a, b: &b, resultant: &resultant, essentials: &essentials };
    let most = cells.count[..L::COUNT].iter().copied().max().unwrap_or(0).div_ceil(2);
    let mut kept = lanes.no_bits();
    for (k, pair) in found.pairs[..most].iter_mut().enumerate() {
        let slot = Twice(lanes.splat((2 * k) as f64), lanes.splat((2 * k + 1) as f64));
        let is_there = slot.less(Twice(count, count));
        let root = roots::refine(lanes, &polynomial, &mirrored, cells, 2 * k, is_there);
        let (matrix, is_good) = back.essential(&root, is_there);
        for j in 0..9 {
            matrix[j].store(&mut pair[j]);
        }
        let twice = TwiceLanes(lanes);
        let (zero, one) = (twice.splat(0.0), twice.splat(1.0));
        let mut is_kept = is_good.and(is_there);
        if rest == Rest::Unasked {
            is_kept = is_kept.and(back.is_oriented(&matrix));
        }
        kept = lanes.with_bit(kept, is_kept.0, 1 << (2 * k));
        kept = lanes.with_bit(kept, is_kept.1, 2 << (2 * k));
        let lost = zero.select(is_good, one).select(is_there, zero);
        is_complete = is_complete.and((lost.0 + lost.1).less(lanes.splat(0.5)));
    }
    lanes.store_words(kept, &mut found.kept);
    lanes.store_words(lanes.with_bit(lanes.no_bits(), is_complete, 1), &mut found.complete);
}

/// From roots to essential matrices.
struct Back<'a, L: Lanes<f64>> {
    lanes: L,
    tolerance: Tolerance,
    a: &'a [Vector3<L>; 5],
    b: &'a [Vector3<L>; 5],
    resultant: &'a Resultant<L>,
    essentials: &'a [[F<L>; 4]; 9],
}

/// Two numbers for each problem, and two truth values.
type F2<L> = F<TwiceLanes<L>>;
type M2<L> = M<TwiceLanes<L>>;

impl<L: Lanes<f64>> Back<'_, L> {
    /// The essential matrices of two roots, and whether they are as accurate as they have to be.
    #[inline(always)]
    fn essential(&self, root: &Root<TwiceLanes<L>>, is_there: M2<L>) -> ([F2<L>; 9], M2<L>) {
        let point = self.resultant.points(root.z, root.w);
        let mut e = [point[0]; 9];
        for i in 0..9 {
            e[i] = dot::<TwiceLanes<L>, 4>(&twice(&self.essentials[i]), &point);
        }
        match self.tolerance {
            Tolerance::Loop => {
                let square = dot::<TwiceLanes<L>, 9>(&e, &e);
                let scale = (TwiceLanes(self.lanes).splat(2.0) / square).sqrt();
                (scaled::<TwiceLanes<L>, 9>(e, scale), root.is_certain)
            }
            Tolerance::Tight => {
                let (e, is_good) = self.polished(&e, is_there);
                (e, is_good.and(root.is_certain))
            }
        }
    }

    /// Whether a pose of each essential matrix may have the five points in front of both cameras.
    ///
    /// From `μ b = λ R a + t` follows `μ (t × b) = λ (t × R a) = λ E a`: where both depths are positive, `(t × b) · E a` is
    /// positive for every match, or negative for every match where the sign of `t` is the other one (O. Chum, T. Werner, J. Matas,
    /// *Epipolar geometry estimation via RANSAC benefits from the oriented epipolar constraint*, ICPR 2004). No parallax
    /// is needed for that. Near the epipole the sign is noise, and either will do.
    #[inline(always)]
    fn is_oriented(&self, e: &[F2<L>; 9]) -> M2<L> {
        let lanes = TwiceLanes(self.lanes);
        let columns = [[e[0], e[3], e[6]], [e[1], e[4], e[7]], [e[2], e[5], e[8]]];
        let rows = [[e[0], e[1], e[2]], [e[3], e[4], e[5]], [e[6], e[7], e[8]]];
        let cofactors = [
            cross::<TwiceLanes<L>>(&columns[1], &columns[2]),
            cross::<TwiceLanes<L>>(&columns[2], &columns[0]),
            cross::<TwiceLanes<L>>(&columns[0], &columns[1]),
        ];
        let (t, _) = longest::<TwiceLanes<L>>(&cofactors);
        let (mut least, mut most) = (lanes.splat(f64::MAX), lanes.splat(f64::MIN));
        for i in 0..5 {
            let image = product::<TwiceLanes<L>>(&rows, &twice(&self.a[i]));
            let side = dot::<TwiceLanes<L>, 3>(&cross::<TwiceLanes<L>>(&t, &twice(&self.b[i])), &image);
            least = side.select(side.less(least), least);
            most = side.select(most.less(side), most);
        }
        let noise = lanes.splat(AT_EPIPOLE);
        (-noise).less(least).or(most.less(noise))
    }

    /// The solutions of the constraints near essential matrices, and whether Newton's iteration has found them.
    #[inline(always)]
    fn polished(&self, e: &[F2<L>; 9], is_there: M2<L>) -> ([F2<L>; 9], M2<L>) {
        let lanes = TwiceLanes(self.lanes);
        let short = lanes.splat(SHORT_STEP);
        let mut motion = Motion::new(lanes, e);
        let mut last = lanes.splat(1.0).select(is_there, lanes.splat(0.0));
        let mut longest = lanes.splat(0.0);
        for _ in 0..MAX_NEWTON_STEPS {
            let step =
                motion.step(lanes, |i| [twice(&self.a[i]), twice(&self.b[i])], |_, constraint| constraint);
            let (next, length) = (step.next, step.turn + step.moved);
            // A lane that has arrived stays where it is, whatever its neighbours do.
            let active = short.less(last);
            motion = next.select(active, motion);
            last = length.select(active, last);
            longest = last.select(longest.less(last), longest);
            if !short.less(last).any() {
                break;
            }
        }
        let has_arrived = last.less(short + short).and(longest.less(lanes.splat(LONG_STEP)));
        (motion.essential(lanes), has_arrived)
    }
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
fn essential_basis<L: Lanes<f64>>(frame: &Frame<L>, basis: &Basis<L>) -> [[F<L>; 4]; 9] {
    let (r, p) = (&frame.r0_21, frame.parallax);
    let mut out = [basis[0]; 9];
    for m in 0..4 {
        let [t0, t1, t2, xx, yy, zz, xy, xz, yz] = basis.map(|form| form[m]);
        let e = [
            [p * xx, p.mul_add(xy, -t2), p.mul_add(xz, t1)],
            [p.mul_add(xy, t2), p * yy, p.mul_add(yz, -t0)],
            [p.mul_add(xz, -t1), p.mul_add(yz, t0), p * zz],
        ];
        for j in 0..3 {
            let column = product::<L>(&e, &[r[0][j], r[1][j], r[2][j]]);
            for i in 0..3 {
                out[3 * i + j][m] = column[i];
            }
        }
    }
    out
}
