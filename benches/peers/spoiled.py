"""A thousand pairs of which one has a NaN and one a pixel without a viewing ray: the others are answered as without them, bit for bit.

    python benches/peers/spoiled.py --cli target/release/quest-cli --pairs 1000

Through the tool (JSON Lines), `estimate_batch` and `quest_pose.arrow.estimate`.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import quest_pose as qp
from cluster import planted
from quest_pose import arrow

# The fold lies at 2.6 focal lengths, beyond every pixel of the image.
MODEL, PARAMS = "SIMPLE_RADIAL", [1000.0, 640.0, 480.0, -0.05]


def tool(cli: Path, rows: list[dict[str, Any]], folder: Path) -> list[Any]:
    camera = {"model": MODEL, "params": PARAMS}
    with (folder / "pairs.jsonl").open("w") as file:
        for row in rows:
            matches = [[*a, *b] for a, b in zip(row["x1"], row["x2"], strict=True)]
            # Python writes NaN, which is not JSON, as a word.
            file.write(json.dumps({"camera1": camera, "matches": matches}) + "\n")
    run = [cli, "estimate", folder / "pairs.jsonl", "--format", "jsonl", "--threshold", "1"]
    text = subprocess.run(run, capture_output=True, text=True, check=False).stdout
    return [{key: value for key, value in json.loads(line).items() if key != "elapsed_ms"} for line in text.splitlines()]


def batch(rows: list[dict[str, Any]]) -> list[Any]:
    x1, x2 = (np.concatenate([row[name] for row in rows]) for name in ("x1", "x2"))
    offsets = np.cumsum([0, *(len(row["x1"]) for row in rows)])
    found = qp.estimate_batch(x1, x2, offsets, qp.Camera(MODEL, PARAMS), threshold=1.0)
    return [None if one is None else one.to_dict() for one in found]


def columns(rows: list[dict[str, Any]]) -> list[Any]:
    keep = ("pair", "x1", "x2", "camera1", "params1")
    schema = pa.schema([arrow.schema_in().field(name) for name in keep])
    table = pa.Table.from_pylist([{name: row[name] for name in keep} for row in rows], schema=schema)
    return arrow.estimate(table, threshold=1.0).to_pylist()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cli", type=Path, default=Path("target/release/quest-cli"))
    parser.add_argument("--pairs", type=int, default=1000)
    arguments = parser.parse_args()
    rows = [row | {"camera1": MODEL, "params1": PARAMS} for row in planted(arguments.pairs, 5).to_pylist()]
    spoiled = [dict(row, x1=list(row["x1"]), x2=list(row["x2"])) for row in rows]
    nan, far = arguments.pairs // 3, arguments.pairs // 2
    spoiled[nan]["x1"][7] = [float("nan"), 3.0]
    spoiled[far]["x2"][5] = [1e5, 0.0]
    with tempfile.TemporaryDirectory() as temporary:
        doors = {"tool": lambda rows: tool(arguments.cli, rows, Path(temporary)), "batch": batch, "arrow": columns}
        for name, door in doors.items():
            clean, found = door(rows), door(spoiled)
            # repr tells every bit of a float, and NaN equals itself.
            same = sum(repr(a) == repr(b) for k, (a, b) in enumerate(zip(clean, found, strict=True)) if k not in (nan, far))
            answered = [found[k] is not None and found[k]["model"] for k in (nan, far)]
            invalid = [found[k]["invalid_count"] for k in (nan, far)]
            print(f"{name}: {same} of {len(rows) - 2} the same; the two: {answered}, without a bearing {invalid}")


if __name__ == "__main__":
    main()
