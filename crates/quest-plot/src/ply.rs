//! A space as PLY, which programs for point clouds and meshes open: points with colours, lines as edges.

use std::fmt::Write;

use crate::{Colour, Part, Space};

impl Space {
    /// The text of a PLY file: every part that is shown and not faint. Its title stands in a comment.
    #[must_use]
    pub fn to_ply(&self) -> String {
        let is_solid = |part: &&Part| part.is_shown && part.opacity >= 0.5;
        let mut vertices: Vec<([f64; 3], Colour)> = Vec::new();
        let mut edges = Vec::new();
        for part in self.parts.iter().filter(is_solid) {
            vertices.extend(part.points.iter().map(|(x, _)| (*x, part.colour)));
            for line in &part.lines {
                let first = vertices.len();
                vertices.extend(line.iter().map(|x| (*x, part.colour)));
                edges.extend((first + 1..vertices.len()).map(|next| [next - 1, next]));
            }
        }
        let title = self.title.replace(char::is_control, " ");
        let mut text = format!(
            "ply\nformat ascii 1.0\ncomment {title}\nelement vertex {}\nproperty double x\nproperty double y\n\
             property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement edge {}\n\
             property int vertex1\nproperty int vertex2\nend_header\n",
            vertices.len(),
            edges.len()
        );
        // Nothing fails that writes into a text.
        for ([x, y, z], Colour(red, green, blue)) in vertices {
            let _ = writeln!(text, "{x} {y} {z} {red} {green} {blue}");
        }
        for [from, to] in edges {
            let _ = writeln!(text, "{from} {to}");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_lines_are_vertices_and_edges() {
        let line = vec![vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.5, 0.0]]];
        let points = vec![([0.25, -1e-3, 2.0], "a point".to_owned())];
        let part = Part { lines: line, points, ..Part::new("a", Colour(1, 2, 3)) };
        let hidden = Part { is_shown: false, ..part.clone() };
        let faint = Part { opacity: 0.3, ..part.clone() };
        let text = Space::new("two\nlines").with(part).with(hidden).with(faint).to_ply();
        let (header, body) = text.split_once("end_header\n").unwrap();
        assert!(
            header.contains("comment two lines\nelement vertex 4\n") && header.contains("element edge 2\n")
        );
        assert_eq!(body, "0.25 -0.001 2 1 2 3\n0 0 0 1 2 3\n1 0 0 1 2 3\n1 0.5 0 1 2 3\n1 2\n2 3\n");
    }
}
