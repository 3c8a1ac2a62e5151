//! What many pairs came to: which of them have no pose, and whether any could be read.

use quest_io::ReadError;

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
    /// The first one that could not be read.
    unreadable: Option<ReadError>,
}

impl Tally {
    /// That of a run that goes on after some pairs, if any.
    pub(crate) fn after(pairs: usize) -> Self {
        Self { are_there: pairs > 0, ..Self::default() }
    }

    /// Tells of a pair without a pose, and counts it.
    pub(crate) fn count(&mut self, refusal: Option<Refusal>) {
        self.is_without_pose |= refusal.is_some();
        match refusal {
            Some(Refusal::Unreadable(error)) => {
                words::say("no pose", &error.to_string());
                self.unreadable.get_or_insert(error);
                return;
            }
            Some(Refusal::NoPose(reason)) => words::say("no pose", &reason),
            None => {}
        }
        self.are_there = true;
    }

    pub(crate) fn outcome(self) -> Result<Outcome, Failure> {
        match self.unreadable {
            Some(error) if !self.are_there => Err(error.into()),
            _ if self.is_without_pose => Ok(Outcome::NoPose),
            _ => Ok(Outcome::Answer),
        }
    }
}
