"""Features for servoing: detected in an image, chosen so that they cover it, matched by their descriptors.

NumPy does the matching, so that a detector of the user's own needs no OpenCV.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quest_pose._core import QuestError, ShapeMismatch

Image: TypeAlias = NDArray[np.uint8]
Detected: TypeAlias = tuple[ArrayLike, ArrayLike]
Detector: TypeAlias = Callable[[Image], Detected]

NOISE = {"sift": 0.5, "orb": 1.0}
"""Standard deviation of a matched coordinate in pixels: the order of size on rendered scenes."""

REFINED_NOISE = 0.5
"""The same of refined ones: 0.05 px in the median there, but 0.4 to 0.7 px in a tenth of them where the view differs much."""

APART = 3.0
"""Keypoints closer than so many pixels are one place: neighbouring levels of a pyramid find a corner twice."""

RIVALS = 8
"""So many nearest descriptors are looked at for one at another place."""

REACH = 4.0
"""A refined match is not further than so many pixels from where it was: tracks drift by 1 to 3."""

WINDOW = 15
"""The width in pixels of the patches that are compared, that of OpenCV's examples; 11 to 21 were not tried."""

CELLS = (8, 6)
"""The features are spread over so many cells of the image."""


def opencv(wanted: str) -> Any:
    """The module cv2, which ``wanted`` needs.

    Raises
    ------
    ImportError
        Where OpenCV is not installed, with the way out.
    """
    try:
        return importlib.import_module("cv2")
    except ImportError as error:
        raise ImportError(
            f"{wanted} needs OpenCV, which is not installed: pip install opencv-python-headless, or give a callable "
            "that returns points and descriptors as detector"
        ) from error


def grey(name: str, image: ArrayLike) -> Image:
    """The image as (height, width) bytes, from grey, (height, width, 1), BGR or BGRA.

    Raises
    ------
    QuestError
        For other types than uint8.
    ShapeMismatch
        For other shapes.
    """
    pixels = np.asarray(image)
    if pixels.dtype != np.uint8:
        raise QuestError(f"{name} is an array of {pixels.dtype}, expected an image of uint8")
    if pixels.ndim == 3 and pixels.shape[2] in (3, 4):
        # The weights of ITU-R BT.601, as OpenCV's BGR2GRAY.
        pixels = (pixels[..., :3] @ np.array([0.114, 0.587, 0.299]) + 0.5).astype(np.uint8)
    elif pixels.ndim == 3 and pixels.shape[2] == 1:
        pixels = pixels[..., 0]
    if pixels.ndim != 2 or 0 in pixels.shape:
        raise ShapeMismatch(
            f"{name} has the shape {pixels.shape}, expected (height, width), or (height, width, 3) as BGR"
        )
    return np.ascontiguousarray(pixels)


def detector(which: str | Detector, most: int) -> Detector:
    """The detector of that name with about ``most`` features an image, or the user's own."""
    if callable(which):
        return which
    if which not in NOISE:
        raise QuestError(f'detector is {which!r}, expected "sift", "orb", or a callable')
    cv2 = opencv(f"the detector {which!r}")
    made = cv2.SIFT_create(nfeatures=most) if which == "sift" else cv2.ORB_create(nfeatures=most, fastThreshold=10)

    def detect(image: Image) -> Detected:
        keypoints, descriptors = made.detectAndCompute(image, None)
        points = np.array([k.pt for k in keypoints], float).reshape(-1, 2)
        return points, np.zeros((0, 1), np.float32) if descriptors is None else descriptors

    return detect


def detect(detector: Detector, image: Image, mask: NDArray[np.bool_] | None) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """The points (M, 2) and the descriptors (M, D) in an image, strongest first where the detector says so.

    Raises
    ------
    ShapeMismatch
        Where a user's detector returns something else.
    """
    found = detector(image)
    points, descriptors = (np.asarray(part) for part in found)
    points = points.reshape(-1, 2).astype(float)
    if descriptors.ndim != 2 or len(descriptors) != len(points):
        raise ShapeMismatch(
            f"detector returned {len(points)} points and descriptors of the shape {descriptors.shape}, "
            "expected one row of descriptors a point"
        )
    height, width = image.shape
    column, row = np.round(points).astype(int).T if len(points) else np.zeros((2, 0), int)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    if mask is not None:
        inside[inside] = mask[row[inside], column[inside]]
    return points[inside], descriptors[inside]


def spread(points: NDArray[np.float64], shape: tuple[int, ...], most: int) -> NDArray[np.intp]:
    """Which ``most`` of the points to keep so that they cover the image: the first of every cell, then the second."""
    columns, rows = CELLS
    cell = (points * [columns, rows] // [shape[1], shape[0]]).astype(int) @ [1, columns]
    rank = np.zeros(len(points), int)
    for number in np.unique(cell):
        members = np.flatnonzero(cell == number)
        rank[members] = np.arange(len(members))
    return np.sort(np.argsort(rank, kind="stable")[:most])


def comparable(descriptors: NDArray[Any]) -> NDArray[np.float32]:
    """Descriptors whose scalar products say how alike they are: bits become 1 and -1."""
    if descriptors.dtype == np.uint8:
        return 2 * np.unpackbits(descriptors, axis=1).astype(np.float32) - 1
    return descriptors.astype(np.float32)


def distances(a: NDArray[np.float32], b: NDArray[np.float32], binary: bool) -> NDArray[np.float32]:
    """(N, M): Hamming distances of binary descriptors, Euclidean ones of others."""
    products = a @ b.T
    if binary:
        return np.asarray((a.shape[1] - products) / 2, np.float32)
    squares = (a * a).sum(1)[:, None] + (b * b).sum(1) - 2 * products
    return np.asarray(np.sqrt(np.maximum(squares, 0)), np.float32)


def pairs(
    between: NDArray[np.float32], place: NDArray[np.intp], points: NDArray[np.float64], ratio: float
) -> NDArray[np.intp]:
    """The image's keypoint for each place of the goal, -1 where there is none.

    A match is mutual, and closer by ``ratio`` than the nearest keypoint at another place of the image.

    Parameters
    ----------
    between
        (D, M): the distances from the goal's descriptors to the image's.
    place
        (D,): the place of each of the goal's descriptors.
    points
        (M, 2): where the image's keypoints are.
    ratio
        The largest ratio of both distances.
    """
    matched = np.full(int(place.max()) + 1, -1)
    few = min(RIVALS, between.shape[1])
    if few < 2:
        return matched
    near = np.argpartition(between, few - 1, axis=1)[:, :few]
    near = np.take_along_axis(near, np.argsort(np.take_along_axis(between, near, 1), axis=1), 1)
    distance = np.take_along_axis(between, near, 1)
    best = near[:, 0]
    elsewhere = np.linalg.norm(points[near] - points[best][:, None], axis=2) > APART
    # Where all of them are at one place the rival is at least as far as the last.
    rival = np.where(elsewhere, distance, np.inf).min(axis=1)
    rival = np.where(np.isinf(rival), distance[:, -1], rival)
    is_mutual = place[between.argmin(axis=0)[best]] == place
    good = np.flatnonzero(is_mutual & (distance[:, 0] < ratio * rival))
    good = good[np.argsort(-distance[good, 0], kind="stable")]  # the closest of a place is written last
    matched[place[good]] = best[good]
    return matched


def refined(
    goal: Image, points: NDArray[np.float64], image: Image, rows: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Matches moved to where the goal's patches are in the image, and which of them were found there.

    1. The homography that most matches agree on takes the goal image to about the view of the other one.
    2. From there the patch of each feature is aligned with the image (Lucas and Kanade), starting at its match.

    The patches are the goal's own, so that an error of a track does not grow from image to image.
    """
    cv2 = opencv("refine")
    found = np.zeros(len(rows), bool)
    seen = np.flatnonzero(np.isfinite(rows).all(axis=1))
    # A homography needs four; six are the fewest that a loop acts on.
    if len(seen) < 6:
        return rows, found
    homography, _ = cv2.findHomography(points[seen], rows[seen], cv2.RANSAC, 6.0)
    if homography is None:
        return rows, found
    height, width = image.shape
    view = cv2.warpPerspective(goal, homography, (width, height), borderMode=cv2.BORDER_REPLICATE)
    there = cv2.perspectiveTransform(points[seen, None], homography).astype(np.float32)
    began = rows[seen, None].astype(np.float32)
    ends = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 20, 0.01)
    now, status, _ = cv2.calcOpticalFlowPyrLK(
        view,
        image,
        there,
        began.copy(),
        winSize=(WINDOW, WINDOW),
        maxLevel=0,
        criteria=ends,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    moved = now[:, 0].astype(float)
    with np.errstate(invalid="ignore"):
        is_near = np.linalg.norm(moved - rows[seen], axis=1) < REACH
    good = (status.ravel() == 1) & is_near
    result = rows.copy()
    result[seen[good]] = moved[good]
    found[seen[good]] = True
    return result, found
