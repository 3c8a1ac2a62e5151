//! Smaller files that look the same: plotters writes every point of a line, with all its digits, and dashes one by one.

use std::fmt::Write;

use super::{DASHED_WIDTH, FINE};

/// How far a line may move, in fine units: an eighth of a unit of the file, so that curves stay smooth.
const TOLERANCE: f64 = FINE as f64 / 8.0;
/// A line that needs more points than this is a noisy one,
const SMOOTH: usize = 64;
/// which may move by half a unit, a third of its width.
const TOLERANCE_OF_NOISE: f64 = FINE as f64 / 2.0;

/// Lines and areas as paths in relative coordinates, without the points that nobody can tell from their neighbours, and with
/// the dashes that plotters does not know.
pub(super) fn compact(svg: &str) -> String {
    let mut out = String::with_capacity(svg.len());
    for line in svg.split_inclusive('\n') {
        match path(line) {
            Some(path) => out.push_str(&path),
            None => out.push_str(line),
        }
    }
    out
}

/// The element on a line of the file as a path; `None` where it is no line or area.
fn path(element: &str) -> Option<String> {
    let (attributes, is_closed) = match element.strip_prefix("<polyline ") {
        Some(rest) => (rest, false),
        None => (element.strip_prefix("<polygon ")?, true),
    };
    let (attributes, rest) = attributes.split_once("points=\"")?;
    let (list, end) = rest.split_once('"')?;
    let point = |text: &str| {
        let (x, y) = text.split_once(',')?;
        Some([x.parse().ok()?, y.parse().ok()?])
    };
    let points = list.split_whitespace().map(point).collect::<Option<Vec<[i32; 2]>>>()?;
    let dashes = if attributes.contains(&format!("stroke-width=\"{DASHED_WIDTH}\"")) {
        format!("stroke-dasharray=\"{} {}\" ", 6 * FINE, 4 * FINE)
    } else {
        String::new()
    };
    let mut path = format!("<path {}{dashes}d=\"", attributes.replace("opacity=\"1\" ", ""));
    let mut last = [0, 0];
    for (k, [x, y]) in reduced(&points).into_iter().enumerate() {
        let (dx, dy) = (x - last[0], y - last[1]);
        let letter = ["M", "l", " "][k.min(2)];
        // A minus sign separates numbers, and commands need no space before them.
        let before = if k > 1 && dx < 0 { "" } else { letter };
        let between = if dy < 0 { "" } else { " " };
        let _ = write!(path, "{before}{dx}{between}{dy}");
        last = [x, y];
    }
    path.push_str(if is_closed { "z\"" } else { "\"" });
    path.push_str(end);
    Some(path)
}

/// The points that the line needs.
fn reduced(points: &[[i32; 2]]) -> Vec<[i32; 2]> {
    let points = columns(points);
    let smooth = thinned(&points, TOLERANCE);
    if smooth.len() > SMOOTH { thinned(&points, TOLERANCE_OF_NOISE) } else { smooth }
}

/// Keeps the first, the last, the highest and the lowest of neighbours in one column of units, for curves such as noise over time.
fn columns(points: &[[i32; 2]]) -> Vec<[i32; 2]> {
    let mut kept = Vec::with_capacity(points.len());
    for column in points.chunk_by(|a, b| a[0].div_euclid(FINE) == b[0].div_euclid(FINE)) {
        let last = column.len() - 1;
        let extreme = |sign: i32| (0..=last).max_by_key(|&k| sign * column[k][1]).unwrap_or(0);
        let mut indices = [0, extreme(-1), extreme(1), last];
        indices.sort_unstable();
        kept.extend(indices.map(|k| column[k]));
    }
    kept.dedup();
    kept
}

/// The ends of the longest pieces from which no point is further than the tolerance: the method of Douglas and Peucker.
fn thinned(points: &[[i32; 2]], tolerance: f64) -> Vec<[i32; 2]> {
    let mut is_kept = vec![false; points.len()];
    let mut pieces = vec![(0, points.len().saturating_sub(1))];
    while let Some((first, last)) = pieces.pop() {
        for end in [first, last] {
            if let Some(kept) = is_kept.get_mut(end) {
                *kept = true;
            }
        }
        let distance = |k: &usize| distance(points[*k], points[first], points[last]);
        let farthest = (first + 1..last).max_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(k) = farthest.filter(|k| distance(k) > tolerance) {
            pieces.extend([(first, k), (k, last)]);
        }
    }
    points.iter().zip(is_kept).filter_map(|(p, kept)| kept.then_some(*p)).collect()
}

/// From a point to a piece of a line.
fn distance(point: [i32; 2], from: [i32; 2], to: [i32; 2]) -> f64 {
    let between = |a: [i32; 2], b: [i32; 2]| [f64::from(b[0] - a[0]), f64::from(b[1] - a[1])];
    let ([px, py], [dx, dy]) = (between(from, point), between(from, to));
    let length = dx * dx + dy * dy;
    let along = if length > 0.0 { ((px * dx + py * dy) / length).clamp(0.0, 1.0) } else { 0.0 };
    (px - along * dx).hypot(py - along * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_become_paths_and_the_rest_stays() {
        let line = "<polyline fill=\"none\" opacity=\"1\" stroke=\"#000000\" stroke-width=\"8\" points=\"10,20 100,20 100,0 \"/>\n";
        let expected = "<path fill=\"none\" stroke=\"#000000\" stroke-width=\"8\" d=\"M10 20l90 0 0-20\"/>\n";
        assert_eq!(compact(line), expected);
        let area = "<polygon opacity=\"0.1\" fill=\"#000000\" points=\"10,20 100,20 0,0 \"/>\n";
        assert_eq!(compact(area), "<path opacity=\"0.1\" fill=\"#000000\" d=\"M10 20l90 0-100-20z\"/>\n");
        let dashed = line.replace("\"8\"", &format!("\"{DASHED_WIDTH}\""));
        assert!(compact(&dashed).contains("stroke-dasharray=\"48 32\" d="));
        let text = "<text x=\"1\">\npoints=\"1,2\"\n</text>\n";
        assert_eq!(compact(text), text);
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "a position on the canvas")]
    fn no_point_is_further_from_the_thinned_line_than_the_tolerance() {
        let wave = |k: i32| [8 * k, (400.0 * (0.1 * f64::from(k)).sin()).round() as i32];
        let points: Vec<_> = (0..500).map(wave).collect();
        let kept = thinned(&points, TOLERANCE);
        assert!(kept.len() < 250 && kept.len() > 50, "{}", kept.len());
        for p in points {
            let nearest = kept.windows(2).map(|w| distance(p, w[0], w[1])).fold(f64::INFINITY, f64::min);
            assert!(nearest <= TOLERANCE);
        }
        assert_eq!(reduced(&[[3, 4]]), [[3, 4]]);
        assert!(reduced(&[]).is_empty());
    }

    #[test]
    fn noise_keeps_its_envelope() {
        let points: Vec<_> = (0..1000).map(|k| [k / 4, (k * 7919) % 800]).collect();
        let kept = columns(&points);
        assert!(kept.len() <= 4 * 32);
        for column in points.chunks(4 * 8) {
            let own = |p: &&[i32; 2]| p[0] / 8 == column[0][0] / 8;
            let range =
                |all: Vec<&[i32; 2]>| (all.iter().map(|p| p[1]).min(), all.iter().map(|p| p[1]).max());
            assert_eq!(range(column.iter().collect()), range(kept.iter().filter(own).collect()));
        }
    }
}
