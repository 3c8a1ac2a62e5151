"""COLMAP databases verified by quest-cli and by COLMAP: CPU time, poses against the truth, reconstructions.

    python benches/peers/databases.py --cli target/release/quest-cli --rounds 3 [--photographs FOLDER] [SET ...]

Both get copies of the same databases (`planted_databases.py`) and one thread each; they take turns, and the least CPU time (user and
system) of the rounds counts. quest-cli's includes the start of its process. COLMAP runs with its defaults and a pose
for every pair (`compute_relative_pose`), once as `verify_matches`, once as `geometric_verification`; the faster one counts.
"""

import argparse
import json
import resource
import shutil
import sqlite3
import subprocess
import tempfile
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
from planted_databases import SETS, Pose, photographs, plant, plant_apart

OVERLAP_FREE = "apart"


def two_view_options() -> Any:
    options = pycolmap.TwoViewGeometryOptions()
    options.compute_relative_pose = True
    options.ransac.random_seed = 1
    return options


def pairs_file(database: Path) -> Path:
    """The pairs with matches, by the names of their images."""
    with closing(sqlite3.connect(database)) as db:
        names = dict(db.execute("SELECT image_id, name FROM images"))
        pairs = [divmod(key, 2147483647) for (key,) in db.execute("SELECT pair_id FROM matches ORDER BY pair_id")]
    path = database.with_suffix(".txt")
    path.write_text("".join(f"{names[a]} {names[b]}\n" for a, b in pairs))
    return path


def by_verify_matches(database: Path) -> float:
    pairs = pairs_file(database)
    start = time.process_time()
    pycolmap.verify_matches(database, pairs, two_view_options())
    return time.process_time() - start


def by_geometric_verification(database: Path) -> float:
    options = pycolmap.GeometricVerifierOptions()
    options.num_threads = 1
    start = time.process_time()
    pycolmap.geometric_verification(database, options, two_view_geometry_options=two_view_options())
    return time.process_time() - start


def by_quest(cli: Path, database: Path, *more: str) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [cli, "colmap", "verify", database, "--threads", "1", "--quiet", *more]
    status = subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode
    if status == 2:
        raise SystemExit(f"quest-cli colmap verify {database} failed")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def without_rows(base: Path, database: Path) -> Path:
    shutil.copy(base, database)
    with closing(sqlite3.connect(database)) as db, db:
        db.execute("DELETE FROM two_view_geometries")
    return database


def pose_errors(database: Path, truth: dict[int, Pose]) -> np.ndarray:
    """Of each row with a pose the larger of the errors of rotation and direction, in degrees."""
    with closing(sqlite3.connect(database)) as db:
        rows = db.execute(
            "SELECT pair_id, qvec, tvec FROM two_view_geometries WHERE rows > 0 AND qvec IS NOT NULL ORDER BY pair_id"
        ).fetchall()
    errors = []
    for key, q, t in rows:
        (R1, t1), (R2, t2) = (truth[image] for image in divmod(key, 2147483647))
        w, x, y, z = np.frombuffer(q)
        R = pycolmap.Rotation3d(np.array([x, y, z, w])).matrix()
        t = np.frombuffer(t)
        R_21 = R2 @ R1.T
        t_21 = t2 - R_21 @ t1
        turned = np.degrees(np.arccos(np.clip((np.trace(R.T @ R_21) - 1) / 2, -1, 1)))
        lengths = np.linalg.norm(t) * np.linalg.norm(t_21)
        # A rotation in place has no direction; a translation of zero says that there is none.
        is_moved = np.linalg.norm(t_21) > 1e-6 and np.linalg.norm(t) > 1e-9
        moved = np.degrees(np.arccos(np.clip(t @ t_21 / lengths, -1, 1))) if is_moved else 0.0
        errors.append(max(turned, moved))
    return np.array(errors)


def table_of(database: Path, truth: dict[int, Pose]) -> dict[str, Any]:
    with closing(sqlite3.connect(database)) as db:
        configs = dict(db.execute("SELECT config, COUNT(*) FROM two_view_geometries GROUP BY config"))
        count = "SELECT COUNT(*), COALESCE(SUM(rows), 0) FROM two_view_geometries WHERE rows > 0"
        accepted, inliers = db.execute(count).fetchone()
    errors = pose_errors(database, truth) if truth else np.array([])
    found: dict[str, Any] = {"accepted": accepted, "inliers": inliers, "configs": configs}
    if len(errors):
        found |= {
            "poses": len(errors),
            "median_deg": round(float(np.median(errors)), 4),
            "p90_deg": round(float(np.quantile(errors, 0.9)), 3),
            "over_5_deg": int((errors > 5).sum()),
        }
    return found


def against_truth(model: Any, truth: dict[int, Pose]) -> dict[str, float]:
    """Errors of the centres after the similarity that fits them best, in the truth's unit."""
    ids = [i for i, image in model.images.items() if image.has_pose and i in truth]
    found = np.array([model.images[i].projection_center() for i in ids])
    true = np.array([-truth[i][0].T @ truth[i][1] for i in ids])
    fit = pycolmap.estimate_sim3d(found, true)
    off = np.linalg.norm(np.array([fit * x for x in found]) - true, axis=1)
    return {"median_centre": round(float(np.median(off)), 5), "max_centre": round(float(off.max()), 5)}


def reconstruct(database: Path, truth: dict[int, Pose], is_global: bool, seed: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        if is_global:
            options = pycolmap.GlobalPipelineOptions()
            mapping = pycolmap.global_mapping
        else:
            options = pycolmap.IncrementalPipelineOptions()
            options.extract_colors = False
            mapping = pycolmap.incremental_mapping
        options.num_threads, options.random_seed = 2, seed
        try:
            models = mapping(database, folder, folder, options)
        except Exception as error:  # COLMAP's checks are plain runtime errors.
            return {"error": str(error).splitlines()[0][:120]}
        if not models:
            return {"images": 0}
        model = max(models.values(), key=lambda model: model.num_reg_images())
        found = {"images": model.num_reg_images(), "points": model.num_points3D()}
        found["reprojection"] = round(model.compute_mean_reprojection_error(), 4)
        return found | (against_truth(model, truth) if truth and found["images"] >= 3 else {})


def measure(name: str, base: Path, truth: dict[int, Pose], arguments: argparse.Namespace) -> dict[str, Any]:
    more = ["--uncalibrated", "guess"] if name == "uncalibrated" else []
    folder = base.parent
    files = {who: folder / f"{base.stem}_{who}.db" for who in ("matches", "colmap", "quest")}
    times: dict[str, list[float]] = {who: [] for who in files}
    for _ in range(arguments.rounds):
        for who, database in files.items():
            without_rows(base, database)
            if who == "quest":
                times[who].append(by_quest(arguments.cli, database, *more))
            else:
                run = by_verify_matches if who == "matches" else by_geometric_verification
                times[who].append(run(database))
    cpu = {who: min(all_times) for who, all_times in times.items()}
    result: dict[str, Any] = {"set": name, "cpu_s": {who: round(value, 3) for who, value in cpu.items()}}
    result["ratio"] = round(min(cpu["matches"], cpu["colmap"]) / cpu["quest"], 2)
    for who in ("colmap", "quest"):
        result[who] = table_of(files[who], truth)
        if name != OVERLAP_FREE and not arguments.no_models:
            for kind in (False, True):
                key = "global" if kind else "incremental"
                result[who][key] = [reconstruct(files[who], truth, kind, seed) for seed in arguments.model_seeds]
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", metavar="SET", help=f"of {', '.join([*SETS, OVERLAP_FREE])} [all]")
    parser.add_argument("--cli", type=Path, default=Path("target/release/quest-cli"))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0, help="of the planted scenes")
    parser.add_argument("--model-seeds", type=int, nargs="*", default=[1], help="of the reconstructions")
    parser.add_argument("--no-models", action="store_true", help="reconstruct nothing")
    parser.add_argument("--photographs", type=Path, help="a folder of photographs, as one more set")
    parser.add_argument("--folder", type=Path, help="where the databases go; else they are deleted")
    arguments = parser.parse_args()
    pycolmap.logging.minloglevel = 3
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(temporary)
        folder.mkdir(exist_ok=True)
        for name in arguments.sets or [*SETS, OVERLAP_FREE]:
            base, truth = folder / f"{name}.db", {}
            if name == OVERLAP_FREE:
                plant_apart(base, arguments.seed)
            else:
                truth = plant(base, SETS[name], arguments.seed)
            print(json.dumps(measure(name, base, truth, arguments)), flush=True)
        if arguments.photographs:
            base = folder / "photographs.db"
            photographs(base, arguments.photographs)
            print(json.dumps(measure("photographs", base, {}, arguments)), flush=True)


if __name__ == "__main__":
    main()
