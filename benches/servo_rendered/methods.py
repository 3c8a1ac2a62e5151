"""One step of each method: the rows of ``GoalImage.match`` in, a twist and a state out."""

import cv2
import numpy as np
import poselib
from scenes import CAMERA, DEPTH, FOCAL, HEIGHT, K, WIDTH, logarithm

from quest_pose.servo import CameraServo

MAX_SPEED, MAX_TURN_RATE, RATE, PERIOD = 0.2, 0.4, 0.6, 0.1
STAND = np.zeros(3), np.zeros(3)


def limited(linear, angular):
    """Both parts slowed alike."""
    factor = min(1, MAX_SPEED / max(np.linalg.norm(linear), 1e-12), MAX_TURN_RATE / max(np.linalg.norm(angular), 1e-12))
    return linear * factor, angular * factor


def on_plane(pixels):
    return (np.c_[pixels, np.ones(len(pixels))] @ np.linalg.inv(K).T)[:, :2]


class Ours:
    """``CameraServo`` as the documentation says it: all rows, right or wrong."""

    def __init__(self, goal, _, noise=None, **options):
        limits = {"max_speed": MAX_SPEED, "max_turn_rate": MAX_TURN_RATE, "period": PERIOD, "unit": DEPTH, "rate": RATE}
        self.loop = CameraServo(goal.points, CAMERA, noise=noise or goal.noise, **limits, **options)

    def step(self, rows):
        command = self.loop.step(rows)
        return command.linear, command.angular, command.state, command.inliers


class OnePose:
    """The law on one pose of each image, by all matches of the image."""

    def __init__(self, goal, depths):
        self.points, self.depths = goal.points, depths

    def step(self, rows):
        seen = np.flatnonzero(np.isfinite(rows[:, 0]))
        if len(seen) < 6:
            return *STAND, "too_few_features", len(seen)
        try:
            pose = self.pose(self.points[seen], rows[seen])
        except cv2.error:
            pose = None
        if pose is None:
            return *STAND, "no_pose", 0
        R, t, used = pose
        return *limited(RATE * DEPTH * t, RATE * logarithm(R)), "tracking", used


class PoseLib(OnePose):
    """PoseLib's relative pose; the length of t by the median of the triangulated depths."""

    def pose(self, goal, now):
        camera = {"model": "PINHOLE", "width": WIDTH, "height": HEIGHT, "params": [FOCAL, FOCAL, K[0, 2], K[1, 2]]}
        options = {"max_epipolar_error": 1.0, "max_iterations": 500, "min_iterations": 50}
        found, info = poselib.estimate_relative_pose(goal, now, camera, camera, options, {})
        inliers = np.array(info["inliers"], bool)
        if inliers.sum() < 6:
            return None
        R, t = np.array(found.R), np.array(found.t)
        if not np.linalg.norm(t) > 0:
            return R, np.zeros(3), inliers.sum()
        t /= np.linalg.norm(t)
        return R, t * self.length(R, t, goal[inliers], now[inliers]), inliers.sum()

    @staticmethod
    def length(R, t, goal, now):
        x1, x2 = (np.c_[on_plane(p), np.ones(len(p))] for p in (goal, now))
        inverse = []
        for a, b in zip(x1 @ R.T, x2, strict=True):
            z1 = np.linalg.lstsq(np.stack([a, -b], 1), -t, rcond=None)[0][0]
            inverse.append(1 / z1 if z1 > 0 else 0.0)
        return np.median(inverse)


class Homography(OnePose):
    """MAGSAC, and the decomposition whose plane is nearest to that of the image before."""

    normal = np.array([0, 0, 1.0])

    def pose(self, goal, now):
        H, mask = cv2.findHomography(goal, now, cv2.USAC_MAGSAC, 2.0)
        if H is None or mask.sum() < 5:
            return None
        inliers = mask.ravel().astype(bool)
        x1 = np.c_[on_plane(goal[inliers]), np.ones(inliers.sum())]
        _, rotations, translations, normals = cv2.decomposeHomographyMat(H, K)
        found = [(n.ravel(), R, t.ravel()) for R, t, n in zip(rotations, translations, normals, strict=True)]
        in_front = [f for f in found if np.median(x1 @ f[0]) > 0]
        if not in_front:
            return None
        normal, R, t = max(in_front, key=lambda f: f[0] @ self.normal)
        if inliers.sum() > 10:
            self.normal = normal
        return R, t, inliers.sum()


class ImageBased(OnePose):
    """Classic image-based servoing: the mean of both interaction matrices, the goal's depths KNOWN, MAGSAC's inliers."""

    def step(self, rows):
        seen = np.flatnonzero(np.isfinite(rows[:, 0]))
        if len(seen) < 6:
            return *STAND, "too_few_features", len(seen)
        E, mask = cv2.findEssentialMat(self.points[seen], rows[seen], K, cv2.USAC_MAGSAC, 0.9999, 1.0)
        if E is None or mask is None or mask.sum() < 6:
            return *STAND, "no_pose", 0
        used = seen[mask.ravel().astype(bool)]
        x, goal, depths = on_plane(rows[used]), on_plane(self.points[used]), self.depths[used]
        mean = 0.5 * (self.interaction(x, depths) + self.interaction(goal, depths))
        twist = -RATE * np.linalg.pinv(mean) @ (x - goal).ravel()
        return *limited(twist[:3], twist[3:]), "tracking", len(used)

    @staticmethod
    def interaction(x, z):
        u, v = x.T
        o = np.zeros_like(u)
        first = np.stack([-1 / z, o, u / z, u * v, -(1 + u * u), v], 1)
        second = np.stack([o, -1 / z, v / z, 1 + v * v, -u * v, -u], 1)
        return np.stack([first, second], 1).reshape(-1, 6)


METHODS = {"servo": Ours, "poselib": PoseLib, "homography": Homography, "ibvs": ImageBased}
