"""Cameras as other libraries have them, and what an estimate says in their words."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import quest_pose as qp
from scenes import K, make_scene, rotation

PARAMS = [500.0, 510.0, 320.0, 240.0, -0.1, 0.02, 1e-3, -2e-3]
CAMERA = qp.Camera("OPENCV", PARAMS, width=640, height=480)
PIXELS = np.random.default_rng(3).uniform([0, 0], [640, 480], (50, 2))


def test_what_may_stand_for_a_camera() -> None:
    plain = {"model": "OPENCV", "width": 640, "height": 480, "params": PARAMS}
    named = SimpleNamespace(name="OPENCV")
    others: list[Any] = [
        plain,
        plain | {"params": np.array(PARAMS), "has_prior_focal_length": True},
        plain | {"model": named},
        plain | {"model": 4},
        SimpleNamespace(model=named, params=np.array(PARAMS), width=640, height=480),
        SimpleNamespace(model_name=lambda: "OPENCV", model_id=4, params=PARAMS, width=640, height=480),
    ]
    scene = make_scene(1, 40)
    expected = qp.estimate(scene.u1, scene.u2, CAMERA)
    for other in others:
        assert qp.estimate(scene.u1, scene.u2, other, other) == expected
        assert qp.estimate_batch(scene.u1, scene.u2, [0, 40], [other])[0] == expected
    assert CAMERA.to_dict() == plain
    for bad, word in [
        ({"model": "OPENCV"}, "params"),
        (plain | {"model": 99}, "99"),
        (plain | {"params": PARAMS[:3]}, "8 parameters"),
    ]:
        with pytest.raises(qp.BadCamera, match=word):
            qp.estimate(scene.u1, scene.u2, bad)


def test_pycolmap_and_poselib() -> None:
    scene = make_scene(1, 40)
    expected = qp.estimate(scene.u1, scene.u2, CAMERA)
    pycolmap = pytest.importorskip("pycolmap")
    camera = pycolmap.Camera(model="OPENCV", width=640, height=480, params=PARAMS)
    assert qp.estimate(scene.u1, scene.u2, camera) == expected
    assert qp.estimate(scene.u1, scene.u2, camera.todict()) == expected


# Parameters of every model of COLMAP 4.2, with COLMAP's number of the model.
MODELS: dict[str, tuple[int, list[float]]] = {
    "SIMPLE_PINHOLE": (0, [300, 500, 250]),
    "PINHOLE": (1, [300, 310, 500, 250]),
    "SIMPLE_RADIAL": (2, [300, 500, 250, -0.05]),
    "RADIAL": (3, [300, 500, 250, -0.05, 0.01]),
    "OPENCV": (4, [300, 310, 500, 250, -0.05, 0.01, 1e-3, -2e-3]),
    "OPENCV_FISHEYE": (5, [300, 310, 500, 250, -0.05, 0.01, 1e-3, -2e-4]),
    "FULL_OPENCV": (6, [300, 310, 500, 250, -0.05, 0.01, 1e-3, -2e-3, 0.01, 0.02, 0.01, 0.005]),
    "FOV": (7, [300, 310, 500, 250, 0.9]),
    "SIMPLE_RADIAL_FISHEYE": (8, [300, 500, 250, -0.02]),
    "RADIAL_FISHEYE": (9, [300, 500, 250, -0.02, 0.004]),
    "THIN_PRISM_FISHEYE": (10, [300, 310, 500, 250, 0.03, -0.01, 0.004, -0.003, 0.002, -0.001, 0.005, -0.006]),
    "RAD_TAN_THIN_PRISM_FISHEYE": (
        11,
        [300, 310, 500, 250, 0.03, -0.01, 0.004, -0.003, 0.002, -0.001, 0.005, -0.006, 0.004, -0.002, 0.003, 0.001],
    ),
    "SIMPLE_DIVISION": (12, [300, 500, 250, -0.1]),
    "DIVISION": (13, [300, 310, 500, 250, 0.1]),
    "SIMPLE_FISHEYE": (14, [300, 500, 250]),
    "FISHEYE": (15, [300, 310, 500, 250]),
    "EUCM": (16, [300, 310, 500, 250, 0.6, 1.1]),
    "EQUIRECTANGULAR": (17, [1000, 500]),
}


@pytest.mark.parametrize("model", MODELS)
def test_every_model_goes_there_and_back(model: str) -> None:
    number, params = MODELS[model]
    camera = qp.Camera(model, params, width=1000, height=500)
    points = np.random.default_rng(number).uniform(-0.6, 0.6, (200, 3)) + [0, 0, 1]
    rays = camera.bearing(camera.project(points))
    np.testing.assert_allclose(np.cross(rays, points), 0, atol=1e-12)
    assert qp.Camera(**camera.to_dict()) == camera
    x1 = np.random.default_rng(number).uniform([-2, -2, 4], [2, 2, 8], (60, 3))
    R, t = rotation(np.array([0.02, -0.05, 0.03])), np.array([0.5, 0.1, 0.2])
    u1, u2 = camera.project(x1), camera.project(x1 @ R.T + t)
    found = qp.estimate(u1, u2, camera)
    np.testing.assert_allclose(found.R, R, atol=1e-9)
    np.testing.assert_allclose(found.t / np.linalg.norm(found.t), t / np.linalg.norm(t), atol=1e-8)
    assert qp.estimate(u1, u2, {"model": number, "params": params, "width": 1000, "height": 500}) == found


@pytest.mark.parametrize("model", MODELS)
def test_every_model_agrees_with_pycolmap(model: str) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    number, params = MODELS[model]
    theirs = pycolmap.Camera(model=model, width=1000, height=500, params=params)
    camera = qp.Camera(model, params)
    assert int(theirs.model) == number
    names = [name.strip() for name in theirs.params_info.split(",")]
    with pytest.raises(qp.BadCamera, match=rf"\({', '.join(names)}\)"):
        qp.Camera(model, [*params, 0.0])
    points = np.random.default_rng(number).uniform(-0.6, 0.6, (200, 3)) + [0, 0, 1]
    pixels = camera.project(points)
    # Coordinates of 1000 pixels are rounded to 1e-13; a few operations.
    np.testing.assert_allclose(pixels, theirs.img_from_cam(points), atol=1e-11)
    rays = camera.bearing(pixels)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    # COLMAP's iterations end at 1e-10 on the plane.
    np.testing.assert_allclose(rays, theirs.cam_ray_from_img(pixels), atol=1e-8)
    everywhere = np.random.default_rng(number).uniform([-2000, -2000], [3000, 3000], (500, 2))
    seen = camera.has_ray(everywhere)
    assert np.isfinite(camera.bearing(everywhere[seen])).all()


def test_opencv() -> None:
    k = np.array([[500.0, 0, 320], [0, 510, 240], [0, 0, 1]])
    assert qp.Camera.from_opencv(k) == qp.Camera.from_k(k)
    assert qp.Camera.from_opencv(k, [-0.1, 0.02, 1e-3, -2e-3], size=(640, 480)) == CAMERA
    five = qp.Camera.from_opencv(k, np.array([[-0.1, 0.02, 1e-3, -2e-3, 0.0]]))
    assert five.model == "FULL_OPENCV"
    np.testing.assert_allclose(five.bearing(PIXELS), CAMERA.bearing(PIXELS), atol=1e-12)
    fourteen = qp.Camera.from_opencv(k, [0.1, 0.2, 1e-3, 2e-3, 0.3, 0.01, 0.02, 0.03, *[0.0] * 6])
    assert fourteen.params[4:] == (0.1, 0.2, 1e-3, 2e-3, 0.3, 0.01, 0.02, 0.03)
    fisheye = qp.Camera.from_opencv(k, [0.1, 0.01, 0.0, 0.0], fisheye=True)
    assert fisheye.model == "OPENCV_FISHEYE"
    for dist, fish, word in [([1.0] * 3, False, "3 coefficients"), ([0.1] * 12, False, "prism"), ([0.1] * 5, True, "0 or 4")]:
        with pytest.raises(qp.BadCamera, match=word):
            qp.Camera.from_opencv(k, dist, fisheye=fish)
    both: Any = (k, [-0.1, 0.02, 1e-3, -2e-3])
    with pytest.raises(qp.BadCamera, match="from_opencv"):
        qp.estimate(PIXELS, PIXELS, both)


def test_camera_info() -> None:
    k = [500.0, 0, 320, 0, 510, 240, 0, 0, 1]
    d = [-0.1, 0.02, 1e-3, -2e-3, 0.0]
    two = SimpleNamespace(k=k, d=d, distortion_model="plumb_bob", width=640, height=480)
    one = SimpleNamespace(K=k, D=d, distortion_model="plumb_bob", width=640, height=480)
    expected = qp.Camera.from_opencv(np.reshape(k, (3, 3)), d, size=(640, 480))
    scene = make_scene(1, 40)
    found = [qp.estimate(scene.u1, scene.u2, camera) for camera in (one, two, expected)]
    assert found[0] == found[1] == found[2]
    two.distortion_model = "other"
    with pytest.raises(qp.BadCamera, match=r"other.*plumb_bob"):
        qp.estimate(scene.u1, scene.u2, two)


def test_cameras_are_keys() -> None:
    again = qp.Camera("OPENCV", PARAMS, width=640, height=480)
    zero, minus = (qp.Camera("SIMPLE_RADIAL", [1, 0, 0, x]) for x in (0.0, -0.0))
    assert hash(again) == hash(CAMERA)
    assert (zero == minus) <= (hash(zero) == hash(minus))
    assert {CAMERA: 1}[again] == 1
    assert len({CAMERA, again, qp.Camera.from_k(K)}) == 2


def test_pixels_without_a_ray() -> None:
    barrel = qp.Camera("SIMPLE_RADIAL", [500, 320, 240, -0.2])
    pixels = np.array([[320, 240], [1e6, 0], [np.nan, 0], [300, 200]])
    assert barrel.has_ray(pixels).tolist() == [True, False, False, True]
    rays = barrel.bearing(pixels, invalid="nan")
    assert np.isnan(rays[1:3]).all()
    np.testing.assert_array_equal(rays[[0, 3]], barrel.bearing(pixels[[0, 3]]))
    with pytest.raises(qp.BadCamera, match="pixel 1"):
        barrel.bearing(pixels)
    with pytest.raises(qp.QuestError, match="nan"):
        barrel.bearing(pixels, invalid="none")  # type: ignore[arg-type]


def test_matrices_points_and_depths() -> None:
    scene = make_scene(5, 60)
    u1, u2 = scene.u1.copy(), scene.u2.copy()
    u2[0] += 100
    est = qp.estimate(u1, u2, K)
    h1, h2 = np.c_[u1, np.ones(60)], np.c_[u2, np.ones(60)]
    inverse = np.linalg.inv(K)
    errors = np.einsum("ni,ij,nj->n", h2 @ inverse.T, est.E, h1 @ inverse.T)[est.inliers]
    np.testing.assert_allclose(errors, 0, atol=1e-8)
    assert np.linalg.norm(est.E) == pytest.approx(np.sqrt(2))
    f = est.fundamental(K)
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", h2, f, h1)[est.inliers], 0, atol=1e-6)
    assert np.linalg.norm(f) == pytest.approx(1)
    with pytest.raises(qp.BadCamera, match="fisheye"):
        est.fundamental(qp.Camera("OPENCV_FISHEYE", [500, 500, 320, 240, 0, 0, 0, 0]))
    np.testing.assert_array_equal(est.matrix()[:3, :3], est.R)
    np.testing.assert_array_equal(est.matrix()[:, 3], [*est.t, 1])
    points, depths = est.points(u1, u2, K), est.depths(u1, u2, K)
    assert np.isnan(points[~est.inliers]).all()
    # One scale stands between the truth and the estimate.
    ratio = np.linalg.norm(est.t) / np.linalg.norm(scene.t)
    np.testing.assert_allclose(points[est.inliers], ratio * scene.X1[est.inliers], rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(depths[est.inliers, 1], ratio * scene.X2[est.inliers, 2], rtol=1e-4)
    assert est.inlier_ratio == est.inlier_count / 60
    with pytest.raises(qp.ShapeMismatch, match=r"59 points.*60"):
        est.points(u1[1:], u2[1:], K)


def test_covariances_in_other_conventions() -> None:
    scene = make_scene(6, 80)
    rng = np.random.default_rng(1)
    est = qp.estimate(scene.u1 + rng.normal(0, 0.5, (80, 2)), scene.u2, K)

    def log(t: Any) -> Any:
        x = t - np.eye(4)
        log = x - x @ x / 2 + x @ x @ x / 3
        return np.array([log[2, 1], log[0, 2], log[1, 0], *log[:3, 3]])

    def changed(delta: Any) -> Any:
        t = est.matrix()
        t[:3, :3] = rotation(delta[:3]) @ t[:3, :3] if np.any(delta[:3]) else t[:3, :3]
        t[:3, 3] += delta[3:]
        return t

    inverse = np.linalg.inv(est.matrix())
    def error(convention: str, delta: Any) -> Any:
        return log(changed(delta) @ inverse if convention == "se3_left" else inverse @ changed(delta))

    for convention in ("se3_left", "se3_right", "gtsam"):
        step = 1e-5
        columns = [error(convention, step * e) - error(convention, -step * e) for e in np.eye(6)]
        jacobian = np.array(columns).T / (2 * step)
        expected = jacobian @ est.covariance @ jacobian.T
        found = est.covariance_as(convention)
        # Central differences of step 1e-5 are exact to its square.
        np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
    np.testing.assert_array_equal(est.covariance_as("additive"), est.covariance)
    with pytest.raises(qp.QuestError, match="gtsam"):
        est.covariance_as("sophus")  # type: ignore[arg-type]
