//! Where samples come from, and when there are enough of them.
//!
//! One sample in four is drawn from all matches. The others come from pools: the first matches of their own order of coherence
//! ([`ranking`](super::ranking)), of the order of the scores that were given, of both together. No schedule lets a pool grow:
//! the guide knows which pool each sample came from, and so what chance it had. The search is over when
//!
//! 1. *the best pose would have been found again*: `Σ −ln(1 − u q) ≥ −ln(1 − confidence)` over all samples, with `q` the chance
//!    that a sample of its pool consists of inliers of the best pose and `u` the share of those that lead to it
//!    ([`useful`](super::useful));
//! 2. *no competitor is left*: another pose with as many inliers would have been found too. Coherence finds what is
//!    coherent first, be it a moving object, a second plane or a repeated texture with fewer matches than the truth. So the matches
//!    that the best pose leaves are ranked again, and samples are drawn from their pools. Three assumptions say how many: a share of
//!    [`APART`] of the competitor's inliers is among these matches; they are as much denser at the head of the order as those of the
//!    best pose, but at most [`MOST_DENSE`]; clean samples are as seldom useful as those of an unknown pose may be;
//! 3. *it is not chance*, which the search asks before it stops.
//!
//! Where a pose is known beforehand, only a competitor matters that explains clearly more. Until one is found the first question is not
//! asked.
//!
//! Where the order is of no use, no pool is denser than all matches are. The rules are then those of uniform samples, and at worst a
//! quarter more samples are drawn than those would take.

use rand_chacha::ChaCha8Rng;

use crate::robust::search::chart::{Chart, part};
use crate::robust::search::crowds::clearly_more_than;
use crate::robust::search::pools::{LEAST, Pools};
use crate::robust::search::ranking;
use crate::robust::search::sampling::{Sample, draw_from, draw_uniform};
use crate::robust::search::stopping::{self, chance, gain};
use crate::robust::search::useful::{USEFUL, Useful};

/// One sample in this many is drawn from all matches. Eight would be a tenth faster and as safe, two would be a fifth slower.
const UNIFORM: usize = 4;

/// A competitor has at least this share of its inliers among the matches that the best pose leaves.
const APART: f64 = 0.8;

/// The largest density of a competitor in a pool. At 0.9 a dense false motion won in 7 to 20 % of the scenes that have one, at 0.6
/// and below in none.
const MOST_DENSE: f64 = 0.6;

/// Draws samples, and counts what they are worth.
#[derive(Debug)]
pub(crate) struct Guide {
    rng: ChaCha8Rng,
    /// Matches, and those of a sample.
    matches: usize,
    sample: usize,
    /// `−ln(1 − confidence)`.
    enough: f64,
    /// The matches from the best to the worst by the scores that were given.
    given: Option<Vec<u32>>,
    chart: Option<Chart>,
    /// Pools of all matches, once they are ranked.
    pools: Option<Pools>,
    /// Pools of the matches that the best pose leaves, once it is found again.
    rest: Option<Pools>,
    /// All samples, and those of them that were drawn from all matches.
    turn: usize,
    uniform: f64,
    /// How many matches a pose explains that explains clearly more than the one which is known beforehand.
    clearly_more: Option<f64>,
    best: Best,
}

/// The best pose, as far as samples are concerned.
#[derive(Debug, Default)]
struct Best {
    is_inlier: Vec<bool>,
    inliers: usize,
    /// Whether it explains no more than the pose that is known beforehand.
    is_known: bool,
    /// So many inliers of a competitor are among the matches that it leaves, at least.
    apart: f64,
    /// One for samples from all matches, one for samples from pools, whose matches are nearer to each other.
    useful: [Useful; 2],
    /// What a sample of all matches adds for it, and for a competitor.
    gain: f64,
    gain_of_competitor: f64,
    /// Whether it would have been found again: from then on a competitor is looked for.
    is_found_again: bool,
}

impl Guide {
    /// Uniform samples until the matches are ranked.
    pub(crate) fn new(rng: ChaCha8Rng, matches: usize, sample: usize, confidence: f64) -> Self {
        Self {
            rng,
            matches,
            sample,
            enough: stopping::enough(confidence),
            given: None,
            chart: None,
            pools: None,
            rest: None,
            turn: 0,
            uniform: 0.0,
            clearly_more: None,
            best: Best::default(),
        }
    }

    /// Whether there are pools.
    pub(crate) fn is_ranked(&self) -> bool {
        self.pools.is_some()
    }

    /// Whether there are so few matches that no pool would be smaller than all of them.
    pub(crate) fn is_too_small(&self) -> bool {
        self.matches < 2 * LEAST
    }

    /// Ranks the matches, by their points and by scores where there are any: from here on samples come from pools.
    pub(crate) fn rank(&mut self, chart: Chart, given: Option<Vec<u32>>) {
        let own = ranking::order(&chart);
        let mut pools = Pools::new(orders(own, given.as_deref()));
        if self.best.inliers > 0 {
            pools.count(&self.best.is_inlier);
        }
        (self.pools, self.chart, self.given) = (Some(pools), Some(chart), given);
    }

    /// The inliers of a new best pose: what was known of the last one does not hold for it.
    pub(crate) fn set_best(&mut self, inliers: &[u32]) {
        let count = inliers.len();
        let clearly_more = self.clearly_more.filter(|least| *least > count as f64);
        self.best = Best {
            is_inlier: vec![false; self.matches],
            inliers: count,
            is_known: clearly_more.is_some(),
            apart: APART * clearly_more.unwrap_or(count as f64),
            ..Best::default()
        };
        for &i in inliers {
            self.best.is_inlier[i as usize] = true;
        }
        self.rest = None;
        if let Some(pools) = &mut self.pools {
            pools.count(&self.best.is_inlier);
        }
    }

    /// A pose with so many inliers is known beforehand: only another is looked for that explains clearly more.
    pub(crate) fn set_known(&mut self, inliers: usize) {
        self.clearly_more = Some(clearly_more_than(inliers as f64));
    }

    /// Whether a sample that came from a pool, or from all matches, tells how useful clean samples are.
    pub(crate) fn tells(&self, sample: &[usize], is_from_pool: bool) -> bool {
        self.best.useful[usize::from(is_from_pool)].is_open()
            && !self.best.is_inlier.is_empty()
            && sample.iter().all(|&i| self.best.is_inlier[i])
    }

    /// Whether a clean sample led to the best pose.
    pub(crate) fn learn(&mut self, is_useful: bool, is_from_pool: bool) {
        self.best.useful[usize::from(is_from_pool)].add(is_useful);
    }

    /// The next sample, and whether it comes from a pool.
    pub(crate) fn draw(&mut self, sample: &mut Sample) -> bool {
        self.turn += 1;
        let is_rest_open = self.best.is_found_again && self.rest.is_some();
        let pools = match (&mut self.rest, &mut self.pools) {
            _ if self.turn.is_multiple_of(UNIFORM) => None,
            // Where the best pose would have been found again, only a competitor is left to be found.
            (Some(rest), _) if is_rest_open => Some(rest),
            (_, pools) => pools.as_mut(),
        };
        let own = &mut sample[..self.sample];
        let Some(pools) = pools else {
            draw_uniform(&mut self.rng, self.matches, own);
            self.uniform += 1.0;
            return false;
        };
        let pool = pools.choose(&mut self.rng);
        draw_from(&mut self.rng, pool, own);
        true
    }

    /// How many more samples it takes, at least.
    pub(crate) fn needed(&mut self) -> f64 {
        if self.best.inliers == 0 {
            return f64::INFINITY;
        }
        self.weigh();
        let pools = self.pools.as_ref();
        let sum = self.uniform * self.best.gain + pools.map_or(0.0, Pools::sum);
        let missing = self.enough - sum;
        if missing > 0.0 && !self.best.is_known {
            self.best.is_found_again = false;
            return missing / pools.map_or(0.0, Pools::most).max(self.best.gain);
        }
        if !self.best.is_found_again {
            self.best.is_found_again = true;
            self.look_at_rest();
        }
        if self.best.gain_of_competitor.is_infinite() {
            return 0.0;
        }
        let rest = self.rest.as_ref();
        let sum = self.uniform * self.best.gain_of_competitor + rest.map_or(0.0, Pools::sum);
        let most = rest.map_or(0.0, Pools::most).max(self.best.gain_of_competitor);
        (self.enough - sum).max(0.0) / most
    }

    /// What samples are worth to the best pose and to a competitor.
    fn weigh(&mut self) {
        let (n, inliers, sample) = (self.matches as f64, self.best.inliers as f64, self.sample);
        let [of_all, of_pools] = self.best.useful.map(|useful| useful.share());
        self.best.gain = gain(of_all * chance(inliers, n, sample));
        let (apart, left) = (self.best.apart, n - inliers);
        // Infinite where the matches that are left are too few for another pose.
        self.best.gain_of_competitor =
            if apart < left { gain(USEFUL * chance(apart / APART, n, sample)) } else { f64::INFINITY };
        let Some(pools) = &mut self.pools else { return };
        pools.weigh(sample, of_pools);
        if let Some(rest) = &mut self.rest {
            rest.weigh_unknown(apart / left, pools, MOST_DENSE, sample, USEFUL);
        }
    }

    /// Ranks the matches that the best pose leaves, where a competitor may be among them.
    fn look_at_rest(&mut self) {
        let Some(chart) = &self.chart else { return };
        if self.rest.is_some() || self.best.gain_of_competitor.is_infinite() {
            return;
        }
        #[expect(clippy::cast_possible_truncation, reason = "matches are counted by u32")]
        let left: Vec<u32> = (0..self.matches as u32).filter(|&i| !self.best.is_inlier[i as usize]).collect();
        if left.len() < LEAST {
            return;
        }
        let own = ranking::order(&part(chart, &left)).into_iter().map(|k| left[k as usize]).collect();
        let is_left = |i: &u32| !self.best.is_inlier[*i as usize];
        let given: Option<Vec<u32>> =
            self.given.as_ref().map(|given| given.iter().copied().filter(is_left).collect());
        self.rest = Some(Pools::new(orders(own, given.as_deref())));
        self.weigh();
    }
}

/// The order of coherence, that which was given, and that of the sum of both ranks.
fn orders(own: Vec<u32>, given: Option<&[u32]>) -> Vec<Vec<u32>> {
    let Some(given) = given else { return vec![own] };
    let most = own.iter().max().map_or(0, |&i| i as usize + 1);
    let mut ranks = vec![0_u64; most];
    for order in [&own[..], given] {
        for (rank, &i) in (0..).zip(order) {
            ranks[i as usize] += rank;
        }
    }
    let mut both = own.clone();
    both.sort_by_key(|&i| ranks[i as usize]);
    vec![own, given.to_vec(), both]
}
