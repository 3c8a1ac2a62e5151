//! `quest-cli solve`: candidate poses from five or more correct matches.

mod given_rotation;
mod third_view;

use std::{
    io::{self, Write},
    path::PathBuf,
};

use clap::Args;
use nalgebra::UnitQuaternion;
use quest_core::{
    Candidates, Correspondence, Degeneracy, InputError,
    feasibility::Feasibility,
    solver::{Kinds, SolverName},
};
use quest_io::{Pair, ReadError, SolveRecord};

use crate::{
    Failure, Outcome, candidate_table,
    input::{InputsOptions, Unread},
    options::{OutputOptions, feasibility_parser, kinds_parser, solver_parser},
    rows,
    tally::{Refusal, Tally},
    words,
    writer::{Record, Writer},
};

const EXAMPLES: &str = "\
Examples:
  quest-cli solve examples/points.json
  quest-cli solve examples/points.json --all --kinds exact
  quest-cli solve examples/points.csv --format json
  quest-cli solve pixels.csv --camera1 PINHOLE,1024,768,1060,1060,514,384
  quest-cli solve pixels.csv --camera1 calibration.yml --camera2 sparse/cameras.txt:2
  quest-cli solve - < pair.json
  quest-cli solve pairs.jsonl -o results.jsonl
  quest-cli solve 'pairs/*.npz' more.csv folder -o results.jsonl
  quest-cli solve points1.npy --points2 points2.npy
  quest-cli solve views12.json --third views13.json
  quest-cli solve pair.json --rotation 0.943,-0.110,-0.223,-0.221

Files:
  JSON: one object, a pair. Only \"matches\" is needed; q_21 (w, x, y, z) and t_21 are the truth.
    {\"name\": \"a\", \"matches\": [[u1, v1, u2, v2], …], \"scores\": […], \"camera1\": {\"model\": \"PINHOLE\",
     \"width\": 1024, \"height\": 768, \"params\": [1060, 1060, 514, 384]}, \"camera2\": {…},
     \"q_21\": […], \"t_21\": […]}
  JSON Lines: one such object a line.
  CSV: one match a row, u1,v1,u2,v2[,score], in this order or under a header with these names
    or x1,y1,x2,y2; separated by commas, semicolons, tabs or blanks.
  NumPy: .npy of N x 4 or N x 5 numbers; .npz of matches (such an array), or of x1 and x2 (N x 2 each), and of
    scores if there are any.
  Points of one image a file, CSV or .npy of N x 2: FILE --points2 FILE.
  Without cameras the points are on the plane z = 1.
  Cameras: an argument MODEL,width,height,params by COLMAP's names and order, or a file. The params are fx,fy,cx,cy of
    PINHOLE, with k1,k2,p1,p2 after them of OPENCV, and with k1,k2,p1,p2,k3,k4,k5,k6 of FULL_OPENCV: five coefficients
    of OpenCV's are FULL_OPENCV with 0,0,0 at the end. A wrong number of them is an error that names them.
    OpenCV's YAML and XML have camera_matrix or K, distortion_coefficients or D, fisheye_model: 1 for a fisheye;
    ROS's camera_info has a distortion_model; of several cameras FILE:ID takes K1 and D1 by ID 1,
    left: {K: .., D: ..} by ID left, and COLMAP's by their numbers.
  Several files, folders and patterns are read one after the other; the name of a file stands for the name
  of a pair that has none.

Results:
  X2 = R X1 + t. The mean absolute depth over both views is 1, so |t| is the parallax.
  --format chooses the format. Without it the extension of -o does; without both, the
  results of several pairs are JSON Lines, and others are a table.
  With --third the candidate comes first whose depths in view 1 agree best with those of a candidate
  of views 1 and 3 (section 10.1). The files share the points whose u1, v1 are the same numbers.
  --feasibility theorem-2 lists the candidates that theorem 2 of the paper accepts: fewer, and none
  of a camera that looks back at the points.
  With --rotation nothing is solved for: the candidate is the translation and the depths that fit
  this rotation best (section 8), of two or more matches.
  Where the truth is known, JSON has the paper's metrics (61) and (62) in radians beside the errors.
  No line and no file stops the others: one that cannot be read gets a record with its reason.

Exit status:
  0 an answer, 1 no pose could be found (of several pairs: for one or more of them),
  2 bad input or arguments (of several pairs: none of them could be read).";

/// Candidate poses from five or more correct matches.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: InputsOptions,
    /// The solver; `quest-cli solvers` describes them.
    #[arg(long, value_name = "NAME", default_value = SolverName::default().info().name, value_parser = solver_parser())]
    solver: SolverName,
    /// Which candidates to compute. `exact`: real solutions only. `all`: also the real parts of complex solutions, and the
    /// rotation alone. `planar`: as `all`, with the motions of a plane if a plane explains the matches.
    #[arg(long, value_name = "KINDS", default_value = Kinds::default().name(), value_parser = kinds_parser())]
    kinds: Kinds,
    /// Which candidates are feasible. `positive-depth`: all points in front of both cameras. `theorem-2`: theorem 2 of the paper's
    /// appendix B.
    #[arg(long, value_name = "TEST", default_value = Feasibility::default().name(), value_parser = feasibility_parser())]
    feasibility: Feasibility,
    /// Also list the candidates that are not feasible.
    #[arg(long)]
    all: bool,
    /// The matches of view 1 with a third view: the candidate that agrees with them comes first.
    #[arg(long, value_name = "FILE")]
    third: Option<PathBuf>,
    /// Find only translation and depths, for this rotation as a quaternion, scalar first.
    #[arg(long, value_name = "w,x,y,z", value_parser = given_rotation::parse, allow_hyphen_values = true,
        conflicts_with_all = ["solver", "kinds", "third"])]
    rotation: Option<UnitQuaternion<f64>>,
    #[command(flatten)]
    output: OutputOptions,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut pairs = arguments.input.open(&arguments.output)?;
    let is_several = pairs.is_several();
    if arguments.third.is_some() && is_several {
        return Err(Failure::Arguments("found several pairs and --third, expected one pair".to_owned()));
    }
    let mut writer = Writer::open(&arguments.output, is_several)?;
    let mut tally = Tally::default();
    while let Some(pair) = pairs.next().transpose() {
        let solved = pair.map_err(Failure::from).and_then(|pair| one_pair(arguments, &pair, is_several));
        let solved = match solved {
            Err(Failure::Read(error)) => arguments.unreadable(pairs.alone(error)?),
            solved => solved?,
        };
        writer.write(&solved.heading, solved.record, solved.focal_length)?;
        tally.count(solved.refusal);
        if let Some(note) = solved.note.filter(|_| !arguments.output.quiet) {
            words::say("note", &note);
        }
    }
    writer.finish(is_several)?;
    tally.outcome()
}

/// The result of one pair.
struct Solved {
    heading: String,
    record: SolveRecord,
    focal_length: Option<f64>,
    /// Why there is no pose.
    refusal: Option<Refusal>,
    /// What is not listed.
    note: Option<String>,
}

fn one_pair(arguments: &Arguments, pair: &Pair, is_several: bool) -> Result<Solved, Failure> {
    let matches = arguments.matches(pair)?;
    let mut found = arguments.candidates(&matches);
    // One degenerate pair among several is no reason to stop; a file that holds nothing else is bad input.
    if let (false, true, Some(degeneracy)) = (is_several, found.is_empty(), found.degeneracy()) {
        return Err(pair.refuse(InputError::Degenerate(degeneracy)).into());
    }
    let third_view = match &arguments.third {
        Some(file) => third_view::decide(arguments, file, (pair, &matches), &mut found)?,
        None => None,
    };
    let record = SolveRecord::new(pair.name.clone(), arguments.solver_name(), &matches, &found, &pair.truth);
    let mut record = record.judged_by(arguments.feasibility, &found, &matches);
    record.third_view = third_view;
    if arguments.rotation.is_some() {
        record.candidates.iter_mut().for_each(|c| c.kind = given_rotation::KIND);
    }
    let hidden = if arguments.all { 0 } else { record.drop_unfeasible() };
    let heading = heading(pair, &record, found.degeneracy());
    let refusal = record.candidates.is_empty().then(|| arguments.refusal(pair, &found, matches.len()));
    let note = (hidden > 0 && refusal.is_none()).then(|| {
        let what = if hidden == 1 { "candidate" } else { "candidates" };
        let why = match arguments.feasibility {
            Feasibility::PositiveDepth => "with points behind a camera",
            Feasibility::Theorem2 => "that theorem 2 rejects",
        };
        format!("{}: {hidden} {what} {why} not listed, --all lists them", pair.place)
    });
    Ok(Solved { heading, record, focal_length: pair.focal_length(), refusal, note })
}

impl Arguments {
    /// The matches of a pair, as many as are needed.
    fn matches(&self, pair: &Pair) -> Result<Vec<Correspondence>, ReadError> {
        match self.rotation {
            Some(_) => at_least(pair, given_rotation::MIN_MATCHES),
            None => enough_matches(pair, self.solver),
        }
    }

    /// The record of a line or a file that is no pair, or has matches that cannot be solved.
    fn unreadable(&self, unread: Unread) -> Solved {
        let heading = unread.heading();
        let Unread { name, error } = unread;
        let record = SolveRecord::unanswered(name, self.solver_name(), error.to_string());
        Solved { heading, record, focal_length: None, refusal: Some(Refusal::Unreadable(error)), note: None }
    }

    fn solver_name(&self) -> &'static str {
        if self.rotation.is_some() { given_rotation::NAME } else { self.solver.info().name }
    }

    fn candidates(&self, matches: &[Correspondence]) -> Candidates {
        let mut found = Candidates::new();
        match self.rotation {
            Some(q_21) => found.push(given_rotation::candidate(q_21, matches)),
            None => self.solver.solve(self.kinds, matches, &mut found),
        }
        found
    }

    /// Why no candidate is listed.
    fn refusal(&self, pair: &Pair, found: &Candidates, matches: usize) -> Refusal {
        if self.feasibility == Feasibility::PositiveDepth || found.is_empty() {
            return refusal(pair, found, matches);
        }
        let count = found.len();
        let reason = format!("theorem 2 accepts none of the {count} candidates; --all lists them");
        Refusal::NoPose(format!("{}: {reason}", pair.place))
    }
}

/// The matches of a pair, at least as many as the solver needs.
pub(crate) fn enough_matches(pair: &Pair, solver: SolverName) -> Result<Vec<Correspondence>, ReadError> {
    at_least(pair, solver.info().min_matches)
}

fn at_least(pair: &Pair, needed: usize) -> Result<Vec<Correspondence>, ReadError> {
    let matches = pair.correspondences()?;
    let found = matches.len();
    if found < needed {
        return Err(pair.refuse(InputError::TooFewMatches { found, needed }));
    }
    Ok(matches)
}

/// Among more matches than that some are likely wrong.
const OUTLIERS: usize = 20;

/// Why no candidate of a solver is shown.
pub(crate) fn refusal(pair: &Pair, found: &Candidates, matches: usize) -> Refusal {
    let why = match (found.iter().map(|c| c.in_front).max(), found.degeneracy()) {
        (Some(most), _) => format!(
            "none of the {} candidates has all {matches} points in front of both cameras, the best has {most}; --all \
             lists them{}",
            found.len(),
            if matches > OUTLIERS {
                "; matches with outliers: quest-cli estimate, quest-cli view --estimate"
            } else {
                ""
            }
        ),
        (None, Some(degeneracy)) => degeneracy.to_string(),
        (None, None) => "the solver found no candidate".to_owned(),
    };
    Refusal::NoPose(format!("{}: {why}", pair.place))
}

/// The line above the table.
fn heading(pair: &Pair, record: &SolveRecord, degeneracy: Option<Degeneracy>) -> String {
    let name = record.name.clone().unwrap_or_else(|| pair.place.to_string());
    let degeneracy = degeneracy.map(|d| format!(", {d}")).unwrap_or_default();
    let third = record.third_view.as_ref().map(third_view::words).unwrap_or_default();
    words::one_line(&format!(
        "{name}: {} matches, solver {}{degeneracy}{third}",
        record.matches, record.solver
    ))
}

impl Record for SolveRecord {
    fn table(&self, focal_length: Option<f64>) -> Option<String> {
        (!self.candidates.is_empty()).then(|| candidate_table::text(self, focal_length))
    }

    fn write_csv(&self, writer: &mut dyn Write, pair: usize) -> io::Result<()> {
        rows::write_candidates(writer, pair, self)
    }
}
