"""Matches of which few are true: recorded pairs diluted by false matches, and scenes with a second motion.

`sets()` names the cells; each makes `Problem`s from the recorded pairs or from a seed. A false match pairs the keypoints of two
matches that are drawn at random, each moved by six pixels, so that false matches crowd where the true ones do. A dense false
motion is a patch of 35 px around a keypoint that moves rigidly and on its own.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from compare import Case

MOST_MATCHES = 3_000
# Keypoints that are paired anew move by so many pixels; a point of a moving patch by so many.
JITTER, NOISE, PATCH = 6.0, 0.5, 35.0
FOCAL, CENTRE, SIZE = 1060.0, np.array([512.0, 384.0]), np.array([1024.0, 768.0])
PINHOLE = {"model": "PINHOLE", "width": 1024, "height": 768, "params": [FOCAL, FOCAL, *CENTRE]}


class Problem(NamedTuple):
    """Pixels `(u1, v1, u2, v2)` with the valid poses: of a rotation in place only R counts; none where all is false."""

    name: str
    source: str
    cameras: tuple[dict[str, Any], dict[str, Any]]
    matches: np.ndarray
    references: list[tuple[np.ndarray, np.ndarray]]
    rotation_only: bool = False


def turn(rng: np.random.Generator, degrees: float) -> np.ndarray:
    """A rotation about any axis by up to so many degrees."""
    k = rng.normal(size=3)
    k /= np.linalg.norm(k)
    a = np.radians(rng.uniform(0, degrees))
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(a) * cross + (1 - np.cos(a)) * cross @ cross


def rays(camera: dict[str, Any], pixels: np.ndarray) -> np.ndarray:
    fx, fy, cx, cy = camera["params"]
    return np.column_stack([(pixels[:, 0] - cx) / fx, (pixels[:, 1] - cy) / fy, np.ones(len(pixels))])


def project(camera: dict[str, Any], points: np.ndarray) -> np.ndarray:
    fx, fy, cx, cy = camera["params"]
    return points[:, :2] / points[:, 2:] * [fx, fy] + [cx, cy]


def sampson(case: Case, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """In pixels of the mean focal length."""
    x1, x2 = rays(case.cameras[0], case.matches[:, :2]), rays(case.cameras[1], case.matches[:, 2:])
    cross = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])
    line2, line1 = x1 @ (cross @ R).T, x2 @ (cross @ R)
    gradient = np.sqrt((line2[:, :2] ** 2).sum(1) + (line1[:, :2] ** 2).sum(1))
    return np.abs((x2 * line2).sum(1)) / gradient * case.cameras[0]["params"][0]


def within(pixels: np.ndarray, camera: dict[str, Any]) -> np.ndarray:
    return np.clip(pixels, 0, [camera["width"] - 1, camera["height"] - 1])


def false_matches(case: Case, count: int, rng: np.random.Generator) -> np.ndarray:
    """Keypoints of both views paired at random."""
    one, two = rng.integers(len(case.matches), size=(2, count))
    moved = case.matches[one, :2], case.matches[two, 2:]
    moved = tuple(m + rng.normal(0, JITTER, m.shape) for m in moved)
    return np.hstack([within(m, c) for m, c in zip(moved, case.cameras, strict=True)])


def patch(case: Case, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points of a thing of 35 px that turns by up to 20° and moves by up to a quarter of its distance."""
    camera1, camera2 = case.cameras
    while True:
        centre = case.matches[rng.integers(len(case.matches)), :2]
        u1 = centre + rng.normal(0, PATCH, (count, 2))
        depth = 1 + 0.05 * rng.normal(size=count)
        middle = rays(camera1, centre[None])[0]
        points = (depth[:, None] * rays(camera1, u1) - middle) @ turn(rng, 20).T + middle
        points = points + rng.uniform(-0.25, 0.25, 3)
        if points[:, 2].min() < 0.2:
            continue
        u2 = project(camera2, points)
        if (np.abs(u2.mean(0) / [camera2["width"], camera2["height"]] - 0.5) < 0.5).all():
            return np.hstack([u1, u2]) + rng.normal(0, NOISE, (count, 4))


def true_matches(case: Case, known: int, limit: int, rng: np.random.Generator) -> np.ndarray:
    """Of the matches that agree best with a reference, as many as are known to be true, at most `limit`."""
    errors = np.min([sampson(case, R, t / np.linalg.norm(t)) for R, t in case.references], axis=0)
    nearest = np.argsort(errors, kind="stable")[:known]
    return case.matches[rng.permutation(nearest)[:limit]]


def diluted(case: Case, known: int, true: float, moving: float, rng: np.random.Generator) -> Problem:
    """A recorded pair of which the share `true` is left, and the share `moving` is a dense false motion."""
    kept = true_matches(case, known, round(true * MOST_MATCHES), rng)
    count = round(len(kept) / true)
    dense = round(moving * count)
    parts = [kept, false_matches(case, count - len(kept) - dense, rng)]
    if dense:
        parts.append(patch(case, dense, rng))
    matches = rng.permutation(np.vstack(parts))
    return Problem(case.name, case.source, case.cameras, matches, case.references, case.rotation_only)


def planted(count: int, shares: dict[str, float], rng: np.random.Generator) -> Problem:
    """A planted pose: shares of points at `depth`s of their own or on a `smooth` surface or `plane`, of a `moving` part or a
    `dense` one, of a `shift`ed texture; the others are false."""
    R, t = turn(rng, 15), rng.normal(size=3) * [1, 1, 0.4]
    t *= 0.5 / np.linalg.norm(t)
    waves = rng.uniform(0.5, 2, (2, 2)), rng.uniform(0, 6, 2)

    def moved(u1: np.ndarray, depth: np.ndarray, R: np.ndarray, t: np.ndarray) -> np.ndarray:
        return project(PINHOLE, (depth[:, None] * rays(PINHOLE, u1)) @ R.T + t)

    def surface(kind: str, u1: np.ndarray) -> np.ndarray:
        x = rays(PINHOLE, u1)[:, :2]
        if kind == "depth":
            return rng.uniform(3, 8, len(u1))
        if kind == "plane":
            return 5 / (1 + x @ np.array([0.3, -0.2]))
        return 5 + 0.8 * np.sin(2 * x @ waves[0] + waves[1]).sum(1)

    parts = []
    for kind, share in shares.items():
        n = round(share * count)
        other = rng.normal(size=3) * [1, 1, 0.4]
        R_other, t_other = turn(rng, 15), 0.5 * other / np.linalg.norm(other)
        middle, shift = rng.uniform(150, SIZE - 150), rng.uniform(40, 120) * np.array([1.0, 0.3])
        found = np.empty((0, 4))
        # Until as many are inside both images.
        for _ in range(100):
            u1 = middle + rng.normal(0, PATCH, (n, 2)) if kind == "dense" else rng.uniform(0, SIZE, (n, 2))
            if kind in ("depth", "smooth", "plane"):
                u2 = moved(u1, surface(kind, u1), R, t)
            elif kind == "shift":
                u2 = moved(u1, surface("smooth", u1), R, t) + shift
            else:
                u2 = moved(u1, surface("smooth", u1), R_other, t_other)
            both = np.hstack([u1, u2]) + rng.normal(0, NOISE, (n, 4))
            inside = ((both > 0) & (both < np.tile(SIZE, 2))).all(1)
            found = np.vstack([found, both[inside]])
            if len(found) >= n:
                break
        parts.append(found[:n])
    true = np.vstack(parts)
    parts = [true, np.hstack(rng.uniform(0, SIZE, (2, count - len(true), 2)))]
    return Problem("planted", "planted", (PINHOLE, PINHOLE), rng.permutation(np.vstack(parts)), [(R, t)])


def noise(count: int, rng: np.random.Generator) -> Problem:
    """False matches alone."""
    matches = np.hstack(rng.uniform(0, SIZE, (2, count, 2)))
    return Problem("noise", "noise", (PINHOLE, PINHOLE), matches, [])


DILUTIONS = {f"{100 * true:.0f} %": (true, 0.0) for true in (0.10, 0.05, 0.03)}
DENSE = {
    f"{100 * true:.0f} / {100 * moving:.0f} dense": (true, moving)
    for true, moving in ((0.45, 0.40), (0.30, 0.25), (0.25, 0.10), (0.20, 0.15), (0.10, 0.07))
}
PLANTED: dict[str, dict[str, float]] = {
    "moving object 40, true 45": {"smooth": 0.45, "moving": 0.40},
    "the same, depths at random": {"depth": 0.45, "moving": 0.40},
    "repetition 40, true 45": {"smooth": 0.45, "shift": 0.40},
    "the same, depths at random ": {"depth": 0.45, "shift": 0.40},
    "second plane 40, true 45": {"plane": 0.45, "moving": 0.40},
    "dense 40, true 45": {"smooth": 0.45, "dense": 0.40},
    "dense 40, true 45, depths at random": {"depth": 0.45, "dense": 0.40},
    "dense 25, true 30": {"smooth": 0.30, "dense": 0.25},
    "dense 25, true 30, depths at random": {"depth": 0.30, "dense": 0.25},
    "dense 10, true 25, depths at random": {"depth": 0.25, "dense": 0.10},
    "dense 15, true 20": {"smooth": 0.20, "dense": 0.15},
    "dense 15, true 20, depths at random": {"depth": 0.20, "dense": 0.15},
    "dense 7, true 10": {"smooth": 0.10, "dense": 0.07},
    "moving 6, true 15, depths at random": {"depth": 0.15, "moving": 0.06},
    "plane 20, off it 5": {"plane": 0.20, "depth": 0.05},
}
NOISE_ONLY = {"noise, 100 matches": 100, "noise, 300 matches": 300}


def sets(
    cases: list[Case], known: dict[str, int], scenes: int, seed: int, only: str
) -> dict[str, list[Callable[[], Problem]]]:
    """The problems of each cell whose name contains `only`."""

    def generator(name: str, index: int) -> np.random.Generator:
        return np.random.default_rng([seed, *name.encode(), index])

    cells: dict[str, list[Callable[[], Problem]]] = {}
    for name, (true, moving) in {**DILUTIONS, **DENSE}.items():
        cells[name] = [
            lambda c=case, i=index, n=name, s=true, m=moving: diluted(c, known[c.name], s, m, generator(n, i))
            for index, case in enumerate(cases)
        ]
    for name, shares in PLANTED.items():
        cells[name] = [lambda i=i, n=name, s=shares: planted(600, s, generator(n, i)) for i in range(scenes)]
    for name, count in NOISE_ONLY.items():
        cells[name] = [lambda i=i, n=name, c=count: noise(c, generator(n, i)) for i in range(scenes)]
    return {name: cell for name, cell in cells.items() if only in name}
