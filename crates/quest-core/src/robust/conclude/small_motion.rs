//! A camera that hardly moves: which of the local minima is right, which matches agree by chance, and whether there is a
//! translation.
//!
//! All of this is asked only where a rotation alone leaves little of the displacements, and of more than a few matches.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::algebra::vectors::widest::{Simd, Work, widest};
use crate::robust::conclude::alternatives::Alternative;
use crate::robust::conclude::depth_field::{self, DepthField, Fit, Mode, Terms};
use crate::robust::conclude::evidence::{Evidence, Likelihood, ROUNDS};
use crate::robust::conclude::final_refinement::{FEWEST, Polished};
use crate::robust::conclude::rotation_alone::{NOT_A_ROTATION, excess, median_root, rotation_alone};
use crate::robust::data::observations::Observations;
use crate::robust::data::point_transfer::{Displacement, Lanes, WIDTH};
use crate::robust::refine::epipolar::{FINE, Subset, refine};
use crate::robust::search::pose_score::PoseScorer;
use crate::robust::search::search_score::MANY;
use crate::solver::shared::motion::Motion;

/// The motion is small where a rotation leaves less than this: the `F` of [`model`](crate::robust::conclude::model), whose cap is
/// 8.2. It is near the cap, so that every motion is looked at of which a rotation explains some matches.
const SMALL: f64 = 7.5;

/// The median of what a rotation leaves must also be less than this, in standard deviations: with heavy tails `F` is low at any
/// parallax. Measured: a planted camera with 10 px of parallax has a median of 4; of the 93 recorded pairs those beyond 6 have depths
/// that are no smooth field, and without this limit their AUC@1 falls by one.
const FAR: f64 = 6.0;

/// The calibration error of a good camera, in radians: noise below that tells nothing of the model.
const CALIBRATION: f64 = 1e-4;

/// So many inliers tell whether the motion is small, and so many refine the rotation if it is. Both bound the time alone.
const GLANCE: usize = 300;
const ENOUGH: usize = 2_000;

/// So many matches decide by their likelihood, and so many compare and refine the minima. Both bound the time alone.
const WEIGHED: usize = 3_000;
const COMPARED: usize = 400;

/// The directions of the translation to begin with, the steps of each refinement, and the rounds of EM that compare minima. Twelve
/// directions of half a sphere are about 40° apart.
const DIRECTIONS: usize = 12;
const STEPS: usize = 10;
const FEW_ROUNDS: usize = 4;

/// Fewer inliers than this, three samples, do not tell minima apart.
const LEAST_INLIERS: usize = 16;

/// Another minimum replaces the polished one if it is better by so many nats, e² times as likely: less is scatter of EM.
const BETTER: f64 = 2.0;

/// The rotation does not explain a match whose displacement is more than this many standard deviations.
const OFF: f64 = 5.0;

/// So many matches that the rotation does not explain are looked at, and so many pairs of them. Both bound the time alone.
const OFF_COUNT: usize = 300;
const PAIRS: usize = 600;

/// A match is within this many standard deviations of its epipolar line.
const WITHIN: f64 = 3.0;

/// A match that is less likely true than this is an inlier by chance.
const LIKELY: f64 = 0.5;

/// At most one in so many inliers is one by chance. Where more seem to be, the likelihood does not fit the matches.
const MOST_BY_CHANCE: usize = 5;

/// The depth fields begin from so many minima. A few rounds with some of the matches compare them, since without a field the
/// evidence of a corridor's true motion is low; the best of them have more rounds, and those that are left have all matches.
const STARTS: usize = 24;
const GLIMPSE_ROUNDS: usize = 3;
const GOOD_STARTS: usize = 7;
const EXPLORED: usize = 250;
const EXPLORING_ROUNDS: usize = 6;
const FIELD_ROUNDS: usize = 10;

/// So many modes are kept at most. A mode that is less likely than the likeliest by so many nats has a weight of 0.001 (the
/// [power](crate::robust::conclude::mixture) of its likelihood). Some of the matches tell less surely which are.
const MODES: usize = 6;
const UNLIKELY: f64 = 14.0;
const UNLIKELY_OF_SOME: f64 = 16.0;

/// Where the essential matrix explains the matches better by so many nats, the depths are no smooth field.
const NO_FIELD: f64 = 8.0;

/// The second pose is a mode that is less likely by at most so many nats, a twentieth, and whose direction is so far away, 20°.
const AS_LIKELY: f64 = 3.0;
const OTHER: f64 = 0.35;

/// A translation stands clear of its noise at this many standard deviations.
const CLEAR: f64 = 4.0;

/// Directions with a larger cosine, within 11°, are the same start.
const SAME_DIRECTION: f64 = 0.98;

/// The spreads of inverse depths to begin with, of points in space and of points that are about equally far. EM changes them.
const USUAL: f64 = 0.2;
const EVEN: f64 = 0.05;

/// A local minimum of the Sampson errors: its likelihood and the mean inverse depth of its points.
#[derive(Clone, Copy, Debug)]
struct Minimum {
    nats: f64,
    motion: Motion,
    mean_depth: f64,
}

/// What is known of a motion that is small.
#[derive(Debug)]
pub(crate) struct SmallMotion {
    /// The best rotation without translation.
    pub(crate) q_21: UnitQuaternion<f64>,
    /// What it leaves: the `F` of [`model`](crate::robust::conclude::model).
    pub(crate) excess: f64,
    /// The evidence against it, in nats.
    pub(crate) nats: f64,
    /// The noise with that of the calibration, in pixels.
    pub(crate) sigma: f64,
    /// Matches that may be true.
    pub(crate) is_likely: Vec<bool>,
    /// The poses that explain the matches, the likeliest first.
    pub(crate) modes: Vec<Mode>,
}

impl SmallMotion {
    /// Leaves only the modes whose translations have about the direction of the likeliest: of the two motions of a plane one is the
    /// answer and the other the second pose. Their mean would be neither.
    pub(crate) fn without_twins(mut self) -> Self {
        let Some(t_21) = self.modes.first().map(|mode| mode.at.t_21) else { return self };
        self.modes.retain(|mode| mode.at.t_21.angle(&t_21) < OTHER);
        self
    }

    /// The likeliest mode.
    pub(crate) fn likeliest(&self) -> Option<Motion> {
        let at = &self.modes.first()?.at;
        Some(Motion { q_21: at.q_21, direction: at.t_21.try_normalize(f64::MIN_POSITIVE)? })
    }

    /// Whether the translation of the likeliest mode stands clear of its noise.
    pub(crate) fn is_clear(&self) -> bool {
        self.modes.first().is_some_and(|mode| {
            let block: Matrix3<f64> = mode.covariance.fixed_view::<3, 3>(3, 3).into_owned();
            let square = block.cholesky().map(|factor| mode.at.t_21.dot(&factor.solve(&mode.at.t_21)));
            square.is_some_and(|square| square > CLEAR * CLEAR)
        })
    }

    /// The modes that are nearly as likely as the likeliest.
    pub(crate) fn likely(&self) -> impl Iterator<Item = &Mode> {
        let most = self.modes.first().map_or(0.0, |mode| mode.nats);
        self.modes.iter().filter(move |mode| mode.nats > most - AS_LIKELY)
    }

    /// Of the modes that are nearly as likely as the likeliest, the one whose direction is the farthest from a translation, if that
    /// is far.
    pub(crate) fn other_mode(&self, t_21: &Vector3<f64>) -> Option<Motion> {
        let away = self.likely().map(|mode| (mode.at.t_21.angle(t_21), mode));
        let (angle, mode) = away.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let direction = mode.at.t_21.try_normalize(f64::MIN_POSITIVE)?;
        (angle > OTHER).then_some(Motion { q_21: mode.at.q_21, direction })
    }
}

/// Looks at a pose whose motion is small: the pose of the likeliest minimum, refined without matches that agree by chance. `of_plane`
/// are the motions of the best plane, both of which may be modes.
pub(crate) fn look(
    poses: &mut PoseScorer,
    polished: Polished,
    of_plane: &[Alternative],
) -> (Polished, Option<SmallMotion>) {
    let observations = poses.observations;
    let sigma = polished.sigma.hypot(CALIBRATION * observations.columns.focal_length());
    let inliers = polished.pose.inliers.len();
    if observations.len() < MANY || inliers == 0 {
        return (polished, None);
    }
    let start = polished.motion().q_21;
    let (q_21, excess, away) = best_rotation(observations, &polished, &start, sigma, GLANCE);
    if excess >= SMALL || away >= FAR {
        return (polished, None);
    }
    let (q_21, excess, _) = if inliers > GLANCE {
        best_rotation(observations, &polished, &q_21, sigma, ENOUGH)
    } else {
        (q_21, excess, away)
    };
    let share = inliers as f64 / observations.len() as f64;
    let likelihood = |count: usize| {
        let all: Vec<u32> = (0_u32..).take(observations.len().min(count)).collect();
        Likelihood::new(observations, &all, &q_21, sigma, share)
    };
    let (mut polished, mut minima) = (polished, Vec::new());
    if excess < NOT_A_ROTATION && inliers >= LEAST_INLIERS {
        (polished, minima) = likeliest(poses, polished, &q_21, sigma, &likelihood(COMPARED));
    }
    let (polished, is_likely) = without_chance(poses, polished, &likelihood(usize::MAX));
    let weighed = likelihood(WEIGHED);
    let Evidence { nats, mean_depth, .. } = weighed.of(polished.motion(), ROUNDS);
    minima.push(Minimum { nats: f64::INFINITY, motion: *polished.motion(), mean_depth });
    minima.extend(of_plane.iter().map(|alternative| {
        let motion = *alternative.motion();
        let mean_depth = weighed.of(&motion, FEW_ROUNDS).mean_depth;
        Minimum { nats: f64::INFINITY, motion, mean_depth }
    }));
    let least_depth = sigma / observations.columns.focal_length();
    let mut modes = modes(&q_21, &minima, least_depth, &likelihood(EXPLORED), &weighed);
    // Where none explains the matches as well as the essential matrix does, the depths are of another kind.
    modes.retain(|mode| mode.nats > nats - NO_FIELD);
    let nats = modes.first().map_or(nats, |mode| mode.nats.max(nats));
    (polished, Some(SmallMotion { q_21, excess, nats, sigma, is_likely, modes }))
}

/// The poses that explain the matches with points at depths that follow a smooth field, from each of the minima and from no
/// translation at all: those that are nearly as likely as the likeliest, by some of the matches first and then by many.
fn modes(
    q_21: &UnitQuaternion<f64>,
    minima: &[Minimum],
    least_depth: f64,
    of_some: &Likelihood,
    of_many: &Likelihood,
) -> Vec<Mode> {
    let fitted = |starts: Vec<DepthField>, (likelihood, terms): (&Likelihood, &[Terms]), rounds, most| {
        let mut fits: Vec<Fit> =
            starts.into_iter().filter_map(|start| start.fit(terms, likelihood, rounds)).collect();
        fits.sort_by(|a, b| b.nats.total_cmp(&a.nats));
        let mut distinct: Vec<Fit> = Vec::new();
        for fit in fits {
            let is_known = distinct.iter().any(|other| fit.at.is_near(other));
            if !is_known && distinct.len() < most {
                distinct.push(fit);
            }
        }
        distinct
    };
    let ends = |fits: Vec<Fit>| fits.into_iter().map(|fit| fit.at).collect::<Vec<_>>();
    let likely = |mut fits: Vec<Fit>, unlikely: f64| {
        let most = fits.first().map_or(0.0, |fit| fit.nats);
        fits.retain(|fit| fit.nats > most - unlikely);
        fits
    };
    let mut starts = vec![DepthField::start(*q_21, Vector3::zeros(), EVEN)];
    starts.extend(distinct(minima).iter().map(|minimum| {
        // The mean of distant points is noise, and may be behind the cameras.
        let t_21 = minimum.motion.direction * minimum.mean_depth.max(least_depth);
        DepthField::start(minimum.motion.q_21, t_21, USUAL)
    }));
    let terms = [of_some, of_many].map(depth_field::terms);
    let (some, many) = ((of_some, &terms[0][..]), (of_many, &terms[1][..]));
    let good = ends(fitted(starts, some, GLIMPSE_ROUNDS, GOOD_STARTS));
    let explored = ends(likely(fitted(good, some, EXPLORING_ROUNDS, MODES), UNLIKELY_OF_SOME));
    let found = likely(fitted(explored, many, FIELD_ROUNDS, MODES), UNLIKELY);
    found.into_iter().filter_map(|fit| Mode::new(fit, many.1, many.0)).collect()
}

/// The likeliest minima whose directions differ.
fn distinct(minima: &[Minimum]) -> Vec<&Minimum> {
    let mut sorted: Vec<&Minimum> = minima.iter().collect();
    sorted.sort_by(|a, b| b.nats.total_cmp(&a.nats));
    let mut distinct: Vec<&Minimum> = Vec::new();
    for minimum in sorted {
        let is_known = distinct
            .iter()
            .any(|other| other.motion.direction.dot(&minimum.motion.direction) > SAME_DIRECTION);
        if !is_known && distinct.len() < STARTS {
            distinct.push(minimum);
        }
    }
    distinct
}

/// The best rotation for some of the inliers, what it leaves, and the median of that in standard deviations.
fn best_rotation(
    observations: &Observations,
    polished: &Polished,
    start: &UnitQuaternion<f64>,
    sigma: f64,
    count: usize,
) -> (UnitQuaternion<f64>, f64, f64) {
    let inliers = &polished.pose.inliers[..polished.pose.inliers.len().min(count)];
    let framed = observations.framed(inliers);
    let q_21 = rotation_alone(observations, inliers, &framed, start, sigma);
    let general: Vec<f64> = inliers.iter().map(|&i| polished.pose.residuals()[i as usize].powi(2)).collect();
    let rotation = framed.square_errors(&q_21.to_rotation_matrix().into_inner());
    let excess = excess(&rotation, &general, sigma);
    (q_21, excess, median_root(rotation) / sigma)
}

/// The local minimum of the greatest evidence: where the parallax is no more than the noise, which of the minima of the Sampson
/// errors is the lowest is chance.
fn likeliest(
    poses: &mut PoseScorer,
    polished: Polished,
    q_21: &UnitQuaternion<f64>,
    sigma: f64,
    likelihood: &Likelihood,
) -> (Polished, Vec<Minimum>) {
    let observations = poses.observations;
    let mut minima = Vec::new();
    let weighed = |motion: Motion| {
        let Evidence { nats, mean_depth, .. } = likelihood.of(&motion, FEW_ROUNDS);
        Minimum { nats, motion, mean_depth }
    };
    let mut of_both_signs = |motion: Motion| {
        let [plus, minus] =
            [1.0, -1.0].map(|sign| weighed(Motion { direction: motion.direction * sign, ..motion }));
        let better = if plus.nats >= minus.nats { plus } else { minus };
        minima.extend([plus, minus]);
        (better.nats, better.motion)
    };
    let refined = |poses: &mut PoseScorer, mut motion: Motion, some: &[u32]| {
        let count = some.len().min(COMPARED);
        let subset = Subset::new(&poses.observations.columns, &some[..count]);
        refine(&subset, &mut motion, &polished.loss, FINE, STEPS);
        motion
    };
    let wide = poses.score(*polished.motion(), polished.limit);
    let current = likelihood.of(polished.motion(), FEW_ROUNDS).nats;
    let mut best = (current, *polished.motion());
    let mut consider = |(nats, motion): (f64, Motion)| {
        if nats > best.0 {
            best = (nats, motion);
        }
    };
    for k in 0..DIRECTIONS {
        let start = Motion { q_21: *q_21, direction: on_half_sphere(k) };
        consider(of_both_signs(refined(poses, start, &wide.inliers)));
    }
    poses.recycle(wide);
    if let Some(direction) = direction_of_pairs(observations, q_21, sigma) {
        for sign in [1.0, -1.0] {
            let start = Motion { q_21: *q_21, direction: direction * sign };
            let near = poses.score(start, polished.limit);
            consider(of_both_signs(refined(poses, start, &near.inliers)));
            poses.recycle(near);
        }
    }
    let (nats, motion) = best;
    if nats < current + BETTER {
        return (polished, minima);
    }
    let wide = poses.score(motion, polished.limit);
    let motion = if wide.inliers.len() >= FEWEST { refined(poses, motion, &wide.inliers) } else { motion };
    poses.recycle(wide);
    let pose = poses.score(motion, poses.threshold());
    if pose.inliers.len() * 10 < polished.pose.inliers.len() * 9 {
        return (polished, minima);
    }
    (polished.with_pose(pose, poses.threshold()), minima)
}

/// The directions of half a sphere, evenly: on a spiral with the golden angle.
fn on_half_sphere(k: usize) -> Vector3<f64> {
    let z = 1.0 - (k as f64 + 0.5) / DIRECTIONS as f64;
    let angle = k as f64 * std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vector3::new(radius * angle.cos(), radius * angle.sin(), z)
}

/// The direction that most of the matches agree with which a rotation does not explain, among those that pairs of them
/// determine: a few near points before many distant ones, of which the rotation is known already.
fn direction_of_pairs(
    observations: &Observations,
    q_21: &UnitQuaternion<f64>,
    sigma: f64,
) -> Option<Vector3<f64>> {
    let all: Vec<u32> = (0_u32..).take(observations.len().min(WEIGHED)).collect();
    let r_21 = q_21.to_rotation_matrix().into_inner();
    let off: Vec<_> = observations
        .framed(&all)
        .displacements(&r_21)
        .into_iter()
        .filter(|d| d.is_in_front && d.residual[0].hypot(d.residual[1]) > OFF * sigma)
        .take(OFF_COUNT)
        .collect();
    // A translation `t` moves a point by `slope · t`: across the displacement it does not move it.
    let across: Vec<Vector3<f64>> =
        off.iter().map(|d| d.slope[0] * d.residual[1] - d.slope[1] * d.residual[0]).collect();
    let (mut most, mut best) = (2.0, None);
    let count = off.len();
    let blocks: Vec<Off> = off.chunks(WIDTH).map(Off::new).collect();
    let pairs = (1..count).flat_map(|gap| (0..count - gap).map(move |i| (i, i + gap))).take(PAIRS);
    for (i, j) in pairs {
        let Some(direction) = across[i].cross(&across[j]).try_normalize(1e-12) else { continue };
        let [plus, minus] = widest(Sides { blocks: &blocks, direction: direction.into(), sigma });
        if plus.max(minus) > most {
            most = plus.max(minus);
            best = Some(if plus >= minus { direction } else { -direction });
        }
    }
    best
}

/// A few matches that a rotation does not explain; those that fill up have no displacement.
struct Off {
    residual: [Lanes; 2],
    slope: [[Lanes; 3]; 2],
}

impl Off {
    fn new(some: &[Displacement]) -> Self {
        let of =
            |value: &dyn Fn(&Displacement) -> f64| std::array::from_fn(|j| some.get(j).map_or(0.0, value));
        Self {
            residual: [0, 1].map(|k| of(&|d| d.residual[k])),
            slope: [0, 1].map(|k| [0, 1, 2].map(|i| of(&|d| d.slope[k][i]))),
        }
    }
}

/// How many matches a translation in a direction takes along their epipolar lines, and how many one against it.
struct Sides<'a> {
    blocks: &'a [Off],
    direction: [f64; 3],
    sigma: f64,
}

impl Work for Sides<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "lazy operators branch, which no vector can")]
    fn run<S: Simd>(self, _: S) -> [f64; 2] {
        let Self { blocks, direction: [x, y, z], sigma } = self;
        let limit = (WITHIN * sigma).powi(2);
        let mut counts = [[0.0; WIDTH]; 2];
        for Off { residual, slope } in blocks {
            for j in 0..WIDTH {
                let b = [0, 1].map(|k| slope[k][0][j] * x + slope[k][1][j] * y + slope[k][2][j] * z);
                let away = residual[0][j] * b[1] - residual[1][j] * b[0];
                let along = -(residual[0][j] * b[0] + residual[1][j] * b[1]);
                let is_near = away * away < limit * (b[0] * b[0] + b[1] * b[1]);
                counts[0][j] += if is_near & (along > 0.0) { 1.0 } else { 0.0 };
                counts[1][j] += if is_near & (along < 0.0) { 1.0 } else { 0.0 };
            }
        }
        counts.map(|lanes| lanes.iter().sum())
    }
}

/// Refines a pose over the matches that are more likely true than false, which then are its inliers: where the parallax is
/// small, a match that agrees by chance is a point before the lens, with a lever a hundred times that of the others, which no loss
/// of its residual makes up for.
fn without_chance(
    poses: &mut PoseScorer,
    polished: Polished,
    likelihood: &Likelihood,
) -> (Polished, Vec<bool>) {
    let columns = &poses.observations.columns;
    let before = polished.pose.inliers.len();
    let fewest = FEWEST.max(before - before / MOST_BY_CHANCE);
    let likely = |motion: &Motion| -> Vec<bool> {
        likelihood.of(motion, ROUNDS).is_true.into_iter().map(|p| p > LIKELY).collect()
    };
    let mut motion = *polished.motion();
    let mut is_likely = likely(&motion);
    for _ in 0..2 {
        let wide = poses.score(motion, polished.limit);
        let kept: Vec<u32> = wide.inliers.iter().copied().filter(|&i| is_likely[i as usize]).collect();
        let is_all = kept.len() == wide.inliers.len();
        poses.recycle(wide);
        if kept.len() < fewest || is_all {
            break;
        }
        refine(&Subset::new(columns, &kept), &mut motion, &polished.loss, FINE, STEPS);
        is_likely = likely(&motion);
    }
    let mut pose = poses.score(motion, poses.threshold());
    pose.inliers.retain(|&i| is_likely[i as usize]);
    if pose.inliers.len() < fewest {
        poses.recycle(pose);
        let all = vec![true; poses.observations.len()];
        return (polished, all);
    }
    (Polished { pose, ..polished }, is_likely)
}

#[cfg(test)]
mod tests;
