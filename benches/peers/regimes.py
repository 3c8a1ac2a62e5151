"""PoseLib, and quest_pose.estimate where it is installed, with a camera that hardly moves.

    python benches/peers/regimes.py --scenes 100

500 and 2,000 matches with half a pixel of noise, half or none of them false; points 4 to 9 away; a translation in any direction that
moves a point at the mean depth by this many pixels. Thresholds of 1.25 and 2.5 pixels, PoseLib's confidence and iterations as they
are by default. Medians of the errors of the rotation and of the direction, in degrees. The table of `regimes` in Rust has the
same kinds of scenes with other random numbers.
"""

import argparse

import numpy as np
import poselib

try:
    import quest_pose as qp
except ImportError:
    qp = None

FOCAL, CENTRE, SIZE, NOISE = 1000.0, np.array([640.0, 480.0]), np.array([1280.0, 960.0]), 0.5
CAMERA = {"model": "PINHOLE", "width": 1280, "height": 960, "params": [FOCAL, FOCAL, *CENTRE]}


def scene(rng: np.random.Generator, matches: int, inliers: float, parallax: float) -> tuple[np.ndarray, ...]:
    t = rng.normal(size=3)
    t *= parallax * 6.5 / FOCAL / np.linalg.norm(t)
    w = rng.normal(size=3) * 0.02
    angle = np.linalg.norm(w)
    k = w / angle
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    R = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    count = round(matches * inliers)
    u1 = rng.uniform(0, SIZE, (4 * count, 2))
    points = np.c_[(u1 - CENTRE) / FOCAL, np.ones(len(u1))] * rng.uniform(4, 9, (len(u1), 1))
    moved = points @ R.T + t
    u2 = FOCAL * moved[:, :2] / moved[:, 2:] + CENTRE
    seen = np.flatnonzero(np.all((u2 > 0) & (u2 < SIZE), axis=1))[:count]
    u1, u2 = (u[seen] + NOISE * rng.normal(size=(count, 2)) for u in (u1, u2))
    false = [rng.uniform(0, SIZE, (matches - count, 2)) for _ in range(2)]
    return np.r_[u1, false[0]], np.r_[u2, false[1]], R, t


def errors(R: np.ndarray, t: np.ndarray, R_true: np.ndarray, t_true: np.ndarray) -> list[float]:
    turn = np.degrees(2 * np.arcsin(min(1.0, np.linalg.norm(R - R_true) / np.sqrt(8))))
    lengths = np.linalg.norm(t) * np.linalg.norm(t_true)
    direction = np.degrees(np.arccos(np.clip(t @ t_true / lengths, -1, 1))) if lengths > 0 else np.nan
    return [turn, direction]


def by_poselib(u1: np.ndarray, u2: np.ndarray, threshold: float) -> tuple[np.ndarray, np.ndarray]:
    pose, _ = poselib.estimate_relative_pose(u1, u2, CAMERA, CAMERA, {"max_epipolar_error": threshold}, {})
    return pose.R, pose.t


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=100, help="scenes of a row (100)")
    parser.add_argument("--seed", type=int, default=77, help="seed of the scenes (77)")
    parser.add_argument("--parallax", type=float, nargs="+", default=[1, 2, 3, 4, 6, 10], help="pixels")
    arguments = parser.parse_args()
    print("| matches, inliers, threshold | parallax | PoseLib rotation, direction | quest_pose |\n|---|---|---|---|")
    for matches, inliers, threshold in [(n, i, h) for n in (500, 2000) for i in (0.5, 1.0) for h in (1.25, 2.5)]:
        for parallax in arguments.parallax:
            found: dict[str, list[list[float]]] = {"poselib": [], "quest": []}
            for index in range(arguments.scenes):
                u1, u2, R, t = scene(np.random.default_rng([arguments.seed, index]), matches, inliers, parallax)
                found["poselib"].append(errors(*by_poselib(u1, u2, threshold), R, t))
                if qp is not None:
                    camera = qp.Camera(CAMERA["model"], CAMERA["params"])
                    est = qp.estimate(u1, u2, camera, threshold=threshold)
                    found["quest"].append(errors(est.R, est.t, R, t))
            cells = [
                "{:.4f}, {:.2f}".format(*np.median(each, axis=0)) if each else "-" for each in found.values()
            ]
            print(f"| {matches}, {inliers:.0%}, {threshold} | {parallax} px | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
