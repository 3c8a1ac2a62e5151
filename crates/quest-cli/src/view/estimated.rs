//! `quest-cli view --estimate`: one pose from matches with outliers, as a page.

use quest_core::robust::{self, Estimate, EstimateError, Options, Priors};
use quest_core::{Correspondence, RelativePose};
use quest_io::Pair;
use quest_plot::{Axis, Colour, Figure, Page, Panel, Part, Series, Space, colour};

use super::scene;
use crate::{Failure, table, words};

const INLIER: Colour = Colour(0x0a, 0x8f, 0x7c);
const OUTLIER: Colour = Colour(0xd6, 0x1f, 0x3a);

/// What counts as zero on the logarithmic axis of residuals, in radians.
const ROUNDING: f64 = 1e-17;

/// The page; `None` where no pose explains the matches, of which is told.
///
/// # Errors
/// Matches or options that are unusable.
pub(super) fn html(pair: &Pair, options: &Options) -> Result<Option<String>, Failure> {
    let matches = pair.correspondences()?;
    let priors = Priors { scores: pair.scores.as_deref(), ..Priors::default() };
    let found = match robust::estimate_with(&matches, options, &priors) {
        Ok(found) => found,
        Err(error @ EstimateError::Option { .. }) => return Err(Failure::Arguments(error.to_string())),
        Err(EstimateError::Input(error)) => return Err(pair.refuse(error).into()),
        Err(error) => {
            words::say("no pose", &format!("{}: {error}", pair.place));
            return Ok(None);
        }
    };
    let title = pair.name.clone().unwrap_or_else(|| pair.place.to_string());
    let introduction = format!(
        "{} of {} matches agree with one pose, X2 = R X1 + t. The mean absolute depth over both views is 1, so |t| is the parallax.",
        found.inlier_count,
        matches.len()
    );
    let page = Page::new(words::one_line(&title))
        .introduction(introduction)
        .figure(images(pair, &found))
        .space(space(pair, &matches, &found))
        .figure(residuals(pair, &matches, &found, options.threshold))
        .table("Estimate", numbers(pair, &found));
    Ok(Some(page.to_html()?))
}

/// Each point of both images, with a line to where it is in the other one.
fn images(pair: &Pair, found: &Estimate) -> Figure {
    let panel = |view: usize| {
        let at = |row: &[f64; 4], k: usize| [row[2 * k], -row[2 * k + 1]]; // Upwards: v runs down.
        let size = pair.cameras.and_then(|cameras| cameras[view].size());
        let axes = match size {
            Some((w, h)) => (
                Axis::linear("u, px").range(0.0, f64::from(w)),
                Axis::linear("−v, px").range(-f64::from(h), 0.0),
            ),
            None => (Axis::linear("u"), Axis::linear("−v")),
        };
        let mut panel = Panel::new(format!("Image {}", view + 1), axes.0, axes.1);
        for (wanted, name, colour) in [(true, "inliers", INLIER), (false, "outliers", OUTLIER)] {
            let chosen = || pair.matches.iter().zip(&found.inliers).filter(move |(_, i)| **i == wanted);
            let lines =
                chosen().flat_map(|(row, _)| [at(row, view), at(row, 1 - view), [f64::NAN; 2]]).collect();
            let points = chosen().map(|(row, _)| at(row, view)).collect();
            panel = panel
                .with(Series::line(name, lines).coloured(colour).labelled(""))
                .with(Series::points(name, points).coloured(colour).labelled(""));
        }
        panel.equal_scales()
    };
    Figure::new("Matches over both images")
        .caption("Each line leads from where a point is in one image to where it is in the other.")
        .row([panel(0), panel(1)])
}

/// Both cameras, the inliers in space, and the second pose where there is one.
fn space(pair: &Pair, matches: &[Correspondence], found: &Estimate) -> Space {
    let mut points = Part::new("inliers", INLIER);
    for (index, m) in matches.iter().enumerate().filter(|(index, _)| found.inliers[*index]) {
        let depths = found.pose.depths(m);
        let ends = scene::ends(&found.pose, m);
        if let (Some((z1, z2)), Some([x, _])) = (depths, ends)
            && x.norm() <= scene::FARTHEST
        {
            points.points.push((x.into(), format!("match {index}<br>depths {z1:.3}, {z2:.3}")));
        }
    }
    let camera = |name: &str, colour: Colour, pose: &RelativePose, view: usize, is_shown: bool| {
        scene::camera(name, colour, pose, scene::corners(pair, view), is_shown)
    };
    let first = camera(scene::CAMERA_1, colour::INK, &RelativePose::identity(), 0, true);
    let second = camera("camera 2", colour::nth(0), &found.pose, 1, true);
    let mut space = Space::of_camera("Cameras and points").with(first).with(second).with(points);
    space.axes = ["x1, mean depths", "y1", "z1"].map(str::to_owned);
    space
        .caption
        .push_str("In the frame of camera 1, x to the right, y down, z forward; the unit is the mean depth.");
    match &found.runner_up {
        Some(other) => space.with(camera("second pose", colour::nth(1), &other.pose, 1, false)),
        None => space,
    }
}

fn residuals(pair: &Pair, matches: &[Correspondence], found: &Estimate, threshold: f64) -> Figure {
    // In pixels where there are cameras, else on the plane z = 1.
    let (focal_length, unit) = pair.focal_length().map_or((1.0, "z = 1"), |f| (f, "px"));
    let mut panel =
        Panel::new("", Axis::linear("match, counted from 0"), Axis::log(format!("Sampson error, {unit}")));
    for (wanted, name, colour) in [(true, "inliers", INLIER), (false, "outliers", OUTLIER)] {
        let points = matches.iter().enumerate().filter(|(k, _)| found.inliers[*k] == wanted);
        let points = points
            .map(|(k, m)| [k as f64, focal_length * found.pose.sampson_error(m).max(ROUNDING)])
            .collect();
        panel = panel.with(Series::points(name, points).coloured(colour).labelled(""));
    }
    Figure::new("Residuals")
        .caption(format!(
            "Inliers have less than the threshold, {} {unit}, and lie in front of both cameras. Their standard deviation is {} {unit}.",
            table::short(threshold),
            table::short(found.noise_px)
        ))
        .row([panel])
}

fn numbers(pair: &Pair, found: &Estimate) -> Vec<Vec<String>> {
    let deviation =
        |first: usize| (first..first + 3).map(|k| found.covariance[(k, k)]).sum::<f64>().max(0.0).sqrt();
    let t = found.pose.t_21;
    let (angle, _) = table::angle_axis(found.pose.wxyz());
    let vector = |t: nalgebra::Vector3<f64>| table::vector(t.into(), table::decimals(t.norm())).join(" ");
    let mut rows = vec![
        ("model", found.model.name().to_owned()),
        ("inliers", format!("{} of {}", found.inlier_count, found.inliers.len())),
        ("rotation", format!("{angle:.3}° ± {}°", table::short(deviation(0).to_degrees()))),
        ("t", vector(t)),
        ("|t|", format!("{} ± {}", table::short(t.norm()), table::short(deviation(3)))),
        ("score", format!("{:.3}", found.score)),
        ("samples", found.iterations.to_string()),
    ];
    if let Some(other) = &found.runner_up {
        rows.push(("second pose", format!("{} inliers, t {}", other.inlier_count, vector(other.pose.t_21))));
    }
    let errors = [
        ("rotation's error, °", pair.truth.rotation_error_deg(&found.pose)),
        ("translation's error, °", pair.truth.translation_error_deg(&found.pose)),
    ];
    rows.extend(errors.into_iter().filter_map(|(name, error)| Some((name, table::short(error?)))));
    let header = ["what", "value"].map(str::to_owned).to_vec();
    [header].into_iter().chain(rows.into_iter().map(|(name, value)| vec![name.to_owned(), value])).collect()
}
