"""``Estimate.plot``: matches over both images, and the uncertainty of the pose. Matplotlib is optional."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quest_pose._core import Estimate, ShapeMismatch

INLIER, OUTLIER = "#0a8f7c", "#d6203a"
# The square of the radius of 95 % of a normal distribution in two dimensions.
RADIUS2 = 5.991


def estimate(
    found: Estimate, x1: ArrayLike, x2: ArrayLike, image1: ArrayLike | None, image2: ArrayLike | None, figure: Any
) -> Any:
    """The figure of ``Estimate.plot``."""
    points = [_points(found, name, x) for name, x in (("x1", x1), ("x2", x2))]
    if figure is None:
        try:
            pyplot = importlib.import_module("matplotlib.pyplot")
        except ImportError as error:
            raise ImportError("plot needs matplotlib, which is not installed: pip install matplotlib") from error
        figure = pyplot.figure(figsize=(11, 6.5), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=[2, 1])
    for view, image in enumerate((image1, image2)):
        _matches(figure.add_subplot(grid[0, view]), view, points, found.inliers, image)
    degrees = np.degrees(1.0)
    for view, (pair, unit, axes_names) in enumerate(
        (([0, 1], degrees, ("rotation about x, °", "about y, °")), ([3, 5], 1.0, ("t along x", "along z")))
    ):
        axes = figure.add_subplot(grid[1, view])
        _ellipse(axes, unit**2 * found.covariance[np.ix_(pair, pair)])
        axes.set(title="95 % of the rotation" if view == 0 else "95 % of the translation")
        axes.set(xlabel=axes_names[0], ylabel=axes_names[1])
    angle = np.degrees(2 * np.arctan2(np.linalg.norm(found.quat_wxyz[1:]), found.quat_wxyz[0]))
    figure.suptitle(
        f"{found.model}: {found.inlier_count} of {len(found.inliers)} inliers, rotation {angle:.3f}°, |t| = {found.parallax:.4f}"
    )
    return figure


def _points(found: Estimate, name: str, given: ArrayLike) -> NDArray[np.float64]:
    points = np.asarray(given, float)
    if points.shape != (len(found.inliers), 2):
        raise ShapeMismatch(f"{name} has the shape {points.shape}, expected ({len(found.inliers)}, 2) as given to estimate")
    return points


def _matches(
    axes: Any, view: int, points: list[NDArray[np.float64]], inliers: NDArray[np.bool_], image: ArrayLike | None
) -> None:
    """Each point of one image, with a line to where it is in the other one."""
    here, there = points[view], points[1 - view]
    if image is not None:
        pixels = np.asarray(image)
        axes.imshow(pixels, cmap="gray" if pixels.ndim == 2 else None)
    for wanted, colour, name in ((True, INLIER, "inlier"), (False, OUTLIER, "outlier")):
        chosen = inliers == wanted
        if chosen.any():
            ends = np.stack([here[chosen], there[chosen]])
            axes.plot(*np.moveaxis(ends, 2, 0), color=colour, alpha=0.45, linewidth=0.8)
            axes.plot(*here[chosen].T, ".", color=colour, markersize=4, label=f"{chosen.sum()} {name}s")
    if image is None:
        # As pixels lie: v runs down.
        axes.invert_yaxis()
    axes.set(title=f"image {view + 1}", aspect="equal")
    if view == 0 and len(inliers):
        axes.legend(loc="upper right", fontsize="small")


def _ellipse(axes: Any, covariance: NDArray[np.float64]) -> None:
    values, vectors = np.linalg.eigh(covariance)
    turn = np.linspace(0, 2 * np.pi, 181)
    circle = np.stack([np.cos(turn), np.sin(turn)])
    axes.plot(*(vectors @ (np.sqrt(RADIUS2 * np.maximum(values, 0))[:, None] * circle)), color=INLIER)
    axes.axhline(0, color="0.8", linewidth=0.8)
    axes.axvline(0, color="0.8", linewidth=0.8)
    axes.set_aspect("equal", adjustable="datalim")
