//! Pools of matches that samples come from, and how soon each of them would give the best pose again.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::robust::search::stopping::{chance, gain};

/// A pool holds at least this many matches: five out of fewer lie too close together. Not sensitive between 12 and 40.
pub(crate) const LEAST: usize = 20;

/// The smallest pool is this part of all matches, in powers of two.
const SMALLEST: u32 = 7;

/// The inliers of a pool that are not counted: any sample fits five.
const FREE: f64 = 5.0;

/// Orders of some matches. The first `n` of an order are a pool, for several `n`; its last pool is everything.
#[derive(Debug)]
pub(crate) struct Pools {
    orders: Vec<Vec<u32>>,
    sizes: Vec<usize>,
    all: Vec<Pool>,
}

/// The first matches of an order.
#[derive(Clone, Copy, Debug)]
struct Pool {
    order: usize,
    size: usize,
    /// Samples drawn from it.
    drawn: f64,
    /// Inliers of the best pose in it, the free ones not counted, and how many times denser they are than in all matches.
    inliers: f64,
    denser: f64,
    /// `−ln` of the probability that one of them does not lead to what is looked for.
    gain: f64,
}

impl Pools {
    /// Pools of orders of the same matches; at least one order.
    pub(crate) fn new(orders: Vec<Vec<u32>>) -> Self {
        let n = orders.first().map_or(0, Vec::len);
        let mut sizes: Vec<usize> = (1..=SMALLEST).rev().map(|k| n >> k).filter(|&m| m >= LEAST).collect();
        sizes.push(n);
        let pool = |order| {
            move |size: &usize| Pool { order, size: *size, drawn: 0.0, inliers: 0.0, denser: 1.0, gain: 0.0 }
        };
        let all = (0..orders.len()).flat_map(|order| sizes.iter().map(pool(order))).collect();
        Self { orders, sizes, all }
    }

    /// The sum of `−ln` of the probabilities that a sample has not led to what is looked for, over all that were drawn.
    pub(crate) fn sum(&self) -> f64 {
        self.all.iter().map(|pool| pool.drawn * pool.gain).sum()
    }

    /// The most that one sample adds to [`Self::sum`].
    pub(crate) fn most(&self) -> f64 {
        self.all.iter().map(|pool| pool.gain).fold(0.0, f64::max)
    }

    /// Chooses a pool: every other time the one that leads most surely to what is looked for, otherwise any, as another pose
    /// may stand higher in another pool.
    pub(crate) fn choose(&mut self, rng: &mut ChaCha8Rng) -> &[u32] {
        let is_known = self.all.iter().any(|pool| pool.gain > 0.0);
        let chosen = if is_known && rng.random_range(0..2) == 0 {
            let better =
                |best: usize, k: usize| if self.all[k].gain > self.all[best].gain { k } else { best };
            (1..self.all.len()).fold(0, better)
        } else {
            rng.random_range(0..self.all.len())
        };
        let pool = &mut self.all[chosen];
        pool.drawn += 1.0;
        &self.orders[pool.order][..pool.size]
    }

    /// Counts the inliers of a pose in every pool.
    pub(crate) fn count(&mut self, is_inlier: &[bool]) {
        let all = self.sizes.last().copied().unwrap_or(0);
        let share = is_inlier.iter().filter(|x| **x).count() as f64 / all.max(1) as f64;
        let (mut inside, mut begin) = (0, 0);
        for pool in &mut self.all {
            let more = &self.orders[pool.order][begin..pool.size];
            inside += more.iter().filter(|&&i| is_inlier[i as usize]).count();
            pool.inliers = if pool.size == all { inside as f64 } else { (inside as f64 - FREE).max(0.0) };
            pool.denser = pool.inliers / (pool.size as f64 * share).max(f64::MIN_POSITIVE);
            // The next order begins anew.
            (inside, begin) = if pool.size == all { (0, 0) } else { (inside, pool.size) };
        }
    }

    /// What a sample of each pool adds, for the pose whose inliers were counted; a share `useful` of the clean samples leads to it.
    pub(crate) fn weigh(&mut self, sample: usize, useful: f64) {
        for pool in &mut self.all {
            pool.gain = gain(useful * chance(pool.inliers, pool.size as f64, sample));
        }
    }

    /// The same for a pose that is not known: `share` of all matches are its inliers, in a pool as many times more as in the
    /// pools of the same part of the same orders of `like`, but not more than `most`.
    pub(crate) fn weigh_unknown(&mut self, share: f64, like: &Self, most: f64, sample: usize, useful: f64) {
        let all = self.sizes.last().copied().unwrap_or(0);
        for pool in &mut self.all {
            let size = pool.size as f64;
            let denser = if pool.size < all { like.denser(pool.order, size / all as f64) } else { 1.0 };
            let own = (share * denser.max(1.0)).min(most.max(share));
            pool.gain = gain(useful * chance(own * size, size, sample));
        }
    }

    /// How much denser the inliers that were counted are in the largest pool of an order that is no larger than this part.
    fn denser(&self, order: usize, part: f64) -> f64 {
        let all = self.sizes.last().copied().unwrap_or(0) as f64;
        let own = || self.all.iter().filter(|pool| pool.order == order);
        let fitting = own().rfind(|pool| pool.size as f64 <= part * all + 0.5);
        fitting.or_else(|| own().next()).map_or(1.0, |pool| pool.denser)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robust::search::sampling::generator;

    /// 400 matches of which every tenth of the order is an inlier, and all of the first 40.
    fn pools() -> (Pools, Vec<bool>) {
        let is_inlier: Vec<bool> = (0..400).map(|i| i < 40 || i % 10 == 0).collect();
        (Pools::new(vec![(0..400).collect()]), is_inlier)
    }

    #[test]
    fn pools_are_halves_down_to_the_least() {
        let (pools, _) = pools();
        assert_eq!(pools.sizes, [25, 50, 100, 200, 400]);
        assert_eq!(Pools::new(vec![(0..30).collect()]).sizes, [30]);
        assert_eq!(Pools::new(vec![(0..30).collect(); 3]).all.len(), 3);
    }

    #[test]
    fn the_best_pool_is_that_with_most_clean_samples() {
        let (mut pools, is_inlier) = pools();
        pools.count(&is_inlier);
        pools.weigh(5, 1.0);
        // Of the first 25 all are inliers, of which five are free.
        let expected = gain(chance(20.0, 25.0, 5));
        assert!((pools.most() - expected).abs() < 1e-12, "{} {expected}", pools.most());
        let mut rng = generator(2018, 0);
        let chosen: Vec<usize> = (0..1000).map(|_| pools.choose(&mut rng).len()).collect();
        // Half of the draws and a fifth of the other half.
        let share = chosen.iter().filter(|size| **size == 25).count();
        assert!((550..650).contains(&share), "{share}");
        assert!((pools.sum() - chosen.len() as f64 * expected).abs() < 0.7 * chosen.len() as f64 * expected);
    }

    #[test]
    fn an_unknown_pose_is_as_dense_as_the_known_one_but_not_denser_than_the_most() {
        let (mut known, is_inlier) = pools();
        known.count(&is_inlier);
        let mut rest = Pools::new(vec![(400..600).collect()]);
        rest.weigh_unknown(0.1, &known, 0.6, 5, 1.0);
        // In a pool of a quarter the known inliers are 2.1 times denser than in all.
        let quarter = rest.all.iter().find(|pool| pool.size == 50).unwrap();
        let denser = (46.0 - 5.0) / 100.0 / (76.0 / 400.0);
        assert!((quarter.gain - gain(chance(0.1 * denser * 50.0, 50.0, 5))).abs() < 1e-12);
        rest.weigh_unknown(0.5, &known, 0.6, 5, 1.0);
        assert!((rest.all[0].gain - gain(chance(15.0, 25.0, 5))).abs() < 1e-12);
    }
}
