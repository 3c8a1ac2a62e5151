//! The options of `estimate`, parsed once for every subcommand that searches for poses.

use std::fmt::Debug;
use std::marker::PhantomData;

use clap::Args;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use quest_core::RelativePose;
use quest_core::lanes::SearchScore;
use quest_core::robust::{KnownDirection, Options};
use quest_core::solver::SolverName;

use crate::Failure;
use crate::options::{loss_parser, solver_parser};

/// What a subcommand takes where an option is not given.
pub(crate) trait Defaults: Clone + Debug + Send + Sync + 'static {
    /// What the help says of the threshold.
    const THRESHOLD: &'static str;

    /// The defaults.
    fn options() -> Options;
}

/// Those of `robust::Options`.
#[derive(Clone, Debug)]
pub(crate) struct OfEstimate;

impl Defaults for OfEstimate {
    const THRESHOLD: &'static str = "Matches with a Sampson error below this are inliers: two to three standard deviations \
        of the noise, in pixels. Without cameras it is in units of the plane z = 1 and must be given [default: 1 with cameras]";

    fn options() -> Options {
        Options::default()
    }
}

/// The options of a search. Their defaults are strings: `default_value_t` keeps the first one that is asked for, whatever `D` is.
#[derive(Args, Clone, Debug)]
pub(crate) struct EstimateOptions<D: Defaults> {
    #[arg(long, value_name = "PX", allow_negative_numbers = true, help = D::THRESHOLD)]
    pub(crate) threshold: Option<f64>,
    /// How sure to be that a sample without outliers was seen.
    #[arg(long, value_name = "P", allow_negative_numbers = true, default_value = D::options().confidence.to_string())]
    confidence: f64,
    /// Draw at least this many samples.
    #[arg(long, value_name = "N", default_value = D::options().min_iterations.to_string())]
    min_iterations: usize,
    /// Draw at most this many samples.
    #[arg(long, value_name = "N", default_value = D::options().max_iterations.to_string())]
    max_iterations: usize,
    /// Answer if at most this many poses as good as the best one are expected where all matches are false; `inf` answers always.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value = D::options().max_false_alarms.to_string())]
    max_false_alarms: f64,
    /// The seed of the samples.
    #[arg(long, value_name = "S", default_value = D::options().seed.to_string())]
    seed: u64,
    /// The solver of the samples; `quest-cli solvers` describes them.
    #[arg(long, value_name = "NAME", default_value = D::options().solver.info().name, value_parser = solver_parser())]
    solver: SolverName,
    /// How the search scores a residual: averaged over all thresholds up to one, or with one threshold (MSAC).
    #[arg(long, value_name = "LOSS", default_value = D::options().loss.name(), value_parser = loss_parser())]
    loss: SearchScore,
    #[arg(skip)]
    defaults: PhantomData<D>,
}

impl<D: Defaults> EstimateOptions<D> {
    /// What contradicts itself.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        let (least, most) = (self.min_iterations, self.max_iterations);
        if least > most {
            let found = format!(
                "found --min-iterations {least} and --max-iterations {most}, expected no fewer at most"
            );
            return Err(Failure::Arguments(found));
        }
        Ok(())
    }

    /// The options with this threshold, for bearings and for the pair of this number.
    pub(crate) fn options(&self, threshold: f64, index: u64) -> Options {
        // Without `..Options::default()`: an option that is new does not compile until it is read here.
        Options {
            threshold,
            focal_lengths: Options::default().focal_lengths,
            loss: self.loss,
            confidence: self.confidence,
            min_iterations: self.min_iterations,
            max_iterations: self.max_iterations,
            max_false_alarms: self.max_false_alarms,
            seed: self.seed,
            index,
            solver: self.solver,
        }
    }
}

/// `W,X,Y,Z,TX,TY,TZ` as a pose.
pub(crate) fn parse_pose(text: &str) -> Result<RelativePose, String> {
    const EXPECTED: &str = "expected W,X,Y,Z,TX,TY,TZ: a quaternion, scalar first, and a translation";
    let [w, x, y, z, tx, ty, tz] = numbers(text, EXPECTED)?[..] else {
        return Err(format!("found {} numbers, {EXPECTED}", text.split(',').count()));
    };
    let q_21 = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6)
        .ok_or_else(|| format!("found a quaternion of length 0, {EXPECTED}"))?;
    Ok(RelativePose::new(q_21, Vector3::new(tx, ty, tz)))
}

/// `X,Y,Z,DEG` or `X1,Y1,Z1,X2,Y2,Z2,DEG` as a direction.
pub(crate) fn parse_direction(text: &str) -> Result<KnownDirection, String> {
    const EXPECTED: &str = "expected X,Y,Z,DEG for a direction that is the same in both views, or \
        X1,Y1,Z1,X2,Y2,Z2,DEG, and how far a pose may turn one from the other in degrees";
    let (first, second, degrees) = match numbers(text, EXPECTED)?[..] {
        [x, y, z, degrees] => ([x, y, z], [x, y, z], degrees),
        [x1, y1, z1, x2, y2, z2, degrees] => ([x1, y1, z1], [x2, y2, z2], degrees),
        ref other => return Err(format!("found {} numbers, {EXPECTED}", other.len())),
    };
    Ok(KnownDirection { in_view1: first.into(), in_view2: second.into(), tolerance: degrees.to_radians() })
}

fn numbers(text: &str, expected: &str) -> Result<Vec<f64>, String> {
    let number = |field: &str| {
        let value = field.trim().parse::<f64>().ok().filter(|value| value.is_finite());
        value.ok_or_else(|| format!("found {field:?}, {expected}"))
    };
    text.split(',').map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_and_directions_are_read_and_what_is_none_is_refused() {
        let pose = parse_pose("2,0,0,0, 1,2,3").unwrap();
        assert!(pose.q_21.angle() < 1e-12 && (pose.t_21 - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-12);
        for wrong in ["0,0,0,0,1,2,3", "1,0,0,0,1,2", "1,0,0,0,1,2,x", "1,0,0,0,1,2,inf", ""] {
            assert!(parse_pose(wrong).unwrap_err().contains("W,X,Y,Z,TX,TY,TZ"), "{wrong}");
        }
        let direction = parse_direction("0,1,0,2").unwrap();
        assert!((direction.tolerance.to_degrees() - 2.0).abs() < 1e-12);
        assert!((direction.in_view1 - direction.in_view2).norm() < 1e-12);
        let direction = parse_direction("0,1,0,0,0,1,2").unwrap();
        assert!((direction.in_view2 - Vector3::z()).norm() < 1e-12);
        for wrong in ["0,1,0", "0,1,0,nan", "a"] {
            assert!(parse_direction(wrong).unwrap_err().contains("X,Y,Z,DEG"), "{wrong}");
        }
    }
}
