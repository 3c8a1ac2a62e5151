//! A recorded run in a few lines: the states one after the other, and the last pose.

use std::io::{self, Write};

use serde::Serialize;

use super::archive::{Image, Recorded};
use crate::table::{self, right, short};

/// Successive images in one state.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Stretch {
    /// In seconds since the first image.
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) images: usize,
    pub(super) state: String,
    /// Means over the stretch.
    pub(super) seen: f64,
    pub(super) used: f64,
    /// In the words of its last image.
    pub(super) advice: String,
}

/// What happened in a run.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Summary {
    pub(super) name: String,
    pub(super) images: usize,
    pub(super) features: usize,
    pub(super) seconds: f64,
    /// The last pose: the length of t in the unit of the run, and the angle of R in degrees.
    pub(super) last_distance: Option<f64>,
    pub(super) last_angle_deg: Option<f64>,
    /// The largest change of the command from one image to the next, in m/s and rad/s.
    pub(super) largest_step: [f64; 2],
    pub(super) states: Vec<Stretch>,
}

impl Summary {
    pub(super) fn new(name: String, run: &Recorded) -> Self {
        let last = run.images.iter().rev().find_map(|i| i.pose);
        let steps = run
            .images
            .windows(2)
            .map(|w| [distance(&w[0].linear, &w[1].linear), distance(&w[0].angular, &w[1].angular)]);
        Self {
            name,
            images: run.images.len(),
            features: run.goal.len(),
            seconds: run.images.last().map_or(0.0, |i| i.time),
            last_distance: last.map(|(_, t)| norm(&t)),
            last_angle_deg: last.map(|(r, _)| angle(&r).to_degrees()),
            largest_step: steps.fold([0.0; 2], |[v, w], [dv, dw]| [f64::max(v, dv), f64::max(w, dw)]),
            states: run.images.chunk_by(|a, b| a.state == b.state).map(Stretch::new).collect(),
        }
    }

    pub(super) fn write(&self, writer: &mut dyn Write) -> io::Result<()> {
        let Self { name, images, features, seconds, .. } = self;
        writeln!(
            writer,
            "{name}: {images} images in {seconds:.1} s, {features} features in the goal image\n"
        )?;
        let mut rows = table::empty(["from, s", "to, s", "images", "seen", "used", "state"]);
        for s in &self.states {
            let numbers = [format!("{:.1}", s.from), format!("{:.1}", s.to), s.images.to_string()];
            let counts = [format!("{:.0}", s.seen), format!("{:.0}", s.used)];
            rows.add_row(numbers.into_iter().chain(counts).map(right).chain([s.state.as_str().into()]));
        }
        writeln!(writer, "{}\n", rows.trim_fmt())?;
        if let Some(advice) = self.states.last().map(|s| &s.advice).filter(|a| !a.is_empty()) {
            writeln!(writer, "at the end      {advice}")?;
        }
        if let (Some(distance), Some(angle)) = (self.last_distance, self.last_angle_deg) {
            writeln!(writer, "last pose       {} and {}° from the goal", short(distance), short(angle))?;
        }
        let [v, w] = self.largest_step.map(short);
        writeln!(writer, "largest step    {v} m/s and {w} rad/s from one image to the next")
    }
}

impl Stretch {
    fn new(images: &[Image]) -> Self {
        let mean =
            |value: &dyn Fn(&Image) -> f64| images.iter().map(value).sum::<f64>() / images.len() as f64;
        let time = |image: Option<&Image>| image.map_or(0.0, |i| i.time);
        Self {
            from: time(images.first()),
            to: time(images.last()),
            images: images.len(),
            state: images.first().map(|i| i.state.clone()).unwrap_or_default(),
            seen: mean(&|i| i.seen() as f64),
            used: mean(&|i| i.inliers.unwrap_or(0.0)),
            advice: images.last().map(|i| i.advice.clone()).unwrap_or_default(),
        }
    }
}

/// One image as a row of CSV or a line of JSON.
#[derive(Debug, Serialize)]
pub(super) struct Row<'a> {
    time: f64,
    state: &'a str,
    advice: &'a str,
    seen: usize,
    used: Option<f64>,
    vx: f64,
    vy: f64,
    vz: f64,
    wx: f64,
    wy: f64,
    wz: f64,
    tx: Option<f64>,
    ty: Option<f64>,
    tz: Option<f64>,
    angle_deg: Option<f64>,
    residual: Option<f64>,
}

impl<'a> Row<'a> {
    pub(super) fn new(image: &'a Image) -> Self {
        let [vx, vy, vz] = image.linear;
        let [wx, wy, wz] = image.angular;
        let t = |k: usize| image.pose.map(|(_, t)| t[k]);
        Self {
            time: image.time,
            state: &image.state,
            advice: &image.advice,
            seen: image.seen(),
            used: image.inliers,
            vx,
            vy,
            vz,
            wx,
            wy,
            wz,
            tx: t(0),
            ty: t(1),
            tz: t(2),
            angle_deg: image.pose.map(|(r, _)| angle(&r).to_degrees()),
            residual: image.residual,
        }
    }
}

pub(super) fn norm(v: &[f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    norm(&[a[0] - b[0], a[1] - b[1], a[2] - b[2]])
}

/// The angle of a rotation matrix, in radians: by its sine and cosine, exact where either is small.
pub(super) fn angle(r: &[f64; 9]) -> f64 {
    let sine = 0.5 * norm(&[r[7] - r[5], r[2] - r[6], r[3] - r[1]]);
    sine.atan2(0.5 * (r[0] + r[4] + r[8] - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angle_is_that_of_the_rotation() {
        for degrees in [0.0_f64, 1e-7, 30.0, 90.0, 179.999_999] {
            let (s, c) = degrees.to_radians().sin_cos();
            let found = angle(&[c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c]).to_degrees();
            // Rounding of sine and cosine: a few units in the last place of one radian.
            assert!((found - degrees).abs() < 1e-13 * 180.0, "{found} {degrees}");
        }
    }
}
