"""Pieces of the paper that no other function has: metrics, scenes, translation and depths of a rotation, the constraint matrix.

K. Fathian, J. Jin, S.-G. Wee, D.-H. Lee, Y.-G. Kim, N. R. Gans, *Camera relative pose estimation for visual servoing using
quaternions*, Robotics and Autonomous Systems (2018), doi 10.1016/j.robot.2018.05.014. Numbers in parentheses are its
equations.
"""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quest_pose._core import (
    Camera,
    _columns,
    _parallax,
    _rotation_metric,
    _scene,
    _translation_and_depths,
    _translation_metric,
    constraint_matrix,
)

__all__ = [
    "Constraints",
    "Scene",
    "TranslationAndDepths",
    "constraints",
    "parallax",
    "rotation_metric",
    "scene",
    "translation_and_depths",
    "translation_metric",
]


class Constraints(NamedTuple):
    """The linear system ``C x = c`` of section 7.2 in the 35 quartic monomials ``x`` of the quaternion."""

    C: NDArray[np.float64]
    """(M + 1, 35): the quartics (39) of the M triples of matches, in lexicographic order, and the norm (40)."""
    c: NDArray[np.float64]
    """(M + 1,): zero for the quartics, one for the norm."""
    columns: list[str]
    """The names of the monomials: ``q1^4``, ``q1^3 q2``, ..., ``q4^4``."""
    triples: NDArray[np.int64]
    """(M, 3): the matches of each quartic."""


def constraints(x1: ArrayLike, x2: ArrayLike) -> Constraints:
    """The constraint matrix with the names of its rows and columns, and the row of the norm, (40).

    Parameters
    ----------
    x1, x2 : array_like of shape (N, 2) or (N, 3)
        As for ``quest_pose.constraint_matrix``.

    Returns
    -------
    Constraints

    Raises
    ------
    TooFewMatches, NotFinite, ShapeMismatch, DegenerateInput, MemoryError
        As ``quest_pose.constraint_matrix``.
    """
    quartics = constraint_matrix(x1, x2)
    columns, norm = _columns()
    n = len(np.asarray(x1))
    triples = [(i, j, k) for i in range(n) for j in range(i + 1, n) for k in range(j + 1, n)]
    c = np.zeros(len(quartics) + 1)
    c[-1] = 1
    return Constraints(np.vstack([quartics, norm]), c, columns, np.array(triples, np.int64).reshape(-1, 3))


class TranslationAndDepths(NamedTuple):
    """What fits a rotation best, in one scale: the mean absolute depth over both views is 1."""

    t: NDArray[np.float64]
    """(3,): the translation; its length is the parallax."""
    depths1: NDArray[np.float64]
    """(N,): the depth of each match in view 1; infinite where none is determined."""
    depths2: NDArray[np.float64]
    """(N,): the same in view 2."""
    residual: float
    """How far the matches are from satisfying the epipolar constraint, in radians."""
    in_front: int
    """How many of the matches have positive depth in both views."""


def translation_and_depths(
    R: ArrayLike,
    x1: ArrayLike,
    x2: ArrayLike,
    camera1: Camera | ArrayLike | None = None,
    camera2: Camera | ArrayLike | None = None,
) -> TranslationAndDepths:
    """The translation and the depths that fit a given rotation best, section 8.

    Parameters
    ----------
    R : array_like of shape (3, 3)
        The rotation from the frame of camera 1 to that of camera 2.
    x1, x2 : array_like of shape (N, 2) or (N, 3)
        Two or more matches, as for ``quest_pose.solve``.
    camera1, camera2 : Camera or array_like of shape (3, 3), optional
        As for ``quest_pose.solve``.

    Returns
    -------
    TranslationAndDepths

    Raises
    ------
    TooFewMatches, NotFinite, ShapeMismatch, DegenerateInput, BadCamera, QuestError
        As ``quest_pose.solve``; for a matrix that is no rotation.
    """
    t, depths1, depths2, residual, in_front = _translation_and_depths(R, x1, x2, camera1, camera2)
    return TranslationAndDepths(np.array(t), np.array(depths1), np.array(depths2), residual, in_front)


def rotation_metric(R: ArrayLike, R_est: ArrayLike) -> float:
    """The metric (61) of the figures in radians: HALF the angle between two rotations."""
    return _rotation_metric(R, R_est)


def translation_metric(t: ArrayLike, t_est: ArrayLike) -> float:
    """The metric (62) of the figures in radians: the angle between two translations whatever their SIGNS.

    Zero where the first, the true one, vanishes, and a right angle where only the second does.
    """
    return _translation_metric(t, t_est)


def parallax(t: ArrayLike, depths1: ArrayLike, depths2: ArrayLike) -> float:
    """The parallax (63): the length of the translation over the mean absolute depth of both views."""
    return _parallax(t, depths1, depths2)


class Scene(NamedTuple):
    """A random scene of section 9. The mean absolute depth over both views is 1."""

    x1: NDArray[np.float64]
    """(N, 2): the points in view 1 on the plane z = 1, with the noise of their pixels."""
    x2: NDArray[np.float64]
    """(N, 2): the same in view 2."""
    R: NDArray[np.float64]
    """(3, 3): the true rotation from the frame of camera 1 to that of camera 2."""
    t: NDArray[np.float64]
    """(3,): the true translation; its length is the parallax (63)."""
    X1: NDArray[np.float64]
    """(N, 3): the points in the frame of camera 1."""


def scene(
    points: int = 5,
    *,
    layout: Literal["general", "coplanar"] = "general",
    motion: Literal["general", "rotation", "translation"] = "general",
    parallax: float | None = None,
    max_angle: float | None = None,
    view: Literal["everywhere", "in-both-images"] = "everywhere",
    noise_px: float = 0.0,
    rounded: bool = False,
    points_box: ArrayLike = ((-1, 1), (-1, 1), (2, 4)),
    translation_box: ArrayLike = (1, 1, 1),
    seed: int = 2018,
    index: int = 0,
) -> Scene:
    """A random scene as section 9 draws it; the same arguments give the same scene everywhere.

    Parameters
    ----------
    points : int
        How many points there are.
    layout : {"general", "coplanar"}
        Points in a box, or on a rectangle around its middle with a random normal.
    motion : {"general", "rotation", "translation"}
        How camera 2 is moved.
    parallax : float, optional
        The parallax that the length of the translation is adjusted to, from 0 to 1.
    max_angle : float, optional
        The largest angle of the rotation in radians; 2 pi where absent, 30 degrees for ``view="in-both-images"``.
    view : {"everywhere", "in-both-images"}
        Whether a point may lie behind camera 2 or outside of the image, as in section 9.
    noise_px : float
        Standard deviation of the noise of every pixel coordinate, with the camera (60).
    rounded : bool
        Whether pixels are rounded to whole numbers after the noise.
    points_box : array_like of shape (3, 2)
        The least and the largest x, y and z of a point in the frame of camera 1. The paper does not give its size.
    translation_box : array_like of shape (3,)
        The largest absolute x, y and z of a translation.
    seed, index : int
        The scene number ``index`` of the sequence ``seed``.

    Returns
    -------
    Scene

    Raises
    ------
    QuestError
        For impossible options.
    ShapeMismatch
        For boxes of another shape.
    """
    boxes = (_numbers("points_box", points_box, (3, 2)), _numbers("translation_box", translation_box, (3,)))
    drawn = _scene(points, layout, motion, parallax, max_angle, view, noise_px, rounded, boxes, seed, index)
    x1, x2, R, t, X1 = drawn
    return Scene(x1, x2, R, np.array(t), X1)


def _numbers(name: str, given: ArrayLike, shape: tuple[int, ...]) -> list[object]:
    from quest_pose._core import ShapeMismatch

    array = np.asarray(given, np.float64)
    if array.shape != shape:
        raise ShapeMismatch(f"{name} has the shape {array.shape}, expected {shape}")
    numbers: list[object] = array.tolist()
    return numbers
