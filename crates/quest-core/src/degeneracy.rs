//! Why matches do not determine a pose, in the words of a user.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use crate::{Correspondence, Degeneracy};

/// Bearings closer than this count as the same one. A constraint of two matches this close has fewer than six correct digits in
/// double precision.
const SAME: f64 = 1e-10;

/// Whether the bearings of camera 1 are parallel, in the same direction or the opposite one: a whole circle of rotations
/// aligns them with those of camera 2.
pub(crate) fn all_parallel(matches: &[Correspondence]) -> bool {
    matches.iter().all(|m| m.bearing1().cross(matches[0].bearing1()).norm() < SAME)
}

/// Names the reason why matches give fewer than five independent constraints. The time is quadratic in the number of matches;
/// callers first find that constraints are missing.
pub(crate) fn diagnose(matches: &[Correspondence]) -> Degeneracy {
    diagnose_fewer_than(5, matches)
}

/// The same for a solver that needs another number of distinct matches.
pub(crate) fn diagnose_fewer_than(needed: usize, matches: &[Correspondence]) -> Degeneracy {
    let same = |x: &Vector3<f64>, y: &Vector3<f64>| (x - y).norm() < SAME;
    let coincident = |bearing: fn(&Correspondence) -> &Vector3<f64>| {
        matches.iter().all(|m| same(bearing(m), bearing(&matches[0])))
    };
    if coincident(Correspondence::bearing1) || coincident(Correspondence::bearing2) {
        return Degeneracy::Coincident;
    }
    let repeated = |i: usize| {
        let twin = |m: &Correspondence| {
            same(m.bearing1(), matches[i].bearing1()) && same(m.bearing2(), matches[i].bearing2())
        };
        matches[..i].iter().any(twin)
    };
    let distinct = (0..matches.len()).filter(|&i| !repeated(i)).count();
    if distinct < needed {
        return Degeneracy::Duplicate;
    }
    let leave_out = |skip: usize| matches.iter().enumerate().filter(move |(i, _)| *i != skip).map(|(_, m)| m);
    if (0..=matches.len()).any(|skip| on_a_line(leave_out(skip))) {
        return Degeneracy::Collinear;
    }
    Degeneracy::RankDeficient
}

/// Whether the points lie on a line in both images, to rounding.
fn on_a_line<'a>(matches: impl Iterator<Item = &'a Correspondence>) -> bool {
    // Squares of distances: rounding of the moments, far above SAME².
    nearest_lines(matches).iter().all(|line| line.square_distance < 1e-14)
}

/// A line is long beside the distances of its points.
const LONG: f64 = 10.0;

/// Whether all points, or all but one, lie on a line in both images up to these mean distances, in radians. Only noise then
/// distinguishes them from points that lie on a line exactly.
pub(crate) fn nearly_on_a_line(matches: &[Correspondence], distances: [f64; 2]) -> bool {
    let lines = nearest_lines(matches.iter());
    let off = |m: &Correspondence| {
        let [one, two] = &lines;
        (one.normal.dot(m.bearing1()) / distances[0])
            .abs()
            .max((two.normal.dot(m.bearing2()) / distances[1]).abs())
    };
    let Some(farthest) = (0..matches.len()).max_by(|&i, &j| off(&matches[i]).total_cmp(&off(&matches[j])))
    else {
        return true;
    };
    let others = matches.iter().enumerate().filter(|(i, _)| *i != farthest).map(|(_, m)| m);
    nearest_lines(others).iter().zip(distances).all(|(line, d)| line.square_distance < d * d)
}

/// Whether the points spread far along their lines, by at least [`LONG`] times these distances: of points that are all within a
/// distance as wide as the image nothing is known.
pub(crate) fn are_spread_along(matches: &[Correspondence], distances: [f64; 2]) -> bool {
    let is_long = |(line, d): (&Line, f64)| line.square_spread > (LONG * d).powi(2);
    nearest_lines(matches.iter()).iter().zip(distances).all(is_long)
}

/// The line nearest to the points of an image: the plane through the camera nearest to their bearings.
#[derive(Clone, Copy, Debug)]
struct Line {
    normal: Vector3<f64>,
    /// The mean over the points, in squared radians.
    square_distance: f64,
    /// Their variance along the line.
    square_spread: f64,
}

fn nearest_lines<'a>(matches: impl Iterator<Item = &'a Correspondence>) -> [Line; 2] {
    let mut moments = [Matrix3::zeros(); 2];
    let mut count = 0.0;
    for m in matches {
        moments[0] += m.bearing1() * m.bearing1().transpose();
        moments[1] += m.bearing2() * m.bearing2().transpose();
        count += 1.0;
    }
    moments.map(|moments| {
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(moments);
        let (smallest, value) = eigenvalues.argmin();
        let square_spread = (eigenvalues.sum() - value - eigenvalues.max()) / count;
        Line { normal: eigenvectors.column(smallest).into(), square_distance: value / count, square_spread }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_does_not_make_a_line_an_area() {
        let on_line = |i: u32, off: f64| {
            let (s, off) = (0.1 * f64::from(i), if i.is_multiple_of(2) { off } else { -off });
            Correspondence::from_image_points([s, 0.3 * s + off], [0.9 * s * s, 0.2 - off]).unwrap()
        };
        let with = |off: f64| -> Vec<_> { (0..8).map(|i| on_line(i, off)).collect() };
        assert!(nearly_on_a_line(&with(1e-4), [1e-3; 2]) && !nearly_on_a_line(&with(1e-2), [1e-3; 2]));
        // One point beside the line changes nothing, two do; a line in one view alone is no line.
        let mut some = with(1e-4);
        some[3] = Correspondence::from_image_points([0.3, 0.5], [0.4, -0.3]).unwrap();
        assert!(nearly_on_a_line(&some, [1e-3; 2]));
        some[5] = Correspondence::from_image_points([0.1, -0.4], [0.2, 0.6]).unwrap();
        assert!(!nearly_on_a_line(&some, [1e-3; 2]));
        assert!(!nearly_on_a_line(&with(1e-4), [1e-3, 1e-6]));
        // They are spread by about 0.2.
        assert!(are_spread_along(&with(1e-4), [0.01; 2]) && !are_spread_along(&with(1e-4), [0.03; 2]));
    }

    #[test]
    fn the_reason_is_the_one_that_was_planted() {
        let general = [
            [[0.1, 0.2], [0.3, 0.1]],
            [[-0.2, 0.3], [-0.1, 0.4]],
            [[0.4, -0.1], [0.5, -0.3]],
            [[-0.3, -0.4], [-0.2, -0.5]],
            [[0.0, 0.5], [0.2, 0.6]],
            [[0.5, 0.4], [0.6, 0.2]],
        ];
        let reason = |points: &[[[f64; 2]; 2]]| {
            let of = |[x1, x2]: &[[f64; 2]; 2]| Correspondence::from_image_points(*x1, *x2).unwrap();
            diagnose(&points.iter().map(of).collect::<Vec<_>>())
        };
        assert_eq!(reason(&general), Degeneracy::RankDeficient);
        // One place in either view.
        for view in [0, 1] {
            let mut points = general;
            for point in &mut points {
                point[view] = [0.1, -0.2];
            }
            assert_eq!(reason(&points), Degeneracy::Coincident);
        }
        // Four matches and one of them again and again: fewer than five differ.
        let mut points = general;
        (points[4], points[5]) = (points[0], points[0]);
        assert_eq!(reason(&points), Degeneracy::Duplicate);
        // A point of view 1 with another one in view 2 is another match.
        points[4][1] = [0.2, 0.6];
        assert_eq!(reason(&points), Degeneracy::RankDeficient);
        let line: Vec<_> = (0..6).map(|k| 0.1 * f64::from(k)).map(|s| [[s, 0.3 * s], [s * s, 0.2]]).collect();
        assert_eq!(reason(&line), Degeneracy::Collinear);
    }
}
