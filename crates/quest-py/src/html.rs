//! What notebooks show.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::estimate_result::Estimate;

/// An estimate as a table.
pub(crate) fn estimate(found: &Estimate) -> String {
    let [w, x, y, z] = found.pose().wxyz();
    let t = found.pose().relative().t_21;
    let deviation = |first: usize| {
        (first..first + 3).map(|k| found.covariance_matrix()[(k, k)]).sum::<f64>().max(0.0).sqrt()
    };
    let [rotation, planar, general] = found.evidence_px();
    let mut rows = vec![
        ("model", escape(&found.model)),
        ("quat_wxyz", format!("{w:.6}, {x:.6}, {y:.6}, {z:.6}")),
        ("t", format!("{:.6}, {:.6}, {:.6}", t.x, t.y, t.z)),
        ("standard deviation", format!("R {}°, t {}", short(deviation(0).to_degrees()), short(deviation(3)))),
        ("inliers", format!("{} of {}", found.inlier_count(), found.inlier_flags().len())),
        ("score", format!("{:.3}", found.score)),
        ("noise", format!("{} px", short(found.noise_px))),
        (
            "median residual",
            format!("{} general, {} plane, {} rotation", short(general), short(planar), short(rotation)),
        ),
    ];
    if found.invalid_count > 0 {
        rows.push(("without a bearing", found.invalid_count.to_string()));
    }
    if found.other().is_some() {
        rows.push(("runner-up", "yes".to_owned()));
    }
    table("Estimate", rows.iter().map(|(name, value)| (*name, value.as_str())))
}

/// A batch as counts of models and of reasons.
pub(crate) fn batch(models: &[Option<&str>], reasons: &[Option<String>]) -> String {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for (model, reason) in models.iter().zip(reasons) {
        let name = model.map_or_else(
            || format!("no pose: {}", escape(&kind(reason.as_deref().unwrap_or("unknown")))),
            str::to_owned,
        );
        *counts.entry(name).or_default() += 1;
    }
    let rows: Vec<_> = counts.into_iter().map(|(name, count)| (name, count.to_string())).collect();
    table(
        &format!("EstimateBatch: {} pairs", models.len()),
        rows.iter().map(|(n, c)| (n.as_str(), c.as_str())),
    )
}

/// A reason without its numbers, which differ from pair to pair.
fn kind(reason: &str) -> String {
    let mut text = String::new();
    for c in reason.chars() {
        match (c.is_ascii_digit(), text.ends_with('#')) {
            (true, true) => {}
            (true, false) => text.push('#'),
            _ => text.push(c),
        }
    }
    text
}

fn table<'a>(title: &str, rows: impl Iterator<Item = (&'a str, &'a str)>) -> String {
    let mut text = format!("<table><caption>{title}</caption>");
    for (name, value) in rows {
        // Writing to a string cannot fail.
        let _ = write!(text, "<tr><th style=\"text-align:left\">{name}</th><td>{value}</td></tr>");
    }
    text + "</table>"
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Three digits.
fn short(x: f64) -> String {
    if x == 0.0 || (1e-3..1e4).contains(&x.abs()) { format!("{x:.3}") } else { format!("{x:.2e}") }
}
