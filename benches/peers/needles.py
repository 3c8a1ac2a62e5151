"""quest_pose.estimate beside PoseLib where few matches are true, or others agree on something false.

    python benches/peers/needles.py ../shared/data

The sets of `dirty.py`: each recorded pair diluted by false matches to 10, 5 and 3 % of true ones, with and without a dense false
motion; planted scenes with a second motion, a repeated texture or a second plane; false matches alone. Both libraries take turns
on one thread, at their own defaults and a threshold of one pixel. Right is a pose within 5 degrees of a reference in rotation and
translation; a library that gives no pose is off by 180. Times are the processor's. A table in Markdown.
"""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from compare import LIBRARIES, Case, Pose, error, load
from dirty import Problem, sets

RIGHT = 5.0


def as_case(p: Problem) -> Case:
    return Case(p.name, p.source, "", p.rotation_only, p.cameras, p.matches, p.references)


def row(name: str, problems: list[Callable[[], Problem]], libraries: list[str]) -> None:
    errors: dict[str, list[float]] = {library: [] for library in libraries}
    posed: dict[str, list[bool]] = {library: [] for library in libraries}
    times: dict[str, list[float]] = {library: [] for library in libraries}
    for index, make in enumerate(problems):
        case = as_case(make())
        for library in libraries:
            run = LIBRARIES[library](case, case.matches, index, False)
            start = time.thread_time()
            pose: Pose = run()
            times[library].append(1e3 * (time.thread_time() - start))
            posed[library].append(pose is not None)
            errors[library].append(error(case, pose) if case.references else 180.0)
    for library in libraries:
        e, t, p = np.array(errors[library]), np.array(times[library]), np.array(posed[library])
        right, wrong = 100 * np.mean(e <= RIGHT), 100 * np.mean(p & (e > RIGHT))
        quantiles = " | ".join(f"{q:.2f}" for q in np.quantile(t, (0.5, 0.95, 0.99)))
        print(
            f"| {name} | {len(e)} | {library} | {right:.1f} % | {wrong:.1f} % | {100 - right - wrong:.1f} % "
            f"| {t.mean():.2f} | {quantiles} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="with manifest.json and pairs/")
    parser.add_argument("--libraries", default="quest_pose,PoseLib")
    parser.add_argument("--scenes", type=int, default=100, help="of a planted set")
    parser.add_argument("--seed", type=int, default=2018)
    parser.add_argument("--every", type=int, default=1, help="only every so manyth problem")
    parser.add_argument("--only", default="", help="sets whose name contains this")
    arguments = parser.parse_args()
    manifest = json.loads((arguments.folder / "manifest.json").read_text())
    known = {entry["name"]: entry["n_inl"] for entry in manifest}
    print("| set | problems | library | right | wrong | no pose | mean ms | median | 95 % | 99 % |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name, problems in sets(
        load(arguments.folder), known, arguments.scenes, arguments.seed, arguments.only
    ).items():
        row(name, problems[:: arguments.every], arguments.libraries.split(","))


if __name__ == "__main__":
    main()
