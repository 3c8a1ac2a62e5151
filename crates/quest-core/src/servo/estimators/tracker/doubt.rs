//! Wrong matches that a map rests on, where features are few.
//!
//! A wrong match may lie on its epipolar line in the images that a map began with, and so count as a feature of some depth. The cost of
//! the map then has a minimum with it in which the depths of the others are wrong, and the camera ends a few centimetres off, even if
//! its last images are fitted without that match. So a map that has settled is adjusted once more without each of its features. Of a right one
//! the cost falls by about what that one costs; of a wrong one also by what it costs the others. Where that is more than chance, the map goes
//! on without the worst. A feature that was left out comes back with the next key image, if the images agree with it by then.

use crate::servo::estimators::source::PoseSource;
use crate::servo::estimators::tracker::adjust::disagreement;
use crate::servo::estimators::tracker::map::Map;
use crate::servo::estimators::tracker::{FEW, Tracker};

/// How much more the cost has to fall by than the two an image that a right feature costs, where the images agree with the feature and where
/// they do not. By the distribution of χ² a right feature of two to six images exceeds the first in one of 700 trials at most, the second in one
/// of seven. The first is not sensitive between 6 and 20. With 0 in place of the second, three in a hundred fewer arrived where matches
/// are wrong for 20 images.
const WRONG: f64 = 20.0;
const WRONG_OF_DOUBTED: f64 = 5.0;
/// The images do not agree with a feature that has agreed in a smaller share of the last ten or so.
const DOUBTED: f64 = 0.5;
/// They agree again with one that has in so large a share.
const AGREES: f64 = 0.6;
/// A feature that costs less than this is not tried, for time: a third of what one of six images costs.
const SUSPECT: f64 = 4.0;
/// Of six features all are needed.
const LEAST: usize = 6;
/// Steps of a trial, and how many an image may take.
const STEPS: usize = 6;
const STEPS_OF_AN_IMAGE: usize = 2;

/// The trials of a hypothesis, which is alone.
#[derive(Clone, Debug)]
pub(super) struct Doubt {
    /// The map without the feature that is tried.
    trial: Map,
    feature: Option<usize>,
    steps: usize,
    was_tried: Vec<bool>,
    /// All were tried, and nothing was found.
    is_done: bool,
    /// What was left out since the last key image.
    is_condemned: Vec<bool>,
    /// The feature without which the cost falls furthest, by how much more than chance, and the map without it.
    worst: Option<usize>,
    excess: f64,
    best: Map,
}

impl Doubt {
    pub(super) fn new(map: &Map, most_keys: usize) -> Self {
        let n = map.points.len();
        let with_room = || {
            let mut map = map.clone();
            map.keys.reserve_exact(most_keys);
            map
        };
        Self {
            trial: with_room(),
            feature: None,
            steps: 0,
            was_tried: vec![false; n],
            is_done: false,
            is_condemned: vec![false; n],
            worst: None,
            excess: 0.0,
            best: with_room(),
        }
    }

    /// There is another key image, or another map.
    pub(super) fn begin(&mut self) {
        self.is_condemned.fill(false);
        self.begin_trials();
    }

    fn begin_trials(&mut self) {
        self.was_tried.fill(false);
        self.is_done = false;
        (self.feature, self.worst, self.excess) = (None, None, 0.0);
    }
}

impl<S: PoseSource> Tracker<S> {
    /// Takes wrong matches out of the map, and takes those back that were none.
    pub(super) fn doubt(&mut self) {
        if self.count != 1 || self.goal.len() >= FEW {
            return;
        }
        self.take_back();
        if self.hypotheses[0].map.steps_left > 0 {
            self.doubt.begin_trials();
        }
        let map = &self.hypotheses[0].map;
        let count = map.points.iter().filter(|point| !point.is_wrong).count();
        // What is left determines a pose, and more.
        if self.key_count < 2 || count <= self.least_inliers().max(LEAST) {
            return;
        }
        for _ in 0..STEPS_OF_AN_IMAGE {
            if self.hypotheses[0].map.steps_left == 0 && !self.doubt.is_done {
                self.try_without_one();
            }
        }
    }

    /// What the images agree with again has a say in the map.
    fn take_back(&mut self) {
        let map = &mut self.hypotheses[0].map;
        let mut has_changed = false;
        for (i, trust) in self.trust.iter().enumerate() {
            if map.points[i].is_wrong && *trust > AGREES && !self.doubt.is_condemned[i] {
                map.set_wrong(i, false, &self.goal, &self.known);
                has_changed = true;
            }
        }
        if has_changed {
            map.unsettle(1e-4);
            self.doubt.begin_trials();
        }
    }

    /// A step of the trial that is under way; the choice of the next one; the verdict after the last.
    fn try_without_one(&mut self) {
        let task = self.task();
        let Self { doubt, hypotheses, workspace, goal, known, keys, key_count, trust, .. } = self;
        let survey = Self::survey(goal, known, &keys[..*key_count], &task);
        let map = &mut hypotheses[0].map;
        if let Some(feature) = doubt.feature {
            let is_settled = workspace.settle(&mut doubt.trial, &survey);
            doubt.steps -= 1;
            if doubt.steps > 0 && !is_settled {
                return;
            }
            doubt.feature = None;
            let own = disagreement(map, &survey, feature);
            // The robust cost keeps it out of the images in which alone it is wrong.
            let fall = map.cost - doubt.trial.cost - own.of_the_others;
            let enough = if trust[feature] > DOUBTED { WRONG } else { WRONG_OF_DOUBTED };
            let excess = fall - 2.0 * own.agreeing as f64 - enough;
            if excess > doubt.excess {
                (doubt.worst, doubt.excess) = (Some(feature), excess);
                doubt.best.copy_from(&doubt.trial);
            }
            return;
        }
        // Those that the images do not agree with come first, then those that cost most.
        let cost = |i: usize| (trust[i] > DOUBTED, disagreement(map, &survey, i).of_the_agreeing);
        let all = (0..goal.len()).filter(|i| !map.points[*i].is_wrong && !doubt.was_tried[*i]);
        let suspects = all.map(|i| (i, cost(i))).filter(|(_, (agrees, cost))| !agrees || *cost > SUSPECT);
        let next = suspects.max_by(|(_, a), (_, b)| b.0.cmp(&a.0).then(a.1.total_cmp(&b.1)));
        if let Some((feature, _)) = next {
            doubt.trial.copy_from(map);
            doubt.trial.set_wrong(feature, true, goal, known);
            doubt.trial.unsettle(1e-4);
            (doubt.feature, doubt.steps) = (Some(feature), STEPS);
            doubt.was_tried[feature] = true;
        } else if let Some(feature) = doubt.worst {
            map.copy_from(&doubt.best);
            map.unsettle(1e-4);
            (doubt.is_condemned[feature], trust[feature]) = (true, 0.0);
            doubt.begin_trials();
        } else {
            doubt.is_done = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;
    use crate::RelativePose;
    use crate::servo::FilterOptions;
    use crate::servo::estimators::tracker::Phase;
    use crate::solver::SolverName;

    /// A tracker with the true map of twelve features and five key images, of which the images show feature 4 this many standard
    /// deviations off its place.
    fn tracker(off: f64) -> Tracker<SolverName> {
        let goal: Vec<[f64; 2]> =
            (0..12).map(f64::from).map(|k| [0.4 * (2.1 * k).sin(), 0.3 * (3.7 * k).cos()]).collect();
        let mut tracker = Tracker::new(&goal, SolverName::Quest, FilterOptions::default());
        let noise = tracker.options.noise;
        let map = &mut tracker.hypotheses[0].map;
        for (k, point) in map.points.iter_mut().enumerate() {
            point.rho = 1.0 + 0.2 * (1.9 * k as f64).sin();
            (point.variance, point.is_mapped) = (1e-4, true);
        }
        for (k, key) in tracker.keys.iter_mut().take(5).enumerate() {
            let angle = 1.3 * k as f64;
            let pose = RelativePose::new(
                UnitQuaternion::new(Vector3::new(0.02, -0.05, 0.03) * angle.cos()),
                Vector3::new(0.2 * angle.cos(), 0.2 * angle.sin(), 0.05),
            );
            map.keys.push(pose);
            key.variance = noise * noise;
            for (image, point) in key.frame.iter_mut().zip(&map.points) {
                let x2 =
                    pose.q_21 * Vector3::new(point.place[0], point.place[1], 1.0) + pose.t_21 * point.rho;
                *image = Some([x2.x / x2.z, x2.y / x2.z]);
            }
            // Five directions around it, so that no other place suits most of them.
            let off = [off * noise * (2.0 * angle).cos(), off * noise * (2.0 * angle).sin()];
            key.frame[4] = key.frame[4].map(|[u, v]| [u + off[0], v + off[1]]);
        }
        (tracker.key_count, tracker.count, tracker.phase) = (5, 1, Phase::Mapped);
        map.unsettle(1e-4);
        tracker
    }

    /// Which features are left out once all were tried.
    fn left_out(tracker: &mut Tracker<SolverName>) -> Vec<usize> {
        for _ in 0..200 {
            tracker.learn();
        }
        let points = &tracker.hypotheses[0].map.points;
        (0..points.len()).filter(|i| points[*i].is_wrong).collect()
    }

    #[test]
    fn a_match_that_contradicts_the_others_is_left_out_until_the_images_agree_with_it() {
        let mut tracker = tracker(3.3);
        assert_eq!(left_out(&mut tracker), [4]);
        assert!(tracker.depths().nth(4).unwrap().is_nan());
        // Another key image alone does not bring it back.
        tracker.doubt.begin();
        assert_eq!(left_out(&mut tracker), [4]);
        tracker.trust[4] = 1.0;
        tracker.doubt.begin();
        tracker.doubt();
        assert!(!tracker.hypotheses[0].map.points[4].is_wrong);
        // It still contradicts them.
        assert_eq!(left_out(&mut tracker), [4]);
    }

    #[test]
    fn noise_is_no_contradiction_nor_is_what_the_robust_cost_keeps_out() {
        for off in [0.0, 1.2, 40.0] {
            assert_eq!(left_out(&mut tracker(off)), [0; 0], "{off}");
        }
    }

    #[test]
    fn of_a_feature_that_the_images_do_not_agree_with_less_is_enough() {
        for (trust, expected) in [(1.0, vec![]), (0.2, vec![4])] {
            let mut tracker = tracker(2.2);
            tracker.trust[4] = trust;
            assert_eq!(left_out(&mut tracker), expected, "{trust}");
        }
    }
}
