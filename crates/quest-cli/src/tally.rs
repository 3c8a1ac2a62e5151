//! What many pairs came to: which of them have no pose, and whether any could be read.

use quest_io::{Fault, ReadError};

use crate::{Failure, Outcome, words};

/// Why there is no pose, with the place.
pub(crate) enum Refusal {
    NoPose(String),
    Unreadable(ReadError),
}

/// What the pairs of a run came to.
#[derive(Default)]
pub(crate) struct Tally {
    /// Whether any pair could be read, or had been.
    are_there: bool,
    is_without_pose: bool,
    /// How many could not be read.
    unreadable: usize,
    /// What the call lacks for all pairs, with how many of them it was not said of.
    unsaid: Vec<(String, usize)>,
}

impl Tally {
    /// Tells of a pair without a pose, and counts it.
    pub(crate) fn count(&mut self, refusal: Option<Refusal>) {
        self.is_without_pose |= refusal.is_some();
        match refusal {
            Some(Refusal::Unreadable(error)) => {
                if self.is_new(&error.fault) {
                    words::say("no pose", &error.to_string());
                }
                self.unreadable += 1;
                return;
            }
            Some(Refusal::NoPose(reason)) => words::say("no pose", &reason),
            None => {}
        }
        self.are_there = true;
    }

    /// Whether a fault is to be said: what the call lacks for one pair it may lack for thousands.
    fn is_new(&mut self, fault: &Fault) -> bool {
        if !matches!(
            fault,
            Fault::NoThreshold | Fault::Pixels | Fault::PointsOfThePlane | Fault::FirstCameraMissing
        ) {
            return true;
        }
        let text = fault.to_string();
        if let Some((_, count)) = self.unsaid.iter_mut().find(|(said, _)| *said == text) {
            *count += 1;
            return false;
        }
        self.unsaid.push((text, 0));
        true
    }

    pub(crate) fn outcome(self) -> Result<Outcome, Failure> {
        if self.unreadable > 0 && !self.are_there {
            // Why was said of each.
            let same = match self.unsaid[..] {
                [(_, others)] if others > 0 && others + 1 == self.unreadable => ", all for the reason above",
                _ => "",
            };
            let count = self.unreadable;
            let found = match count {
                1 => "the only pair cannot be read".to_owned(),
                _ => format!("none of the {count} pairs can be read{same}"),
            };
            return Err(Failure::Arguments(found));
        }
        for (fault, count) in self.unsaid.iter().filter(|(_, count)| *count > 0) {
            words::say("no pose", &format!("{count} more for the same reason: {fault}"));
        }
        Ok(if self.is_without_pose { Outcome::NoPose } else { Outcome::Answer })
    }
}
