//! XML, as OpenCV writes it.

use roxmltree::{Document, Node};

use super::keys::Keys;

/// The values in `text`, or the line of a mistake and what it is.
pub(super) fn keys(text: &str) -> Result<Keys, (Option<usize>, String)> {
    let document = Document::parse(text)
        .map_err(|error| (usize::try_from(error.pos().row).ok(), format!("found no XML: {error}")))?;
    let root = document.root_element();
    let mut keys = Keys::default();
    for leaf in
        root.descendants().filter(|node| node.is_element() && !node.children().any(|n| n.is_element()))
    {
        let within = |node: &Node| *node != root;
        let mut path: Vec<_> = leaf.ancestors().take_while(within).map(|n| n.tag_name().name()).collect();
        path.reverse();
        for value in leaf.text().unwrap_or_default().split_whitespace() {
            keys.push(&path, value.trim_matches('"'));
        }
    }
    Ok(keys)
}
