//! `solve`, `constraint_matrix` and the table of solvers.

use numpy::PyArray2;
use pyo3::prelude::*;
use quest_core::correspondence::Usable;
use quest_core::feasibility::{Feasibility, UnknownFeasibility};
use quest_core::solver::{Kinds, SolverName, UnknownKinds};
use quest_core::{Camera, Candidates, Correspondence, InputError, correspondence, quaternion};

use crate::arrays::{self, Points};
use crate::camera;
use crate::candidate::Candidate;
use crate::coordinates;
use crate::errors::{self, BadCamera, QuestError, ShapeMismatch};
use crate::supervisor::apart;

/// So many matches take a few hundredths of a second: with more a signal has to be answered meanwhile.
const LONG: usize = 20_000;

/// Candidate poses from five or more correct matches.
///
/// Parameters
/// ----------
/// x1, x2 : array_like of shape (N, 2) or (N, 3)
///     The same N points in view 1 and in view 2: pixels where cameras are given, otherwise points on the plane
///     z = 1 of each camera (normalised image coordinates). Three numbers a row are bearings of any length, and
///     take no camera.
/// camera1, camera2 : Camera or array_like of shape (3, 3), optional
///     The cameras, or their matrices K. ``camera2`` is ``camera1`` where absent.
/// solver : str, optional
///     One of the names in ``solvers()``; the first of them where absent. The paper's own steps are
///     ``"quest-literal"`` and ``"relinearization-literal"``, which are slower and lose some solutions.
/// kinds : {"all", "exact", "planar"}
///     Which candidates to return. ``"all"``: every candidate. ``"exact"``: the real solutions of the constraints
///     alone. ``"planar"``: every candidate, and the motions of a plane if one explains the matches.
/// feasibility : {"positive-depth", "theorem-2"}
///     What makes a candidate ``feasible``. ``"positive-depth"``: every match in front of both cameras.
///     ``"theorem-2"``: theorem 2 of the paper's appendix B, which accepts fewer candidates, and none of a camera
///     that looks back at the points from their far side.
///
/// Returns
/// -------
/// list of Candidate
///     Best first: most points in front of both cameras, then the smallest residual. The list includes candidates
///     that are not feasible. It is empty if the constraints have no real
///     solution and ``kinds`` is ``"exact"``. Matches that a rotation alone explains give that rotation, with
///     ``t = 0``.
///
/// Raises
/// ------
/// TooFewMatches
///     For fewer matches than the solver needs.
/// NotFinite
///     For a coordinate that is NaN, infinite or masked.
/// ShapeMismatch
///     For an array of another shape, or views with different numbers of points.
/// DegenerateInput
///     For points that determine no pose (coincident, collinear, repeated), and for one that has no direction.
/// BadCamera
///     For an impossible camera, or a pixel for which it has no viewing ray.
/// QuestError
///     For an unknown ``solver``, ``kinds`` or ``feasibility``. It is also the base class of the errors above.
///
/// Notes
/// -----
/// The lock of the interpreter is released while the solver works.
#[pyfunction]
#[pyo3(signature = (x1, x2, camera1=None, camera2=None, *, solver=None, kinds="all", feasibility="positive-depth"))]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
pub(crate) fn solve(
    py: Python<'_>,
    x1: &Bound<'_, PyAny>,
    x2: &Bound<'_, PyAny>,
    camera1: Option<&Bound<'_, PyAny>>,
    camera2: Option<&Bound<'_, PyAny>>,
    solver: Option<&str>,
    kinds: &str,
    feasibility: &str,
) -> PyResult<Vec<Py<Candidate>>> {
    let solver = solver_named(solver)?;
    let feasibility: Feasibility =
        feasibility.parse().map_err(|error: UnknownFeasibility| QuestError::new_err(error.to_string()))?;
    let kinds: Kinds = kinds.parse().map_err(|error: UnknownKinds| QuestError::new_err(error.to_string()))?;
    let views = Views::new(x1, x2, camera1, camera2)?;
    views.refuse_other_units()?;
    let is_long = views.given() > LONG;
    let solved = move || {
        let matches = views.matches()?;
        let (found, needed) = (matches.len(), solver.info().min_matches);
        if found < needed {
            return Err(InputError::TooFewMatches { found, needed });
        }
        let mut out = Candidates::new();
        solver.solve(kinds, &matches, &mut out);
        let candidates: Vec<_> = out.iter().map(|c| Candidate::new(c, &matches, feasibility)).collect();
        Ok((candidates, out.degeneracy()))
    };
    match py
        .detach(|| if is_long { apart(solved) } else { Ok(solved()) })?
        .map_err(|error| errors::input(&error))?
    {
        (candidates, Some(degeneracy)) if candidates.is_empty() => Err(errors::degenerate(degeneracy)),
        (candidates, _) => candidates.into_iter().map(|candidate| candidate.into_python(py)).collect(),
    }
}

/// The coefficients of the quartic constraints on the rotation, one row for three matches.
///
/// Parameters
/// ----------
/// x1, x2 : array_like of shape (N, 2) or (N, 3)
///     The same N points in view 1 and in view 2, on the plane z = 1 of each camera or as bearings.
///
/// Returns
/// -------
/// numpy.ndarray of shape (N (N - 1) (N - 2) / 6, 35)
///     Each row is the polynomial ``det[n_i n_j n_k] / |q|**2`` of three matches i < j < k, in lexicographic
///     order, with ``n = x2 x R(q) x1``. It vanishes at the true rotation. The columns are the monomials of
///     degree four in ``(q1, q2, q3, q4)``, scalar first: ``q1**4, q1**3 q2, q1**3 q3, ..., q4**4``.
///
/// Raises
/// ------
/// TooFewMatches
///     For fewer than three matches.
/// NotFinite, ShapeMismatch, DegenerateInput
///     As ``solve``.
/// MemoryError
///     For more rows than there is memory.
#[pyfunction]
pub(crate) fn constraint_matrix<'py>(
    py: Python<'py>,
    x1: &Bound<'py, PyAny>,
    x2: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let views = Views::new(x1, x2, None, None)?;
    // The third power of the number of matches.
    let is_long = views.given() > 100;
    let rows = move || quaternion::constraint_matrix(&views.matches()?);
    let rows = py.detach(|| if is_long { apart(rows) } else { Ok(rows()) })?;
    let rows = rows.map_err(|error| errors::input(&error))?;
    Ok(arrays::to_numpy(py, rows))
}

/// The rows of ``solvers()``.
#[pyfunction]
pub(crate) fn _solvers() -> Vec<(&'static str, usize, usize, &'static str, &'static str)> {
    SolverName::named()
        .map(SolverName::info)
        .map(|i| (i.name, i.min_matches, i.max_candidates, i.reference, i.lost))
        .collect()
}

pub(crate) fn solver_named(name: Option<&str>) -> PyResult<SolverName> {
    name.map_or(Ok(SolverName::default()), str::parse).map_err(|error| QuestError::new_err(error.to_string()))
}

/// Two views of the same points, of the right shapes.
pub(crate) enum Views {
    Image(Vec<[f64; 2]>, Vec<[f64; 2]>),
    Pixels(Box<[Camera; 2]>, Vec<[f64; 2]>, Vec<[f64; 2]>),
    Bearings(Vec<[f64; 3]>, Vec<[f64; 3]>),
}

impl Views {
    pub(crate) fn new(
        x1: &Bound<'_, PyAny>,
        x2: &Bound<'_, PyAny>,
        camera1: Option<&Bound<'_, PyAny>>,
        camera2: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let camera1 = camera1.map(|c| camera::from_argument("camera1", c)).transpose()?;
        let camera2 = camera2.map(|c| camera::from_argument("camera2", c)).transpose()?;
        match (arrays::points("x1", x1)?, arrays::points("x2", x2)?) {
            (Points::Image(x1), Points::Image(x2)) => match (camera1, camera2) {
                (None, None) => Ok(Self::Image(x1, x2)),
                (Some(camera1), camera2) => {
                    Ok(Self::Pixels([camera1, camera2.unwrap_or(camera1)].into(), x1, x2))
                }
                (None, Some(_)) => Err(BadCamera::new_err("camera2 is given without camera1, expected both")),
            },
            (Points::Bearings(x1), Points::Bearings(x2)) => match (camera1, camera2) {
                (None, None) => Ok(Self::Bearings(x1, x2)),
                _ => Err(ShapeMismatch::new_err(
                    "x1 and x2 have the shape (N, 3), expected pixels of shape (N, 2) where cameras are given",
                )),
            },
            (x1, x2) => Err(ShapeMismatch::new_err(format!(
                "x1 has {} columns and x2 has {}, expected as many",
                x1.columns(),
                x2.columns()
            ))),
        }
    }

    /// Refuses coordinates that are probably of another unit.
    pub(crate) fn refuse_other_units(&self) -> PyResult<()> {
        match self {
            Self::Image(x1, x2) => {
                coordinates::on_plane("x1", x1)?;
                coordinates::on_plane("x2", x2)
            }
            Self::Pixels(cameras, u1, u2) => {
                coordinates::in_pixels("x1", u1, &cameras[0])?;
                coordinates::in_pixels("x2", u2, &cameras[1])
            }
            Self::Bearings(..) => Ok(()),
        }
    }

    /// The cameras, where there are any.
    pub(crate) fn cameras(&self) -> Option<&[Camera; 2]> {
        match self {
            Self::Pixels(cameras, ..) => Some(cameras),
            _ => None,
        }
    }

    /// How many points view 1 has.
    fn given(&self) -> usize {
        match self {
            Self::Image(x1, _) | Self::Pixels(_, x1, _) => x1.len(),
            Self::Bearings(x1, _) => x1.len(),
        }
    }

    /// The matches that have bearings, and which do not.
    pub(crate) fn usable(&self) -> Result<Usable, InputError> {
        match self {
            Self::Image(x1, x2) => Usable::from_image_points(x1, x2),
            Self::Pixels(cameras, u1, u2) => Usable::from_pixels(&cameras[0], u1, &cameras[1], u2),
            Self::Bearings(x1, x2) => Usable::from_bearings(x1, x2),
        }
    }

    pub(crate) fn matches(&self) -> Result<Vec<Correspondence>, InputError> {
        match self {
            Self::Image(x1, x2) => correspondence::from_image_points(x1, x2),
            Self::Pixels(cameras, u1, u2) => correspondence::from_pixels(&cameras[0], u1, &cameras[1], u2),
            Self::Bearings(x1, x2) => correspondence::from_bearings(x1, x2),
        }
    }
}
