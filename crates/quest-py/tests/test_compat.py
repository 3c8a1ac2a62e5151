"""In the place of other libraries, beside them where they are installed."""

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from quest_pose import compat
from scenes import K, make_scene, rotation

CAMERA = {"model": "PINHOLE", "width": 1024, "height": 768, "params": [1060.0, 1060.0, 514.0, 384.0]}
SCENE = make_scene(31, 200)
RNG = np.random.default_rng(4)
U1 = SCENE.u1 + RNG.normal(0, 0.3, (200, 2))
U2 = SCENE.u2 + RNG.normal(0, 0.3, (200, 2))
U2[::4] = RNG.uniform(0, 700, U2[::4].shape)
FALSE = RNG.uniform(0, 700, (2, 100, 2))


def angle(a: Any, b: Any) -> float:
    return float(np.degrees(np.arccos(np.clip(np.ravel(a) @ np.ravel(b) / np.linalg.norm(a) / np.linalg.norm(b), -1, 1))))


def turned(a: Any, b: Any) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(np.asarray(a).T @ b) - 1) / 2, -1, 1))))


def right(R: Any, t: Any) -> bool:
    return turned(R, SCENE.R) < 0.5 and angle(t, SCENE.t) < 2


def test_poselib() -> None:
    pose, info = compat.poselib.estimate_relative_pose(U1, U2, CAMERA, CAMERA, {"max_epipolar_error": 1.0}, {})
    assert right(pose.R, pose.t)
    assert np.linalg.norm(pose.t) == pytest.approx(1)
    np.testing.assert_allclose(pose.Rt, np.c_[pose.R, pose.t])
    np.testing.assert_allclose(pose.R @ pose.center() + pose.t, 0, atol=1e-12)
    assert info["num_inliers"] == sum(info["inliers"]) >= 140
    nested, _ = compat.poselib.estimate_relative_pose(
        U1, U2, camera1_dict=CAMERA, camera2_dict=CAMERA, ransac_opt={"ransac": {"max_error": 1.0}}
    )
    np.testing.assert_array_equal(nested.q, pose.q)
    pose, info = compat.poselib.estimate_relative_pose(*FALSE, CAMERA, CAMERA, {"max_iterations": 1000})
    assert (info["num_inliers"], pose.R.tolist()) == (0, np.eye(3).tolist())
    assert len(info["inliers"]) == 100
    begun, _ = compat.poselib.estimate_relative_pose(U1, U2, CAMERA, CAMERA, initial_pose=SCENE)
    assert right(begun.R, begun.t)


def test_poselib_beside_itself() -> None:
    poselib = pytest.importorskip("poselib")
    theirs, their_info = poselib.estimate_relative_pose(U1, U2, CAMERA, CAMERA, {"max_epipolar_error": 1.0}, {})
    camera = poselib.Camera("PINHOLE", CAMERA["params"], 1024, 768)
    for cameras in ((CAMERA, CAMERA), (camera, camera)):
        pose, info = compat.poselib.estimate_relative_pose(U1, U2, *cameras, {"max_epipolar_error": 1.0}, {})
        assert set(info) == set(their_info)
        assert turned(pose.R, theirs.R) < 0.5
        assert angle(pose.t, theirs.t) < 2


def test_opencv() -> None:
    E, mask = compat.cv2.findEssentialMat(U1, U2, K, compat.cv2.RANSAC, 0.999, 1.0)
    assert E is not None
    assert mask is not None
    assert mask.shape == (200, 1)
    assert mask.dtype == np.uint8
    assert np.linalg.norm(E) == pytest.approx(1)
    count, R, t, front = compat.cv2.recoverPose(E, U1, U2, K, mask=mask)
    assert right(R, t)
    assert t.shape == (3, 1)
    assert count == (front > 0).sum() >= 140
    flat, _ = compat.cv2.findEssentialMat(U1[:, None], U2[:, None], focal=1060.0, pp=(514.0, 384.0), threshold=1.0)
    np.testing.assert_allclose(flat, E)
    assert compat.cv2.findEssentialMat(*FALSE, K) == (None, None)


def test_opencv_beside_itself() -> None:
    cv2 = pytest.importorskip("cv2")
    E, mask = compat.cv2.findEssentialMat(U1, U2, K, cv2.RANSAC, 0.999, 1.0)
    count, R, t, front = compat.cv2.recoverPose(E, U1, U2, K, mask=mask.copy())
    their_count, their_R, their_t, their_front = cv2.recoverPose(E, U1, U2, K, mask=mask)
    np.testing.assert_allclose(R, their_R, atol=1e-6)
    np.testing.assert_allclose(t, their_t, atol=1e-6)
    assert abs(count - their_count) <= 2
    assert front.shape == their_front.shape


def fake(monkeypatch: pytest.MonkeyPatch, name: str, **members: Any) -> None:
    """A module of that name, in the place of one that is not installed."""
    module = ModuleType(name)
    for key, value in members.items():
        setattr(module, key, value)
    parts = name.split(".")
    for i in range(1, len(parts)):
        monkeypatch.setitem(sys.modules, ".".join(parts[:i]), ModuleType(".".join(parts[:i])))
    monkeypatch.setitem(sys.modules, name, module)


def test_gtsfm(monkeypatch: pytest.MonkeyPatch) -> None:
    fake(monkeypatch, "gtsam", Rot3=np.asarray, Unit3=np.asarray)
    keypoints = [SimpleNamespace(coordinates=u) for u in (U1[::-1], U2)]
    indices = np.stack([np.arange(200)[::-1], np.arange(200)], 1)
    pinhole = SimpleNamespace(K=lambda: K)
    bundler = SimpleNamespace(K=lambda: K, k1=lambda: 0.0, k2=lambda: 0.0)
    verifier = compat.GtsfmVerifier(1.0)
    R, t, verified, ratio = verifier.verify(keypoints[0], keypoints[1], indices, pinhole, bundler)
    assert right(R, t)
    assert len(verified) == round(200 * ratio) >= 140
    np.testing.assert_array_equal(verified.sum(1), 199)
    nothing = [SimpleNamespace(coordinates=u) for u in FALSE]
    R, t, verified, ratio = verifier.verify(nothing[0], nothing[1], np.stack([np.arange(100)] * 2, 1), pinhole, pinhole)
    assert (R, t, len(verified), ratio) == (None, None, 0, 0.0)


def test_the_loader_of_glue_factory_takes_the_class(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes the classes of a module that belong there and are estimators."""
    base = type("BaseEstimator", (), {})
    fake(monkeypatch, "torch")
    for name in ("gluefactory", "gluefactory.geometry", "gluefactory.robust_estimators"):
        fake(monkeypatch, name)
    fake(monkeypatch, "gluefactory.geometry.wrappers", Pose=object)
    fake(monkeypatch, "gluefactory.robust_estimators.base_estimator", BaseEstimator=base)
    module = ModuleType("gluefactory.robust_estimators.relative_pose.quest")
    exec("from quest_pose import compat\nQuestRelativePoseEstimator = compat.gluefactory_estimator()", vars(module))
    classes = [c for c in vars(module).values() if isinstance(c, type) and issubclass(c, base)]
    found = [c for c in classes if c.__module__ == module.__name__]
    assert [c.__name__ for c in found] == ["QuestRelativePoseEstimator"]


def test_glue_factory_and_gtsam_are_needed_only_there(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("gluefactory", "torch", "gtsam"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError):
        compat.gluefactory_estimator()
    with pytest.raises(ImportError):
        compat.GtsfmVerifier().verify(None, None, np.zeros((0, 2)), None, None)


def test_a_pure_rotation_has_no_direction() -> None:
    R = rotation(np.array([0.05, 0.1, -0.02]))
    X = RNG.uniform(-1, 1, (200, 3)) + [0, 0, 4]
    pixels = [x[:, :2] / x[:, 2:] * 1060 + [514, 384] + RNG.normal(0, 0.3, (200, 2)) for x in (X, X @ R.T)]
    pose, info = compat.poselib.estimate_relative_pose(*pixels, CAMERA, CAMERA)
    assert pose.t.tolist() == [0, 0, 0]
    assert info["num_inliers"] > 150
    assert turned(pose.R, R) < 0.2
