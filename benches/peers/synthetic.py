"""quest_pose.estimate beside PoseLib on planted poses among false matches.

    python benches/peers/synthetic.py

100, 500 and 2,000 matches with a pixel of noise, none to 90 % of them false; equal settings: a threshold of 1.5 pixels, a
confidence of 0.999, no smallest number of iterations and at most 10,000, one thread. PoseLib always answers, and so does
quest_pose here, unless a number of false alarms is given. A success is a pose within 5 degrees in rotation and translation. Times
are the processor's. A table in Markdown.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import poselib
import quest_pose as qp
from compare import FAILED, Pose, angle, auc

FOCAL, CENTRE, SIZE = 1060.0, np.array([514.0, 384.0]), np.array([1024, 768])
CAMERA = {"model": "PINHOLE", "width": 1024, "height": 768, "params": [FOCAL, FOCAL, *CENTRE]}
THRESHOLD, CONFIDENCE, MOST = 1.5, 0.999, 10_000
NOISE = 1.0


class Problem(NamedTuple):
    """Pixels of both views, and the true pose."""

    u1: np.ndarray
    u2: np.ndarray
    R: np.ndarray
    t: np.ndarray


def rotation(rng: np.random.Generator) -> np.ndarray:
    """About any axis by up to 30 degrees."""
    k = rng.normal(size=3)
    k /= np.linalg.norm(k)
    a = rng.uniform(0, np.pi / 6)
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(a) * cross + (1 - np.cos(a)) * cross @ cross


def pixels(points: np.ndarray) -> np.ndarray:
    return FOCAL * points[:, :2] / points[:, 2:] + CENTRE


def problem(matches: int, outliers: float, rng: np.random.Generator) -> Problem:
    """Points of a box in front of both cameras and inside both images; some matched with any place in view 2."""
    while True:
        R, t = rotation(rng), rng.uniform(-1, 1, 3)
        points = rng.uniform([-1, -1, 2], [1, 1, 4], (20 * matches, 3))
        moved = points @ R.T + t
        u1, u2 = pixels(points), pixels(moved)
        seen = (moved[:, 2] > 0) & np.all((u1 >= 0) & (u1 < SIZE) & (u2 >= 0) & (u2 < SIZE), axis=1)
        if seen.sum() >= matches:
            break
    u1, u2 = u1[seen][:matches], u2[seen][:matches]
    u1 = u1 + rng.normal(0, NOISE, u1.shape)
    u2 = u2 + rng.normal(0, NOISE, u2.shape)
    false = rng.permutation(matches) < round(outliers * matches)
    u2[false] = rng.uniform(0, SIZE, (false.sum(), 2))
    return Problem(u1, u2, R, t)


def with_quest(p: Problem, seed: int, max_false_alarms: float) -> Callable[[], Pose]:
    camera = qp.Camera("PINHOLE", CAMERA["params"])

    def run() -> Pose:
        try:
            found = qp.estimate(
                p.u1,
                p.u2,
                camera,
                threshold=THRESHOLD,
                confidence=CONFIDENCE,
                min_iterations=0,
                max_iterations=MOST,
                max_false_alarms=max_false_alarms,
                seed=seed,
            )
        except qp.QuestError:
            return None
        return found.R, found.t

    return run


def with_poselib(p: Problem, seed: int) -> Callable[[], Pose]:
    options = {
        "max_epipolar_error": THRESHOLD,
        "success_prob": CONFIDENCE,
        "min_iterations": 0,
        "max_iterations": MOST,
        "seed": seed,
    }

    def run() -> Pose:
        pose, _ = poselib.estimate_relative_pose(p.u1, p.u2, CAMERA, CAMERA, options, {})
        return pose.R, pose.t

    return run


def error(p: Problem, pose: Pose) -> float:
    if pose is None:
        return FAILED
    R, t = pose
    turned = angle((np.trace(R.T @ p.R) - 1) / 2)
    length = np.linalg.norm(t) * np.linalg.norm(p.t)
    return max(turned, angle(t @ p.t / length) if length > 0 else FAILED)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=2018)
    parser.add_argument("--matches", type=int, nargs="*", default=[100, 500, 2_000])
    parser.add_argument("--outliers", type=int, nargs="*", default=[0, 30, 50, 70, 80, 90], help="in per cent")
    parser.add_argument("--max-false-alarms", type=float, default=np.inf, help="of quest_pose")
    arguments = parser.parse_args()
    quest = partial(with_quest, max_false_alarms=arguments.max_false_alarms)
    estimators = {"quest_pose": quest, "PoseLib": with_poselib}
    columns = ["success", "AUC@5", "median ms", "mean ms"]
    print("| matches | outliers | " + " | ".join(f"{n} {c}" for n in estimators for c in columns) + " |")
    print("|---|---|" + "---|" * (len(columns) * len(estimators)))
    for matches in arguments.matches:
        for percent in arguments.outliers:
            cells = []
            errors: dict[str, list[float]] = {name: [] for name in estimators}
            times: dict[str, list[float]] = {name: [] for name in estimators}
            for index in range(arguments.scenes):
                rng = np.random.default_rng([arguments.seed, matches, percent, index])
                planted = problem(matches, percent / 100, rng)
                for name, estimator in estimators.items():
                    run = estimator(planted, index)
                    start = time.thread_time()
                    pose = run()
                    times[name].append(1e3 * (time.thread_time() - start))
                    errors[name].append(error(planted, pose))
            for name in estimators:
                e, t = np.array(errors[name]), np.array(times[name])
                success, area = 100 * np.mean(e < 5), auc(e, 5)
                cells += [f"{success:.1f} %", f"{area:.1f}", f"{np.median(t):.2f}", f"{t.mean():.2f}"]
            print(f"| {matches:,} | {percent} % | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
