//! What every solver returns: a short list of poses.

use std::fmt;
use std::ops::Deref;

use crate::{Correspondence, RelativePose};

/// Where a candidate comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum CandidateKind {
    /// A real solution of the constraints (a local minimum of their squares for more than five matches).
    Exact,
    /// The real part of a complex solution. Under noise the true pose often hides in one.
    FromComplex,
    /// The rotation that best aligns the bearings, as if there were no translation.
    RotationOnly,
    /// A motion of the plane that best explains the matches. If the points do lie on a plane, this motion uses all of the
    /// matches, and under noise it is closer to the truth than a pose that fits five of them exactly.
    Planar,
}

impl CandidateKind {
    /// The name in files: `exact`, `from_complex`, `rotation_only`, `planar`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::FromComplex => "from_complex",
            Self::RotationOnly => "rotation_only",
            Self::Planar => "planar",
        }
    }
}

/// Why the matches do not determine a pose, or determine only a part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Degeneracy {
    /// There are fewer matches than the solver needs.
    TooFewMatches,
    /// All points coincide in one view.
    Coincident,
    /// Some matches are repeated, and too few distinct ones are left.
    Duplicate,
    /// All points, or all but one, lie on a line.
    Collinear,
    /// The matches give fewer independent constraints than the solver needs, and none of the reasons above applies.
    RankDeficient,
    /// A rotation alone explains the matches to the last digit: there is no translation, and no depth is
    /// determined. The candidate holds the rotation and `t = 0`.
    PureRotation,
}

impl Degeneracy {
    /// The name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::TooFewMatches => "too_few_matches",
            Self::Coincident => "coincident",
            Self::Duplicate => "duplicate",
            Self::Collinear => "collinear",
            Self::RankDeficient => "rank_deficient",
            Self::PureRotation => "pure_rotation",
        }
    }
}

/// What it means, in words: a clause for the end of a sentence.
impl fmt::Display for Degeneracy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooFewMatches => "there are fewer matches than the solver needs",
            Self::Coincident => "all points coincide in one view",
            Self::Duplicate => "matches are repeated, and too few distinct ones are left",
            Self::Collinear => "too many of the points lie on a line",
            Self::RankDeficient => "the matches do not give five independent constraints",
            Self::PureRotation => {
                "pure rotation: a rotation alone explains the matches, there is no translation and no depth"
            }
        })
    }
}

/// One pose that may be the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Candidate {
    /// Where it comes from.
    pub kind: CandidateKind,
    /// The pose. The mean absolute depth over both views is 1, so `|t_21|` is the parallax of (63).
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub pose: RelativePose,
    /// Root mean square over the matches, in radians, of the angle by which each bearing of a match would
    /// have to turn to satisfy the epipolar constraint (the Sampson error on the sphere).
    pub residual: f64,
    /// How many of the matches have positive depth in both views. With more than five matches those whose rays are parallel to
    /// within the noise that the residual shows, points so far away that the sign of their depth is chance, count as well.
    pub in_front: usize,
}

impl Candidate {
    /// The depths of a match at this pose; see [`RelativePose::depths`].
    #[must_use]
    pub fn depths(&self, m: &Correspondence) -> Option<(f64, f64)> {
        self.pose.depths(m)
    }
}

/// The candidates of one solve, best first: most points in front, then the smallest residual, then the smallest
/// rotation.
///
/// Residuals below 1e-12 rad count as equal: they are rounding, which must not decide the order of exact solutions. A smaller
/// rotation only makes the order definite; it does not make a pose more likely.
///
/// The list holds at most [`Candidates::CAPACITY`] candidates and never allocates. It dereferences to a slice.
#[derive(Clone, Debug)]
pub struct Candidates {
    items: [Candidate; Self::CAPACITY],
    len: usize,
    degeneracy: Option<Degeneracy>,
}

impl Candidates {
    /// Twenty rotations solve the five-point problem; the rotation-only candidate and the four motions of a
    /// homography come on top.
    pub const CAPACITY: usize = 25;

    /// An empty list.
    #[must_use]
    pub fn new() -> Self {
        let none = Candidate {
            kind: CandidateKind::Exact,
            pose: RelativePose::identity(),
            residual: f64::INFINITY,
            in_front: 0,
        };
        Self { items: [none; Self::CAPACITY], len: 0, degeneracy: None }
    }

    /// Empties the list.
    pub fn clear(&mut self) {
        self.len = 0;
        self.degeneracy = None;
    }

    /// Appends a candidate; one that no longer fits is dropped.
    pub fn push(&mut self, candidate: Candidate) {
        if self.len < Self::CAPACITY {
            self.items[self.len] = candidate;
            self.len += 1;
        }
    }

    /// What kept the matches from determining a pose, if anything did.
    #[must_use]
    pub fn degeneracy(&self) -> Option<Degeneracy> {
        self.degeneracy
    }

    /// Records why there is no pose, or only a part of one.
    pub fn set_degeneracy(&mut self, degeneracy: Degeneracy) {
        self.degeneracy = Some(degeneracy);
    }

    /// The candidates that can be changed in place.
    pub fn as_mut_slice(&mut self) -> &mut [Candidate] {
        &mut self.items[..self.len]
    }
}

impl Default for Candidates {
    fn default() -> Self {
        Self::new()
    }
}

impl Deref for Candidates {
    type Target = [Candidate];

    fn deref(&self) -> &[Candidate] {
        &self.items[..self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn kinds_and_reasons_have_names_of_their_own() {
        use CandidateKind::{Exact, FromComplex, Planar, RotationOnly};
        use Degeneracy::{Coincident, Collinear, Duplicate, PureRotation, RankDeficient, TooFewMatches};
        let kinds: HashSet<_> = [Exact, FromComplex, RotationOnly, Planar].map(CandidateKind::name).into();
        assert_eq!(kinds, ["exact", "from_complex", "rotation_only", "planar"].into());
        let all = [TooFewMatches, Coincident, Duplicate, Collinear, RankDeficient, PureRotation];
        let names: HashSet<_> = all.map(Degeneracy::name).into();
        let words: HashSet<_> = all.map(|reason| reason.to_string()).into();
        assert_eq!((names.len(), words.len()), (6, 6));
        assert!(names.iter().all(|name| name.chars().all(|c| c.is_ascii_lowercase() || c == '_')));
        assert!(words.iter().all(|text| text.contains(' ')));
    }

    #[test]
    fn a_full_list_takes_no_more() {
        let candidate = |in_front: usize| Candidate {
            kind: CandidateKind::Exact,
            pose: RelativePose::identity(),
            residual: 0.0,
            in_front,
        };
        let mut list = Candidates::default();
        (0..Candidates::CAPACITY + 3).for_each(|k| list.push(candidate(k)));
        assert_eq!(list.len(), Candidates::CAPACITY);
        assert!(list.iter().enumerate().all(|(k, candidate)| candidate.in_front == k));
        list.set_degeneracy(Degeneracy::Collinear);
        list.clear();
        assert!(list.is_empty() && list.degeneracy().is_none());
    }
}
