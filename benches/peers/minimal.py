"""The same five-point problems through PoseLib, OpenCV, pycolmap, kornia-3d and our solvers: one table.

    pip install -r benches/peers/requirements.txt          # and ./crates/quest-py, for the rows of our own wrapper
    python benches/peers/minimal.py [--scenes 1000] [--rounds 10] [--kornia]

Scenes are realistic: rotations up to 30 degrees, all points in front of both cameras and inside both images. Errors
are the metrics (61) and (62) of the paper, in radians, of the candidate closest to the truth; of essential matrices
all four poses count. Compare like with like: libraries that return real solutions beside "exact" rows, one that
returns a single pose with nothing. Times are means over the problems, each in its fastest round, on one thread, with
the wrapper's own time in them; the second table says how long the cheapest call through each wrapper takes.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import poselib
import pycolmap

try:
    import quest_pose as qp
except ImportError:
    qp = None
    print("skipped: quest_pose is not installed, its wrapper is not timed")

ROOT = Path(__file__).resolve().parents[2]
Poses = list[tuple[np.ndarray, np.ndarray]]


def problems(scenes: int, kornia: bool) -> dict:
    features = ["--features", "peers"] if kornia else []
    command = ["cargo", "run", "--quiet", "--release", "-p", "quest-benches", *features, "--bin", "peer_problems"]
    command += ["--", "--scenes", str(scenes)]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout)


def rotation_matrix(q: list[float]) -> np.ndarray:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def half_angle(r: np.ndarray, r_est: np.ndarray) -> float:
    """(61), from the chord: |R - R_est| = 2 sqrt(2) sin of half the angle."""
    return float(np.arcsin(min(np.linalg.norm(r - r_est) / np.sqrt(8), 1.0)))


def between(t: np.ndarray, t_est: np.ndarray) -> float:
    """(62), whatever the signs; zero where the true translation vanishes."""
    if np.linalg.norm(t) == 0:
        return 0.0
    return float(np.arctan2(np.linalg.norm(np.cross(t, t_est)), abs(t @ t_est)))


def decomposed(matrices: list[np.ndarray]) -> Poses:
    poses = []
    for e in matrices:
        r1, r2, t = cv2.decomposeEssentialMat(np.ascontiguousarray(e))
        poses += [(r1, t.ravel()), (r2, t.ravel())]
    return poses


class Peer:
    """A call that is timed, and what makes poses of its result, which is not."""

    def __init__(self, name: str, prepare: Callable, call: Callable, poses: Callable[[object], Poses]):
        self.name, self.prepare, self.call, self.poses = name, prepare, call, poses


CAMERA = pycolmap.Camera(model="PINHOLE", width=1024, height=768, params=[1060, 1060, 514, 384])
ONE_SAMPLE = pycolmap.RANSACOptions(min_num_trials=1, max_num_trials=1)


def pixels(x: np.ndarray) -> np.ndarray:
    return x * 1060 + np.array([514.0, 384.0])


def opencv_matrices(found: tuple) -> list[np.ndarray]:
    return [] if found[0] is None else [found[0][k : k + 3] for k in range(0, len(found[0]), 3)]


def homogeneous(x: np.ndarray) -> np.ndarray:
    return np.c_[x, np.ones(len(x))]


def peers() -> list[Peer]:
    unchanged = lambda x1, x2: (x1, x2)
    in_space = lambda x1, x2: (homogeneous(x1), homogeneous(x2))
    in_pixels = lambda x1, x2: (pixels(x1), pixels(x2))
    pose = lambda p: (np.asarray(p.R), np.asarray(p.t))
    of_colmap = lambda f: [] if f is None else [(f["cam2_from_cam1"].rotation.matrix(), f["cam2_from_cam1"].translation)]
    found = [
        Peer("PoseLib essential_matrix_5pt", in_space, poselib.essential_matrix_5pt, decomposed),
        Peer("PoseLib relpose_5pt (in front)", in_space, poselib.relpose_5pt, lambda f: [pose(p) for p in f]),
        Peer(
            "OpenCV findEssentialMat, 5 points",
            unchanged,
            # One sample is all there is.
            lambda x1, x2: cv2.findEssentialMat(x1, x2, np.eye(3), method=cv2.RANSAC, threshold=1e-3, maxIters=1),
            lambda f: decomposed(opencv_matrices(f)),
        ),
        Peer(
            "pycolmap estimate_essential_matrix (one pose)",
            in_pixels,
            lambda x1, x2: pycolmap.estimate_essential_matrix(x1, x2, CAMERA, CAMERA, ONE_SAMPLE),
            of_colmap,
        ),
    ]
    if qp is not None:
        found.append(Peer("quest_pose.solve (Python)", unchanged, lambda x1, x2: qp.solve(x1, x2), lambda f: [pose(c) for c in f]))
    return found


def fastest(calls: list[Callable[[], object]], rounds: int) -> float:
    """Microseconds a call: the mean over the calls, of each its fastest round, so that a busy machine matters little."""
    best = [float("inf")] * len(calls)
    for _ in range(rounds):
        for k, call in enumerate(calls):
            start = time.perf_counter()
            call()
            best[k] = min(best[k], time.perf_counter() - start)
    return 1e6 * sum(best) / len(calls)


def judged(peer: Peer, kind: list[dict], rounds: int) -> dict:
    rotations, translations, candidates = [], [], 0
    inputs = [peer.prepare(np.array(p["x1"]), np.array(p["x2"])) for p in kind]
    for problem, arguments in zip(kind, inputs):
        truth, t = rotation_matrix(problem["q_21"]), np.array(problem["t_21"])
        poses = peer.poses(peer.call(*arguments))
        poses = [(r, t_est) for r, t_est in poses if np.isfinite(r).all() and np.isfinite(t_est).all()]
        candidates += len(poses)
        if poses:
            rotations.append(min(half_angle(truth, r) for r, _ in poses))
            translations.append(min(between(t, t_est) for _, t_est in poses))
    return {
        "name": peer.name,
        "rotation": float(np.mean(rotations)) if rotations else float("nan"),
        "translation": float(np.mean(translations)) if translations else float("nan"),
        "unanswered": len(kind) - len(rotations),
        "candidates": candidates / len(kind),
        "time_us": fastest([lambda a=a: peer.call(*a) for a in inputs], rounds),
    }


def overheads(rounds: int) -> list[tuple[str, float]]:
    """The cheapest call through each wrapper with arrays as in the table: what a call costs before it solves."""
    x = np.random.default_rng(0).uniform(-0.4, 0.4, (5, 2))
    few = homogeneous(x)[:3]
    rigid = pycolmap.Rigid3d()
    calls = [
        ("PoseLib relpose_upright_3pt", lambda: poselib.relpose_upright_3pt(few, few)),
        ("OpenCV convertPointsToHomogeneous", lambda: cv2.convertPointsToHomogeneous(x)),
        ("pycolmap essential_matrix_from_pose", lambda: pycolmap.essential_matrix_from_pose(rigid)),
    ]
    if qp is not None:
        camera = qp.Camera("PINHOLE", [1.0, 1.0, 0.0, 0.0])
        calls.append(("quest_pose Camera.bearing", lambda: camera.bearing(x)))
    return [(name, fastest([call] * 1000, rounds)) for name, call in calls]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--kornia", action="store_true", help="with kornia-3d, which is a hundred crates to build")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    data = problems(arguments.scenes, arguments.kornia)
    print(f"{arguments.scenes} realistic scenes of a kind, seed {data['seed']}")
    print(f"poselib {poselib_version()}, opencv {cv2.__version__}, pycolmap {pycolmap.__version__}")
    for kind in data["kinds"]:
        print(f"\n### {kind['name']}\n")
        print("| | rotation, rad | translation, rad | µs | poses | no pose |\n|---|---:|---:|---:|---:|---:|")
        rows = kind["rows"] + [judged(peer, kind["problems"], arguments.rounds) for peer in peers()]
        for row in rows:
            errors = " | ".join("–" if row[k] is None else f"{row[k]:.2e}" if row[k] < 1e-4 else f"{row[k]:.4f}" for k in ("rotation", "translation"))
            print(f"| {row['name']} | {errors} | {row['time_us']:.1f} | {row['candidates']:.1f} | {row['unanswered']} |")
    print("\n### The cheapest call through each wrapper\n\n| | µs |\n|---|---:|")
    for name, time_us in overheads(arguments.rounds):
        print(f"| {name} | {time_us:.2f} |")


def poselib_version() -> str:
    from importlib.metadata import version

    return version("poselib")


if __name__ == "__main__":
    main()
