"""Camera relative pose from matched image points.

Two views of the same rigid points determine the rotation between the cameras, the direction of the translation and
the depths of the points up to one common scale:

    X2 = R @ X1 + t

where X1 and X2 are the coordinates of a point in the frames of camera 1 and camera 2 (x to the right, y down, z
forward).

>>> import quest_pose as qp
>>> camera = qp.Camera("PINHOLE", [1060, 1060, 514, 384], width=1024, height=768)
>>> camera.bearing([[514, 384]])
array([[0., 0., 1.]])

``estimate`` finds one pose from matches with outliers, ``estimate_batch`` those of many pairs on all cores, ``third_view``
decides between two possible poses, ``solve`` finds the candidate poses of five or more correct matches, ``solve_batch`` those of many samples of five, ``choose`` takes the candidates that a third view agrees with,
and ``solve_polynomials`` finds every solution of a system of polynomials. ``quest_pose.paper`` has further pieces of the paper. ``quest_pose.colmap`` verifies the
image pairs of COLMAP databases, ``quest_pose.compat`` takes the place of other libraries, ``quest_pose.arrow`` and
``quest_pose.dask`` work on columns and on clusters. What is wrong with points, cameras and options is a ``QuestError``, that matches have no
answer a ``NoAnswer``; what is no array of numbers at all is a ``TypeError``.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quest_pose._core import (
    BadCamera,
    Camera,
    Candidate,
    DegenerateInput,
    Estimate,
    EstimateBatch,
    NoAnswer,
    NoPose,
    NotFinite,
    QuestError,
    RelativePose,
    RunnerUp,
    ShapeMismatch,
    TooFewMatches,
    __version__,
    _choose,
    _solve_batch,
    _solvers,
    _third_view,
    constraint_matrix,
    estimate,
    estimate_batch,
    solve,
)
from quest_pose._options import EstimateOptions
from quest_pose._polynomials import PolynomialSolutions, solve_polynomials

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = [
    "BadCamera",
    "Camera",
    "Candidate",
    "Choice",
    "DegenerateInput",
    "Estimate",
    "EstimateBatch",
    "EstimateOptions",
    "NoAnswer",
    "NoPose",
    "NotFinite",
    "PolynomialSolutions",
    "QuestError",
    "RelativePose",
    "RunnerUp",
    "ShapeMismatch",
    "SolvedBatch",
    "SolverInfo",
    "ThirdView",
    "TooFewMatches",
    "__version__",
    "choose",
    "constraint_matrix",
    "estimate",
    "estimate_batch",
    "solve",
    "solve_batch",
    "solve_polynomials",
    "solvers",
    "third_view",
]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        """A module of the package, which is loaded when it is named first: ``quest_pose.colmap`` needs no import of its own."""
        if name in {"arrow", "colmap", "compat", "dask", "paper", "servo"}:
            return importlib.import_module(f"quest_pose.{name}")
        raise AttributeError(f"module 'quest_pose' has no attribute {name!r}")


class SolverInfo(NamedTuple):
    """A row of the table of solvers."""

    name: str
    """What ``solve`` takes."""
    min_matches: int
    """The smallest number of matches it works with."""
    max_candidates: int
    """The largest number of candidates, of all kinds."""
    reference: str
    """Where the method was published."""
    lost: str = ""
    """What the method as published is known to lose, counted; empty where it finds every pose of the tests."""


def solvers() -> list[SolverInfo]:
    """The solvers that ``solve`` knows; the first is the default.

    Returns
    -------
    list of SolverInfo
        Named tuples of name, min_matches, max_candidates, reference and lost.
    """
    return [SolverInfo(*row) for row in _solvers()]


class SolvedBatch(NamedTuple):
    """The candidates of many samples, in columns."""

    offsets: NDArray[np.int64]
    """(B + 1,): the candidates of sample ``b`` are ``offsets[b]`` to ``offsets[b + 1]``, best first."""
    quat_wxyz: NDArray[np.float64]
    """(M, 4): the rotations as unit quaternions, scalar first."""
    t: NDArray[np.float64]
    """(M, 3): the translations; the mean absolute depth over both views is 1."""
    in_front: NDArray[np.int64]
    """(M,): how many of the five matches have positive depth in both views."""
    residual: NDArray[np.float64]
    """(M,): how far the matches are from satisfying the epipolar constraint, in radians."""

    @property
    def sample(self) -> NDArray[np.int64]:
        """(M,): the sample that each candidate belongs to."""
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))

    @property
    def R(self) -> NDArray[np.float64]:
        """(M, 3, 3): the rotation matrices."""
        w, x, y, z = self.quat_wxyz.T
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        return np.moveaxis(np.array(rows), 2, 0)


def solve_batch(x1: ArrayLike, x2: ArrayLike) -> SolvedBatch:
    """Candidate poses of many samples of five matches, on all cores.

    What ``solve(x1[b], x2[b], kinds="exact")`` finds for every sample ``b``, several samples at a time in vector
    registers.

    Parameters
    ----------
    x1, x2 : array_like of shape (B, 5, 2) or (B, 5, 3)
        The same five points of B samples in view 1 and in view 2, on the plane z = 1 of each camera or as bearings of
        any length.

    Returns
    -------
    SolvedBatch
        Named columns. A sample that determines no pose, or only a rotation, has no candidates. The result does not
        depend on the number of cores.

    Raises
    ------
    NotFinite, ShapeMismatch, DegenerateInput
        As ``solve``.

    Notes
    -----
    The lock of the interpreter is released while the solver works.
    """
    return SolvedBatch(*_solve_batch(x1, x2))


class ThirdView(NamedTuple):
    """What three views of the same points say."""

    estimate_21: Estimate
    """From view 1 to view 2; the runner-up is the pose that the third view speaks against."""
    estimate_31: Estimate
    """From view 1 to view 3."""
    disagreement: float | None
    """How far the depths of the two pairs are apart, in units of the noise; None where nothing was decided."""
    next_best: float | None
    """The same with the other pose from view 1 to view 2, infinite where there is none."""
    ratio: float | None
    """The length of the translation to view 3 over that to view 2, in one common scale."""


def third_view(
    x1: ArrayLike,
    x2: ArrayLike,
    x3: ArrayLike,
    camera1: Camera | ArrayLike | None = None,
    camera2: Camera | ArrayLike | None = None,
    camera3: Camera | ArrayLike | None = None,
    **options: Unpack[EstimateOptions],
) -> ThirdView:
    """The poses from view 1 to views 2 and 3; where one of two views is ambiguous, the other decides.

    Points on a plane, and few points, have two possible poses. The depths in view 1 do not depend on where the other
    camera is: the poses of the two pairs are chosen so that they agree.

    Parameters
    ----------
    x1, x2, x3 : array_like of shape (N, 2) or (N, 3)
        The same N points in three views, as for ``estimate``.
    camera1, camera2, camera3 : Camera or array_like of shape (3, 3), optional
        The cameras, or their matrices K. The second and the third are ``camera1`` where absent.
    options
        As for ``estimate``: the keywords of ``EstimateOptions`` but for ``index``.

    Returns
    -------
    ThirdView
        Named fields. ``disagreement`` close to ``next_best`` does not decide. Where fewer than five points are
        inliers of both pairs, or a camera only turned, nothing does.

    Raises
    ------
    NoPose, TooFewMatches, NotFinite, ShapeMismatch, DegenerateInput, BadCamera, QuestError
        As ``estimate``, for either pair.
    """
    first, second, decision = _third_view(x1, x2, x3, (camera1, camera2, camera3), options)
    return ThirdView(first, second, *(decision or (None, None, None)))


class _Pose(Protocol):
    """A ``Candidate``, an ``Estimate``, a ``RunnerUp``."""

    @property
    def R(self) -> NDArray[np.float64]: ...
    @property
    def t(self) -> NDArray[np.float64]: ...


_Poses: TypeAlias = Sequence[_Pose | tuple[ArrayLike, ArrayLike]]


class Choice(NamedTuple):
    """The poses of two pairs of views whose depths agree best."""

    pose_21: int
    """The index of the pose from view 1 to view 2."""
    pose_31: int
    """The index of the pose from view 1 to view 3."""
    disagreement: float
    """How far the depths are apart: mean square over the points in units of the noise, at most nine."""
    next_best: float
    """The same for the best pair with another pose from view 1 to view 2; infinite if there is none."""
    ratio: float
    """The length of the translation to view 3 over that to view 2, in one common scale."""


def choose(
    x1: ArrayLike,
    x2: ArrayLike,
    x3: ArrayLike,
    poses_21: _Poses,
    poses_31: _Poses,
    camera1: Camera | ArrayLike | None = None,
    camera2: Camera | ArrayLike | None = None,
    camera3: Camera | ArrayLike | None = None,
    *,
    noise: float = 1e-3,
) -> Choice | None:
    """Of the candidate poses of two pairs of views the ones whose depths in view 1 agree.

    Five points have several poses that fit exactly, and so has a plane. The depths in view 1 do not depend on where the
    other camera is: the true candidates of views 1 and 2 and of views 1 and 3 give the same, up to one scale.

    Parameters
    ----------
    x1, x2, x3 : array_like of shape (N, 2) or (N, 3)
        The same N points in three views, as for ``solve``. Any number of points will do; five or more tell poses apart.
    poses_21, poses_31 : sequence
        The candidates of views 1 and 2 and of views 1 and 3: what ``solve`` returns, estimates, or pairs ``(R, t)``.
    camera1, camera2, camera3 : Camera or array_like of shape (3, 3), optional
        The cameras, or their matrices K. The second and the third are ``camera1`` where absent.
    noise : float
        The standard deviation of a bearing in radians: a pixel over the focal length.

    Returns
    -------
    Choice or None
        Named fields. A ``disagreement`` close to ``next_best`` does not decide. None where one of the lists is empty or
        has no pose with a translation.

    Raises
    ------
    NotFinite, ShapeMismatch, DegenerateInput, BadCamera, QuestError
        As ``solve``; for a matrix that is no rotation, and a noise that is not positive.
    """
    cameras = (camera1, camera2, camera3)
    choice = _choose(x1, x2, x3, _pairs(poses_21), _pairs(poses_31), cameras, noise)
    return None if choice is None else Choice(*choice)


def _pairs(poses: _Poses) -> list[tuple[ArrayLike, ArrayLike]]:
    return [pose if isinstance(pose, tuple) else (pose.R, pose.t) for pose in poses]
