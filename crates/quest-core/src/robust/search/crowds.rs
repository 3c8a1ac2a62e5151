//! Crowds: matches that are near many others in both views.
//!
//! The score counts every match alike, as if each were false on its own. A thing that moves by itself is false with all of its matches
//! at once. Where it is small and full of texture, its matches and some that agree by chance may be more than those of the scene. But
//! matches in one place say nearly the same of a motion, and most of them can be left out without loss. Among the others that pose
//! is the better one which explains more of the image, not more of one place.

use std::f64::consts::PI;

use crate::algebra::vectors::widest::{Simd, Work, widest};
use crate::robust::data::observations::Observations;
use crate::robust::search::chart::{Chart, chart};
use crate::robust::search::pose_score::ScoredPose;

/// A neighbourhood is a circle of this share of the area that has matches.
const PART: f64 = 0.005;

/// Its radius in view 2 is so many times larger: a thing may come nearer.
const NEARER: f64 = 1.5;

/// A neighbourhood keeps at most so many times the matches that it would have if all were evenly spread, or [`LEAST`].
const TIMES: f64 = 2.0;
const LEAST: f64 = 3.0;

/// The first so many matches stand for all: they are in random order.
const PROBES: u32 = 256;

/// This share of the matches in the middle of a coordinate says how far it reaches: a few may be anywhere.
const MIDDLE: f64 = 0.9;

/// Much of the inliers is a crowd if fewer than this share of them are left. Measured: with 0.85 the recorded pairs take a sixth longer, and
/// as many planted scenes with a dense false motion are right.
const LEFT: f64 = 0.75;

/// Inliers that are looked at for that.
const ASKED: usize = 64;

/// A pose explains clearly more than another if the numbers of matches that only one of them explains differ by so many of the standard
/// deviations that chance gives them.
const CLEARLY: f64 = 2.0;

/// Neighbourhoods of matches in both views.
#[derive(Debug)]
pub(crate) struct Crowds {
    chart: Chart,
    /// The squares of the radii.
    squares: [f32; 2],
    /// How many matches a neighbourhood keeps.
    most: f64,
}

impl Crowds {
    pub(crate) fn new(observations: &Observations) -> Self {
        Self::of_chart(chart(observations))
    }

    fn of_chart(chart: Chart) -> Self {
        let [square1, square2] = [0, 2].map(|k| PART * extent(&chart[k]) * extent(&chart[k + 1]) / PI);
        #[expect(clippy::cast_possible_truncation, reason = "neighbours need no more digits")]
        let squares = [square1 as f32, (NEARER * NEARER * square2) as f32];
        let most = (TIMES * PART * chart[0].len() as f64).max(LEAST);
        Self { chart, squares, most }
    }

    /// Whether much of the inliers of a pose is a crowd.
    pub(crate) fn hold(&self, inliers: &[u32]) -> bool {
        let every = inliers.len().div_ceil(ASKED).max(1);
        let asked: Vec<u32> = inliers.iter().step_by(every).copied().collect();
        let left = self.are_left(&asked).iter().filter(|is_left| **is_left).count();
        (left as f64) < LEFT * asked.len() as f64
    }

    /// The matches, in their order, of which none crowd.
    pub(crate) fn others(&self, observations: &Observations) -> Vec<u32> {
        let places: Vec<u32> = (0..).take(observations.len()).collect();
        let are_left = self.are_left(&places);
        let of_order = observations.order.iter().zip(are_left);
        of_order.filter(|(_, is_left)| *is_left).map(|(i, _)| *i).collect()
    }

    /// Whether each of the matches at these places is left: of a match and its neighbours the first are.
    fn are_left(&self, places: &[u32]) -> Vec<bool> {
        let mut counts = vec![0; places.len()];
        widest(Neighbours { chart: &self.chart, squares: self.squares, places, counts: &mut counts });
        let is_left = |(&place, count): (&u32, u32)| {
            let (place, probes) = (f64::from(place), f64::from(place.min(PROBES)));
            place == 0.0 || f64::from(count) * place < self.most * probes
        };
        places.iter().zip(counts).map(is_left).collect()
    }
}

/// How far a coordinate would reach if the matches were evenly spread.
fn extent(values: &[f32]) -> f64 {
    let mut values = values.to_vec();
    let mut at = |part: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in the list")]
        let place = (part * (values.len() - 1) as f64) as usize;
        f64::from(*values.select_nth_unstable_by(place, f32::total_cmp).1)
    };
    (at(0.5 + 0.5 * MIDDLE) - at(0.5 - 0.5 * MIDDLE)) / MIDDLE
}

/// Counts the neighbours of some matches among all before them, or among the first [`PROBES`].
struct Neighbours<'a> {
    chart: &'a Chart,
    squares: [f32; 2],
    places: &'a [u32],
    counts: &'a mut [u32],
}

impl Work for Neighbours<'_> {
    type Output = ();

    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "lazy operators branch, which no vector can")]
    fn run<S: Simd>(self, _: S) {
        let Self { chart, squares: [square1, square2], places, counts } = self;
        for (&place, count) in places.iter().zip(counts) {
            let [u1, v1, u2, v2] = chart.each_ref().map(|column| column[place as usize]);
            let [x1, y1, x2, y2] = chart.each_ref().map(|column| &column[..place.min(PROBES) as usize]);
            for (((x1, y1), x2), y2) in x1.iter().zip(y1).zip(x2).zip(y2) {
                let distance1 = (x1 - u1) * (x1 - u1) + (y1 - v1) * (y1 - v1);
                let distance2 = (x2 - u2) * (x2 - u2) + (y2 - v2) * (y2 - v2);
                *count += u32::from((distance1 < square1) & (distance2 < square2));
            }
        }
    }
}

/// Whether a pose explains clearly more of the matches than another, and mostly others.
pub(crate) fn explains_clearly_more(pose: &ScoredPose, other: &ScoredPose) -> bool {
    let both = pose.inliers_in_common(other);
    let [own, others] = [pose, other].map(|pose| pose.inliers.len() - both);
    own > both && own as f64 > clearly_more_than(others as f64)
}

/// The least `m` with `m − n ≥ z √(m + n)`, `z` of [`CLEARLY`].
pub(crate) fn clearly_more_than(n: f64) -> f64 {
    let square = CLEARLY * CLEARLY;
    n + 0.5 * (square + (square * (square + 8.0 * n)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robust::search::sampling::generator;
    use rand::RngExt;

    const SEED: u64 = 71;

    /// Matches all over two images of a thousand pixels in random order, a share of them within a small square of each view.
    fn chart(count: usize, crowd: f64, unit: f32) -> (Chart, Vec<bool>) {
        let mut rng = generator(SEED, 0);
        let mut is_crowd = Vec::new();
        let mut chart = Chart::default();
        for _ in 0..count {
            let is_one = rng.random_bool(crowd);
            is_crowd.push(is_one);
            for column in &mut chart {
                let x: f32 =
                    if is_one { rng.random_range(400.0..500.0) } else { rng.random_range(0.0..1000.0) };
                column.push(unit * x);
            }
        }
        (chart, is_crowd)
    }

    fn are_left(chart: &Chart) -> Vec<bool> {
        let places: Vec<u32> = (0..).take(chart[0].len()).collect();
        Crowds::of_chart(chart.clone()).are_left(&places)
    }

    /// How many of the crowd and of the others there are, and how many of them are left.
    fn counts(chart: &Chart, is_crowd: &[bool]) -> [[usize; 2]; 2] {
        let is_left = are_left(chart);
        [true, false].map(|which| {
            let of = is_left.iter().zip(is_crowd).filter(|(_, is)| **is == which);
            [of.clone().count(), of.filter(|(is_left, _)| **is_left).count()]
        })
    }

    #[test]
    fn matches_all_about_do_not_crowd() {
        for count in [10, 100, 1_000, 5_000] {
            let (chart, _) = chart(count, 0.0, 1.0);
            // Both points of a false match are anywhere: hardly two are near each other in both views.
            assert!(are_left(&chart).iter().all(|is_left| *is_left), "{count}");
        }
    }

    #[test]
    fn a_scene_that_moves_together_is_no_crowd() {
        let (chart, _) = chart(1_000, 0.0, 1.0);
        let [x, y, ..] = chart;
        let moved = [x.clone(), y.clone(), x.iter().map(|x| x + 50.0).collect(), y];
        let left = are_left(&moved).iter().filter(|is| **is).count();
        assert!(left > 950, "{left}");
    }

    #[test]
    fn few_of_a_crowd_are_left_and_all_others() {
        for (count, part) in [(100, 2), (600, 4), (5_000, 4)] {
            let (chart, is_crowd) = chart(count, 0.4, 1.0);
            let [[crowd, left], [others, others_left]] = counts(&chart, &is_crowd);
            assert!(part * left < crowd, "{left} of {crowd}");
            assert_eq!(others_left, others);
        }
    }

    #[test]
    fn a_crowd_holds_inliers_of_which_a_quarter_would_be_left_out() {
        let (chart, is_crowd) = chart(600, 0.4, 1.0);
        let of =
            |which| (0_u32..).zip(&is_crowd).filter(move |(_, is)| **is == which).map(|(place, _)| place);
        let crowds = Crowds::of_chart(chart);
        let mixed = |crowd, others| {
            let mut inliers: Vec<u32> = of(true).take(crowd).chain(of(false).take(others)).collect();
            inliers.sort_unstable();
            inliers
        };
        assert!(crowds.hold(&mixed(200, 0)) && crowds.hold(&mixed(200, 200)));
        assert!(!crowds.hold(&mixed(0, 200)) && !crowds.hold(&mixed(40, 200)));
        assert!(!crowds.hold(&[]));
    }

    #[test]
    fn the_unit_does_not_matter_nor_one_match_far_away() {
        let (mut chart, mut is_crowd) = chart(600, 0.4, 1.0);
        let (other, _) = self::chart(600, 0.4, 128.0);
        assert_eq!(are_left(&chart), are_left(&other));
        for column in &mut chart {
            column.push(1e6);
        }
        is_crowd.push(false);
        let [[crowd, left], [others, others_left]] = counts(&chart, &is_crowd);
        assert!(4 * left < crowd && others_left == others, "{left} of {crowd}");
    }

    #[test]
    fn more_is_clearly_more_beyond_chance() {
        for n in [0.0, 4.0, 100.0] {
            let m = clearly_more_than(n);
            assert!((m - n - 2.0 * (m + n).sqrt()).abs() < 1e-9, "{n}: {m}");
        }
    }
}
