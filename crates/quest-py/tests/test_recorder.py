"""``Recorder``: whole files or none, and what is in them."""

import doctest
import json
import os
import stat
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import quest_pose as qp
from quest_pose import _servo_recorder
from quest_pose.servo import CameraServo, Recorder

GOAL = np.array([[0.1, 0.2], [-0.3, 0.1], [0.2, -0.2], [-0.1, -0.3], [0.3, 0.3], [-0.2, 0.15]])


def a_run(recorder: Recorder, images: int = 30) -> list[Any]:
    servo = CameraServo(GOAL, max_speed=0.3, max_turn_rate=0.5, noise=1e-3)
    recorder.begin(GOAL, options={"noise": 1e-3, "depths": None})
    rows, commands = GOAL * 1.1, []
    for k in range(images):
        seen = rows.copy()
        if k >= images - 3:
            seen[: 1 + k % 6] = np.nan
        commands.append(servo.step(seen))
        recorder.add(seen, commands[-1], stamp=100 + 0.1 * k)
    return commands


def test_examples() -> None:
    result = doctest.testmod(_servo_recorder)
    assert result.attempted > 0
    assert result.failed == 0


def test_npz_has_what_happened(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.npz") as recorder:
        commands = a_run(recorder)
    assert len(recorder) == 30
    with np.load(tmp_path / "run.npz") as run:
        np.testing.assert_array_equal(run["goal"], GOAL)
        np.testing.assert_allclose(run["stamp"], 100 + 0.1 * np.arange(30))
        assert run["points"].shape == (30, 6, 2)
        assert np.isnan(run["points"][-1]).any() and not np.isnan(run["points"][0]).any()
        about = json.loads(run["about"].tobytes())
        assert [about["state"][k] for k in run["state"]] == [c.state for c in commands]
        assert about["version"] == 1 and about["options"] == {"noise": 0.001, "depths": "None"}
        for name in ("linear", "angular", "inliers"):
            np.testing.assert_array_equal(run[name], [getattr(c, name) for c in commands])
        for k, command in enumerate(commands):
            assert np.isnan(run["R"][k]).all() if command.R is None else (run["R"][k] == command.R).all()
            assert np.isnan(run["t"][k]).all() if command.t is None else (run["t"][k] == command.t).all()


def test_parquet_has_a_row_an_image(tmp_path: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    recorder = Recorder()
    commands = a_run(recorder)
    recorder.save(tmp_path / "run.parquet")
    table = pq.read_table(tmp_path / "run.parquet")
    assert table.num_rows == 30
    assert table["state"].to_pylist() == [c.state for c in commands]
    points = np.array(table["points"].to_pylist()).reshape(30, 6, 2)
    np.testing.assert_array_equal(points, recorder.columns()["points"])
    about = json.loads(table.schema.metadata[b"quest-pose"])
    np.testing.assert_array_equal(about["goal"], GOAL)


def test_without_pyarrow_it_is_said_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ImportError, match=r"pip install pyarrow, or write \.npz"):
        Recorder("run.parquet")


def test_what_later_commands_say_is_kept() -> None:
    recorder = Recorder()
    recorder.begin(GOAL)
    said = {"covariance": np.eye(6), "inlier_mask": np.arange(6) < 4, "residual": 0.5, "arrived": True, "advice": "why"}
    plain = {"linear": np.ones(3), "angular": np.zeros(3), "state": "tracking", "R": None, "t": None, "inliers": 4}
    recorder.add(GOAL, SimpleNamespace(**plain))
    recorder.add(GOAL, SimpleNamespace(**plain, **said))
    columns = recorder.columns()
    assert np.isnan(columns["covariance"][0]).all() and (columns["covariance"][1] == np.eye(6)).all()
    np.testing.assert_array_equal(columns["inlier_mask"].sum(axis=1), [0, 4])
    np.testing.assert_array_equal(columns["arrived"], [False, True])
    assert columns["advice"].tolist() == ["", "why"]
    assert columns["stamp"].tolist() == [0.0, 1.0]
    assert "R" not in columns and "hypotheses" not in columns


def test_a_run_that_fails_is_written(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), Recorder(tmp_path / "run.npz") as recorder:
        a_run(recorder, 4)
        raise RuntimeError("the robot fell over")
    with np.load(tmp_path / "run.npz") as run:
        assert len(run["stamp"]) == 4


def test_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.npz"
    recorder = Recorder(path)
    a_run(recorder, 3)
    recorder.save()
    before = path.read_bytes()
    path.chmod(0o640)
    a_run(recorder, 5)

    def full(_: int) -> None:
        raise OSError("no space left on device")

    with monkeypatch.context() as patch, pytest.raises(OSError, match="no space left"):
        patch.setattr(os, "fsync", full)
        recorder.save()
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]
    recorder.save()
    assert path.read_bytes() != before
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    with pytest.raises(FileNotFoundError):
        recorder.save(tmp_path / "nowhere" / "run.npz")


def test_misuse_is_named() -> None:
    recorder = Recorder()
    with pytest.raises(qp.QuestError, match=r"expected Recorder\.begin\(goal\) before add"):
        recorder.add(GOAL, None)
    with pytest.raises(qp.QuestError, match="no run was begun"):
        recorder.save("run.npz")
    recorder.begin(GOAL)
    with pytest.raises(qp.ShapeMismatch, match=r"\(2, 2\), expected \(6, 2\) as the goal"):
        recorder.add(GOAL[:2], None)
    with pytest.raises(qp.QuestError, match="no path was given"):
        recorder.save()
    with pytest.raises(qp.QuestError, match=r"ends in '\.csv', expected \.npz or \.parquet"):
        Recorder("run.csv")
    assert recorder.columns()["points"].shape == (0, 6, 2)
