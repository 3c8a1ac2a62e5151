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

``estimate`` finds one pose from matches with outliers, ``estimate_batch`` those of many pairs on all cores, ``solve`` the
candidate poses of five or more correct matches. All errors are a ``QuestError``.
"""

from typing import NamedTuple

from quest_pose._core import (
    BadCamera,
    Camera,
    Candidate,
    DegenerateInput,
    Estimate,
    EstimateBatch,
    NoPose,
    NotFinite,
    QuestError,
    RunnerUp,
    ShapeMismatch,
    TooFewMatches,
    __version__,
    _solvers,
    constraint_matrix,
    estimate,
    estimate_batch,
    solve,
)

__all__ = [
    "BadCamera",
    "Camera",
    "Candidate",
    "DegenerateInput",
    "Estimate",
    "EstimateBatch",
    "NoPose",
    "NotFinite",
    "QuestError",
    "RunnerUp",
    "ShapeMismatch",
    "SolverInfo",
    "TooFewMatches",
    "__version__",
    "constraint_matrix",
    "estimate",
    "estimate_batch",
    "solve",
    "solvers",
]


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


def solvers() -> list[SolverInfo]:
    """The solvers that ``solve`` knows; the first is the default.

    Returns
    -------
    list of SolverInfo
        Named tuples of name, min_matches, max_candidates and reference.
    """
    return [SolverInfo(*row) for row in _solvers()]
