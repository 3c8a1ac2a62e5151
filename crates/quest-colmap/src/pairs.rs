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
    for (line, text) in named_lines(text) {
        let names: Vec<_> = text.split_whitespace().collect();
        let &[first, second] = names.as_slice() else {
            let found = format!("found {} names", names.len());
            return Err(ColmapError::Pairs { file: file.to_owned(), line, found });
        };
        pairs.push((first.to_owned(), second.to_owned()));
    }
    Ok(pairs)
}

/// The lines with names, and their numbers.
fn named_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = (1..).zip(text.lines()).map(|(line, text)| (line, text.trim()));
    lines.filter(|(_, text)| !text.is_empty() && !text.starts_with('#'))
}

/// What a list is called that is no file.
const LIST: &str = "pairs";

impl ColmapError {
    /// The error of a list of pairs that was read from this file, with the file and its line in place of the list and the number of
    /// the pair; any other error as it is.
    #[must_use]
    pub fn in_list(self, path: &Path) -> Self {
        match self {
            Self::Pairs { file, line: number, found } if file == LIST => {
                // The list is at hand no more.
                let text = std::fs::read_to_string(path).unwrap_or_default();
                let line = named_lines(&text).nth(number - 1).map_or(number, |(line, _)| line);
                Self::Pairs { file: path.display().to_string(), line, found }
            }
            other => other,
        }
    }
}

/// The keys of named pairs, each once, in ascending order.
pub(crate) fn keys(
    pairs: &[(String, String)],
    images: &HashMap<String, i64>,
) -> Result<BTreeSet<PairId>, ColmapError> {
    let mut keys = BTreeSet::new();
    for (line, (first, second)) in (1..).zip(pairs) {
        let refuse = |found| ColmapError::Pairs { file: LIST.to_owned(), line, found };
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
    fn an_error_of_a_list_has_its_file_and_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.txt");
        std::fs::write(&path, "# pairs\n\na b\na c\n").unwrap();
        let images = HashMap::from([("a".to_owned(), 1), ("b".to_owned(), 2)]);
        let error = keys(&read_pairs(&path).unwrap(), &images).unwrap_err();
        let said = error.in_list(&path).to_string();
        assert!(said.contains("list.txt:4: found no image \"c\""), "{said}");
    }

    #[test]
    fn lists_are_two_names_a_line() {
        let pairs = parse_pairs("p", "a.jpg b/c.jpg\n\n# no\n d e \n").unwrap();
        assert_eq!(pairs[1], ("d".to_owned(), "e".to_owned()));
        let error = parse_pairs("p", "a b\na b c\n").unwrap_err().to_string();
        assert!(error.contains("p:2") && error.contains("3 names"), "{error}");
    }
}
