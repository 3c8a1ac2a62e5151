//! Which of several poses is the true one: a third view decides (section 10.1).
//!
//! Views 1 and 2 give candidates, and so do views 1 and 3, for the same points of view 1. The depths of these points in view 1 do
//! not depend on where the other view is. The true pair of candidates gives the same depths up to one common scale; a wrong pair
//! does not. The paper compares the scaled depths. This module compares inverse depths, weighted by their noise, and limits the
//! influence of a false match.

use nalgebra::Vector3;

use crate::{Correspondence, InputError, RelativePose};

/// The largest cost of one match, in standard deviations of its noise, squared.
const CAP: f64 = 9.0;

/// How many matches propose their ratio of inverse depths as the common scale.
const TRIALS: usize = 50;

/// The noise that is assumed where none is known: a pixel at a focal length of a thousand, in radians.
pub const USUAL_NOISE: f64 = 1e-3;

/// The pair of candidates that the three views agree on best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The index of the pose from view 1 to view 2.
    pub pose_21: usize,
    /// The index of the pose from view 1 to view 3.
    pub pose_31: usize,
    /// How far the depths are apart: mean square over the matches in units of the noise, at most nine.
    pub disagreement: f64,
    /// The same for the best pair with another pose from view 1 to view 2; infinite if there is none. The third view does not
    /// decide if this is close to [`disagreement`](Self::disagreement).
    pub next_best: f64,
    /// The length of the translation to view 3 over that to view 2, in one common scale.
    pub ratio: f64,
}

/// Chooses among candidate poses from view 1 to view 2 and from view 1 to view 3.
///
/// `matches_21[i]` and `matches_31[i]` show the same point, and their points of view 1 are the same. `noise` is the standard
/// deviation of a bearing in radians; [`USUAL_NOISE`] where nothing is known. `None` where one of the lists is empty, or no
/// candidate has a translation.
///
/// # Errors
/// [`InputError::LengthMismatch`] where the two do not have as many matches.
pub fn choose(
    matches_21: &[Correspondence],
    poses_21: &[RelativePose],
    matches_31: &[Correspondence],
    poses_31: &[RelativePose],
    noise: f64,
) -> Result<Option<Choice>, InputError> {
    if matches_21.len() != matches_31.len() {
        return Err(InputError::LengthMismatch { first: matches_21.len(), second: matches_31.len() });
    }
    let depths = |poses: &[RelativePose], matches: &[Correspondence]| -> Vec<Option<Vec<InverseDepth>>> {
        poses.iter().map(|pose| inverse_depths(pose, matches)).collect()
    };
    let (first, second) = (depths(poses_21, matches_21), depths(poses_31, matches_31));
    let mut best: Vec<Option<Choice>> = vec![None; poses_21.len()];
    for (i, a) in first.iter().enumerate() {
        for (j, b) in second.iter().enumerate() {
            let (Some(a), Some(b)) = (a, b) else { continue };
            let Some((ratio, disagreement)) = compare(a, b, noise) else { continue };
            if best[i].is_none_or(|c| disagreement < c.disagreement) {
                let length = |pose: &RelativePose| pose.t_21.norm();
                best[i] = Some(Choice {
                    pose_21: i,
                    pose_31: j,
                    disagreement,
                    next_best: f64::INFINITY,
                    ratio: ratio * length(&poses_31[j]) / length(&poses_21[i]),
                });
            }
        }
    }
    let mut all: Vec<Choice> = best.into_iter().flatten().collect();
    all.sort_by(|a, b| a.disagreement.total_cmp(&b.disagreement));
    let next_best = all.get(1).map_or(f64::INFINITY, |c| c.disagreement);
    Ok(all.first().map(|c| Choice { next_best, ..*c }))
}

/// An inverse range in view 1, in the unit of the translation, and its variance at unit noise.
#[derive(Clone, Copy, Debug)]
struct InverseDepth {
    value: f64,
    variance: f64,
}

/// `ρ = −(b × t) · (b × c) / |b × t|²` with unit bearings: equation (28) divided by the depth. `None` without a translation.
fn inverse_depths(pose: &RelativePose, matches: &[Correspondence]) -> Option<Vec<InverseDepth>> {
    let t: Vector3<f64> = pose.t_21;
    t.try_normalize(0.0)?;
    let one = |m: &Correspondence| {
        let b = m.bearing2();
        let across = b.cross(&t);
        let square = across.norm_squared().max(f64::MIN_POSITIVE);
        let value = -across.dot(&b.cross(&(pose.q_21 * m.bearing1()))) / square;
        InverseDepth { value, variance: 2.0 / square }
    };
    Some(matches.iter().map(one).collect())
}

/// The common scale `b = s a` that most of the inverse depths agree on, and how far they are apart at it.
fn compare(a: &[InverseDepth], b: &[InverseDepth], noise: f64) -> Option<(f64, f64)> {
    let step = a.len().div_ceil(TRIALS).max(1);
    let cost = |scale: f64| {
        let one = |(a, b): (&InverseDepth, &InverseDepth)| {
            let variance = noise * noise * (b.variance + scale * scale * a.variance);
            ((b.value - scale * a.value).powi(2) / variance).min(CAP)
        };
        a.iter().zip(b).map(one).sum::<f64>() / a.len() as f64
    };
    let ratios = a.iter().zip(b).step_by(step).map(|(a, b)| b.value / a.value);
    let scales = ratios.filter(|scale| scale.is_finite() && *scale > 0.0);
    let (mut scale, mut least) = scales.map(|s| (s, cost(s))).min_by(|x, y| x.1.total_cmp(&y.1))?;
    // Least squares over those that agree, with the weights at the scale found.
    let (mut sum, mut weight) = (0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let variance = noise * noise * (b.variance + scale * scale * a.variance);
        if (b.value - scale * a.value).powi(2) < CAP * variance {
            sum += a.value * b.value / variance;
            weight += a.value * a.value / variance;
        }
    }
    let refined = sum / weight;
    if refined.is_finite() && refined > 0.0 && cost(refined) < least {
        (scale, least) = (refined, cost(refined));
    }
    Some((scale, least))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robust::{self, Model, Options};
    use crate::simulate::{FOCAL_LENGTH, pixel_to_plane, plane_to_pixel};
    use nalgebra::UnitQuaternion;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const SEED: u64 = 1010;

    /// Points of a slanted plane, seen from three places a tenth of their depth apart, with noise in pixels.
    fn views(rng: &mut ChaCha8Rng, noise: f64) -> ([RelativePose; 2], [Vec<Correspondence>; 2]) {
        let mut vector = |s: f64| Vector3::from_fn(|_, _| rng.random_range(-s..s));
        let poses = [(); 2]
            .map(|()| RelativePose::new(UnitQuaternion::new(vector(0.2)), vector(1.0).normalize() * 0.3));
        let slope = vector(0.5);
        let points: Vec<_> = (0..60)
            .map(|_| {
                let x = vector(1.0);
                Vector3::new(x.x, x.y, 3.0 + slope.x * x.x + slope.y * x.y)
            })
            .collect();
        let image = |x: Vector3<f64>, rng: &mut ChaCha8Rng| {
            let mut normal = || noise * Distribution::<f64>::sample(&StandardNormal, rng);
            pixel_to_plane(plane_to_pixel([x.x / x.z, x.y / x.z]).map(|u| u + normal()))
        };
        let first: Vec<_> = points.iter().map(|x| image(*x, rng)).collect();
        let matches = poses.map(|pose| {
            let seen = |(x, x1): (&Vector3<f64>, &[f64; 2])| {
                Correspondence::from_image_points(*x1, image(pose.q_21 * x + pose.t_21, rng)).unwrap()
            };
            points.iter().zip(&first).map(seen).collect()
        });
        (poses, matches)
    }

    #[test]
    fn a_third_view_decides_between_the_poses_of_a_plane() {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let options = Options { threshold: 1.5, focal_lengths: [[FOCAL_LENGTH; 2]; 2], ..Options::default() };
        let (mut asked, mut right) = (0, 0);
        for _ in 0..20 {
            let (truth, matches) = views(&mut rng, 0.3);
            let [first, second] = &matches;
            let alone = robust::estimate(first, &options).unwrap();
            assert_eq!(alone.model, Model::Planar);
            if alone.runner_up.is_none() {
                continue;
            }
            // The lists need not have the same order, nor the same points.
            let some: Vec<_> = second.iter().rev().skip(5).copied().collect();
            let found = robust::estimate_with_third_view(first, &options, &some, &options).unwrap();
            let choice = found.choice.unwrap();
            assert!(choice.disagreement <= choice.next_best);
            let error = |pose: &RelativePose| pose.rotation_error(&truth[0]);
            let (pose, other) = (found.estimate_21.pose, found.estimate_21.runner_up.unwrap().pose);
            // The same two poses as without the third view, in the order that it decides.
            let expected = if choice.pose_21 == 0 { alone.pose } else { alone.runner_up.unwrap().pose };
            assert!(pose.rotation_error(&expected) < 1e-12 && (pose.t_21 - expected.t_21).norm() < 1e-9);
            assert_eq!(
                found.estimate_21.inliers.iter().filter(|i| **i).count(),
                found.estimate_21.inlier_count
            );
            asked += 1;
            right += usize::from(error(&pose) <= error(&other));
        }
        assert!(asked >= 5 && right * 10 >= asked * 9, "{right} of {asked}");
    }

    #[test]
    fn the_true_pair_agrees_and_its_scale_is_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED + 1);
        let (truth, matches) = views(&mut rng, 0.0);
        let longer = RelativePose::new(truth[1].q_21, truth[1].t_21 * 5.0);
        let wrong = RelativePose::new(truth[0].q_21, -truth[0].t_21);
        let found = choose(&matches[0], &[wrong, truth[0]], &matches[1], &[longer], 1e-3).unwrap().unwrap();
        assert_eq!((found.pose_21, found.pose_31), (1, 0));
        assert!(found.disagreement < 1e-20 && found.next_best > 1e-3);
        assert!((found.ratio - 1.0).abs() < 1e-9);
    }

    #[test]
    fn nothing_to_choose_from() {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED + 2);
        let (truth, matches) = views(&mut rng, 0.0);
        let [m21, m31] = &matches;
        assert_eq!(choose(m21, &[], m31, &truth, 1e-3), Ok(None));
        let still = RelativePose::new(truth[0].q_21, Vector3::zeros());
        assert_eq!(choose(m21, &[still], m31, &truth, 1e-3), Ok(None));
        assert!(choose(&m21[1..], &truth, m31, &truth, 1e-3).is_err());
    }
}
