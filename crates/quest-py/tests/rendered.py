"""Images of textured rectangles at several depths, painted from back to front: exact, and without a renderer."""

from typing import Any

import cv2
import numpy as np
import quest_pose as qp
from scenes import Array

WIDTH, HEIGHT = 320, 240
CAMERA = qp.Camera("PINHOLE", [290.0, 290.0, 159.5, 119.5], width=WIDTH, height=HEIGHT)
K = np.array([[290.0, 0.0, 159.5], [0.0, 290.0, 119.5], [0.0, 0.0, 1.0]])

# Pixels of texture on a metre, at least as many as the images have of it.
DENSITY = 400


def texture(seed: int, width: float, height: float) -> Any:
    """Rectangles and discs of random greys."""
    rng = np.random.default_rng(seed)
    shape = int(height * DENSITY), int(width * DENSITY)
    picture = np.full(shape, 128, np.uint8)
    for _ in range(int(800 * width * height)):
        u, v = (int(x) for x in rng.integers(0, shape[::-1]))
        a, b = (int(x) for x in rng.integers(6, 45, 2))
        tone = int(rng.integers(10, 245))
        if rng.random() < 0.6:
            cv2.rectangle(picture, (u, v), (u + a, v + b), (tone,), -1)
        else:
            cv2.circle(picture, (u, v), a // 2, (tone,), -1, cv2.LINE_AA)
    return picture


class World:
    """Rectangles across the optical axis of the goal's camera: (x, y, z) of the middle, width, height in metres."""

    def __init__(self, rectangles: list[tuple[float, float, float, float, float]], seed: int = 0) -> None:
        self.rectangles = sorted(rectangles, key=lambda r: -r[2])
        self.textures = [texture(10 * seed + k, r[3], r[4]) for k, r in enumerate(self.rectangles)]
        self.noise = np.random.default_rng(seed)

    def homography(self, k: int, R: Array, t: Array) -> Array:
        """From the pixels of texture ``k`` to those of a camera with X2 = R X1 + t."""
        x, y, z, width, height = self.rectangles[k]
        to_metres = np.array([[1 / DENSITY, 0, x - width / 2], [0, 1 / DENSITY, y - height / 2], [0, 0, 1]])
        at_depth = R @ np.array([[1, 0, 0], [0, 1, 0], [0, 0, z]]) + np.outer(t, [0, 0, 1])
        return np.asarray(K @ at_depth @ to_metres)

    def image(self, R: Array, t: Array, sigma: float = 2.0) -> Any:
        """What a camera with X2 = R X1 + t sees, with the noise of a sensor."""
        seen = np.full((HEIGHT, WIDTH), 90, np.uint8)
        for k, picture in enumerate(self.textures):
            H = self.homography(k, R, t)
            # The area of a pixel is averaged by a blur where the texture is finer than the image.
            warped = cv2.warpPerspective(cv2.GaussianBlur(picture, (3, 3), 0), H, (WIDTH, HEIGHT), flags=cv2.INTER_AREA)
            covers = cv2.warpPerspective(np.full_like(picture, 255), H, (WIDTH, HEIGHT), flags=cv2.INTER_NEAREST) > 0
            seen = np.where(covers, warped, seen)
        noisy = seen + self.noise.normal(0, sigma, seen.shape)
        return np.clip(noisy + 0.5, 0, 255).astype(np.uint8)


GENERAL = [
    (0.0, 0.0, 1.5, 3.0, 2.4),
    (-0.3, -0.15, 1.1, 0.35, 0.3),
    (0.3, 0.2, 0.9, 0.3, 0.3),
    (0.25, -0.2, 1.25, 0.3, 0.3),
    (-0.25, 0.2, 0.8, 0.25, 0.25),
]
PLANAR = [(0.0, 0.0, 1.0, 2.4, 2.0)]
