//! Matched points as pairs of bearings, checked once at the door.

use nalgebra::{UnitQuaternion, Vector3};

use crate::camera::MAX_IMAGE_COORDINATE;
use crate::{Camera, CameraError, Degeneracy};

/// The lengths of bearings that are accepted. The largest product in the crate is that of the six lengths of a row of the
/// constraint matrix: between these bounds it is a normal number, and so is every product of two lengths and a squared angle.
const BEARING_LENGTHS: std::ops::RangeInclusive<f64> = 1e-50..=1e50;

/// One match: the viewing rays of the same point in camera 1 and in camera 2.
///
/// The rays are kept as unit bearings together with the lengths of the vectors they were given as, so that
/// depths are reported for the vectors as given: for points on the plane `z = 1` a depth is the z coordinate
/// of the point, as in the paper; for unit bearings it is the distance along the ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    bearing1: Vector3<f64>,
    bearing2: Vector3<f64>,
    length1: f64,
    length2: f64,
}

/// Why a match was refused. The view is 1 or 2.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MatchError {
    /// A coordinate is NaN or infinite.
    #[error("a coordinate in view {view} is {value}, expected a finite number")]
    NotFinite {
        /// 1 or 2.
        view: u8,
        /// What was found.
        value: f64,
    },
    /// A point lies too far from the optical axis to have a bearing.
    #[error(
        "a coordinate in view {view} is {value:e} on the plane z = 1, expected at most {MAX_IMAGE_COORDINATE:e}"
    )]
    TooFar {
        /// 1 or 2.
        view: u8,
        /// What was found.
        value: f64,
    },
    /// A bearing has no direction: its length is zero, or so small or large that products of lengths are not numbers.
    #[error(
        "a bearing in view {view} has the length {length:e}, expected between {:e} and {:e}",
        BEARING_LENGTHS.start(),
        BEARING_LENGTHS.end()
    )]
    NoDirection {
        /// 1 or 2.
        view: u8,
        /// What was found.
        length: f64,
    },
    /// The camera has no viewing ray for the pixel.
    #[error("view {view}: {source}")]
    Camera {
        /// 1 or 2.
        view: u8,
        /// What the camera says.
        source: CameraError,
    },
}

/// Why a set of matches was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// One match is unusable.
    #[error("match {index}: {source}")]
    Match {
        /// Counted from zero.
        index: usize,
        /// What is wrong with it.
        source: MatchError,
    },
    /// The two views do not have the same number of points.
    #[error("view 1 has {first} points and view 2 has {second}, expected as many")]
    LengthMismatch {
        /// Points in view 1.
        first: usize,
        /// Points in view 2.
        second: usize,
    },
    /// The matches determine no pose.
    #[error("{0}, expected matches that determine a pose")]
    Degenerate(Degeneracy),
    /// There are fewer matches than the solver needs.
    #[error("found {found} matches, expected at least {needed}")]
    TooFewMatches {
        /// How many there are.
        found: usize,
        /// How many the solver needs.
        needed: usize,
    },
    /// A table with a row for every three matches does not fit in memory.
    #[error("{found} matches make {rows} rows, which do not fit in memory")]
    TooManyMatches {
        /// How many there are.
        found: usize,
        /// How many rows that would be.
        rows: u128,
    },
}

impl Correspondence {
    /// A match of two bearings of any length, in the frames of camera 1 and camera 2.
    ///
    /// # Errors
    /// [`MatchError::NotFinite`] and [`MatchError::NoDirection`].
    pub fn from_bearings(x1: [f64; 3], x2: [f64; 3]) -> Result<Self, MatchError> {
        let (bearing1, length1) = unit(1, x1)?;
        let (bearing2, length2) = unit(2, x2)?;
        Ok(Self { bearing1, bearing2, length1, length2 })
    }

    /// A match of two points on the planes `z = 1` of the cameras (normalised image coordinates).
    ///
    /// # Errors
    /// [`MatchError::NotFinite`], and [`MatchError::TooFar`] beyond [`MAX_IMAGE_COORDINATE`].
    pub fn from_image_points(x1: [f64; 2], x2: [f64; 2]) -> Result<Self, MatchError> {
        for (view, x) in [(1, x1), (2, x2)] {
            for value in x {
                if value.abs() > MAX_IMAGE_COORDINATE && value.is_finite() {
                    return Err(MatchError::TooFar { view, value });
                }
            }
        }
        Self::from_bearings([x1[0], x1[1], 1.0], [x2[0], x2[1], 1.0])
    }

    /// A match of two pixels.
    ///
    /// # Errors
    /// As [`Correspondence::from_bearings`], and [`MatchError::Camera`] where a camera has no ray for its pixel.
    pub fn from_pixels(
        camera1: &Camera,
        u1: [f64; 2],
        camera2: &Camera,
        u2: [f64; 2],
    ) -> Result<Self, MatchError> {
        let ray = |view, camera: &Camera, u| {
            camera.bearing(u).map_err(|source| MatchError::Camera { view, source })
        };
        Self::from_bearings(ray(1, camera1, u1)?.into(), ray(2, camera2, u2)?.into())
    }

    /// The match as a camera 2 would see it that is turned, its bearings multiplied by `g`.
    pub(crate) fn with_view2_rotated(mut self, g: &UnitQuaternion<f64>) -> Self {
        self.bearing2 = g * self.bearing2;
        self
    }

    /// The unit bearing in the frame of camera 1.
    #[must_use]
    #[inline]
    pub fn bearing1(&self) -> &Vector3<f64> {
        &self.bearing1
    }

    /// The unit bearing in the frame of camera 2.
    #[must_use]
    #[inline]
    pub fn bearing2(&self) -> &Vector3<f64> {
        &self.bearing2
    }

    /// The length of the vector given for camera 1.
    #[must_use]
    #[inline]
    pub fn length1(&self) -> f64 {
        self.length1
    }

    /// The length of the vector given for camera 2.
    #[must_use]
    #[inline]
    pub fn length2(&self) -> f64 {
        self.length2
    }
}

fn unit(view: u8, x: [f64; 3]) -> Result<(Vector3<f64>, f64), MatchError> {
    if let Some(&value) = x.iter().find(|v| !v.is_finite()) {
        return Err(MatchError::NotFinite { view, value });
    }
    let x = Vector3::from(x);
    let largest = x.amax();
    if !BEARING_LENGTHS.contains(&largest) {
        return Err(MatchError::NoDirection { view, length: largest });
    }
    let length = x.norm();
    Ok((x / length, length))
}

/// Matches from points on the planes `z = 1`, one `[x, y]` a match and view.
///
/// # Errors
/// [`InputError::LengthMismatch`], and [`InputError::Match`] for the first match that is refused.
pub fn from_image_points(x1: &[[f64; 2]], x2: &[[f64; 2]]) -> Result<Vec<Correspondence>, InputError> {
    collect(x1, x2, Correspondence::from_image_points)
}

/// Matches from bearings of any length, one `[x, y, z]` a match and view.
///
/// # Errors
/// [`InputError::LengthMismatch`], and [`InputError::Match`] for the first match that is refused.
pub fn from_bearings(x1: &[[f64; 3]], x2: &[[f64; 3]]) -> Result<Vec<Correspondence>, InputError> {
    collect(x1, x2, Correspondence::from_bearings)
}

/// Matches from pixels of two cameras, one `[u, v]` a match and view.
///
/// # Errors
/// [`InputError::LengthMismatch`], and [`InputError::Match`] for the first match that is refused.
pub fn from_pixels(
    camera1: &Camera,
    u1: &[[f64; 2]],
    camera2: &Camera,
    u2: &[[f64; 2]],
) -> Result<Vec<Correspondence>, InputError> {
    collect(u1, u2, |a, b| Correspondence::from_pixels(camera1, a, camera2, b))
}

/// The matches that have bearings in both views, where some of the given ones may not: a pixel without a viewing ray, or a
/// coordinate that is not a number, is no more than an outlier to an estimate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Usable {
    /// Those with bearings, in the order given.
    pub matches: Vec<Correspondence>,
    /// The others: their places among all, and what is wrong with them.
    pub invalid: Vec<(usize, MatchError)>,
}

impl Usable {
    /// As [`from_image_points`].
    ///
    /// # Errors
    /// [`InputError::LengthMismatch`].
    pub fn from_image_points(x1: &[[f64; 2]], x2: &[[f64; 2]]) -> Result<Self, InputError> {
        Self::collect(x1, x2, Correspondence::from_image_points)
    }

    /// As [`from_bearings`].
    ///
    /// # Errors
    /// [`InputError::LengthMismatch`].
    pub fn from_bearings(x1: &[[f64; 3]], x2: &[[f64; 3]]) -> Result<Self, InputError> {
        Self::collect(x1, x2, Correspondence::from_bearings)
    }

    /// As [`from_pixels`].
    ///
    /// # Errors
    /// [`InputError::LengthMismatch`].
    pub fn from_pixels(
        camera1: &Camera,
        u1: &[[f64; 2]],
        camera2: &Camera,
        u2: &[[f64; 2]],
    ) -> Result<Self, InputError> {
        Self::collect(u1, u2, |a, b| Correspondence::from_pixels(camera1, a, camera2, b))
    }

    fn collect<const D: usize>(
        x1: &[[f64; D]],
        x2: &[[f64; D]],
        one: impl Fn([f64; D], [f64; D]) -> Result<Correspondence, MatchError>,
    ) -> Result<Self, InputError> {
        if x1.len() != x2.len() {
            return Err(InputError::LengthMismatch { first: x1.len(), second: x2.len() });
        }
        Ok(x1.iter().zip(x2).map(|(&a, &b)| one(a, b)).collect())
    }

    /// How many matches were given.
    #[must_use]
    pub fn given(&self) -> usize {
        self.matches.len() + self.invalid.len()
    }

    /// The error that the first unusable match is, where there is one.
    #[must_use]
    pub fn error(&self) -> Option<InputError> {
        self.invalid
            .first()
            .map(|(index, source)| InputError::Match { index: *index, source: source.clone() })
    }

    /// Of values, one a match that was given, those of the usable ones.
    #[must_use]
    pub fn keep<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let mut invalid = self.invalid.iter().map(|(place, _)| *place).peekable();
        let kept = values.iter().enumerate().filter(|(place, _)| invalid.next_if_eq(place).is_none());
        kept.map(|(_, value)| *value).collect()
    }

    /// Flags of the usable matches as flags of all that were given: the unusable ones are `false`.
    #[must_use]
    pub fn spread(&self, flags: &[bool]) -> Vec<bool> {
        let mut all = vec![false; self.given()];
        let mut invalid = self.invalid.iter().map(|(place, _)| *place).peekable();
        let mut flags = flags.iter();
        for (place, slot) in all.iter_mut().enumerate() {
            if invalid.next_if_eq(&place).is_none() {
                *slot = flags.next().copied().unwrap_or(false);
            }
        }
        all
    }
}

impl FromIterator<Result<Correspondence, MatchError>> for Usable {
    /// Sets apart what was refused.
    fn from_iter<I: IntoIterator<Item = Result<Correspondence, MatchError>>>(all: I) -> Self {
        let all = all.into_iter();
        let mut usable = Self { matches: Vec::with_capacity(all.size_hint().0), invalid: Vec::new() };
        for (place, one) in all.enumerate() {
            match one {
                Ok(m) => usable.matches.push(m),
                Err(error) => usable.invalid.push((place, error)),
            }
        }
        usable
    }
}

fn collect<const D: usize>(
    x1: &[[f64; D]],
    x2: &[[f64; D]],
    one: impl Fn([f64; D], [f64; D]) -> Result<Correspondence, MatchError>,
) -> Result<Vec<Correspondence>, InputError> {
    if x1.len() != x2.len() {
        return Err(InputError::LengthMismatch { first: x1.len(), second: x2.len() });
    }
    let pairs = x1.iter().zip(x2).enumerate();
    pairs.map(|(index, (&a, &b))| one(a, b).map_err(|source| InputError::Match { index, source })).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_bearing_is_set_apart() {
        let x1 = [[0.0, 0.0], [f64::NAN, 0.0], [0.1, 0.0], [1e9, 0.0], [0.2, 0.0]];
        let x2 = [[0.0; 2]; 5];
        let usable = Usable::from_image_points(&x1, &x2).unwrap();
        assert_eq!((usable.matches.len(), usable.given()), (3, 5));
        assert_eq!(usable.invalid.iter().map(|(place, _)| *place).collect::<Vec<_>>(), [1, 3]);
        assert_eq!(usable.keep(&[0, 1, 2, 3, 4]), [0, 2, 4]);
        assert_eq!(usable.spread(&[true, false, true]), [true, false, false, false, true]);
        // Errors with a NaN in them are never equal.
        let refused = from_image_points(&x1, &x2).err();
        assert_eq!(usable.error().map(|e| e.to_string()), refused.map(|e| e.to_string()));
        let clean = Usable::from_image_points(&x1[..1], &x2[..1]).unwrap();
        assert_eq!((clean.error(), clean.spread(&[true])), (None, vec![true]));
        assert!(Usable::from_image_points(&x1, &x2[..4]).is_err());
    }

    #[test]
    fn bearings_and_pixels_are_set_apart_too() {
        let x1 = [[0.0, 0.0, 2.0], [0.0; 3], [0.1, 0.2, -3.0]];
        let usable = Usable::from_bearings(&x1, &[[0.0, 0.0, 1.0]; 3]).unwrap();
        let places = |usable: &Usable| usable.invalid.iter().map(|(place, _)| *place).collect::<Vec<_>>();
        assert_eq!((usable.matches.len(), places(&usable)), (2, vec![1]));
        assert!((usable.matches[1].length1() - 9.05_f64.sqrt()).abs() < 1e-12);
        let camera = Camera::new(crate::CameraModel::Pinhole, &[500.0, 500.0, 320.0, 240.0]).unwrap();
        let u1 = [[320.0, 240.0], [f64::NAN, 0.0], [820.0, 240.0]];
        let usable = Usable::from_pixels(&camera, &u1, &camera, &[[320.0, 240.0]; 3]).unwrap();
        assert_eq!((usable.matches.len(), places(&usable)), (2, vec![1]));
        assert!((usable.matches[1].bearing1() - Vector3::new(1.0, 0.0, 1.0).normalize()).amax() < 1e-12);
        let few = Usable::from_pixels(&camera, &u1, &camera, &[]).unwrap_err();
        assert_eq!(few, InputError::LengthMismatch { first: 3, second: 0 });
        assert_eq!(Usable::from_bearings(&x1, &[]).unwrap_err(), few);
        assert_eq!(from_bearings(&x1, &[]).unwrap_err(), few);
    }
}
