//! Two pairs of views of the same points: where one pair leaves two poses, the other decides.

use std::collections::HashMap;

use super::{Estimate, EstimateError, MIN_MATCHES, Model, Options, Priors, answer};
use crate::disambiguation::{Choice, choose};
use crate::robust::conclude::Answer;
use crate::solver::Kinds;
use crate::solver::shared::motion::Motion;
use crate::{Candidates, Correspondence, RelativePose};

/// Points that both pairs have to share.
const FEWEST: usize = 5;

/// With fewer matches than this all solutions of the solver are offered. Of 400 realistic triples with 0.5 px of noise both directions are
/// within 0.2 rad in 173 so, and in 149 with the two poses of the estimate alone, of five matches; of six in 314 and 295, of
/// seven in 360 and 353, of eight in 370 and 374.
const FEW: usize = 8;

/// Solutions of five matches that are further apart than this, in radians, are two: the search's are polished to 1e-7.
const APART: f64 = 1e-4;

/// The pose of six or seven matches and what the solver makes of them are the same answer where they are this close, in radians:
/// one is refined by pixels and the other by angles.
const SAME: f64 = 0.03;

/// What three views say.
#[derive(Clone, Debug, PartialEq)]
pub struct ThirdView {
    /// From view 1 to view 2; the runner-up is the pose that the third view speaks against.
    pub estimate_21: Estimate,
    /// From view 1 to view 3.
    pub estimate_31: Estimate,
    /// What decided, `None` where nothing did: fewer than five points are inliers of both pairs, or a camera only turned. Its
    /// indices are 0 for the pose that the pair alone puts first, then the runner-up if there is one. With fewer than eight matches
    /// the other solutions of the solver that have all points in front follow.
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
    let first = Offer::new(matches_21, options_21)?;
    let second = Offer::new(matches_31, options_31)?;
    let (common_21, common_31) = common(&first, &second);
    let choice = if common_21.len() < FEWEST {
        None
    } else {
        // The two lists have as many matches.
        choose(&common_21, &first.poses, &common_31, &second.poses, first.noise().max(second.noise()))?
    };
    let chosen = choice.and_then(|choice| {
        Some(ThirdView {
            estimate_21: first.chosen(choice.pose_21)?,
            estimate_31: second.chosen(choice.pose_31)?,
            choice: Some(choice),
        })
    });
    match chosen {
        Some(chosen) => Ok(chosen),
        None => Ok(ThirdView { estimate_21: first.alone?, estimate_31: second.alone?, choice: None }),
    }
}

/// What one pair of views offers.
struct Offer<'a> {
    matches: &'a [Correspondence],
    options: &'a Options,
    /// What the pair says alone; of few matches it may be that they leave the rotation open.
    alone: Result<Estimate, EstimateError>,
    /// The estimate's pose, the runner-up's, and those that only few matches have.
    poses: Vec<RelativePose>,
}

impl<'a> Offer<'a> {
    /// # Errors
    /// Those of the estimate, where no other pose is offered either.
    fn new(matches: &'a [Correspondence], options: &'a Options) -> Result<Self, EstimateError> {
        let alone = estimate(matches, options, Answer::Best);
        let own = alone.iter().flat_map(|e| [Some(e.pose), e.runner_up.map(|other| other.pose)]);
        let mut offer = Self { matches, options, poses: own.flatten().collect(), alone };
        let is_rotation = offer.alone.as_ref().is_ok_and(|e| e.model == Model::PureRotation);
        let is_possible = matches.len() >= options.solver.info().min_matches.max(FEWEST);
        if offer.is_few() && !is_rotation && is_possible {
            offer.add_solutions();
        }
        match offer.alone {
            Err(error) if offer.poses.is_empty() => Err(error),
            _ => Ok(offer),
        }
    }

    /// Whether noise hardly tells the poses apart that fit: of five matches all that the solver finds fit exactly.
    fn is_few(&self) -> bool {
        self.matches.len() < FEW
    }

    /// Adds what the solver finds in all matches: poses with every point in front, and as many inliers as an estimate needs.
    fn add_solutions(&mut self) {
        let mut found = Candidates::new();
        self.options.solver.solve(Kinds::All, self.matches, &mut found);
        let threshold = self.options.threshold / self.focal_length();
        for candidate in found.iter().filter(|c| c.in_front == self.matches.len()) {
            let pose = &candidate.pose;
            let fits = |m: &&Correspondence| pose.sampson_error(m) < threshold;
            let is_new = !self.poses.iter().any(|other| is_same(pose, other, self.matches.len()));
            if is_new && self.matches.iter().filter(fits).count() >= MIN_MATCHES {
                self.poses.push(*pose);
            }
        }
    }

    /// The estimate with the pose of this index; `None` where it is left with too few inliers.
    fn chosen(&self, index: usize) -> Option<Estimate> {
        match (index, &self.alone) {
            (0, Ok(alone)) => return Some(alone.clone()),
            (1, Ok(Estimate { runner_up: Some(_), .. })) => {
                return estimate(self.matches, self.options, Answer::Other).ok();
            }
            _ => {}
        }
        let pose = self.poses.get(index)?;
        let given = Motion { q_21: pose.q_21, direction: pose.t_21.try_normalize(0.0)? };
        estimate(self.matches, self.options, Answer::Given(given)).ok()
    }

    /// The noise of a bearing in radians; a third of the threshold where there is no estimate, as a threshold is usually chosen.
    fn noise(&self) -> f64 {
        let noise_px = self.alone.as_ref().map_or(self.options.threshold / 3.0, |e| e.noise_px);
        noise_px / self.focal_length()
    }

    fn focal_length(&self) -> f64 {
        self.options.focal_lengths.iter().flatten().sum::<f64>() / 4.0
    }

    /// The inliers; of few matches all, as which of them are inliers depends on the pose that is to be chosen.
    fn inliers(&self) -> Vec<Correspondence> {
        match &self.alone {
            Ok(alone) if !self.is_few() => {
                self.matches.iter().zip(&alone.inliers).filter(|(_, is)| **is).map(|(m, _)| *m).collect()
            }
            _ => self.matches.to_vec(),
        }
    }
}

/// Whether two poses of so many matches are the same answer.
fn is_same(a: &RelativePose, b: &RelativePose, matches: usize) -> bool {
    let within = if matches == FEWEST { APART } else { SAME };
    a.rotation_error(b) < within && a.t_21.angle(&b.t_21) < within
}

fn estimate(matches: &[Correspondence], options: &Options, which: Answer) -> Result<Estimate, EstimateError> {
    answer(matches, options, &Priors::default(), which, &|| false)
}

/// The matches of either offer whose bearings in view 1 are equal, in the same order.
fn common(first: &Offer, second: &Offer) -> (Vec<Correspondence>, Vec<Correspondence>) {
    let key = |m: &Correspondence| <[f64; 3]>::from(*m.bearing1()).map(f64::to_bits);
    let by_bearing: HashMap<_, _> = second.inliers().into_iter().map(|m| (key(&m), m)).collect();
    let both = first.inliers().into_iter();
    both.filter_map(|m: Correspondence| Some((m, *by_bearing.get(&key(&m))?))).unzip()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{
        FOCAL_LENGTH, Scene, SceneOptions, is_inside_image, pixel_to_plane, plane_to_pixel,
    };
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const SEED: u64 = 1_023;

    /// A realistic scene, its matches of views 1 and 2, and those of views 1 and 3, which another scene's camera sees.
    fn triple(points: usize, noise_px: f64, index: u64) -> ([RelativePose; 2], [Vec<Correspondence>; 2]) {
        let options = SceneOptions { points, noise_px, ..SceneOptions::realistic() };
        let scene = Scene::generate(&options, SEED, index).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        rng.set_stream(index);
        let third = (1..1_000).find_map(|attempt| {
            let pose = Scene::generate(&options, SEED + attempt, index).unwrap().truth;
            let see = |(x, m): (&nalgebra::Vector3<f64>, &Correspondence)| {
                let x3 = pose.q_21 * x + pose.t_21;
                let exact = plane_to_pixel([x3.x / x3.z, x3.y / x3.z]);
                let pixel =
                    exact.map(|u| u + noise_px * Distribution::<f64>::sample(&StandardNormal, &mut rng));
                let seen = x3.z > 0.0 && is_inside_image(exact);
                seen.then(|| {
                    let x1 = on_plane(m.bearing1());
                    Correspondence::from_image_points(x1, pixel_to_plane(pixel)).unwrap()
                })
            };
            let matches = scene.points1.iter().zip(&scene.matches).map(see).collect::<Option<Vec<_>>>();
            Some((pose, matches?))
        });
        let (pose, matches) = third.unwrap();
        // A bearing of view 1 is made in the same way in both lists: it has to be the same bits.
        let again = |m: &Correspondence| {
            Correspondence::from_image_points(on_plane(m.bearing1()), on_plane(m.bearing2())).unwrap()
        };
        ([scene.truth, pose], [scene.matches.iter().map(again).collect(), matches])
    }

    fn on_plane(b: &nalgebra::Vector3<f64>) -> [f64; 2] {
        [b.x / b.z, b.y / b.z]
    }

    /// How many of `count` triples have both rotations and directions within `limit` radians, by the three views and by each
    /// pair alone.
    fn right(points: usize, noise_px: f64, count: u64, limit: f64) -> [u64; 2] {
        let options = Options { threshold: 1.5, focal_lengths: [[FOCAL_LENGTH; 2]; 2], ..Options::default() };
        let mut right = [0; 2];
        for index in 0..count {
            let (truth, [m21, m31]) = triple(points, noise_px, index);
            let is_right = |found: &Estimate, truth: &RelativePose| {
                found.pose.rotation_error(truth) < limit && found.pose.t_21.angle(&truth.t_21) < limit
            };
            if let Ok(found) = estimate_with_third_view(&m21, &options, &m31, &options) {
                let both = is_right(&found.estimate_21, &truth[0]) && is_right(&found.estimate_31, &truth[1]);
                right[0] += u64::from(both);
                for found in [&found.estimate_21, &found.estimate_31] {
                    assert!(crate::robust::conclude::says_something(&found.covariance), "triple {index}");
                }
            }
            let alone = [&m21, &m31].map(|m| estimate(m, &options, Answer::Best));
            let both = alone
                .iter()
                .zip(&truth)
                .all(|(found, truth)| found.as_ref().is_ok_and(|e| is_right(e, truth)));
            right[1] += u64::from(both);
        }
        right
    }

    #[test]
    fn three_views_of_five_points_without_noise_are_right_where_two_are_not() {
        let [three, two] = right(5, 0.0, 300, 1e-6);
        assert_eq!(three, 300);
        assert!(two < 200, "each pair alone has {two}");
    }

    #[test]
    fn three_views_of_few_points_with_noise_are_right_more_often_than_two() {
        for points in [5, 6] {
            let [three, two] = right(points, 0.5, 150, 0.2);
            assert!(three >= two, "{points} points: {three}, each pair alone {two}");
        }
    }

    #[test]
    fn views_with_few_points_in_common_have_the_poses_of_their_pairs() {
        let options = Options { threshold: 1.5, focal_lengths: [[FOCAL_LENGTH; 2]; 2], ..Options::default() };
        let (truth, [m21, _]) = triple(40, 0.3, 900);
        // Another scene: no bearing of view 1 is in both lists.
        let (other, [m31, _]) = triple(40, 0.3, 901);
        let found = estimate_with_third_view(&m21, &options, &m31, &options).unwrap();
        assert!(found.choice.is_none());
        assert!(found.estimate_21.pose.rotation_error(&truth[0]) < 0.02);
        assert!(found.estimate_31.pose.rotation_error(&other[0]) < 0.02);
        // Two points in common are too few to choose by.
        let mut shared = m31.clone();
        shared[..2].copy_from_slice(&m21[..2]);
        let found = estimate_with_third_view(&m21, &options, &shared, &options).unwrap();
        assert!(found.choice.is_none());
        assert!(found.estimate_31.pose.rotation_error(&other[0]) < 0.02);
        // A pair without any pose has its own reason, on either side.
        let none = vec![m21[0]; 20];
        let reason = estimate(&none, &options, Answer::Best).unwrap_err();
        for (a, b) in [(&m21, &none), (&none, &m21)] {
            assert_eq!(estimate_with_third_view(a, &options, b, &options).unwrap_err(), reason);
        }
        // Four matches are refused before anything else.
        assert!(estimate_with_third_view(&m21[..4], &options, &m31, &options).is_err());
    }
}
