"""The options of every search, and what every pose has."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import quest_pose as qp
from quest_pose import colmap
from scenes import K, make_scene

SCENE = make_scene(1, 60)
OFFSETS = [0, 60]
SEARCHES: dict[str, Callable[..., Any]] = {
    "estimate": lambda **options: qp.estimate(SCENE.u1, SCENE.u2, K, **options),
    "estimate_batch": lambda **options: qp.estimate_batch(SCENE.u1, SCENE.u2, OFFSETS, K, **options),
    "third_view": lambda **options: qp.third_view(SCENE.u1, SCENE.u2, SCENE.u2, K, **options),
    "verify": lambda **options: colmap.verify("absent.db", **options),
}


@pytest.mark.parametrize("name", SEARCHES)
def test_what_is_no_option_is_refused_with_the_list_of_those_that_are(name: str) -> None:
    with pytest.raises(TypeError, match=rf"{name}\(\) got an unexpected keyword argument 'treshold'") as refused:
        SEARCHES[name](treshold=1.0)
    listed = re.split(", ", str(refused.value).split("expected one of ")[1])
    assert set(listed) == set(qp.EstimateOptions.__annotations__)
    with pytest.raises(TypeError, match="focal_lengths"):
        SEARCHES[name](focal_lengths=1.0)


@pytest.mark.parametrize("name", ["estimate", "estimate_batch", "third_view"])
@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"threshold": -1.0}, qp.QuestError, "threshold"),
        ({"threshold": "1"}, TypeError, "threshold is .*str.*expected a number"),
        ({"confidence": 1.5}, qp.QuestError, "confidence"),
        ({"min_iterations": -1}, qp.QuestError, "min_iterations is .*-1.*whole number"),
        ({"max_iterations": 0}, qp.QuestError, "iterations"),
        ({"max_iterations": 1.5}, TypeError, "max_iterations is .*1.5.*whole number"),
        ({"max_false_alarms": 0.0}, qp.QuestError, "false alarms"),
        ({"seed": []}, TypeError, "seed is .*list"),
        ({"solver": "orb"}, qp.QuestError, "solver is \"orb\", expected one of quest, "),
        ({"solver": 5}, TypeError, "solver is of .*int"),
        ({"loss": "huber"}, qp.QuestError, "loss is \"huber\", expected one of .*marginalised"),
    ],
)
def test_every_search_checks_every_option(name: str, options: dict[str, Any], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        SEARCHES[name](**options)


def test_the_type_of_the_loss_has_every_loss() -> None:
    with pytest.raises(qp.QuestError) as refused:
        SEARCHES["estimate"](loss="huber")
    listed = str(refused.value).split("expected one of ")[1].split(", ")
    assert set(listed) == set(get_args(qp.EstimateOptions.__annotations__["loss"]))


@pytest.mark.parametrize("name", ["estimate", "estimate_batch", "third_view"])
def test_every_search_hears_every_option(name: str) -> None:
    def iterations(**options: Any) -> int:
        found = SEARCHES[name](**options)
        return int(found.estimate_21.iterations if name == "third_view" else np.ravel(found.iterations)[0])

    assert iterations(min_iterations=2000) >= 2000
    assert iterations(min_iterations=np.int64(1), max_iterations=np.int32(20)) <= 20
    everything = {"confidence": 0.99, "max_false_alarms": np.inf, "seed": 3, "solver": "nister", "loss": "truncated"}
    assert iterations(threshold=np.float32(2), **everything) >= 1
    assert iterations(solver=None, seed=None, threshold=None) == iterations()


def test_a_pair_has_its_number_in_one_way() -> None:
    one = [qp.estimate(SCENE.u1[:20], SCENE.u2[:20], K, index=k) for k in (4, 5)]
    u1, u2 = np.r_[SCENE.u1[:20], SCENE.u1[:20]], np.r_[SCENE.u2[:20], SCENE.u2[:20]]
    assert list(qp.estimate_batch(u1, u2, [0, 20, 40], K, first_index=4)) == one
    for name in ["estimate_batch", "third_view", "verify"]:
        with pytest.raises(TypeError, match="'index'"):
            SEARCHES[name](index=1)


def test_a_batch_has_one_known_direction() -> None:
    down = np.array([0.0, 1.0, 0.0])
    turned = SCENE.R @ down
    found = qp.estimate_batch(SCENE.u1, SCENE.u2, OFFSETS, K, known_direction=(down, turned, 0.05))
    assert found.found.tolist() == [True]
    others = qp.estimate_batch(SCENE.u1, SCENE.u2, OFFSETS, K, known_direction=(down, -turned, 0.05), max_iterations=500)
    assert others.found.tolist() == [False]


def test_every_pose_has_the_same_base() -> None:
    few = make_scene(1, 6)
    est = qp.estimate(few.u1, few.u2, K)
    poses: list[qp.RelativePose] = [est, *qp.solve(few.x1, few.x2)]
    assert est.runner_up is not None
    poses.append(est.runner_up)
    for pose in poses:
        assert isinstance(pose, qp.RelativePose)
        assert {"R", "t", "quat_wxyz", "E", "matrix"}.isdisjoint(vars(type(pose)))
        np.testing.assert_array_equal(pose.matrix()[:3], np.c_[pose.R, pose.t])
        np.testing.assert_array_equal(pose.quat_xyzw, np.roll(pose.quat_wxyz, -1))
        np.testing.assert_allclose(pose.parallax, np.linalg.norm(pose.t))
        cross = np.cross(np.eye(3), pose.t / (pose.parallax or 1.0))
        np.testing.assert_allclose(pose.E, cross @ pose.R, atol=1e-12)
        f = np.linalg.inv(K).T @ pose.E @ np.linalg.inv(K)
        np.testing.assert_allclose(pose.fundamental(K), f / (float(np.linalg.norm(f)) or 1.0), atol=1e-12)
    with pytest.raises(TypeError):
        qp.RelativePose()


def test_the_plane_of_an_estimate() -> None:
    scene = make_scene(5, 100, planar=True)
    est = qp.estimate(scene.u1, scene.u2, K, threshold=1.0)
    assert est.model == "planar"
    assert est.normal is not None
    poses = [(est.R, est.t, est.normal)]
    x1, x2 = np.c_[scene.x1, np.ones(100)], np.c_[scene.x2, np.ones(100)]
    for R, t, normal in poses:
        taken = x1 @ (R + np.outer(t, normal)).T
        np.testing.assert_allclose(taken[:, :2] / taken[:, 2:], x2[:, :2], atol=1e-4)
    assert est.to_dict()["normal"] == est.normal.tolist()
    batch = qp.estimate_batch(scene.u1, scene.u2, [0, 100], K, threshold=1.0)
    np.testing.assert_array_equal(batch.normal, [est.normal])
    general = qp.estimate(SCENE.u1, SCENE.u2, K)
    assert general.normal is None
    assert general.to_dict()["normal"] is None


def test_the_share_of_false_matches_and_those_that_did_not_move() -> None:
    est = qp.estimate(SCENE.u1, SCENE.u2, K)
    assert 0.0 <= est.false_share < 0.3
    assert est.unmoved == 0
    rng = np.random.default_rng(3)
    logo = rng.uniform([20, 20], [120, 80], (25, 2))
    u1, u2 = np.r_[SCENE.u1, logo], np.r_[SCENE.u2, logo]
    marked = qp.estimate(u1, u2, K)
    assert marked.unmoved == 25
    assert marked.to_dict()["unmoved"] == 25
    batch = qp.estimate_batch(u1, u2, [0, len(u1)], K)
    assert batch.unmoved.tolist() == [25]
    np.testing.assert_array_equal(batch.false_share, [marked.false_share])


def test_a_database_is_asked_with_the_options_of_colmap(tmp_path: Path) -> None:
    with pytest.raises(qp.QuestError, match="absent"):
        colmap.verify(tmp_path / "absent.db", solver="nister", min_iterations=10)
