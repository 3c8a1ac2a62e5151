"""One pose from matches with outliers."""

import copy
import json
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import quest_pose as qp
from quest_pose.servo import CameraServo
from scenes import Array, K, Scene, make_scene

CAMERA = qp.Camera("PINHOLE", [1060, 1060, 514, 384], width=1024, height=768)


def with_outliers(
    scene: Scene, share: float, seed: int, noise: float = 0.3
) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Pixels of both views, a share of them false, and which are true."""
    rng = np.random.default_rng(seed)
    u1 = scene.u1 + rng.normal(0, noise, scene.u1.shape)
    u2 = scene.u2 + rng.normal(0, noise, scene.u2.shape)
    false = rng.random(len(u1)) < share
    u2[false] = rng.uniform(0, 1000, (false.sum(), 2))
    return u1, u2, ~false


def rotation_error(R: Array, other: Array) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(R.T @ other) - 1) / 2, -1, 1))))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6])
def test_planted_pose(share: float) -> None:
    scene = make_scene(1, 200)
    u1, u2, true = with_outliers(scene, share, 2)
    est = qp.estimate(u1, u2, CAMERA, CAMERA, threshold=1.0)
    assert est.model == "general"
    assert rotation_error(est.R, scene.R) < 0.3
    np.testing.assert_allclose(est.t, scene.t, atol=0.02)
    assert est.inliers.dtype == bool
    assert est.inliers.shape == (200,)
    assert est.inlier_count == est.inliers.sum()
    assert (est.inliers != true).mean() < 0.1
    assert est.covariance.shape == (6, 6)
    np.testing.assert_allclose(est.covariance, est.covariance.T, atol=1e-18)
    assert (np.linalg.eigvalsh(est.covariance) > 0).all()
    assert 0.0 < est.score < 1.0
    assert est.iterations >= 1
    assert est.evidence["general_px"] < est.evidence["rotation_px"]
    np.testing.assert_allclose(est.parallax, np.linalg.norm(est.t))
    np.testing.assert_array_equal(np.roll(est.quat_wxyz, -1), est.quat_xyzw)


def test_rotation_in_place() -> None:
    scene = make_scene(3, 150)
    bearings = scene.X1 @ scene.R.T
    u2 = bearings[:, :2] / bearings[:, 2:] * 1060 + [514, 384]
    rng = np.random.default_rng(4)
    u1 = scene.u1 + rng.normal(0, 0.3, scene.u1.shape)
    u2[::4] = rng.uniform(0, 1000, u2[::4].shape)
    est = qp.estimate(u1, u2, K)
    assert est.model == "pure_rotation"
    assert rotation_error(est.R, scene.R) < 0.1
    assert est.parallax < 0.01


def test_plane() -> None:
    scene = make_scene(5, 100, planar=True)
    u1, u2, _ = with_outliers(scene, 0.3, 6)
    est = qp.estimate(u1, u2, K, threshold=1.0)
    assert est.model == "planar"
    poses = [est.R] if est.runner_up is None else [est.R, est.runner_up.R]
    assert min(rotation_error(R, scene.R) for R in poses) < 1


def test_seed() -> None:
    scene = make_scene(1, 100)
    u1, u2, _ = with_outliers(scene, 0.5, 2)
    assert qp.estimate(u1, u2, K, seed=3) == qp.estimate(u1, u2, K, seed=3)
    rng = np.random.default_rng(1)
    scores = rng.uniform(size=100)
    assert qp.estimate(u1, u2, K, scores=scores) == qp.estimate(u1, u2, K, scores=scores)


def test_points_without_cameras() -> None:
    scene = make_scene(1, 50)
    for x1, x2 in [(scene.x1, scene.x2), (scene.X1, scene.X2)]:
        est = qp.estimate(x1, x2, threshold=1e-3)
        assert rotation_error(est.R, scene.R) < 1e-4
        with pytest.raises(qp.QuestError, match="threshold"):
            qp.estimate(x1, x2)


def test_priors() -> None:
    scene = make_scene(1, 200)
    u1, u2, true = with_outliers(scene, 0.7, 2)
    est = qp.estimate(u1, u2, K, scores=true, min_iterations=0, max_iterations=15)
    assert rotation_error(est.R, scene.R) < 0.5
    est = qp.estimate(u1, u2, K, initial_pose=(scene.R, scene.t), min_iterations=0, max_iterations=1)
    assert rotation_error(est.R, scene.R) < 0.5
    down = np.array([0.0, 1.0, 0.0])
    est = qp.estimate(u1, u2, K, known_direction=(down, scene.R @ down, 0.05))
    assert rotation_error(est.R, scene.R) < 0.5


def test_a_known_direction_holds_for_the_answer() -> None:
    scene = make_scene(1, 200)
    u1, u2, _ = with_outliers(scene, 0.3, 2)
    down = np.array([0.0, 1.0, 0.0])
    c, s = np.cos(0.15), np.sin(0.15)
    wrong = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ scene.R @ down
    with pytest.raises(qp.NoPose, match="known direction to within 1.146 degrees|no pose"):
        qp.estimate(u1, u2, K, known_direction=(down, wrong, 0.02))
    with pytest.raises(qp.QuestError, match="radians from 0 to π"):
        qp.estimate(u1, u2, K, known_direction=(down, scene.R @ down, 20.0))


def test_coordinates_of_the_wrong_unit_are_refused() -> None:
    scene = make_scene(1, 30)
    without: list[Callable[[], object]] = [
        lambda: qp.estimate(scene.u1, scene.u2, threshold=1.0),
        lambda: qp.solve(scene.u1, scene.u2),
        lambda: CameraServo(scene.u1, max_speed=0.1, max_turn_rate=0.3, noise=0.5),
    ]
    for call in without:
        with pytest.raises(qp.BadCamera, match="looks like pixels and no camera is given"):
            call()
    with_camera: list[Callable[[], object]] = [
        lambda: qp.estimate(scene.x1, scene.x2, K),
        lambda: qp.solve(scene.x1, scene.x2, K),
        lambda: CameraServo(scene.x1, K, max_speed=0.1, max_turn_rate=0.3, noise=0.5),
    ]
    for call in with_camera:
        with pytest.raises(qp.QuestError, match="within 2 pixels of the corner"):
            call()


def test_a_quaternion_is_no_rotation_matrix() -> None:
    scene = make_scene(1, 30)
    with pytest.raises(qp.ShapeMismatch, match=r"shape \(4,\), expected a rotation matrix of shape \(3, 3\)"):
        qp.estimate(scene.u1, scene.u2, K, initial_pose=(np.array([1.0, 0, 0, 0]), scene.t))


def test_false_matches() -> None:
    rng = np.random.default_rng(7)
    with pytest.raises(qp.NoPose, match="of 60 matches"):
        qp.estimate(rng.uniform(0, 800, (60, 2)), rng.uniform(0, 800, (60, 2)), K, max_iterations=2000)
    x1, x2 = rng.uniform(0, 800, (2, 60, 2))
    est = qp.estimate(x1, x2, K, max_iterations=2000, max_false_alarms=np.inf)
    assert 5 <= est.inliers.sum() < 40
    found = qp.estimate_batch(x1, x2, [0, 60], K, max_iterations=2000, max_false_alarms=np.inf)
    np.testing.assert_array_equal(found.R, [est.R])


def test_bad_input() -> None:
    scene = make_scene(1, 20)
    u1, u2 = scene.u1, scene.u2
    with pytest.raises(qp.TooFewMatches, match="4.*5"):
        qp.estimate(u1[:4], u2[:4], K)
    with pytest.raises(qp.NotFinite, match="match 0"):
        qp.estimate(u1 * np.nan, u2, K, invalid="raise")
    with pytest.raises(qp.TooFewMatches, match="20 more have no bearing, the first of them: match 0.*NaN"):
        qp.estimate(u1 * np.nan, u2, K)
    for options, word in [
        ({"threshold": -1.0}, "threshold"),
        ({"threshold": np.nan}, "threshold"),
        ({"confidence": 1.0}, "confidence"),
        ({"max_iterations": 0}, "iterations"),
        ({"solver": "orb"}, "orb"),
        ({"scores": [1.0]}, "scores"),
        ({"initial_pose": (2 * np.eye(3), np.ones(3))}, "rotation"),
        ({"known_direction": (np.zeros(3), np.ones(3), 0.1)}, "direction"),
    ]:
        with pytest.raises(qp.QuestError, match=word):
            qp.estimate(u1, u2, K, **options)  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        qp.estimate(u1, u2, K, treshold=1.0)  # type: ignore[call-arg]
    with pytest.raises(qp.DegenerateInput, match="line"):
        qp.estimate(u1 * [1, 0], u2 * [1, 0], K)


def test_values() -> None:
    few = make_scene(1, 6)
    est = qp.estimate(few.u1, few.u2, K)
    assert est.runner_up is not None
    values: list[Any] = [est, est.runner_up]
    for value in values:
        for other in [copy.deepcopy(value), pickle.loads(pickle.dumps(value))]:
            assert other == value
            assert repr(other) == repr(value)
        assert json.loads(json.dumps(value.to_dict(), allow_nan=False))["t_21"] == value.t.tolist()
        with pytest.raises(AttributeError):
            value.score = 1.0
    keys = "model q_21 R_21 t_21 parallax covariance inliers inlier_count score iterations runner_up evidence noise_px"
    keys += " normal false_share unmoved"
    assert list(est.to_dict()) == keys.split()


def batch() -> tuple[Array, Array, list[int]]:
    pairs = [with_outliers(make_scene(k, 40 + 7 * k), 0.3, k) for k in range(6)]
    pairs.append((pairs[0][0][:3], pairs[0][1][:3], pairs[0][2][:3]))
    offsets = np.cumsum([0, *(len(p[0]) for p in pairs)]).tolist()
    return np.concatenate([p[0] for p in pairs]), np.concatenate([p[1] for p in pairs]), offsets


def test_batch() -> None:
    x1, x2, offsets = batch()
    found = qp.estimate_batch(x1, x2, offsets, K, seed=5)
    assert len(found) == 7
    assert found.found.tolist() == [True] * 6 + [False]
    assert found.model[6] is None
    assert "3 matches" in str(found.reason[6])
    for i, (a, b) in enumerate(zip(offsets[:6], offsets[1:], strict=False)):
        one = qp.estimate(x1[a:b], x2[a:b], K, seed=5, index=i)
        np.testing.assert_array_equal(found.R[i], one.R)
        np.testing.assert_array_equal(found.t[i], one.t)
        np.testing.assert_array_equal(found.quat_wxyz[i], one.quat_wxyz)
        np.testing.assert_array_equal(found.covariance[i], one.covariance)
        np.testing.assert_array_equal(found.inliers[a:b], one.inliers)
        assert found.model[i] == one.model
        assert found.inlier_count[i] == one.inlier_count
        assert found.iterations[i] == one.iterations
        assert found.score[i] == one.score
    assert not found.inliers[offsets[6] :].any()
    for threads in [1, 2, 5]:
        assert qp.estimate_batch(x1, x2, offsets, [K] * 7, [CAMERA] * 7, seed=5, num_threads=threads) == found
    assert pickle.loads(pickle.dumps(found)) == found


def test_batch_of_batches() -> None:
    x1, x2, offsets = batch()
    found = qp.estimate_batch(x1, x2, offsets, K, seed=5)
    a, rest = offsets[3], [o - offsets[3] for o in offsets[3:]]
    first = qp.estimate_batch(x1[:a], x2[:a], offsets[:4], K, seed=5)
    second = qp.estimate_batch(x1[a:], x2[a:], rest, K, seed=5, first_index=3)
    np.testing.assert_array_equal(np.concatenate([first.R, second.R]), found.R)
    np.testing.assert_array_equal(np.concatenate([first.iterations, second.iterations]), found.iterations)
    # Without the index the same pairs get other samples.
    other = qp.estimate_batch(x1[a:], x2[a:], rest, K, seed=5)
    assert not np.array_equal(other.R, second.R)


def test_degenerate() -> None:
    s = np.arange(20.0)[:, None]
    line = [100.0, 200.0] + s * [30.0, 10.0]
    other = [150.0, 300.0] + s * [20.0, 10.0] + s**2 * [1.0, 0.5]
    rng = np.random.default_rng(8)
    noise = rng.normal(0, 0.3, (2, *line.shape))
    for u1, u2, word in [
        (line, other, "line"),
        (line + noise[0], other + noise[1], "line"),
        (line[:5], other[:5], "line"),
        (line, line * 0 + 300.0, "coincide"),
        (line[[0, 1, 2] * 5], other[[0, 1, 2] * 5], "repeated"),
    ]:
        with pytest.raises(qp.DegenerateInput, match=word):
            qp.estimate(u1, u2, K)
    # On a line in view 1, anywhere in view 2.
    with pytest.raises(qp.NoPose):
        qp.estimate(line, rng.uniform(0, 800, line.shape), K)


def test_third_view() -> None:
    right, alone = 0, 0
    for seed in range(6):
        scene = make_scene(20 + seed, 80, planar=True)
        other = make_scene(40 + seed, 80)
        X3 = scene.X1 @ other.R.T + other.t
        u3 = X3[:, :2] / X3[:, 2:] * 1060 + [514, 384]
        u1, u2, _ = with_outliers(scene, 0.0, seed, noise=0.2)
        found = qp.third_view(u1, u2, u3, K)
        errors = [rotation_error(e.R, scene.R) for e in (found.estimate_21, qp.estimate(u1, u2, K))]
        right += errors[0] < 1
        alone += errors[1] < 1
        assert rotation_error(found.estimate_31.R, other.R) < 1
        assert found.disagreement is not None
        assert found.next_best is not None
        assert found.ratio is not None
        assert found.disagreement <= found.next_best
        ratio = np.linalg.norm(other.t) / np.linalg.norm(scene.t)
        np.testing.assert_allclose(found.ratio, ratio, rtol=0.1)
    assert right == 6
    assert alone <= right
    with pytest.raises(qp.ShapeMismatch):
        qp.third_view(u1, u2, u3[:5], K)


def test_bad_batches() -> None:
    x1, x2, offsets = batch()
    offers: list[list[float]] = [[0, 5], [*offsets[:-1], 10_000], [0, 50, 20, len(x1)], [0.5, len(x1)], []]
    for bad in offers:
        with pytest.raises(qp.ShapeMismatch, match="offsets"):
            qp.estimate_batch(x1, x2, bad, K)
    with pytest.raises(qp.ShapeMismatch, match="cameras1 has 3"):
        qp.estimate_batch(x1, x2, offsets, [K] * 3)
    with pytest.raises(qp.BadCamera, match="cameras1"):
        qp.estimate_batch(x1, x2, offsets, cameras2=K)
    with pytest.raises(qp.QuestError, match="threshold"):
        qp.estimate_batch(x1, x2, offsets, K, threshold=-1.0)
    with pytest.raises(qp.NotFinite, match="match"):
        qp.estimate_batch(x1 * np.nan, x2, offsets, K, invalid="raise")
