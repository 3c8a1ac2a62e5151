"""Pairs of a Parquet file through quest-cli, one process of Python, and Dask with two workers: the same bits, CPU time, a killed worker.

    python benches/peers/cluster.py --cli target/release/quest-cli --pairs 100000

Needs quest_pose with the extra `dask`, and quest-cli built with `--features parquet`. Each pair has 60 to 140 matches of a planted scene with 0.5 px of noise, 30 % of them
false. CPU times (user and system) include the start of the processes; that of Dask is the sum of its workers, with the scheduler in brackets.
"""

import argparse
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet

PARAMS = [1000.0, 1000.0, 640.0, 480.0]


def planted(count: int, seed: int) -> pa.Table:
    rng = np.random.default_rng(seed)
    sizes = rng.integers(60, 141, count)
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    total = int(offsets[-1])
    X = rng.uniform([-2, -2, 4], [2, 2, 8], (total, 3))
    # One small rotation and one translation a pair.
    w, t = rng.normal(0, 0.1, (count, 3)), rng.normal(0, 0.5, (count, 3))
    pair = np.repeat(np.arange(count), sizes)
    moved = X + np.cross(w[pair], X) + 0.5 * np.cross(w[pair], np.cross(w[pair], X)) + t[pair]
    x1, x2 = (points[:, :2] / points[:, 2:] * 1000 + [640, 480] for points in (X, moved))
    x1 += rng.normal(0, 0.5, x1.shape)
    x2 += rng.normal(0, 0.5, x2.shape)
    is_false = rng.random(total) < 0.3
    x2[is_false] = rng.uniform([0, 0], [1280, 960], (int(is_false.sum()), 2))

    def points(values: np.ndarray) -> pa.Array:
        flat = pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), 2)
        return pa.ListArray.from_arrays(pa.array(offsets.astype(np.int32)), flat)

    columns = {"pair": pa.array(np.arange(count, dtype=np.uint64)), "x1": points(x1), "x2": points(x2)}
    columns |= {"camera1": pa.array(["PINHOLE"] * count), "params1": pa.array([PARAMS] * count)}
    return pa.table(columns)


def children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def of_files(files: list[Path]) -> pa.Table:
    """The poses of blocks, all columns of them but the name that only the tool writes."""
    table = pa.concat_tables([parquet.read_table(file) for file in files])
    return table.select([name for name in table.column_names if name != "name"])


ONE_PROCESS = """
import sys
from quest_pose import dask
import pyarrow.parquet as parquet
source, target, rows = sys.argv[1], sys.argv[2], int(sys.argv[3])
for first in range(0, parquet.ParquetFile(source).metadata.num_rows, rows):
    dask.estimate_block(source, first, f"{target}/{first:012d}.parquet", rows, threshold=1.0)
"""


def on_dask(source: Path, target: Path, rows: int, kill_after: int | None) -> tuple[list[Path], float, float, int]:
    """The files, CPU seconds of the workers and of the scheduler's process, and blocks that were there when a worker was killed."""
    import psutil
    from distributed import Client, LocalCluster
    from quest_pose import dask

    there = 0
    before = time.process_time()
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        killed: list[float] = []

        def kill() -> None:
            nonlocal there
            while (there := len(list(target.glob("[!.]*.parquet")))) < (kill_after or 0):
                time.sleep(0.01)
            victim = next(iter(client.run(os.getpid).values()))
            killed.append(sum(psutil.Process(victim).cpu_times()[:2]))
            os.kill(victim, signal.SIGKILL)

        target.mkdir(exist_ok=True)
        killer = threading.Thread(target=kill)
        if kill_after is not None:
            killer.start()
        files = dask.estimate_parquet(client, source, target, rows=rows, threshold=1.0)
        if kill_after is not None:
            killer.join()
        cpu = sum(client.run(time.process_time).values()) + sum(killed)
        scheduler = time.process_time() - before
    return files, cpu, scheduler, there


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cli", type=Path, default=Path("target/release/quest-cli"))
    parser.add_argument("--pairs", type=int, default=100_000)
    parser.add_argument("--rows", type=int, default=1_000, help="of a block")
    parser.add_argument("--seed", type=int, default=6)
    parser.add_argument("--keep", type=Path, help="where the Parquet file goes; else it is deleted")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        source = arguments.keep or folder / "pairs.parquet"
        table = planted(arguments.pairs, arguments.seed)
        parquet.write_table(table, source, row_group_size=arguments.rows)

        before = children()
        run = [arguments.cli, "estimate", source, "-o", folder / "tool.parquet", "--threads", "1", "--quiet", "--threshold", "1"]
        # It ends with 1 where a pair has no pose.
        subprocess.run(run, check=False, stderr=subprocess.DEVNULL)
        print(f"tool: {children() - before:.2f} s")
        expected = of_files([folder / "tool.parquet"])

        (folder / "one").mkdir()
        before = children()
        subprocess.run([sys.executable, "-c", ONE_PROCESS, source, folder / "one", str(arguments.rows)], check=True)
        one = children() - before
        same = of_files(sorted((folder / "one").glob("*.parquet"))).equals(expected)
        print(f"one process: {one:.2f} s, the tool's bits: {same}")

        for kill_after in (None, arguments.pairs // arguments.rows // 3):
            target = folder / f"dask_{kill_after}"
            files, cpu, scheduler, there = on_dask(source, target, arguments.rows, kill_after)
            same = of_files(files).equals(expected)
            left = len(list(target.iterdir())) - len(files)
            told = f", a worker killed after {there} of {len(files)} blocks, {left} unfinished file left" if kill_after else ""
            print(f"Dask: {cpu:.2f} s ({scheduler:.2f} s), {cpu / one - 1:+.1%}, the tool's bits: {same}{told}")


if __name__ == "__main__":
    main()
