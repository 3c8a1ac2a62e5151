//! Which matches a hypothesis is made from.

use rand::seq::index::sample_array;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The largest sample of any solver.
pub(crate) const MAX_SAMPLE: usize = 8;

/// PROSAC samples as uniform sampling does after this many iterations.
const PROSAC_CONVERGENCE: f64 = 20_000.0;

/// Few enough matches for every five of them to be tried.
const EXHAUSTIVE: usize = 10;

/// Draws samples of distinct matches.
#[derive(Debug)]
pub(crate) struct Sampler {
    rng: ChaCha8Rng,
    matches: usize,
    size: usize,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Uniform,
    /// Every sample once, in lexicographic order; `None` after the last.
    Exhaustive(Option<[usize; MAX_SAMPLE]>),
    Prosac(Prosac),
}

/// O. Chum, J. Matas, *Matching with PROSAC*, CVPR 2005: samples from the best matches first.
#[derive(Debug)]
struct Prosac {
    /// The matches from the best to the worst.
    ranked: Vec<usize>,
    /// How many of them the samples come from, `n` of the paper.
    pool: usize,
    /// `T_n`, the average number of samples of uniform sampling that lie in the pool.
    average: f64,
    /// `T'_n`, the iteration at which the pool grows.
    next: f64,
    iteration: f64,
}

/// The generator of the estimate of the pair with this index among those that share a seed.
pub(crate) fn generator(seed: u64, index: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index);
    rng
}

impl Sampler {
    /// Samples of `size` of `matches` matches; with `ranked`, the matches from the best to the worst, by PROSAC.
    pub(crate) fn new(rng: ChaCha8Rng, matches: usize, size: usize, ranked: Option<Vec<usize>>) -> Self {
        let kind = match ranked {
            _ if matches <= EXHAUSTIVE => {
                Kind::Exhaustive(Some(std::array::from_fn(|k| if k < size { k } else { 0 })))
            }
            None => Kind::Uniform,
            Some(ranked) => Kind::Prosac(Prosac::new(ranked, size)),
        };
        Self { rng, matches, size, kind }
    }

    /// Whether every sample is drawn once, in which case none is left out.
    pub(crate) fn is_exhaustive(&self) -> bool {
        matches!(self.kind, Kind::Exhaustive(_))
    }

    /// The next sample, `None` when every one has been drawn.
    pub(crate) fn draw(&mut self, sample: &mut [usize; MAX_SAMPLE]) -> Option<()> {
        match &mut self.kind {
            Kind::Uniform => draw_uniform(&mut self.rng, self.matches, &mut sample[..self.size]),
            Kind::Exhaustive(next) => {
                *sample = (*next)?;
                *next = successor(*sample, self.size, self.matches);
            }
            Kind::Prosac(prosac) => {
                let pool = prosac.grow(self.size);
                let (last, rest) = sample[..self.size].split_last_mut()?;
                if pool == prosac.ranked.len() && prosac.next < prosac.iteration {
                    draw_uniform(&mut self.rng, pool, rest);
                    *last = loop {
                        let candidate = self.rng.random_range(0..pool);
                        if !rest.contains(&candidate) {
                            break candidate;
                        }
                    };
                } else {
                    draw_uniform(&mut self.rng, pool - 1, rest);
                    *last = pool - 1;
                }
                for index in &mut sample[..self.size] {
                    *index = prosac.ranked[*index];
                }
            }
        }
        Some(())
    }
}

impl Prosac {
    fn new(ranked: Vec<usize>, size: usize) -> Self {
        let n = ranked.len();
        let average = (0..size).fold(PROSAC_CONVERGENCE, |t, i| t * (size - i) as f64 / (n - i) as f64);
        Self { ranked, pool: size, average, next: 1.0, iteration: 0.0 }
    }

    /// Equations (3) to (5) of the paper.
    fn grow(&mut self, size: usize) -> usize {
        self.iteration += 1.0;
        while self.iteration > self.next && self.pool < self.ranked.len() {
            let average = self.average * (self.pool + 1) as f64 / (self.pool + 1 - size) as f64;
            self.next += (average - self.average).ceil();
            self.average = average;
            self.pool += 1;
        }
        self.pool
    }
}

fn draw_uniform(rng: &mut ChaCha8Rng, count: usize, sample: &mut [usize]) {
    if let Ok(five) = <&mut [usize; 5]>::try_from(&mut *sample)
        && let Some(drawn) = sample_array(rng, count)
    {
        *five = drawn;
        return;
    }
    for k in 0..sample.len() {
        sample[k] = loop {
            let candidate = rng.random_range(0..count);
            if !sample[..k].contains(&candidate) {
                break candidate;
            }
        };
    }
}

/// The next of the samples `i < j < k < …` in lexicographic order.
fn successor(mut sample: [usize; MAX_SAMPLE], size: usize, count: usize) -> Option<[usize; MAX_SAMPLE]> {
    let k = (0..size).rev().find(|&k| sample[k] < count - size + k)?;
    let first = sample[k] + 1;
    for (offset, index) in sample[k..size].iter_mut().enumerate() {
        *index = first + offset;
    }
    Some(sample)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    const SEED: u64 = 40;

    fn drawn(sampler: &mut Sampler, count: usize) -> Vec<Vec<usize>> {
        let mut sample = [0; MAX_SAMPLE];
        (0..count)
            .map_while(|_| sampler.draw(&mut sample).map(|()| sample[..sampler.size].to_vec()))
            .collect()
    }

    #[test]
    fn samples_are_distinct_and_cover_all() {
        for size in [4, 5, 8] {
            let mut sampler = Sampler::new(generator(SEED, 0), 20, size, None);
            let mut seen = HashSet::new();
            for sample in drawn(&mut sampler, 500) {
                let distinct: HashSet<_> = sample.iter().copied().collect();
                assert_eq!(distinct.len(), size);
                assert!(distinct.iter().all(|&i| i < 20));
                seen.extend(distinct);
            }
            assert_eq!(seen.len(), 20);
        }
    }

    #[test]
    fn few_matches_are_tried_in_every_combination_once() {
        for (count, size, expected) in [(5, 5, 1), (7, 5, 21), (10, 5, 252), (9, 8, 9), (6, 4, 15)] {
            let mut sampler = Sampler::new(generator(SEED, 0), count, size, None);
            let all: HashSet<_> = drawn(&mut sampler, 10_000).into_iter().collect();
            assert_eq!(all.len(), expected);
        }
    }

    #[test]
    fn prosac_begins_with_the_best_and_ends_with_all() {
        let ranked: Vec<_> = (0..100).rev().collect();
        let mut sampler = Sampler::new(generator(SEED, 0), 100, 5, Some(ranked));
        let mut first = drawn(&mut sampler, 1).remove(0);
        first.sort_unstable();
        assert_eq!(first, [95, 96, 97, 98, 99]);
        let early: HashSet<_> = drawn(&mut sampler, 50).into_iter().flatten().collect();
        assert!(early.iter().all(|&i| i > 50), "{early:?}");
        let late: HashSet<_> = drawn(&mut sampler, 30_000).into_iter().skip(25_000).flatten().collect();
        assert_eq!(late.len(), 100);
    }

    #[test]
    fn the_seed_decides() {
        let all = |seed| drawn(&mut Sampler::new(generator(seed, 0), 50, 5, None), 20);
        assert_eq!(all(1), all(1));
        assert_ne!(all(1), all(2));
    }
}
