//! `solve --third`: of the candidates of two views the one whose depths agree with a third view, section 10.1.

use std::{collections::HashMap, path::Path};

use quest_core::{
    Candidates, Correspondence, InputError, RelativePose,
    disambiguation::{USUAL_NOISE, choose},
};
use quest_io::{Pair, ThirdViewRecord};

use super::Arguments;
use crate::{Failure, table, words as messages};

/// Points that the two pairs of views have to share: fewer agree with many poses.
const FEWEST: usize = 5;

/// The noise that is assumed where there are cameras, in pixels.
const NOISE_PX: f64 = 1.0;

/// Puts the candidate first that the third view chooses among the feasible ones; `None` where it decides nothing.
pub(super) fn decide(
    arguments: &Arguments,
    file: &Path,
    (pair, matches): (&Pair, &[Correspondence]),
    found: &mut Candidates,
) -> Result<Option<ThirdViewRecord>, Failure> {
    let Some(other) = arguments.input.open_other(file, arguments.output.quiet)?.next()? else {
        return Err(Failure::Arguments(format!("{}: found no pair, expected one", file.display())));
    };
    let other_matches = arguments.matches(&other)?;
    let others = arguments.candidates(&other_matches);
    if let (true, Some(degeneracy)) = (others.is_empty(), others.degeneracy()) {
        return Err(other.refuse(InputError::Degenerate(degeneracy)).into());
    }
    let (common_21, common_31) = common(matches, &other_matches);
    if common_21.len() < FEWEST {
        return Err(Failure::Arguments(format!(
            "{}: {} of its points of view 1 are points of view 1 of {}, expected at least {FEWEST} with the same u1, v1",
            other.place,
            common_21.len(),
            pair.place
        )));
    }
    let feasible = |found: &Candidates, matches: &[Correspondence]| -> Vec<usize> {
        let is_feasible = |i: &usize| arguments.feasibility.accepts(&found[*i], matches);
        (0..found.len()).filter(is_feasible).collect()
    };
    let (first, second) = (feasible(found, matches), feasible(&others, &other_matches));
    let poses = |found: &Candidates, indices: &[usize]| -> Vec<RelativePose> {
        indices.iter().map(|&i| found[i].pose).collect()
    };
    let (poses_21, poses_31) = (poses(found, &first), poses(&others, &second));
    let noise = pair.focal_length().map_or(USUAL_NOISE, |f| NOISE_PX / f);
    // The lists of common matches are as long.
    let choice = choose(&common_21, &poses_21, &common_31, &poses_31, noise);
    let Ok(Some(choice)) = choice else {
        messages::say("note", &format!("{}: the third view decides nothing", other.place));
        return Ok(None);
    };
    found.as_mut_slice()[..=first[choice.pose_21]].rotate_right(1);
    Ok(Some(ThirdViewRecord::chosen(&poses_31[choice.pose_31], &choice)))
}

/// What the heading says of the choice.
pub(super) fn words(record: &ThirdViewRecord) -> String {
    let short = |x: Option<f64>| x.map_or_else(|| "none".to_owned(), table::short);
    format!(
        ", the first by a third view: disagreement {}, of the next {}",
        short(record.disagreement),
        short(record.next_best)
    )
}

/// The matches of either list whose bearings in view 1 are equal, in the same order.
fn common(first: &[Correspondence], second: &[Correspondence]) -> (Vec<Correspondence>, Vec<Correspondence>) {
    let key = |m: &Correspondence| <[f64; 3]>::from(*m.bearing1()).map(f64::to_bits);
    let by_bearing: HashMap<_, _> = second.iter().map(|m| (key(m), *m)).collect();
    first.iter().filter_map(|m| Some((*m, *by_bearing.get(&key(m))?))).unzip()
}
