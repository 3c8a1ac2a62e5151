"""quest_pose beside PoseLib, OpenCV, pycolmap and others on recorded image pairs with reference poses.

    python benches/peers/compare.py ../shared/data

Every library gets the same shuffled matches and a threshold of one pixel, on one thread. An error is the larger of the
rotation's and the translation's angle to the reference (for rotations in place the rotation's alone; for scenes with several
valid poses the nearest). Two settings: each library's own defaults; and equal ones, a confidence of 0.999 without a smallest
number of iterations. A library that gives no pose is off by 180 degrees. Tables in Markdown.
"""

import argparse
import csv
import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import poselib
import pycolmap
import quest_pose as qp

AUC_AT = (1, 3, 5, 10, 20)
FAILED = 180.0
Pose = tuple[np.ndarray, np.ndarray] | None


class Case(NamedTuple):
    """One image pair."""

    name: str
    source: str
    grade: str
    rotation_only: bool
    cameras: tuple[dict[str, Any], dict[str, Any]]
    matches: np.ndarray
    references: list[tuple[np.ndarray, np.ndarray]]


def rotation(q: list[float]) -> np.ndarray:
    w, x, y, z = np.asarray(q) / np.linalg.norm(q)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def load(folder: Path) -> list[Case]:
    cases = []
    for entry in json.loads((folder / "manifest.json").read_text()):
        path = folder / "pairs" / f"{entry['name']}.json"
        if not path.exists():
            continue
        pair = json.loads(path.read_text())
        poses = [pair, *pair.get("alternatives", [])]
        cases.append(
            Case(
                entry["name"],
                entry["source"],
                entry["gt_grade"],
                entry["scene"] == "pure_rotation",
                (pair["camera1"], pair.get("camera2", pair["camera1"])),
                np.array(pair["matches"], dtype=float),
                [(rotation(p["q_21"]), np.array(p["t_21"])) for p in poses],
            )
        )
    return cases


def angle(cosine: float) -> float:
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def error(case: Case, pose: Pose) -> float:
    if pose is None:
        return FAILED
    R, t = pose
    errors = []
    for R_true, t_true in case.references:
        turned = angle((np.trace(R.T @ R_true) - 1) / 2)
        length = np.linalg.norm(t) * np.linalg.norm(t_true)
        moved = 0.0 if case.rotation_only else angle(t @ t_true / length) if length > 0 else FAILED
        errors.append(max(turned, moved))
    return min(errors)


def k_of(camera: dict[str, Any]) -> np.ndarray:
    fx, fy, cx, cy = camera["params"]
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


# Each returns a function without arguments, so that only the estimate itself is timed.
Estimator = Callable[[Case, np.ndarray, int, bool], Callable[[], Pose]]


def with_quest(case: Case, matches: np.ndarray, seed: int, equal: bool) -> Callable[[], Pose]:
    cameras = [qp.Camera(c["model"], c["params"]) for c in case.cameras]
    x1, x2 = np.ascontiguousarray(matches[:, :2]), np.ascontiguousarray(matches[:, 2:])
    options: dict[str, Any] = {"confidence": 0.999, "min_iterations": 0} if equal else {}

    def run() -> Pose:
        try:
            found = qp.estimate(x1, x2, *cameras, threshold=1.0, seed=seed, **options)
        except qp.QuestError:
            return None
        return found.R, found.t

    return run


def with_poselib(
    case: Case, matches: np.ndarray, seed: int, equal: bool, threshold: float = 1.0
) -> Callable[[], Pose]:
    options: dict[str, Any] = {"max_epipolar_error": threshold, "seed": seed}
    if equal:
        options |= {"success_prob": 0.999, "min_iterations": 0}

    def run() -> Pose:
        pose, _ = poselib.estimate_relative_pose(matches[:, :2], matches[:, 2:], *case.cameras, options, {})
        return pose.R, pose.t

    return run


def with_opencv(case: Case, matches: np.ndarray, seed: int, equal: bool) -> Callable[[], Pose]:
    k1, k2 = (k_of(c) for c in case.cameras)
    mean = (k1[0, 0] + k1[1, 1] + k2[0, 0] + k2[1, 1]) / 4
    confidence, iterations = (0.999, 100_000) if equal else (0.999, 1_000)

    def run() -> Pose:
        # Points on the plane z = 1: the two cameras may differ.
        x1 = cv2.undistortPoints(matches[:, None, :2], k1, None)[:, 0]
        x2 = cv2.undistortPoints(matches[:, None, 2:], k2, None)[:, 0]
        cv2.setRNGSeed(seed)
        try:
            e, mask = cv2.findEssentialMat(
                x1, x2, np.eye(3), cv2.USAC_MAGSAC, confidence, 1.0 / mean, iterations
            )
            if e is None or e.shape != (3, 3):
                return None
            _, R, t, _ = cv2.recoverPose(e, x1, x2, np.eye(3), mask=mask)
        except cv2.error:
            return None
        return R, t[:, 0]

    return run


def with_pycolmap(case: Case, matches: np.ndarray, seed: int, equal: bool) -> Callable[[], Pose]:
    cameras = [
        pycolmap.Camera(model=c["model"], width=c["width"], height=c["height"], params=c["params"])
        for c in case.cameras
    ]
    options = pycolmap.RANSACOptions()
    options.max_error = 1.0
    options.random_seed = seed
    if equal:
        options.confidence = 0.999
        options.min_num_trials = 0

    def run() -> Pose:
        found = pycolmap.estimate_essential_matrix(matches[:, :2], matches[:, 2:], *cameras, options)
        if found is None:
            return None
        pose = found["cam2_from_cam1"]
        return pose.rotation.matrix(), np.asarray(pose.translation)

    return run


def with_fastpose(case: Case, matches: np.ndarray, seed: int, equal: bool) -> Callable[[], Pose]:
    from fastpose.estimators import estimate_relative_pose

    x1, x2 = np.ascontiguousarray(matches[:, :2]), np.ascontiguousarray(matches[:, 2:])
    k1, k2 = (k_of(c) for c in case.cameras)
    # Its own default of 1,000 iterations leaves many pairs without a pose; PoseLib's is taken.
    options: dict[str, Any] = {"max_error": 1.0, "seed": seed, "iterations": 100_000, "min_iterations": 1_000}
    if equal:
        options |= {"success_prob": 0.999, "min_iterations": 0}

    def run() -> Pose:
        model, _ = estimate_relative_pose(x1, x2, k1, k2, **options)
        return None if model is None else (np.asarray(model["R"]), np.asarray(model["t"]).ravel())

    run()  # Numba compiles in the first call.
    return run


def with_openmvg(case: Case, matches: np.ndarray, seed: int, equal: bool) -> Callable[[], Pose]:
    import openmvg_rs

    k1, k2 = (k_of(c) for c in case.cameras)
    x1, x2 = np.ascontiguousarray(matches[:, :2]), np.ascontiguousarray(matches[:, 2:])

    def run() -> Pose:
        try:
            found = openmvg_rs.estimate_essential(x1, x2, k1, k2, threshold=1.0, seed=seed)
        except (openmvg_rs.OpenMVGError, ValueError):
            return None
        return np.asarray(found.pose.rotation), np.asarray(found.pose.translation)

    return run


LIBRARIES: dict[str, Estimator] = {
    "quest_pose": with_quest,
    "PoseLib": with_poselib,
    "PoseLib 0.75 px": partial(with_poselib, threshold=0.75),
    "OpenCV MAGSAC": with_opencv,
    "pycolmap": with_pycolmap,
    "fastpose": with_fastpose,
    "openmvg-rs": with_openmvg,
}
# These are compared where nothing else is said: the others are small or slow to start.
USUAL = ("quest_pose", "PoseLib", "PoseLib 0.75 px", "OpenCV MAGSAC", "pycolmap")


class Row(NamedTuple):
    """One estimate."""

    case: Case
    library: str
    equal: bool
    error: float
    milliseconds: float


def measure(cases: list[Case], libraries: list[str], seeds: int, repeats: int) -> list[Row]:
    rows = []
    for case in cases:
        for seed in range(seeds):
            matches = np.random.default_rng(seed).permutation(case.matches)
            for equal in (False, True):
                runs = {name: LIBRARIES[name](case, matches, seed, equal) for name in libraries}
                best = dict.fromkeys(libraries, np.inf)
                poses: dict[str, Pose] = {}
                # In turns: what else the machine does meets all of them.
                for _ in range(repeats):
                    for name, run in runs.items():
                        start = time.thread_time()
                        poses[name] = run()
                        best[name] = min(best[name], time.thread_time() - start)
                rows += [
                    Row(case, name, equal, error(case, poses[name]), 1e3 * best[name]) for name in libraries
                ]
    return rows


def auc(errors: np.ndarray, limit: float) -> float:
    """The area under the recall curve up to `limit` degrees, in per cent."""
    errors = np.sort(errors)
    inside = errors[errors <= limit]
    recall = np.arange(1, len(inside) + 1) / len(errors)
    x = np.concatenate([[0], inside, [limit]])
    y = np.concatenate([[0], recall, recall[-1:] if len(recall) else [0]])
    return float(100 * np.trapezoid(y, x) / limit)


def mean_auc(errors: np.ndarray) -> float:
    return float(np.mean([auc(errors, limit) for limit in AUC_AT]))


def leads(rows: list[Row], libraries: list[str], rounds: int = 1_000) -> None:
    """How far the first library is ahead of each other one in the mean of the five AUC, with the 95 % intervals of a paired
    bootstrap: of pairs drawn anew, all seeds of a pair together, and of sources drawn anew."""
    first, *others = libraries
    rng = np.random.default_rng(2018)
    groups: dict[str, dict[str, list[str]]] = {"pairs": {}, "sources": {}}
    errors: dict[tuple[str, str], list[float]] = {}
    for r in rows:
        groups["pairs"][r.case.name] = [r.case.name]
        own = groups["sources"].setdefault(r.case.source, [])
        if r.case.name not in own:
            own.append(r.case.name)
        errors.setdefault((r.library, r.case.name), []).append(r.error)
    names = list(groups["pairs"])

    def lead(other: str, drawn: list[str]) -> float:
        of = [np.concatenate([errors[library, name] for name in drawn]) for library in (first, other)]
        return mean_auc(of[0]) - mean_auc(of[1])

    print(f"\n| {first} over | mean of the AUC | 95 % over pairs | over sources |\n|---|---|---|---|")
    for other in others:
        cells = [f"{lead(other, names):+.2f}"]
        for kind in ("pairs", "sources"):
            all_groups = list(groups[kind].values())
            drawn = [
                lead(other, [name for k in rng.integers(len(all_groups), size=len(all_groups)) for name in all_groups[k]])
                for _ in range(rounds)
            ]
            cells.append("[{:+.2f}, {:+.2f}]".format(*np.quantile(drawn, (0.025, 0.975))))
        print(f"| {other} | " + " | ".join(cells) + " |")


def table(rows: list[Row], title: str, libraries: list[str], keep: Callable[[Case], bool]) -> None:
    kept = [r for r in rows if keep(r.case)]
    if not kept:
        return
    cases = len({r.case.name for r in kept})
    print(f"\n### {title}: {cases} pairs\n")
    print("| library | AUC@" + " | @".join(map(str, AUC_AT)) + " | mean | off by > 20° | median ms | mean | 95 % | 99 % |")
    print("|---|" + "---|" * (len(AUC_AT) + 6))
    for name in libraries:
        own = [r for r in kept if r.library == name]
        errors = np.array([r.error for r in own])
        times = np.array([r.milliseconds for r in own])
        numbers = [f"{auc(errors, limit):.1f}" for limit in AUC_AT] + [f"{mean_auc(errors):.1f}"]
        numbers += [f"{100 * np.mean(errors > 20):.1f} %", f"{np.median(times):.2f}", f"{times.mean():.2f}"]
        numbers += [f"{q:.2f}" for q in np.quantile(times, (0.95, 0.99))]
        print(f"| {name} | " + " | ".join(numbers) + " |")


def write(rows: list[Row], path: Path) -> None:
    """Every estimate, to look at single pairs."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["name", "grade", "library", "equal", "error_deg", "milliseconds"])
        writer.writerows([r.case.name, r.case.grade, *r[1:]] for r in rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="with manifest.json and pairs/")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--repeats", type=int, default=3, help="the smallest time of so many counts")
    parser.add_argument("--libraries", default=",".join(USUAL), help=", ".join(LIBRARIES))
    parser.add_argument("--only", default="", help="pairs whose name contains this")
    parser.add_argument("--rows", type=Path, help="write every estimate to this CSV file")
    arguments = parser.parse_args()
    libraries = arguments.libraries.split(",")
    cases = [c for c in load(arguments.folder) if arguments.only in c.name]
    cv2.setNumThreads(1)
    rows = measure(cases, libraries, arguments.seeds, arguments.repeats)
    if arguments.rows:
        write(rows, arguments.rows)
    sources = sorted({c.source for c in cases})
    for equal, setting in ((False, "own defaults"), (True, "equal settings")):
        print(f"\n## {setting.capitalize()}")
        own = [r for r in rows if r.equal == equal]
        table(own, "all", libraries, lambda c: True)
        leads(own, libraries)
        for few in (True, False):
            size = "fewer than" if few else "at least"
            table(own, f"{size} 100 matches", libraries, lambda c, f=few: (len(c.matches) < 100) == f)  # type: ignore[misc]
        for grade in sorted({c.grade for c in cases}):
            table(own, f"grade {grade}", libraries, lambda c, g=grade: c.grade == g)  # type: ignore[misc]
        for source in sources:
            table(own, source, libraries, lambda c, s=source: c.source == s)  # type: ignore[misc]


if __name__ == "__main__":
    main()
