//! Which matches a hypothesis is made from.

use rand::seq::index::sample_array;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The largest sample of any solver.
pub(crate) const MAX_SAMPLE: usize = 8;

/// The indices of the matches of a sample; those of a smaller solver stand first.
pub(crate) type Sample = [usize; MAX_SAMPLE];

/// Few enough matches for every five of them to be tried.
const EXHAUSTIVE: usize = 10;

/// Every sample once, in lexicographic order.
#[derive(Debug)]
pub(crate) struct Exhaustive {
    matches: usize,
    size: usize,
    next: Option<Sample>,
}

/// The generator of the estimate of the pair with this index among those that share a seed.
pub(crate) fn generator(seed: u64, index: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index);
    rng
}

/// Whether there are so few matches that every sample is tried.
pub(crate) fn is_exhaustive(matches: usize) -> bool {
    matches <= EXHAUSTIVE
}

impl Exhaustive {
    /// The samples of `size` of `matches` matches.
    pub(crate) fn new(matches: usize, size: usize) -> Self {
        Self { matches, size, next: Some(std::array::from_fn(|k| if k < size { k } else { 0 })) }
    }
}

impl Iterator for Exhaustive {
    type Item = Sample;

    fn next(&mut self) -> Option<Sample> {
        let sample = self.next?;
        self.next = successor(sample, self.size, self.matches);
        Some(sample)
    }
}

/// A sample of these matches.
pub(crate) fn draw_from(rng: &mut ChaCha8Rng, pool: &[u32], sample: &mut [usize]) {
    draw_uniform(rng, pool.len(), sample);
    for index in sample {
        *index = pool[*index] as usize;
    }
}

/// A sample of all matches.
pub(crate) fn draw_uniform(rng: &mut ChaCha8Rng, count: usize, sample: &mut [usize]) {
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
fn successor(mut sample: Sample, size: usize, count: usize) -> Option<Sample> {
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

    const SEED: u64 = 2018;

    #[test]
    fn samples_are_distinct_and_cover_all() {
        let pool: Vec<u32> = (0..20).map(|i| 3 * i).collect();
        for size in [4, 5, 8] {
            let mut rng = generator(SEED, 0);
            let mut seen = HashSet::new();
            for _ in 0..500 {
                let mut sample = [0; MAX_SAMPLE];
                draw_from(&mut rng, &pool, &mut sample[..size]);
                let distinct: HashSet<_> = sample[..size].iter().copied().collect();
                assert_eq!(distinct.len(), size);
                seen.extend(distinct);
            }
            assert_eq!(seen, pool.iter().map(|&i| i as usize).collect());
        }
    }

    #[test]
    fn few_matches_are_tried_in_every_combination_once() {
        for (count, size, expected) in [(5, 5, 1), (7, 5, 21), (10, 5, 252), (9, 8, 9), (6, 4, 15)] {
            let all: HashSet<_> = Exhaustive::new(count, size).collect();
            assert_eq!(all.len(), expected);
        }
    }

    #[test]
    fn the_seed_decides() {
        let all = |seed| {
            let mut rng = generator(seed, 0);
            let mut sample = [0; 5];
            let draw = |_| {
                draw_uniform(&mut rng, 50, &mut sample);
                sample
            };
            (0..20).map(draw).collect::<Vec<_>>()
        };
        assert_eq!(all(1), all(1));
        assert_ne!(all(1), all(2));
    }
}
