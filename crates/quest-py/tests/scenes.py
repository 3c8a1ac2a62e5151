"""Scenes with a known pose."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

K = np.array([[1060.0, 0.0, 514.0], [0.0, 1060.0, 384.0], [0.0, 0.0, 1.0]])


@dataclass
class Scene:
    """Points in front of two cameras, with X2 = R X1 + t and a mean depth of 1 over both views."""

    R: Array
    t: Array
    X1: Array
    X2: Array

    @property
    def x1(self) -> Array:
        return self.X1[:, :2] / self.X1[:, 2:]

    @property
    def x2(self) -> Array:
        return self.X2[:, :2] / self.X2[:, 2:]

    @property
    def u1(self) -> Array:
        return self.x1 * 1060.0 + [514.0, 384.0]

    @property
    def u2(self) -> Array:
        return self.x2 * 1060.0 + [514.0, 384.0]


def rotation(w: Array) -> Array:
    """The rotation by the vector w (Rodrigues)."""
    angle = np.linalg.norm(w)
    k = w / angle
    cross = np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def make_scene(seed: int, n: int = 5, planar: bool = False) -> Scene:
    rng = np.random.default_rng(seed)
    R, t = rotation(rng.uniform(-0.3, 0.3, 3)), rng.uniform(-1.0, 1.0, 3)
    X1 = rng.uniform(-1.0, 1.0, (n, 3)) + [0.0, 0.0, 4.0]
    if planar:
        X1[:, 2] = 4.0 + X1[:, :2] @ [0.3, -0.2]
    X2 = X1 @ R.T + t
    scale = np.mean([X1[:, 2], X2[:, 2]])
    return Scene(R, t / scale, X1 / scale, X2 / scale)
