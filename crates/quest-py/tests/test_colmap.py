"""Databases of COLMAP, through Python."""

import sqlite3
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import quest_pose as qp
from quest_pose import colmap
from scenes import rotation

FOCAL, SIZE = 1000.0, (1280, 960)
K = np.array([[FOCAL, 0, 640], [0, FOCAL, 480], [0, 0, 1.0]])
COUNT, POINTS = 4, 150


def pair_id(a: int, b: int) -> int:
    return 2147483647 * min(a, b) + max(a, b)


def poses() -> list[tuple[Any, Any]]:
    return [(rotation(np.array([0.02, 0.15 * k + 1e-3, 0.0])), np.array([-0.8 * k, 0.1 * k, 6.0])) for k in range(COUNT)]


def planted(path: Path) -> Path:
    """A database of four images of the same points, a fifth of the matches wrong."""
    rng = np.random.default_rng(17)
    db = sqlite3.connect(path)
    db.executescript("""
        CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY, model INTEGER, width INTEGER, height INTEGER, params BLOB,
          prior_focal_length INTEGER);
        CREATE TABLE images(image_id INTEGER PRIMARY KEY, name TEXT UNIQUE, camera_id INTEGER);
        CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);
        CREATE TABLE matches(pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);
        CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL,
          data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB, camera1 BLOB, camera2 BLOB);
        PRAGMA user_version = 4020100;""")
    params = np.array([FOCAL, 640.0, 480.0]).tobytes()
    db.execute("INSERT INTO cameras VALUES(1, 0, 1280, 960, ?, 1)", (params,))
    X = rng.uniform(-1.5, 1.5, (POINTS, 3))
    for k, (R, t) in enumerate(poses(), 1):
        x = X @ R.T + t
        u = x[:, :2] / x[:, 2:] * FOCAL + [640, 480] + rng.normal(0, 0.4, (POINTS, 2))
        db.execute("INSERT INTO images VALUES(?, ?, 1)", (k, f"{k}.jpg"))
        db.execute("INSERT INTO keypoints VALUES(?, ?, 2, ?)", (k, POINTS, u.astype("<f4").tobytes()))
    for a in range(1, COUNT + 1):
        for b in range(a + 1, COUNT + 1):
            m = np.stack([np.arange(POINTS), np.arange(POINTS)], 1).astype("<u4")
            m[::5, 1] = rng.integers(0, POINTS, len(m[::5]))
            db.execute("INSERT INTO matches VALUES(?, ?, 2, ?)", (pair_id(a, b), POINTS, m.tobytes()))
    db.commit()
    db.close()
    return path


def rows(path: Path) -> dict[int, tuple[int, int, Any, Any]]:
    db = sqlite3.connect(path)
    found = db.execute("SELECT pair_id, rows, config, qvec, tvec FROM two_view_geometries").fetchall()
    db.close()

    def array(blob: bytes | None) -> Any:
        return None if blob is None else np.frombuffer(blob)

    return {pid: (n, config, array(q), array(t)) for pid, n, config, q, t in found}


def test_verify(tmp_path: Path) -> None:
    path = planted(tmp_path / "a.db")
    told: list[tuple[int, int]] = []
    dry = colmap.verify(path, dry_run=True, progress=lambda done, total: told.append((done, total)))
    assert rows(path) == {}
    assert told[-1] == (6, 6)
    report = colmap.verify(path)
    assert report.summary["verified"] == report.summary["pairs"] == 6
    assert report.pairs == dry.pairs
    for pid, (n, config, q, t) in rows(path).items():
        a, b = (pid - pid % 2147483647) // 2147483647, pid % 2147483647
        (R1, t1), (R2, t2) = poses()[a - 1], poses()[b - 1]
        R = R2 @ R1.T
        true_t = t2 - R @ t1
        assert n >= 110
        assert config == 2
        cos = abs(q @ _quaternion(R))
        assert np.degrees(2 * np.arccos(min(cos, 1))) < 0.5
        assert t @ true_t / np.linalg.norm(true_t) > np.cos(np.radians(5))
        assert np.linalg.norm(t) == pytest.approx(1)
    with pytest.raises(qp.QuestError, match=r"6 of 6 pairs.*existing"):
        colmap.verify(path)
    assert colmap.verify(path, existing="resume").summary["resumed"] == 6


def _quaternion(R: Any) -> Any:
    w = np.sqrt(max(1 + np.trace(R), 1e-12)) / 2
    return np.array([w, (R[2, 1] - R[1, 2]) / (4 * w), (R[0, 2] - R[2, 0]) / (4 * w), (R[1, 0] - R[0, 1]) / (4 * w)])


def test_the_signature_of_pycolmap(tmp_path: Path) -> None:
    path, pairs = planted(tmp_path / "a.db"), tmp_path / "pairs.txt"
    pairs.write_text("1.jpg 2.jpg\n\n3.jpg 1.jpg\n")
    assert colmap.read_pairs(pairs) == [("1.jpg", "2.jpg"), ("3.jpg", "1.jpg")]
    colmap.verify_matches(path, pairs, options={"ransac": {"max_num_trials": 20000, "min_inlier_ratio": 0.1}})
    assert set(rows(path)) == {pair_id(1, 2), pair_id(1, 3)}
    ransac = SimpleNamespace(max_error=2.0, confidence=0.99, max_num_trials=500, random_seed=3)
    options = SimpleNamespace(min_num_inliers=POINTS + 1, detect_watermark=False, ransac=ransac)
    pairs.write_text("2.jpg 4.jpg\n1.jpg 2.jpg\n")
    colmap.verify_matches(path, pairs, options)
    # What was there stays; of 150 matches there are no 151 inliers.
    assert rows(path)[pair_id(1, 2)][1] == 2
    assert rows(path)[pair_id(2, 4)][:2] == (0, 0)


def test_estimates_of_ones_own_are_written(tmp_path: Path) -> None:
    path = planted(tmp_path / "a.db")
    db = sqlite3.connect(path)
    u = [np.frombuffer(d, "<f4").reshape(-1, 2) for (d,) in db.execute("SELECT data FROM keypoints ORDER BY image_id")]
    (data,) = db.execute("SELECT data FROM matches WHERE pair_id = ?", (pair_id(1, 2),)).fetchone()
    db.close()
    m = np.frombuffer(data, "<u4").reshape(-1, 2)
    # From image 2 to image 1: the row goes the other way.
    batch = qp.estimate_batch(u[1][m[:, 1]], u[0][m[:, 0]], [0, len(m)], K, threshold=4.0)
    colmap.write_two_view_geometries(path, [("2.jpg", "1.jpg")], batch)
    n, config, q, t = rows(path)[pair_id(1, 2)]
    assert (n, config) == (batch.inlier_count[0], 2)
    inverse = np.linalg.inv(batch[0].matrix())  # type: ignore[union-attr]
    assert abs(q @ _quaternion(inverse[:3, :3])) == pytest.approx(1)
    np.testing.assert_allclose(t, inverse[:3, 3] / np.linalg.norm(inverse[:3, 3]), atol=1e-9)
    with pytest.raises(qp.QuestError, match="1 of 1 pairs"):
        colmap.write_two_view_geometries(path, [("2.jpg", "1.jpg")], batch)
    colmap.write_two_view_geometries(path, [("2.jpg", "1.jpg")], [None], overwrite=True)
    assert rows(path)[pair_id(1, 2)][:2] == (0, 0)
    with pytest.raises(ValueError, match="1 pairs and 2"):
        colmap.write_two_view_geometries(path, [("2.jpg", "1.jpg")], [None, None])


def test_exports(tmp_path: Path) -> None:
    path = planted(tmp_path / "a.db")
    assert colmap.export_matches(path, tmp_path / "a.jsonl") == []
    assert len((tmp_path / "a.jsonl").read_text().splitlines()) == 6
    assert colmap.export_poses(path, tmp_path / "a.g2o", pairs=[("1.jpg", "2.jpg")]) == []
    assert (tmp_path / "a.g2o").read_text().count("EDGE_SE3:QUAT") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.db", "a.g2o", "a.jsonl"]


def test_an_exception_of_progress_leaves_the_database(tmp_path: Path) -> None:
    path = planted(tmp_path / "a.db")

    def stop(done: int, total: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        colmap.verify(path, progress=stop)


def test_pycolmap_reads_the_rows(tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    path = planted(tmp_path / "a.db")
    colmap.verify(path)
    db = pycolmap.Database.open(path)
    found = db.read_two_view_geometry(1, 3)
    db.close()
    n, _, q, t = rows(path)[pair_id(1, 3)]
    assert len(found.inlier_matches) == n
    np.testing.assert_allclose(found.cam2_from_cam1.translation, t)
    np.testing.assert_allclose(np.roll(found.cam2_from_cam1.rotation.quat, 1), q, atol=1e-12)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"threshold": 0.0}, "threshold"),
        ({"min_inlier_ratio": 2.0}, "ratio"),
        ({"existing": "ignore"}, "existing"),
        ({"uncalibrated": "solve"}, "uncalibrated"),
        ({"pairs": [("1.jpg", "9.jpg")]}, "9.jpg"),
        ({"pairs": [("1.jpg", "1.jpg")]}, "twice"),
    ],
)
def test_bad_options(tmp_path: Path, options: dict[str, Any], word: str) -> None:
    path = planted(tmp_path / "a.db")
    with pytest.raises(qp.QuestError, match=word):
        colmap.verify(path, **options)
    assert rows(path) == {}


def test_bad_files(tmp_path: Path) -> None:
    with pytest.raises(qp.QuestError, match="found no file"):
        colmap.verify(tmp_path / "none.db")
    (tmp_path / "pairs.txt").write_text("a b c\n")
    with pytest.raises(qp.QuestError, match="pairs.txt:1.*3 names"):
        colmap.read_pairs(tmp_path / "pairs.txt")
    with pytest.raises(OSError, match="cannot be read"):
        colmap.read_pairs(tmp_path / "none.txt")
