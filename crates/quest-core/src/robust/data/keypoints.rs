//! Which matches share a keypoint. A point is seen once in a view: of the matches of one keypoint at most one is true, and a match
//! that is there twice says nothing twice.

use hashbrown::HashTable;

use crate::Correspondence;

/// The keypoints of every match, one number for each keypoint of a view.
#[derive(Debug)]
pub(crate) struct Keypoints {
    of_match: Vec<[u32; 2]>,
    /// How many matches each keypoint of a view has.
    counts: [Vec<u32>; 2],
}

/// The coordinates of a keypoint as bits.
type Key = [u64; 3];

fn key(m: &Correspondence, view: usize) -> Key {
    let bearing = if view == 0 { m.bearing1() } else { m.bearing2() };
    // One zero, not two.
    <[f64; 3]>::from(*bearing).map(|x| (x + 0.0).to_bits())
}

/// The first match of each keypoint of a view. Coordinates are looked up in the matches: with them the table of ten million matches would
/// have half a gigabyte.
struct Firsts(HashTable<u32>);

impl Firsts {
    fn new(matches: usize) -> Self {
        Self(HashTable::with_capacity(matches))
    }

    /// The first match with the keypoint of a match, which is put there if there is none.
    fn first(&mut self, matches: &[Correspondence], view: usize, index: u32) -> u32 {
        let of = |i: u32| key(&matches[i as usize], view);
        let own = of(index);
        *self.0.entry(hash(own), |&other| of(other) == own, |&other| hash(of(other))).or_insert(index).get()
    }
}

/// Multiplies and rotates: bits of coordinates need no more, and a tenth of the time of an estimate would go into a hash that
/// withstands malice.
fn hash(key: Key) -> u64 {
    // 2^64 over the golden ratio.
    let mix = |hash: u64, x: u64| (hash.rotate_left(23) ^ x).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = key.into_iter().fold(0, mix);
    mixed ^ (mixed >> 29)
}

impl Keypoints {
    pub(crate) fn new(matches: &[Correspondence]) -> Self {
        let mut counts = [Vec::new(), Vec::new()];
        let mut of_match = vec![[0; 2]; matches.len()];
        for (view, counts) in counts.iter_mut().enumerate() {
            let mut firsts = Firsts::new(matches.len());
            let mut next = 0;
            for (index, i) in (0_u32..).zip(0..matches.len()) {
                let first = firsts.first(matches, view, index);
                let id = if first == index { next } else { of_match[first as usize][view] };
                if id == next {
                    counts.push(0);
                    next += 1;
                }
                counts[id as usize] += 1;
                of_match[i][view] = id;
            }
        }
        Self { of_match, counts }
    }

    /// Whether some keypoint has more than one match.
    pub(crate) fn are_shared(&self) -> bool {
        self.counts.iter().any(|counts| counts.len() < self.of_match.len())
    }

    /// Those of some matches, in their order, that are left if each keypoint keeps one match, the `first` of its matches.
    /// Among equals the match whose keypoints have fewer others is first.
    pub(crate) fn one_each(&self, order: &[u32], first: impl Fn(usize) -> f64) -> Vec<u32> {
        let others = |i: usize| -> u64 {
            (0..2).map(|view| u64::from(self.counts[view][self.of_match[i][view] as usize])).product()
        };
        let mut by_worth: Vec<_> =
            order.iter().map(|&i| (first(i as usize), others(i as usize), i as usize)).collect();
        by_worth.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut is_taken = self.counts.each_ref().map(|counts| vec![false; counts.len()]);
        let mut is_kept = vec![false; self.of_match.len()];
        for (_, _, i) in by_worth {
            let places = self.of_match[i].map(|id| id as usize);
            if (0..2).all(|view| !is_taken[view][places[view]]) {
                (0..2).for_each(|view| is_taken[view][places[view]] = true);
                is_kept[i] = true;
            }
        }
        order.iter().copied().filter(|&i| is_kept[i as usize]).collect()
    }

    /// Marks the matches that are the same as a marked one.
    pub(crate) fn mark_copies(&self, marked: &mut [bool]) {
        let same: std::collections::HashSet<[u32; 2]> =
            self.of_match.iter().zip(&*marked).filter(|(_, is)| **is).map(|(ids, _)| *ids).collect();
        for (ids, marked) in self.of_match.iter().zip(marked) {
            *marked |= same.contains(ids);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keypoints(pairs: &[[f64; 2]]) -> Keypoints {
        let match_of = |[a, b]: &[f64; 2]| Correspondence::from_image_points([*a, 0.1], [*b, 0.2]).unwrap();
        Keypoints::new(&pairs.iter().map(match_of).collect::<Vec<_>>())
    }

    #[test]
    fn each_keypoint_keeps_one_match() {
        // Keypoint 9 of view 2 has three matches, keypoint 1 of view 1 has two, and the last match is there twice.
        let all = keypoints(&[[1.0, 9.0], [2.0, 9.0], [3.0, 9.0], [1.0, 5.0], [4.0, 6.0], [4.0, 6.0]]);
        assert!(all.are_shared());
        let order = [5, 4, 3, 2, 1, 0];
        // The match of keypoint 1 with one other is before that with three.
        assert_eq!(all.one_each(&order, |_| 0.0), [5, 3, 2]);
        // Whatever is known comes before that.
        assert_eq!(all.one_each(&order, |i| if i == 0 { -1.0 } else { 0.0 }), [5, 0]);
        let mut marked = [false, false, false, true, true, false];
        all.mark_copies(&mut marked);
        assert_eq!(marked, [false, false, false, true, true, true]);
    }

    #[test]
    fn distinct_keypoints_are_not_shared() {
        let all = keypoints(&[[0.0, 0.0], [-0.5, 0.5], [0.5, -0.5]]);
        assert!(!all.are_shared());
        assert_eq!(all.one_each(&[2, 0, 1], |_| 0.0), [2, 0, 1]);
        assert!(keypoints(&[[0.0, 1.0], [-0.0, 2.0]]).are_shared());
    }
}
