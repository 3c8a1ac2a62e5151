"""In the place of other libraries: their signatures and results, this one's poses.

>>> from quest_pose import compat
>>> poselib, cv2 = compat.poselib, compat.cv2     # then as before

None of the libraries is needed. What changes: false pairs are refused where others return a pose (``num_inliers`` is 0 and the
pose the identity), and a camera that only turned has ``t = 0`` in ``poselib`` and a direction of no meaning in ``cv2``, whose
results have no other.
"""

import sys
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quest_pose._core import Camera, Estimate, NoAnswer, estimate

__all__ = ["CameraPose", "GtsfmVerifier", "cv2", "gluefactory_estimator", "poselib"]


class CameraPose(NamedTuple):
    """A pose with the attributes of ``poselib.CameraPose``: ``X2 = R @ X1 + t``, ``|t|`` is 1, or 0 for a pure rotation."""

    q: NDArray[np.float64]
    """The rotation as a unit quaternion, scalar first."""
    t: NDArray[np.float64]
    """The direction of the translation."""

    @property
    def R(self) -> NDArray[np.float64]:
        """The rotation matrix."""
        w, x, y, z = self.q
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    @property
    def Rt(self) -> NDArray[np.float64]:
        """``[R t]``."""
        return np.c_[self.R, self.t]

    def center(self) -> NDArray[np.float64]:
        """The centre of camera 2 in the frame of camera 1."""
        return -self.R.T @ self.t


def estimate_relative_pose(
    points2D_1: ArrayLike,
    points2D_2: ArrayLike,
    camera1: Any = None,
    camera2: Any = None,
    ransac_opt: Mapping[str, Any] | None = None,
    bundle_opt: Mapping[str, Any] | None = None,
    initial_pose: Any = None,
    *,
    camera1_dict: Any = None,
    camera2_dict: Any = None,
) -> tuple[CameraPose, dict[str, Any]]:
    """``poselib.estimate_relative_pose``, in both of its signatures: of cameras and of dictionaries.

    Parameters
    ----------
    points2D_1, points2D_2 : array_like of shape (N, 2)
        Pixels.
    camera1, camera2
        What stands for a camera: PoseLib's dictionaries and cameras.
    ransac_opt : mapping, optional
        Options of PoseLib up to 2.0.4, or all options of 2.0.5, whose ``ransac`` is such a mapping. Of these are heard:
        ``max_epipolar_error`` (2.0.5: ``max_error``), ``success_prob``, ``min_iterations``, ``max_iterations``, ``seed``.
    bundle_opt : mapping, optional
        Plays no part: poses are refined until they stand still.
    initial_pose : pose with R and t, optional

    Returns
    -------
    (CameraPose, dict)
        The keys of PoseLib: ``refinements``, ``iterations``, ``num_inliers``, ``inlier_ratio``, ``model_score``, ``inliers`` (list of
        bool). Where there is no pose ``num_inliers`` is 0 and the pose the identity.
    """
    cameras = (camera1 if camera1_dict is None else camera1_dict), (camera2 if camera2_dict is None else camera2_dict)
    options = dict(ransac_opt or {})
    options |= options.pop("ransac", {})
    keywords: dict[str, Any] = {"threshold": options.get("max_epipolar_error", options.get("max_error", 1.0))}
    names = {"success_prob": "confidence", "min_iterations": "min_iterations", "max_iterations": "max_iterations"}
    keywords |= {ours: options[theirs] for theirs, ours in (names | {"seed": "seed"}).items() if theirs in options}
    if initial_pose is not None:
        keywords["initial_pose"] = (initial_pose.R, initial_pose.t)
    try:
        found = estimate(points2D_1, points2D_2, *cameras, **keywords)
    except NoAnswer:
        nothing = {"refinements": 0, "iterations": 0, "num_inliers": 0, "inlier_ratio": 0.0, "model_score": float("inf")}
        pose = CameraPose(np.array([1.0, 0, 0, 0]), np.zeros(3))
        return pose, nothing | {"inliers": [False] * len(np.asarray(points2D_1))}
    return CameraPose(found.quat_wxyz, _direction(found)), {
        "refinements": 1,
        "iterations": found.iterations,
        "num_inliers": found.inlier_count,
        "inlier_ratio": found.inlier_ratio,
        "model_score": (1 - found.score) * len(found.inliers),
        "inliers": found.inliers.tolist(),
    }


def _direction(found: Estimate) -> NDArray[np.float64]:
    """The translation with length one; zero where the camera only turned."""
    if found.model == "pure_rotation":
        return np.zeros(3)
    return found.t / np.linalg.norm(found.t)


poselib = SimpleNamespace(estimate_relative_pose=estimate_relative_pose, CameraPose=CameraPose)
"""In the place of ``poselib``: ``estimate_relative_pose``."""


def _k(given: Any, focal: float, pp: Any) -> NDArray[np.float64]:
    if given is None:
        return np.array([[focal, 0, pp[0]], [0, focal, pp[1]], [0, 0, 1.0]])
    return np.asarray(given, dtype=float)


def _pixels(points: Any) -> NDArray[np.float64]:
    return np.asarray(points, dtype=float).reshape(-1, 2)


def find_essential_mat(
    points1: Any,
    points2: Any,
    cameraMatrix: Any = None,
    method: int = 8,
    prob: float = 0.999,
    threshold: float = 1.0,
    maxIters: int = 1000,
    mask: Any = None,
    *,
    focal: float = 1.0,
    pp: tuple[float, float] = (0.0, 0.0),
) -> tuple[NDArray[np.float64] | None, NDArray[np.uint8] | None]:
    """``cv2.findEssentialMat`` with one camera matrix; ``method`` plays no part.

    Returns
    -------
    (numpy.ndarray of shape (3, 3), numpy.ndarray of shape (N, 1)), or (None, None)
        The essential matrix, and 1 for inliers; nothing where no pose is found.
    """
    del method, mask
    k = _k(cameraMatrix, focal, pp)
    u1, u2 = _pixels(points1), _pixels(points2)
    try:
        found = estimate(
            u1, u2, k, threshold=threshold, confidence=prob, max_iterations=max(maxIters, 1),
            min_iterations=min(100, max(maxIters, 1)),
        )  # fmt: skip
    except NoAnswer:
        return None, None
    return found.E / np.sqrt(2), found.inliers.astype(np.uint8)[:, None]


def recover_pose(
    E: Any,
    points1: Any,
    points2: Any,
    cameraMatrix: Any = None,
    R: Any = None,
    t: Any = None,
    mask: Any = None,
    *,
    focal: float = 1.0,
    pp: tuple[float, float] = (0.0, 0.0),
) -> tuple[int, NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8]]:
    """``cv2.recoverPose`` of an essential matrix: the one of its four poses that has the most points in front of both cameras.

    Returns
    -------
    (int, numpy.ndarray of shape (3, 3), numpy.ndarray of shape (3, 1), numpy.ndarray of shape (N, 1))
        How many of the points of ``mask`` are in front, R, t with length one, and 255 for those points.
    """
    del R, t
    inverse = np.linalg.inv(_k(cameraMatrix, focal, pp))
    rays = [np.c_[_pixels(p), np.ones(len(_pixels(p)))] @ inverse.T for p in (points1, points2)]
    given = np.ones(len(rays[0]), bool) if mask is None else np.asarray(mask).reshape(-1) != 0
    U, _, Vt = np.linalg.svd(np.asarray(E, dtype=float)[:3])
    U, Vt = U * np.sign(np.linalg.det(U)), Vt * np.sign(np.linalg.det(Vt))
    W = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    best: tuple[int, Any, Any, Any] | None = None
    for turn in (U @ W @ Vt, U @ W.T @ Vt):
        for direction in (U[:, 2], -U[:, 2]):
            front = given & _in_front(turn, direction, *rays)
            if best is None or front.sum() > best[0]:
                best = int(front.sum()), turn, direction[:, None], (255 * front).astype(np.uint8)[:, None]
    assert best is not None
    return best


def _in_front(R: Any, t: Any, x1: Any, x2: Any) -> Any:
    """Whether the depths of matches are positive in both views."""
    a, b = x1 @ R.T, x2
    n = np.cross(b, a)
    squared = np.maximum((n * n).sum(1), np.finfo(float).tiny)
    z1 = -(np.cross(b, t) * n).sum(1) / squared
    z2 = -(np.cross(a, t) * n).sum(1) / squared
    return (z1 > 0) & (z2 > 0)


cv2 = SimpleNamespace(findEssentialMat=find_essential_mat, recoverPose=recover_pose, RANSAC=8, USAC_MAGSAC=38)
"""In the place of ``cv2``: ``findEssentialMat`` and ``recoverPose``."""


def gluefactory_estimator() -> type:
    """The class of an estimator of relative poses for glue-factory: ``gluefactory.robust_estimators.relative_pose``.

    Returns
    -------
    type
        A subclass of its ``BaseEstimator``, with the configuration ``ransac_th``, in pixels, and ``options`` of ``estimate``. It
        belongs to the module that asks for it, since glue-factory's loader takes no class of another one.

    Raises
    ------
    ImportError
        Where glue-factory is not installed.
    """
    import torch
    from gluefactory.geometry.wrappers import Pose
    from gluefactory.robust_estimators.base_estimator import BaseEstimator

    class QuestRelativePoseEstimator(BaseEstimator):  # type: ignore[misc]
        """Relative poses by quest_pose."""

        default_conf = {"ransac_th": 1.0, "options": {}}
        required_data_keys = ["m_kpts0", "m_kpts1", "camera0", "camera1"]

        def _init(self, conf: Any) -> None:
            pass

        def _forward(self, data: Any) -> dict[str, Any]:
            points = data["m_kpts0"], data["m_kpts1"]
            cameras = [data[key].to_cameradict() for key in ("camera0", "camera1")]
            try:
                found = estimate(
                    *(p.cpu().numpy() for p in points), *cameras, threshold=self.conf.ransac_th, **self.conf.options
                )
            except NoAnswer:
                identity = Pose.from_4x4mat(torch.eye(4).to(points[0]))
                return {"success": False, "M_0to1": identity, "inliers": torch.zeros(len(points[0])).bool()}
            R, t = (torch.from_numpy(x).to(points[0]) for x in (found.R, _direction(found)))
            return {"success": True, "M_0to1": Pose.from_Rt(R, t), "inliers": torch.from_numpy(found.inliers)}

    QuestRelativePoseEstimator.__module__ = sys._getframe(1).f_globals["__name__"]
    return QuestRelativePoseEstimator


class GtsfmVerifier:
    """The verifier of GTSFM: ``verify`` with its arguments and its results; gtsam is imported when it is called.

    Parameters
    ----------
    estimation_threshold_px : float
        As ``threshold`` of ``estimate``.
    options
        Further options of ``estimate``.
    """

    def __init__(self, estimation_threshold_px: float = 1.0, **options: Any) -> None:
        self.options = options | {"threshold": estimation_threshold_px}

    def verify(
        self, keypoints_i1: Any, keypoints_i2: Any, match_indices: Any, camera_intrinsics_i1: Any, camera_intrinsics_i2: Any
    ) -> tuple[Any, Any, NDArray[np.uint64], float]:
        """The rotation and the direction from image 1 to image 2, the matches that agree, and how many do.

        Returns
        -------
        (gtsam.Rot3 or None, gtsam.Unit3 or None, numpy.ndarray of shape (M, 2), float)
            ``i2Ri1``, ``i2Ui1``, the inliers among ``match_indices``, and their part of them.
        """
        from gtsam import Rot3, Unit3

        matches = np.asarray(match_indices)
        cameras = [_calibration(c) for c in (camera_intrinsics_i1, camera_intrinsics_i2)]
        points = [k.coordinates[matches[:, i]] for i, k in enumerate((keypoints_i1, keypoints_i2))]
        try:
            found = estimate(*points, *cameras, **self.options)
        except NoAnswer:
            return None, None, np.zeros((0, 2), np.uint64), 0.0
        return Rot3(found.R), Unit3(_direction(found)), matches[found.inliers].astype(np.uint64), found.inlier_ratio


def _calibration(given: Any) -> Camera:
    """A calibration of gtsam: ``Cal3Bundler`` has f, k1, k2, u0, v0; others have a matrix K."""
    k = np.asarray(given.K())
    if hasattr(given, "k1") and hasattr(given, "k2"):
        return Camera("RADIAL", [k[0, 0], k[0, 2], k[1, 2], given.k1(), given.k2()])
    return Camera.from_k(k)
