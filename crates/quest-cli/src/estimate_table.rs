//! An estimate as a table.

use comfy_table::{Cell, ColumnConstraint, Table};
use quest_io::{EstimateRecord, FoundRecord, PoseRecord, ThirdViewRecord};

use crate::table::{self, angle_axis, decimals, right, short, vector};

/// The pose and the runner-up, a line each, and what is known of them.
pub(crate) fn text(record: &EstimateRecord, unit: &str) -> Option<String> {
    let found = record.found.as_ref()?;
    let mut table = table::empty([
        "pose",
        "rotation\ndeg",
        "about",
        "t",
        "|t|",
        "inliers",
        "score",
        "R error\ndeg",
        "t error\ndeg",
    ]);
    let errors = [record.rotation_error_deg, record.translation_error_deg];
    row(&mut table, record.model.unwrap_or("best"), &found.pose, found.inlier_count, found.score, errors);
    if let Some(other) = &found.runner_up {
        let errors = [other.rotation_error_deg, other.translation_error_deg];
        row(&mut table, "runner-up", &other.pose, other.inlier_count, other.score, errors);
    }
    for (index, error) in [(7, errors[0]), (8, errors[1])] {
        if let Some(column) = table.column_mut(index).filter(|_| error.is_none()) {
            column.set_constraint(ColumnConstraint::Hidden);
        }
    }
    let deviation =
        |first: usize| (first..first + 3).map(|k| found.covariance[k][k]).sum::<f64>().max(0.0).sqrt();
    let size = |value: Option<f64>| value.map_or_else(|| "none".to_owned(), short);
    let evidence = &found.evidence;
    let third = record.third_view.as_ref().map_or_else(String::new, third_view);
    Some(format!(
        "{}\n\nstandard deviation  R {} deg, t {}\nmedian residual     {} {unit} general, {} {unit} plane, {} {unit} rotation \
         alone\nnoise               {} {unit}{third}{}",
        table.trim_fmt(),
        short(deviation(0).to_degrees()),
        short(deviation(3)),
        size(evidence.general_px),
        size(evidence.planar_px),
        size(evidence.rotation_px),
        short(found.noise_px),
        unusual(found),
    ))
}

/// A threshold that accepts more of the false matches than this is said.
const UNUSUAL: f64 = 0.3;

/// What a user should know of the matches and the threshold.
fn unusual(found: &FoundRecord) -> String {
    let unmoved = match found.unmoved {
        0 => String::new(),
        count => format!("\nset aside           {count} matches that did not move at all"),
    };
    if found.false_share < UNUSUAL {
        return unmoved;
    }
    let percent = 100.0 * found.false_share;
    format!(
        "{unmoved}\nthreshold           accepts {percent:.0} % of false matches: is it in the unit of the points?"
    )
}

/// What the third view decided.
fn third_view(third: &ThirdViewRecord) -> String {
    let Some(disagreement) = third.disagreement else {
        return "\nthird view          decides nothing: too few points are common".to_owned();
    };
    let other =
        third.next_best.map_or_else(String::new, |other| format!(", {} with the other pose", short(other)));
    format!("\nthird view          depths disagree by {} of the noise{other}", short(disagreement))
}

fn row(
    table: &mut Table,
    name: &str,
    pose: &PoseRecord,
    inliers: usize,
    score: f64,
    errors: [Option<f64>; 2],
) {
    let (angle, axis) = angle_axis(pose.q_21);
    let [rotation_error, translation_error] = errors.map(|e| right(e.map(short).unwrap_or_default()));
    table.add_row([
        Cell::new(name),
        right(format!("{angle:.3}")),
        right(axis.map_or_else(|| "-".to_owned(), |axis| vector(axis, 3).join(" "))),
        right(vector(pose.t_21, decimals(pose.parallax)).join(" ")),
        right(short(pose.parallax)),
        right(inliers),
        right(format!("{score:.3}")),
        rotation_error,
        translation_error,
    ]);
}
