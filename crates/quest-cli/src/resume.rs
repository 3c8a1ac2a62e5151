//! A batch that goes on after the records of an earlier run.
//!
//! A record is kept where it is of this run: the pair in its place of the input has its name and as many matches. Records say nothing of
//! the options, so the first ones with a pose are estimated again: the same pair, options and seed give the same record. A pair
//! without a pose is tried again in its place, so that the whole is what a run that was not ended would write.

use quest_io::{Earlier, EstimateRecord, Pair, Place, ReadError};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;

use crate::Failure;
use crate::input::Unread;

/// How many records with a pose are estimated again. One may be the same under two seeds or limits; that four are is unlikely, and
/// four pairs cost a long batch nothing.
const AGAIN: usize = 4;

/// How far numbers may be apart: those of another processor agree to about 1e-12.
const TOLERANCE: f64 = 1e-6;

/// A pair with the key of its search, or why there is none; an error ends the run.
pub(crate) type Numbered = (u64, Result<Pair, Result<Unread, ReadError>>);

/// What is to be done next.
pub(crate) enum Task {
    /// A pair that has no record, or one without a pose.
    Estimate(Box<Numbered>),
    /// A line that is kept.
    Keep(Vec<u8>),
    /// A line that is kept if its pair gives the same record again.
    Compare(Box<Comparison>),
    /// All lines of the earlier run are of this one.
    Settle,
    /// They are not.
    Refuse(Failure),
}

/// A record and its pair.
pub(crate) struct Comparison {
    index: u64,
    pair: Pair,
    place: Place,
    line: Vec<u8>,
}

/// The lines of an earlier run beside the pairs of the input, then the pairs after them.
pub(crate) struct Tasks<I> {
    pairs: I,
    earlier: Option<Earlier>,
    /// Lines so far, and how many of them are estimated again.
    lines: usize,
    compared: usize,
}

impl<I: Iterator<Item = Numbered>> Tasks<I> {
    pub(crate) fn new(pairs: I, earlier: Option<Earlier>) -> Self {
        Self { pairs, earlier, lines: 0, compared: 0 }
    }

    fn beside(&mut self, place: Place, line: Vec<u8>) -> Result<Task, Failure> {
        let record = Stored::parse(&place, &line)?;
        let Some((index, read)) = self.pairs.next() else {
            let found = format!("{place} is {}, the input ends after {} pairs", record.called(), self.lines);
            return Err(refusal(&found));
        };
        self.lines += 1;
        if matches!(read, Err(Err(_))) {
            return Ok(Task::Estimate(Box::new((index, read))));
        }
        record.check(&place, self.lines, &read)?;
        Ok(match read {
            read if record.q_21.is_none() => Task::Estimate(Box::new((index, read))),
            Ok(pair) if self.compared < AGAIN => {
                self.compared += 1;
                Task::Compare(Box::new(Comparison { index, pair, place, line }))
            }
            _ => Task::Keep(line),
        })
    }
}

impl<I: Iterator<Item = Numbered>> Iterator for Tasks<I> {
    type Item = Task;

    fn next(&mut self) -> Option<Task> {
        let Some(earlier) = &mut self.earlier else {
            return self.pairs.next().map(Box::new).map(Task::Estimate);
        };
        let task = match earlier.next() {
            Some(Ok((place, line))) => self.beside(place, line),
            Some(Err(error)) => Err(error.into()),
            None => {
                self.earlier = None;
                Ok(Task::Settle)
            }
        };
        Some(task.unwrap_or_else(Task::Refuse))
    }
}

/// What a record says of its pair.
#[derive(Deserialize)]
struct Stored {
    name: Option<String>,
    /// Every record has it; it tells a record from another line of JSON.
    #[serde(rename = "elapsed_ms")]
    _elapsed_ms: f64,
    q_21: Option<IgnoredAny>,
    inliers: Option<Vec<IgnoredAny>>,
}

impl Stored {
    fn parse(place: &Place, line: &[u8]) -> Result<Self, Failure> {
        serde_json::from_slice(line).map_err(|_| refusal(&format!("{place} is no record of an estimate")))
    }

    fn called(&self) -> &str {
        self.name.as_deref().unwrap_or("a pair without a name")
    }

    /// That the record is of the pair, the input's of this number.
    fn check(
        &self,
        place: &Place,
        number: usize,
        read: &Result<Pair, Result<Unread, ReadError>>,
    ) -> Result<(), Failure> {
        let input = if number == 1 {
            "the input begins with".into()
        } else {
            format!("pair {number} of the input is")
        };
        if !self.may_be(read) {
            let other = match read {
                Ok(pair) => pair.name.clone().unwrap_or_else(|| "one without a name".to_owned()),
                Err(Ok(unread)) => unread.name.clone().unwrap_or_else(|| unread.error.to_string()),
                Err(Err(error)) => error.to_string(),
            };
            return Err(refusal(&format!("{place} is {}, {input} {other}", self.called())));
        }
        match (&self.inliers, read) {
            (Some(inliers), Ok(pair)) if inliers.len() != pair.matches.len() => {
                let (found, expected) = (inliers.len(), pair.matches.len());
                let name = self.called();
                Err(refusal(&format!("{place} is {name} with {found} matches, {input} one with {expected}")))
            }
            _ => Ok(()),
        }
    }

    fn may_be(&self, read: &Result<Pair, Result<Unread, ReadError>>) -> bool {
        let (name, file) = match read {
            Ok(pair) => (pair.name.as_ref(), &pair.place.file),
            Err(Ok(unread)) => (unread.name.as_ref(), &unread.error.place.file),
            Err(Err(error)) => (None, &error.place.file),
        };
        let is_unread = read.is_err() && name.is_none();
        match &self.name {
            Some(own) if self.q_21.is_some() => Some(own) == name,
            // A file that could not be read was called by its own name; the pair in it may have another.
            Some(own) => Some(own) == name || own == file || is_unread,
            None => self.q_21.is_none() || (name.is_none() && !is_unread),
        }
    }
}

impl Comparison {
    /// The line, if its pair gives the same record but for the time.
    pub(crate) fn kept(
        self,
        again: impl FnOnce(u64, Pair) -> Result<EstimateRecord, Failure>,
    ) -> Result<Vec<u8>, Failure> {
        let Self { index, pair, place, line } = self;
        let again = again(index, pair)?;
        let (before, now) = (serde_json::from_slice(&line), serde_json::to_value(&again));
        let (Ok(Value::Object(before)), Ok(Value::Object(now))) = (before, now) else {
            return Err(refusal(&format!("{place} is no record of an estimate")));
        };
        let keys = before.keys().chain(now.keys()).filter(|key| *key != "elapsed_ms");
        let is_other = |key: &&String| match (before.get(*key), now.get(*key)) {
            (Some(a), Some(b)) => !is_same(a, b),
            _ => true,
        };
        match { keys }.find(is_other) {
            None => Ok(line),
            Some(key) => Err(refusal(&format!(
                "{place} has another {key} than its pair has now: found other options or matches, or another version"
            ))),
        }
    }
}

fn is_same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => {
            let (Some(a), Some(b)) = (a.as_f64(), b.as_f64()) else { return a == b };
            (a - b).abs() <= TOLERANCE * a.abs().max(b.abs()).max(1.0)
        }
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_same(a, b))
        }
        (Value::Object(a), Value::Object(b)) => {
            a.len() == b.len() && a.iter().all(|(key, a)| b.get(key).is_some_and(|b| is_same(a, b)))
        }
        _ => a == b,
    }
}

fn refusal(found: &str) -> Failure {
    Failure::Arguments(format!(
        "{found}; --resume goes on with the same input and options, without it the run begins anew"
    ))
}
