"""Cameras and candidates as Python values: frozen, comparable, copied, pickled."""

import copy
import json
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import quest_pose as qp
from scenes import make_scene

CAMERA = qp.Camera("PINHOLE", [1060, 1060, 514, 384], width=1024, height=768)
SCENE = make_scene(seed=1)
CANDIDATES = qp.solve(SCENE.x1, SCENE.x2)
(ROTATION,) = qp.solve(SCENE.X1, SCENE.X1 @ SCENE.R.T)
VALUES = [CAMERA, qp.Camera("SIMPLE_RADIAL", (500.5, 320, 240, -0.1)), *CANDIDATES, ROTATION]


def pickled(protocol: int) -> Callable[[Any], Any]:
    return lambda value: pickle.loads(pickle.dumps(value, protocol))


COPIES = [copy.copy, copy.deepcopy, *map(pickled, range(2, pickle.HIGHEST_PROTOCOL + 1))]


@pytest.mark.parametrize("duplicate", COPIES)
@pytest.mark.parametrize("value", VALUES)
def test_copies_are_equal(value: object, duplicate: Callable[[Any], Any]) -> None:
    other = duplicate(value)
    assert other is not value
    assert other == value
    assert repr(other) == repr(value)


def test_different_values_differ() -> None:
    for i, a in enumerate(VALUES):
        for j, b in enumerate(VALUES):
            assert (a == b) == (i == j)
            assert (a != b) == (i != j)
        assert a != "something else"


@pytest.mark.parametrize("value", [CAMERA, CANDIDATES[0]])
def test_frozen(value: Any) -> None:
    for name in [*(n for n in dir(value) if not n.startswith("_")), "new"]:
        with pytest.raises(AttributeError):
            setattr(value, name, 1)


def test_cameras_are_keys_and_candidates_are_not() -> None:
    assert hash(CAMERA) == hash(eval(repr(CAMERA), {"Camera": qp.Camera}))
    with pytest.raises(TypeError, match="unhashable"):
        hash(CANDIDATES[0])


def test_camera() -> None:
    assert CAMERA.model == "PINHOLE"
    assert CAMERA.params == (1060.0, 1060.0, 514.0, 384.0)
    assert (CAMERA.width, CAMERA.height) == (1024, 768)
    assert repr(CAMERA) == 'Camera("PINHOLE", [1060.0, 1060.0, 514.0, 384.0], width=1024, height=768)'
    assert eval(repr(CAMERA), {"Camera": qp.Camera}) == CAMERA
    k = qp.Camera.from_k([[1060, 0, 514], [0, 1060, 384], [0, 0, 1]])
    assert (k.width, k.height) == (None, None)
    assert k == qp.Camera("PINHOLE", np.array([1060, 1060, 514, 384], np.float32))
    assert k != CAMERA


@pytest.mark.parametrize("camera", [CAMERA, qp.Camera("OPENCV_FISHEYE", [300, 301, 320, 240, 0.1, 0.01, 0, 0])])
def test_bearing_and_project(camera: qp.Camera) -> None:
    pixels = np.array([[100.5, 200.0], [400.0, 300.25], [514.0, 384.0]])
    rays = camera.bearing(pixels)
    assert rays.shape == (3, 3)
    np.testing.assert_allclose(camera.project(3 * rays), pixels, atol=1e-9)
    assert camera.bearing(np.empty((0, 2))).shape == (0, 3)


def test_candidate() -> None:
    for c in [*CANDIDATES, ROTATION]:
        np.testing.assert_allclose(c.R @ c.R.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(c.R), 1)
        assert (c.R.shape, c.t.shape, c.depths1.shape, c.depths2.shape) == ((3, 3), (3,), (5,), (5,))
        assert c.quat_wxyz.shape == (4,)
        assert c.quat_wxyz[0] >= 0
        np.testing.assert_array_equal(np.roll(c.quat_wxyz, -1), c.quat_xyzw)
        assert c.feasible == (c.in_front == 5)
        assert 0 <= c.residual < 1
        assert c.kind in repr(c)


def test_the_quaternion_is_the_rotation() -> None:
    c = CANDIDATES[0]
    w, v = c.quat_wxyz[0], c.quat_wxyz[1:]
    x = np.array([0.3, -0.8, 0.5])
    np.testing.assert_allclose(c.R @ x, x + 2 * np.cross(v, np.cross(v, x) + w * x), atol=1e-12)


def test_arrays_are_copies() -> None:
    c = CANDIDATES[0]
    for name in ["R", "t", "quat_wxyz", "quat_xyzw", "depths1", "depths2"]:
        before = getattr(c, name).copy()
        getattr(c, name)[...] = 7
        np.testing.assert_array_equal(getattr(c, name), before)


def test_to_dict() -> None:
    c = CANDIDATES[0]
    d = json.loads(json.dumps(c.to_dict(), allow_nan=False))
    names = ["kind", "q_21", "R_21", "t_21", "depths1", "depths2", "residual", "in_front", "feasible"]
    assert list(d) == names
    found = [c.kind, c.quat_wxyz.tolist(), c.R.tolist(), c.t.tolist(), c.depths1.tolist(), c.depths2.tolist()]
    assert list(d.values()) == [*found, c.residual, c.in_front, c.feasible]


def test_undetermined_depths() -> None:
    assert ROTATION.depths1.tolist() == [np.inf] * 5
    assert json.loads(json.dumps(ROTATION.to_dict(), allow_nan=False))["depths2"] == [None] * 5


def test_candidates_are_not_made_by_hand() -> None:
    with pytest.raises(TypeError):
        qp.Candidate()
