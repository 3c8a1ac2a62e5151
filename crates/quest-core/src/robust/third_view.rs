//! Two pairs of views of the same points: where one pair leaves two poses, the other decides.

use std::collections::HashMap;

use super::{Estimate, EstimateError, Options, Priors, answer};
use crate::disambiguation::{Choice, choose};
use crate::robust::conclude::Answer;
use crate::{Correspondence, RelativePose};

/// Points that both pairs have to share.
const FEWEST: usize = 5;

/// What three views say.
#[derive(Clone, Debug, PartialEq)]
pub struct ThirdView {
    /// From view 1 to view 2; the runner-up is the pose that the third view speaks against.
    pub estimate_21: Estimate,
    /// From view 1 to view 3.
    pub estimate_31: Estimate,
    /// What decided, `None` where nothing did: fewer than five points are inliers of both pairs, or a camera only turned. Its
    /// indices are 0 for the pose that the pair alone puts first and 1 for the other.
    pub choice: Option<Choice>,
}

/// As [`estimate`](super::estimate) for the pairs (1, 2) and (1, 3), the poses of both chosen so that the depths of their common
/// points agree (section 10.1, [`disambiguation`](crate::disambiguation)).
///
/// A point is common where its bearing in view 1 is the same number in both lists; the lists may differ in order and in length.
///
/// # Errors
/// Those of [`estimate`](super::estimate), for either pair.
pub fn estimate_with_third_view(
    matches_21: &[Correspondence],
    options_21: &Options,
    matches_31: &[Correspondence],
    options_31: &Options,
) -> Result<ThirdView, EstimateError> {
    let one = |matches, options, which| answer(matches, options, &Priors::default(), which, &|| false);
    let mut first = one(matches_21, options_21, Answer::Best)?;
    let mut second = one(matches_31, options_31, Answer::Best)?;
    let (common_21, common_31) = common((matches_21, &first.inliers), (matches_31, &second.inliers));
    if common_21.len() < FEWEST {
        return Ok(ThirdView { estimate_21: first, estimate_31: second, choice: None });
    }
    let noise = noise(&first, options_21).max(noise(&second, options_31));
    // The two lists have as many matches.
    let choice = choose(&common_21, &poses(&first), &common_31, &poses(&second), noise)?;
    if let Some(choice) = choice {
        if choice.pose_21 == 1 {
            first = one(matches_21, options_21, Answer::Other)?;
        }
        if choice.pose_31 == 1 {
            second = one(matches_31, options_31, Answer::Other)?;
        }
    }
    Ok(ThirdView { estimate_21: first, estimate_31: second, choice })
}

fn poses(found: &Estimate) -> Vec<RelativePose> {
    [Some(found.pose), found.runner_up.map(|other| other.pose)].into_iter().flatten().collect()
}

/// The noise of a bearing in radians.
fn noise(found: &Estimate, options: &Options) -> f64 {
    found.noise_px / (options.focal_lengths.iter().flatten().sum::<f64>() / 4.0)
}

/// The inliers of either list whose bearings in view 1 are equal, in the same order.
fn common(
    (first, inliers1): (&[Correspondence], &[bool]),
    (second, inliers2): (&[Correspondence], &[bool]),
) -> (Vec<Correspondence>, Vec<Correspondence>) {
    let key = |m: &Correspondence| <[f64; 3]>::from(*m.bearing1()).map(f64::to_bits);
    let inliers = |matches: &[Correspondence], are: &[bool]| -> Vec<_> {
        matches.iter().zip(are).filter(|(_, is)| **is).map(|(m, _)| *m).collect()
    };
    let by_bearing: HashMap<_, _> =
        inliers(second, inliers2).into_iter().map(|m: Correspondence| (key(&m), m)).collect();
    let both = inliers(first, inliers1);
    both.into_iter().filter_map(|m: Correspondence| Some((m, *by_bearing.get(&key(&m))?))).unzip()
}
