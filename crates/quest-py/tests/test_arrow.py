"""Columns in and out: partitions and retries change no bit."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import quest_pose as qp
from quest_pose import arrow, dask
from scenes import make_scene
from test_colmap import planted

PARAMS = [1060.0, 1060.0, 514.0, 384.0]
CAMERA = qp.Camera("PINHOLE", PARAMS)


def pairs(count: int) -> list[dict[str, Any]]:
    rng = np.random.default_rng(23)
    rows = []
    for k in range(count):
        n = 3 if k == 4 else 20 + k
        scene = make_scene(200 + k, n)
        rows.append(
            {
                "pair": 2**62 + 7 * k,
                "x1": (scene.u1 + rng.normal(0, 0.3, (n, 2))).tolist(),
                "x2": scene.u2.tolist(),
                "camera1": "PINHOLE",
                "params1": PARAMS,
                "camera2": "PINHOLE",
                "params2": PARAMS,
                "score": rng.uniform(size=n).tolist(),
                "note": "left out",
            }
        )
    return rows


def table(rows: list[dict[str, Any]]) -> Any:
    pa = pytest.importorskip("pyarrow")
    schema = arrow.schema_in().append(pa.field("note", pa.string()))
    return pa.Table.from_pylist(rows, schema=schema)


def test_columns_are_those_of_the_batch() -> None:
    rows = pairs(7)
    found = arrow.estimate(table(rows))
    assert found.schema == arrow.schema_out()
    assert found.column("pair").to_pylist() == [row["pair"] for row in rows]
    for k, (row, one) in enumerate(zip(rows, found.to_pylist(), strict=True)):
        if k == 4:
            assert one["q_wxyz"] is None
            assert "found 3 matches" in one["reason"]
            assert one["inliers"] == [False] * 3
            continue
        expected = qp.estimate(row["x1"], row["x2"], CAMERA, index=row["pair"], scores=row["score"])
        assert one["q_wxyz"] == expected.quat_wxyz.tolist()
        assert one["t"] == expected.t.tolist()
        assert one["covariance"] == expected.covariance.ravel().tolist()
        assert one["inliers"] == expected.inliers.tolist()
        assert one["model"] == expected.model
        assert one["normal"] == (None if expected.normal is None else expected.normal.tolist())
        assert (one["false_share"], one["unmoved"]) == (expected.false_share, expected.unmoved)
        assert (one["runner_up_t"] is None) == (expected.runner_up is None)


def test_partitions_change_no_bit() -> None:
    whole = table(pairs(7))
    found = arrow.estimate(whole).to_pylist()
    parts = [arrow.estimate(whole.slice(a, n), num_threads=2).to_pylist() for a, n in [(0, 3), (3, 0), (3, 4)]]
    assert sum(parts, []) == found
    batches = [arrow.estimate(batch).to_pylist() for batch in whole.to_batches(max_chunksize=2)]
    assert sum(batches, []) == found


def test_a_nan_and_a_pixel_without_a_ray_spoil_no_pair() -> None:
    # The fold lies at 1.7 focal lengths, beyond every pixel of the scenes.
    barrel = {"camera1": "SIMPLE_RADIAL", "params1": [1060.0, 514.0, 384.0, -0.05]}
    rows = [row | barrel | {"camera2": barrel["camera1"], "params2": barrel["params1"]} for row in pairs(9)]
    clean = arrow.estimate(table(rows)).to_pylist()
    spoiled = [row | {"x1": list(row["x1"]), "x2": list(row["x2"])} for row in rows]
    spoiled[5]["x1"][2] = [float("nan"), 1.0]
    spoiled[7]["x2"][3] = [1e5, 0.0]
    found = arrow.estimate(table(spoiled)).to_pylist()
    for k, (a, b) in enumerate(zip(clean, found, strict=True)):
        assert k in (5, 7) or a == b
    assert [row["invalid_count"] for row in found] == [int(k in (5, 7)) for k in range(9)]
    assert not found[5]["inliers"][2]
    assert not found[7]["inliers"][3]
    assert None not in (found[5]["model"], found[7]["model"])


def test_other_forms_go_in_as_they_are() -> None:
    pa = pytest.importorskip("pyarrow")
    rows = pairs(3)
    found = arrow.estimate(table(rows)).to_pylist()
    large = pa.schema(
        [pa.field(f.name, pa.large_list(f.type.value_type) if pa.types.is_list(f.type) else f.type) for f in arrow.schema_in()]
    )
    assert arrow.estimate(pa.Table.from_pylist(rows, schema=large)).to_pylist() == found
    assert arrow.estimate(pa.RecordBatch.from_pylist(rows, schema=arrow.schema_in())).to_pylist() == found

    class Foreign:
        def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
            return table(rows).__arrow_c_stream__(requested_schema)

    assert arrow.estimate(Foreign()).to_pylist() == found
    # Lists of any length, as pandas, Polars and Spark have them, and numbers of other kinds.
    for kind in (pa.float64(), pa.float32(), pa.int32()):
        lists = pa.list_(pa.list_(kind))
        forms = pa.schema([f.with_type(lists) if f.name in ("x1", "x2") else f for f in arrow.schema_in()])
        rounded = [row | {name: np.round(row[name]).tolist() for name in ("x1", "x2")} for row in rows]
        expected = arrow.estimate(table(rounded)).to_pylist()
        assert arrow.estimate(pa.Table.from_pylist(rounded, schema=forms)).to_pylist() == expected
    # Without keys the number of the row is the key.
    plain = table(rows).select(["x1", "x2"])
    one = arrow.estimate(plain, threshold=500.0, max_iterations=300, max_false_alarms=np.inf, first_index=5)
    assert one.column("pair").to_pylist() == [5, 6, 7]
    keyed = arrow.estimate(table(rows).drop_columns(["pair"]), indices=[row["pair"] for row in rows])
    assert keyed.to_pylist() == found


def spoiled(rows: list[dict[str, Any]]) -> tuple[list[dict[str, Any]], list[str]]:
    """Rows most of which are no pairs, each in another way, and a word of the reason of each. The last three lack what a pair may lack."""
    faults: list[tuple[dict[str, Any], str]] = [
        ({"x1": None}, "x1: found null"),
        ({"x2": rows[1]["x2"][1:]}, "x2: found 20 points, expected 21"),
        ({"x2": [*rows[2]["x2"][:-1], None]}, "x2: found a point of 0 numbers"),
        ({"x1": [*rows[3]["x1"][:-1], [1.0, 2.0, 3.0]]}, "x1: found a point of 3 numbers"),
        ({"score": rows[5]["score"][1:]}, "score: found 24 scores, expected 25"),
        ({"score": [float("nan"), *rows[6]["score"][1:]]}, "score: found"),
        ({"camera1": "FISH"}, "FISH"),
        ({"params2": [1.0]}, "PINHOLE"),
        ({"params1": None}, "params1: found"),
    ]
    places = [0, 1, 2, 3, 5, 6, 7, 8, 9]
    made = [dict(row) for row in rows]
    words = [""] * len(rows)
    for place, (change, word) in zip(places, faults, strict=True):
        made[place] |= change
        words[place] = word
    made[10] |= {"score": None}
    made[11] |= {"camera2": None}
    made[12] |= {"x1": [*made[12]["x1"][:-1], [None, 1.0]]}
    return made, words


def of_any_length(rows: list[dict[str, Any]]) -> Any:
    pa = pytest.importorskip("pyarrow")
    points = pa.list_(pa.list_(pa.float64()))
    schema = pa.schema([f.with_type(points) if f.name in ("x1", "x2") else f for f in arrow.schema_in()])
    return pa.Table.from_pylist(rows, schema=schema)


def test_a_row_that_is_no_pair_costs_no_other_its_pose() -> None:
    rows, words = spoiled(pairs(13))
    found = arrow.estimate(of_any_length(rows))
    assert found.schema == arrow.schema_out()
    for k, (one, word) in enumerate(zip(found.to_pylist(), words, strict=True)):
        assert one["pair"] == rows[k]["pair"]
        if k == 4:
            assert "found 3 matches" in one["reason"]
        elif word:
            assert word in one["reason"]
            assert (one["q_wxyz"], one["t"], one["model"], one["inliers"]) == (None, None, None, [])
        else:
            assert one["q_wxyz"] is not None
    whole = [k for k, word in enumerate(words) if not word]
    assert arrow.estimate(of_any_length([rows[k] for k in whole])).to_pylist() == [found.to_pylist()[k] for k in whole]
    assert [row["invalid_count"] for row in found.to_pylist()] == [0] * 12 + [1]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda t: t.drop_columns(["x2"]), "x2"),
        (lambda t: t.set_column(1, "x1", t.column("score")), "expected lists of points"),
        (lambda t: t.set_column(7, "score", t.column("x1")), "expected lists of numbers"),
        (lambda t: t.set_column(0, "pair", t.column("camera1")), "expected whole numbers"),
        (lambda t: t.drop_columns(["params1"]), "expected also params1"),
        (lambda t: t.drop_columns(["camera1"]), "expected also camera1"),
        (lambda t: t.drop_columns(["camera1", "params1"]), "expected also camera1"),
        (lambda t: t.drop_columns(["camera2"]), "expected also camera2"),
    ],
)
def test_bad_columns(change: Any, word: str) -> None:
    pytest.importorskip("pyarrow")
    with pytest.raises(qp.QuestError, match=word):
        arrow.estimate(change(table(pairs(2)).slice(0, 1)))


def test_what_is_no_table_is_refused() -> None:
    pytest.importorskip("pyarrow")
    with pytest.raises(qp.QuestError, match="list"):
        arrow.estimate([1, 2])


class Here:
    """A cluster of one, which works when it is asked."""

    def __init__(self) -> None:
        self.submitted = 0

    def submit(self, function: Any, *args: Any, pure: bool, **options: Any) -> Any:
        self.submitted += 1
        return function(*args, **options)

    def gather(self, futures: list[Any]) -> list[Any]:
        return futures


def test_blocks_are_whole_and_done_once(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    pa = pytest.importorskip("pyarrow")
    rows = pairs(7)
    parquet.write_table(table(rows), tmp_path / "pairs.parquet", row_group_size=2)
    client = Here()
    target = tmp_path / "poses"
    files = dask.estimate_parquet(client, tmp_path / "pairs.parquet", target, rows=3)
    assert client.submitted == len(files) == 3
    found = pa.concat_tables([parquet.read_table(file) for file in files]).to_pylist()
    assert found == arrow.estimate(table(rows)).to_pylist()
    before = files[0].stat().st_mtime_ns
    files[1].unlink()
    # What a worker left that was killed.
    (target / f".{files[1].name}.{os.getpid()}").write_text("half")
    assert dask.estimate_parquet(client, tmp_path / "pairs.parquet", target, rows=3) == files
    assert client.submitted == 4
    assert files[0].stat().st_mtime_ns == before
    assert parquet.read_table(files[1]).num_rows == 3


@pytest.mark.filterwarnings("default")
def test_on_dask(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    parquet = pytest.importorskip("pyarrow.parquet")
    parquet.write_table(table(pairs(4)), tmp_path / "pairs.parquet")
    with distributed.Client(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as client:
        files = dask.estimate_parquet(client, tmp_path / "pairs.parquet", tmp_path / "poses", rows=2)
    assert [parquet.read_table(file).num_rows for file in files] == [2, 2]


def tool(*arguments: str | Path) -> None:
    """Runs the tool, which is named by the environment and was built with Parquet."""
    if "QUEST_CLI" not in os.environ:
        pytest.skip("QUEST_CLI names no quest-cli that was built with --features parquet")
    subprocess.run([os.environ["QUEST_CLI"], *arguments, "--quiet"], check=True)


def test_the_tool_has_the_same_columns_and_bits(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    pa = pytest.importorskip("pyarrow")
    name = pa.field("name", pa.string())
    # What pandas, Polars and Spark write: other lists, other numbers, groups of rows.
    forms = {
        "lists": pa.list_(pa.list_(pa.float64())),
        "large": pa.large_list(pa.large_list(pa.float64())),
        "sizes": arrow.schema_in().field("x1").type,
    }
    rows = [row for k, row in enumerate(pairs(7)) if k != 4]
    expected = arrow.estimate(table(rows)).to_pylist()
    for form, points in forms.items():
        schema = pa.schema([f.with_type(points) if f.name in ("x1", "x2") else f for f in arrow.schema_in()])
        source, target = tmp_path / f"{form}.parquet", tmp_path / "poses.parquet"
        parquet.write_table(pa.Table.from_pylist(rows, schema=schema), source, row_group_size=2)
        tool("estimate", source, "-o", target)
        assert parquet.read_schema(target).equals(arrow.schema_out().append(name))
        assert parquet.read_table(target).drop_columns("name").to_pylist() == expected


def test_the_tool_says_what_a_pair_lacks(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    rows, words = spoiled(pairs(13))
    parquet.write_table(of_any_length(rows), tmp_path / "pairs.parquet")
    with pytest.raises(subprocess.CalledProcessError) as error:
        tool("estimate", tmp_path / "pairs.parquet", "-o", tmp_path / "poses.parquet")
    assert error.value.returncode == 1
    found = parquet.read_table(tmp_path / "poses.parquet").drop_columns("name").to_pylist()
    for k, (one, expected, word) in enumerate(zip(found, arrow.estimate(of_any_length(rows)).to_pylist(), words, strict=True)):
        reasons = one.pop("reason"), expected.pop("reason")
        assert one == expected, k
        assert all(word in (reason or "") for reason in reasons), k
    assert found[4]["inliers"] == [False] * 3


def test_the_tool_exports_what_is_read_here(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path = planted(tmp_path / "a.db")
    tool("colmap", "export", path, "-o", tmp_path / "pairs.parquet")
    tool("estimate", tmp_path / "pairs.parquet", "-o", tmp_path / "poses.parquet")
    matches = parquet.read_table(tmp_path / "pairs.parquet")
    assert matches.schema.equals(arrow.schema_in().remove(7).append(matches.schema.field("name")))
    assert matches.column("name").to_pylist()[0] == "1.jpg 2.jpg"
    found = parquet.read_table(tmp_path / "poses.parquet")
    assert found.drop_columns("name").to_pylist() == arrow.estimate(matches).to_pylist()
    assert found.column("name").to_pylist() == matches.column("name").to_pylist()


def test_pyarrow_is_needed_only_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(ImportError, match=r"pip install quest-pose\[arrow\]"):
        arrow.estimate([])
    with pytest.raises(ImportError, match=r"pip install quest-pose\[arrow\]"):
        dask.estimate_parquet(None, "a", "b")
