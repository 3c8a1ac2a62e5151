//! `quest-cli view --estimate`: one pose from matches with outliers, as a page or as PLY.

use nalgebra::{Matrix3, Vector3};
use quest_core::robust::{self, Estimate, EstimateError, Options, Priors};
use quest_core::{Correspondence, RelativePose};
use quest_io::Pair;
use quest_plot::{Axis, Colour, Figure, Page, Panel, Part, Series, Space, Style, colour};

use super::scene;
use crate::{Failure, table, words};

const INLIER: Colour = Colour(0x0a, 0x8f, 0x7c);
const OUTLIER: Colour = Colour(0xd6, 0x1f, 0x3a);

/// What counts as zero on the logarithmic axis of residuals, in radians.
const ROUNDING: f64 = 1e-17;

/// The page, or PLY; `None` where no pose explains the matches, of which is told.
///
/// # Errors
/// Matches or options that are unusable.
pub(super) fn text(pair: &Pair, options: &Options, is_ply: bool) -> Result<Option<String>, Failure> {
    let matches = pair.correspondences()?;
    let priors = Priors { scores: pair.scores.as_deref(), ..Priors::default() };
    let found = match robust::estimate_with(&matches, options, &priors) {
        Ok(found) => found,
        Err(error @ EstimateError::Option { .. }) => return Err(Failure::Arguments(error.to_string())),
        Err(EstimateError::Input(error)) => return Err(pair.refuse(error).into()),
        Err(error) => {
            let reason = error.to_string();
            words::say("no pose", &format!("{}: {}", pair.place, words::after_no_pose(&reason)));
            return Ok(None);
        }
    };
    if is_ply {
        return Ok(Some(space(pair, &matches, &found).to_ply()));
    }
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
        .figure(histogram(pair, &matches, &found, options.threshold))
        .table("Estimate", numbers(pair, &found));
    Ok(Some(page.to_html()?))
}

/// Each point of both images, with a line to where it is in the other one.
fn images(pair: &Pair, found: &Estimate) -> Figure {
    let panel = |view: usize| {
        let at = |row: &[f64; 4], k: usize| [row[2 * k], row[2 * k + 1]];
        let size = pair.cameras.and_then(|cameras| cameras[view].size());
        let axes = match size {
            Some((w, h)) => (
                Axis::linear("u, px").range(0.0, f64::from(w)),
                Axis::linear("v, px").range(f64::from(h), 0.0),
            ),
            None => (Axis::linear("u"), Axis::linear("v").backwards()),
        };
        let mut panel = Panel::new(format!("Image {}", view + 1), axes.0, axes.1);
        for (wanted, name, colour) in [(true, "inliers", INLIER), (false, "outliers", OUTLIER)] {
            let chosen = || pair.matches.iter().zip(&found.inliers).filter(move |(_, i)| **i == wanted);
            let lines =
                chosen().flat_map(|(row, _)| [at(row, view), at(row, 1 - view), [f64::NAN; 2]]).collect();
            let points = chosen().map(|(row, _)| at(row, view)).collect();
            let curves = chosen().map(|(row, _)| epipolar_curve(pair, &found.pose, row, view)).collect();
            panel = panel
                .with(Series::line(name, lines).coloured(colour).labelled(""))
                .with(Series::points(name, points).coloured(colour).labelled("").beside(curves));
        }
        panel.equal_scales()
    };
    Figure::new("Matches over both images")
        .caption(
            "Each line leads from where a point is in one image to where it is in the other. Point at a point: the other image \
             shows where it may be seen from there, at depths from infinity to a tenth of the mean depth.",
        )
        .row([panel(0), panel(1)])
}

/// Inverse depths of an epipolar curve, in those of the mean depth: densest far away, where most points are.
const STEPS: usize = 40;
const NEAREST: f64 = 10.0;

/// Where a point of one image may be seen in the other one, as far as that is inside of it.
fn epipolar_curve(pair: &Pair, pose: &RelativePose, row: &[f64; 4], view: usize) -> Vec<[f64; 2]> {
    let pixel = [row[2 * view], row[2 * view + 1]];
    let cameras = pair.cameras;
    let ray = match &cameras {
        Some(cameras) => cameras[view].bearing(pixel).ok(),
        None => Some(Vector3::new(pixel[0], pixel[1], 1.0)),
    };
    let Some(ray) = ray else { return Vec::new() };
    let pose = if view == 0 { *pose } else { pose.inverse() };
    let size = cameras.and_then(|cameras| cameras[1 - view].size());
    let is_inside = |[u, v]: [f64; 2]| {
        size.is_none_or(|(w, h)| u >= 0.0 && v >= 0.0 && u <= f64::from(w) && v <= f64::from(h))
    };
    let seen = |k: usize| {
        let share = k as f64 / STEPS as f64;
        let x = pose.q_21 * ray + pose.t_21 * (NEAREST * share * share);
        match &cameras {
            Some(cameras) => cameras[1 - view].project(&x).ok(),
            None => (x.z > 0.0).then(|| [x.x / x.z, x.y / x.z]),
        }
    };
    (0..=STEPS).filter_map(seen).filter(|pixel| is_inside(*pixel)).collect()
}

/// Both cameras, the inliers in space, and the second pose where there is one.
fn space(pair: &Pair, matches: &[Correspondence], found: &Estimate) -> Space {
    let mut points = Part::new("inliers", INLIER);
    for (index, m) in matches.iter().enumerate().filter(|(index, _)| found.inliers[*index]) {
        let depths = found.pose.depths(m);
        let ends = scene::ends(&found.pose, m);
        if let (Some((z1, z2)), Some([x, _])) = (depths, ends)
            && z1.min(z2) > 0.0
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
    space = space.with(ellipses(found));
    space.axes = ["x1, mean depths", "y1", "z1"].map(str::to_owned);
    space
        .caption
        .push_str("In the frame of camera 1, x to the right, y down, z forward; the unit is the mean depth. The ellipses are of the region where the centre of camera 2 is with 95 % for the rotation found.");
    match &found.runner_up {
        Some(other) => space.with(camera("second pose", colour::nth(1), &other.pose, 1, false)),
        None => space,
    }
}

/// The 95 % quantile of χ² with three degrees of freedom.
const CHI_SQUARE_3: f64 = 7.814_7;

/// The region in which the centre of camera 2 is: the ellipses in the planes of its axes.
fn ellipses(found: &Estimate) -> Part {
    let block: Matrix3<f64> = found.covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let axes = block.symmetric_eigen();
    let back = found.pose.q_21.inverse();
    let half =
        |k: usize| back * axes.eigenvectors.column(k) * (CHI_SQUARE_3 * axes.eigenvalues[k].max(0.0)).sqrt();
    let centre = found.pose.inverse().t_21;
    let ellipse = |(i, j): (usize, usize)| -> Vec<[f64; 3]> {
        let at = |k: u32| {
            let angle = f64::from(k) * std::f64::consts::TAU / 48.0;
            (centre + half(i) * angle.cos() + half(j) * angle.sin()).into()
        };
        (0..=48).map(at).collect()
    };
    let lines = [(0, 1), (1, 2), (2, 0)].map(ellipse).to_vec();
    Part { lines, ..Part::new("95 % of camera 2", colour::nth(2)) }
}

/// Bins of the histogram, from minus to plus this many thresholds.
const BINS: usize = 60;
const SPAN: f64 = 3.0;

/// How many matches have a residual of each size, beside what noise of the size found would give.
fn histogram(pair: &Pair, matches: &[Correspondence], found: &Estimate, threshold: f64) -> Figure {
    let (focal_length, unit) = pair.focal_length().map_or((1.0, "z = 1"), |f| (f, "px"));
    let width = SPAN * threshold / BINS as f64;
    let mut counts = [0.0; BINS];
    for m in matches {
        let bin = focal_length * found.pose.sampson_error(m) / width;
        if bin < BINS as f64 {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a bin")]
            let bin = bin as usize;
            counts[bin] += 1.0;
        }
    }
    let outline = counts
        .iter()
        .enumerate()
        .flat_map(|(k, count)| [[k as f64 * width, *count], [(k + 1) as f64 * width, *count]]);
    let highest = counts.iter().fold(1.0_f64, |a, b| a.max(*b));
    // The errors of inliers are the absolute values of normal variables.
    let noise = found.noise_px.max(f64::MIN_POSITIVE);
    let scale = found.inlier_count as f64 * width / noise * std::f64::consts::FRAC_2_PI.sqrt();
    let normal = (0..=BINS).map(|k| {
        let x = k as f64 * width;
        [x, scale * (-0.5 * (x / noise).powi(2)).exp()]
    });
    let panel = Panel::new("", Axis::linear(format!("Sampson error, {unit}")), Axis::linear("matches"))
        .with(Series::line("matches", outline.collect()).coloured(INLIER).labelled(""))
        .with(
            Series::line("normal noise", normal.collect())
                .coloured(colour::INK)
                .styled(Style::Dashed)
                .labelled(""),
        )
        .with(
            Series::line("threshold", vec![[threshold, 0.0], [threshold, highest]])
                .coloured(OUTLIER)
                .labelled(""),
        );
    Figure::new("Residuals against the noise")
        .caption(
            "How many matches have an error of each size. The dashed curve is what the inliers would give with normal noise of the \
             standard deviation found; false matches lie beyond it. A good threshold stands where the curve has come down.",
        )
        .row([panel])
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
    let vector = |t: Vector3<f64>| table::vector(t.into(), table::decimals(t.norm())).join(" ");
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
