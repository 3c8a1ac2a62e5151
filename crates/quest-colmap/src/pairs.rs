//! Pairs of images: their key, and lists of them.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use crate::ColmapError;

/// COLMAP's number in the key of a pair: the largest number of an image.
const BASE: i64 = 2_147_483_647;

/// The key of a pair of images, the one with the smaller number first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PairId(pub i64);

impl PairId {
    /// The key of two images, in whatever order; `None` for equal or impossible numbers.
    #[must_use]
    pub fn new(a: i64, b: i64) -> Option<Self> {
        let (first, second) = (a.min(b), a.max(b));
        (first > 0 && first < second && second < BASE).then(|| Self(BASE * first + second))
    }

    /// The numbers of the two images; the first is the smaller one.
    #[must_use]
    pub fn images(self) -> (i64, i64) {
        (self.0.div_euclid(BASE), self.0.rem_euclid(BASE))
    }
}

/// The pairs of a text file with two names of images a line, as `hloc` and COLMAP's matchers write it. Blank lines and lines
/// that begin with `#` are skipped.
///
/// # Errors
/// [`ColmapError::Io`] and [`ColmapError::Pairs`].
pub fn read_pairs(path: &Path) -> Result<Vec<(String, String)>, ColmapError> {
    let file = path.display().to_string();
    let text =
        std::fs::read_to_string(path).map_err(|source| ColmapError::Io { file: file.clone(), source })?;
    parse_pairs(&file, &text)
}

/// The pairs of a text, as [`read_pairs`]; `file` is how errors call it.
///
/// # Errors
/// [`ColmapError::Pairs`] for a line that is not two names.
pub fn parse_pairs(file: &str, text: &str) -> Result<Vec<(String, String)>, ColmapError> {
    let mut pairs = Vec::new();
    for (line, text) in (1..).zip(text.lines()) {
        let text = text.trim();
        if text.is_empty() || text.starts_with('#') {
            continue;
        }
        let names: Vec<_> = text.split_whitespace().collect();
        let &[first, second] = names.as_slice() else {
            let found = format!("found {} names", names.len());
            return Err(ColmapError::Pairs { file: file.to_owned(), line, found });
        };
        pairs.push((first.to_owned(), second.to_owned()));
    }
    Ok(pairs)
}

/// The keys of named pairs, each once, in ascending order.
pub(crate) fn keys(
    pairs: &[(String, String)],
    images: &HashMap<String, i64>,
) -> Result<BTreeSet<PairId>, ColmapError> {
    let mut keys = BTreeSet::new();
    for (line, (first, second)) in (1..).zip(pairs) {
        let refuse = |found| ColmapError::Pairs { file: "pairs".to_owned(), line, found };
        let number = |name: &String| {
            images
                .get(name)
                .copied()
                .ok_or_else(|| refuse(format!("found no image {name:?} in the database")))
        };
        let key = PairId::new(number(first)?, number(second)?);
        keys.insert(key.ok_or_else(|| refuse(format!("found {first:?} twice")))?);
    }
    Ok(keys)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_do_not_depend_on_the_order() {
        let key = PairId::new(7, 3).unwrap();
        assert_eq!((Some(key), key.images(), key.0), (PairId::new(3, 7), (3, 7), 2_147_483_647 * 3 + 7));
        assert_eq!((PairId::new(3, 3), PairId::new(0, 3), PairId::new(1, BASE)), (None, None, None));
    }

    #[test]
    fn lists_are_two_names_a_line() {
        let pairs = parse_pairs("p", "a.jpg b/c.jpg\n\n# no\n d e \n").unwrap();
        assert_eq!(pairs[1], ("d".to_owned(), "e".to_owned()));
        let error = parse_pairs("p", "a b\na b c\n").unwrap_err().to_string();
        assert!(error.contains("p:2") && error.contains("3 names"), "{error}");
    }
}
