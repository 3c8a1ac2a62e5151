"""COLMAP databases of planted scenes: keypoints with noise, matches with false ones, poses that are known. Needs pycolmap.

A scene is a cloud of points, a plane, or nothing that two images share. Cameras stand on three quarters of a circle and look at its
middle. Two images match where they see the same point, each time with a probability; the false matches pair keypoints at random.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pycolmap

WIDTH, HEIGHT = 1280, 960
PARAMS = {
    "OPENCV": [1000, 1005, 640, 480, -0.05, 0.02, 1e-4, -2e-4],
    "PINHOLE": [1000, 1005, 640, 480],
}
NOISE_PX, CLUTTER, MOST_MATCHES, PART_MATCHED = 0.7, 300, 500, 0.6

Pose = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Scene:
    """What is planted."""

    images: int
    false_part: float
    points: int = 6000
    keypoints: int = 1500
    model: str = "OPENCV"
    turned: int = 0
    """Further images from the places of others, turned only."""
    flat: bool = False
    prior: bool = True
    """Whether the focal length is known; else COLMAP's guess stands in the database."""


SETS = {
    "orbit": Scene(30, 0.4),
    "hard": Scene(20, 0.7),
    "rotation": Scene(16, 0.4, turned=6),
    "plane": Scene(12, 0.3, points=2500, keypoints=800, model="PINHOLE", flat=True),
    "uncalibrated": Scene(16, 0.4, prior=False),
}


def looking_at(centre: np.ndarray, target: np.ndarray) -> Pose:
    """The pose (camera from world) of a camera that looks at a point, with the horizon level."""
    z = (target - centre) / np.linalg.norm(target - centre)
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(z, x), z])
    return R, -R @ centre


def poses_of(scene: Scene, rng: np.random.Generator) -> list[Pose]:
    poses = []
    for i in range(scene.images):
        angle = 1.5 * np.pi * i / scene.images
        centre = np.array([9 * np.cos(angle), 9 * np.sin(angle), 1.5 + rng.normal(0, 0.4)])
        poses.append(looking_at(centre, rng.normal(0, 0.4, 3)))
    for k in range(scene.turned):
        R, t = poses[3 * k]
        poses.append(looking_at(-R.T @ t, rng.normal(0, 1.2, 3)))
    return poses


def false_matches(rng: np.random.Generator, true: np.ndarray, part: float, sizes: list[int]) -> np.ndarray:
    """The true matches among false ones, each keypoint once, in random order."""
    count = max(40, round(len(true) * part / (1 - part)))
    false = np.column_stack([rng.integers(0, size, count) for size in sizes])
    both = np.concatenate([true, false])
    for view in (0, 1):
        both = both[np.sort(np.unique(both[:, view], return_index=True)[1])]
    return rng.permutation(both).astype(np.uint32)


class Writer:
    """A new database with one camera."""

    def __init__(self, path: Path, model: str, params: list[float], prior: bool) -> None:
        path.unlink(missing_ok=True)
        self.db = pycolmap.Database.open(path)
        self.camera = pycolmap.Camera(model=model, width=WIDTH, height=HEIGHT, params=params)
        self.camera.has_prior_focal_length = prior
        self.camera.camera_id = self.db.write_camera(self.camera)
        rig = pycolmap.Rig()
        rig.add_ref_sensor(self.camera.sensor_id)
        self.rig = self.db.write_rig(rig)

    def image(self, name: str, keypoints: np.ndarray) -> int:
        image = self.db.write_image(pycolmap.Image(name=name, camera_id=self.camera.camera_id))
        frame = pycolmap.Frame()
        frame.rig_id = self.rig
        frame.add_data_id(pycolmap.data_t(self.camera.sensor_id, image))
        self.db.write_frame(frame)
        self.db.write_keypoints(image, keypoints.astype(np.float32))
        return image


def plant(path: Path, scene: Scene, seed: int) -> dict[int, Pose]:
    """Writes the database of a scene; the true poses by the numbers of the images."""
    rng = np.random.default_rng(seed)
    params: list[float] = list(PARAMS[scene.model])
    truth = pycolmap.Camera(model=scene.model, width=WIDTH, height=HEIGHT, params=params)
    if not scene.prior:
        params[:2] = [1.2 * max(WIDTH, HEIGHT)] * 2  # COLMAP's guess without EXIF
    writer = Writer(path, scene.model, params, scene.prior)
    X = rng.uniform(-1, 1, (scene.points, 3)) * [3, 3, 0 if scene.flat else 2]
    poses = poses_of(scene, rng)
    images, seen = [], []
    for i, (R, t) in enumerate(poses):
        Xc = X @ R.T + t
        centre = -R.T @ t
        # Points on the far side are hidden by the others.
        is_near = scene.flat | (X @ (centre / np.linalg.norm(centre)) > -0.8)
        u = np.full((len(X), 2), -1.0)
        is_front = Xc[:, 2] > 0.1
        u[is_front] = truth.img_from_cam(Xc[is_front])
        is_seen = is_front & is_near & (u > 0).all(1) & (u < [WIDTH, HEIGHT]).all(1)
        points = rng.permutation(np.flatnonzero(is_seen))[: scene.keypoints]
        clutter = rng.uniform(0, 1, (CLUTTER, 2)) * [WIDTH, HEIGHT]
        keypoints = np.concatenate([u[points] + rng.normal(0, NOISE_PX, (len(points), 2)), clutter])
        images.append(writer.image(f"{i:03d}.jpg", keypoints))
        seen.append(points)
    for i in range(len(images)):
        for j in range(i + 1, len(images)):
            _, a, b = np.intersect1d(seen[i], seen[j], return_indices=True)
            both = np.column_stack([a, b])
            both = both[rng.random(len(both)) < PART_MATCHED][:MOST_MATCHES]
            sizes = [len(seen[k]) + CLUTTER for k in (i, j)]
            matches = false_matches(rng, both, scene.false_part, sizes)
            writer.db.write_matches(images[i], images[j], matches)
    writer.db.close()
    return dict(zip(images, poses, strict=True))


def plant_apart(path: Path, seed: int, images: int = 20) -> None:
    """Images no two of which see the same thing: every match is false."""
    rng = np.random.default_rng(seed)
    writer = Writer(path, "PINHOLE", [1000, 1000, 640, 480], True)
    numbers = [
        writer.image(f"{i}.jpg", rng.uniform(0, 1, (1000, 2)) * [WIDTH, HEIGHT]) for i in range(images)
    ]
    for i in range(images):
        for j in range(i + 1, images):
            count = int(rng.choice([50, 150, 400]))
            matches = np.column_stack([rng.permutation(1000)[:count], rng.permutation(1000)[:count]])
            writer.db.write_matches(numbers[i], numbers[j], matches.astype(np.uint32))
    writer.db.close()


def photographs(path: Path, folder: Path) -> None:
    """The SIFT features and matches of a folder of photographs, as COLMAP finds them."""
    path.unlink(missing_ok=True)
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = "SIMPLE_RADIAL"
    pycolmap.extract_features(path, folder, camera_mode=pycolmap.CameraMode.SINGLE, reader_options=reader)
    pycolmap.match_exhaustive(path, verification_options=pycolmap.TwoViewGeometryOptions())
