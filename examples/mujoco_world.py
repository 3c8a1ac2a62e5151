"""What the MuJoCo examples share: a textured scene, a camera that renders it, and what a goal is.

Rendering needs no screen: MUJOCO_GL=egl with libegl1 and libgl1-mesa-dri, or MUJOCO_GL=osmesa with libosmesa6.
"""

import argparse
import os

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "1")

import cv2
import mujoco
import numpy as np

import quest_pose as qp
from quest_pose.servo import Recorder

WIDTH, HEIGHT, FOVY = 320, 240, 45.0
FOCAL = 0.5 * HEIGHT / np.tan(np.radians(FOVY) / 2)
CAMERA = qp.Camera("PINHOLE", [FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2], width=WIDTH, height=HEIGHT)
# MuJoCo's cameras look along -z with y up; those of computer vision along z with y down.
FLIP = np.diag([1.0, -1.0, -1.0])
# About how far the scene is from the goal, in metres.
DEPTH = 1.1
# The goal counts as reached within 2 % of the depth and one degree.
NEAR, ANGLE = 0.02 * DEPTH, 1.0


def texture(seed):
    """Rectangles and discs of random colours, as the bytes of a PNG file."""
    rng = np.random.default_rng(seed)
    picture = np.full((256, 256, 3), 128, np.uint8)
    for _ in range(120):
        colour = tuple(int(c) for c in rng.integers(20, 236, 3))
        u, v = (int(x) for x in rng.integers(0, 256, 2))
        a, b = (int(x) for x in rng.integers(6, 34, 2))
        if rng.random() < 0.6:
            cv2.rectangle(picture, (u, v), (u + a, v + b), colour, -1)
        else:
            cv2.circle(picture, (u, v), a // 2, colour, -1, cv2.LINE_AA)
    return cv2.imencode(".png", picture)[1].tobytes()


def rotation(vector):
    return cv2.Rodrigues(np.asarray(vector, float))[0]


def angle(R):
    """In degrees."""
    return float(np.degrees(np.linalg.norm(cv2.Rodrigues(R)[0])))


def quaternion(R):
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(R).ravel())
    return " ".join(f"{x:.9f}" for x in q)


def scene(seed, R=np.eye(3), p=np.zeros(3), textures=8):
    """Boxes before a wall, as MJCF and files: what the goal's camera at (R, p) in the world has before it."""
    rng = np.random.default_rng(seed)
    files = {f"t{k}.png": texture(100 * seed + k) for k in range(textures)}
    assets = "".join(
        f'<texture name="t{k}" type="cube" file="t{k}.png"/><material name="m{k}" texture="t{k}" specular="0"/>'
        for k in range(textures)
    )

    def box(k, middle, half, turn):
        size, position = " ".join(map(str, half)), " ".join(map(str, middle))
        return (
            f'<geom type="box" material="m{k % textures}" size="{size}" pos="{position}" quat="{quaternion(rotation(turn))}" '
            'contype="0" conaffinity="0"/>'
        )

    wall = [box(k, (x, y, 1.5), (0.8, 0.8, 0.05), np.zeros(3)) for k, (x, y) in enumerate([(-0.8, -0.8), (0.8, -0.8), (-0.8, 0.8), (0.8, 0.8)])]
    spots = [(x, y) for x in (-0.36, 0, 0.36) for y in (-0.26, 0, 0.26)]
    boxes = []
    for k, (x, y) in enumerate(spots):
        middle = np.add([x, y, 0], [*rng.uniform(-0.05, 0.05, 2), rng.uniform(0.75, 1.25)])
        boxes.append(box(4 + k, middle, np.full(3, rng.uniform(0.08, 0.13)), rng.uniform(-0.6, 0.6, 3)))
    body = f'<body pos="{p[0]} {p[1]} {p[2]}" quat="{quaternion(R)}">{"".join(wall + boxes)}</body>'
    return assets, body, files


def model(assets, bodies, files):
    """A MuJoCo model of these parts, with light."""
    text = f"""<mujoco><compiler angle="radian"/>
    <visual><quality offsamples="4" shadowsize="0"/><map znear="0.01" zfar="20"/>
    <headlight ambient="0.6 0.6 0.6" diffuse="0.2 0.2 0.2" specular="0 0 0"/></visual>
    <asset>{assets}</asset><worldbody>{bodies}</worldbody></mujoco>"""
    return mujoco.MjModel.from_xml_string(text, files)


class Eye:
    """The camera ``eye`` of a model: where it is, and what it sees, with the noise of a sensor."""

    def __init__(self, model, data, seed):
        self.model, self.data = model, data
        self.renderer = mujoco.Renderer(model, HEIGHT, WIDTH)
        self.noise = np.random.default_rng(seed)

    def pose(self):
        """R and p: from the camera's frame, as computer vision has it, to the world's."""
        camera = self.data.camera("eye")
        return camera.xmat.reshape(3, 3) @ FLIP, camera.xpos.copy()

    def image(self):
        self.renderer.update_scene(self.data, camera="eye")
        grey = cv2.cvtColor(self.renderer.render(), cv2.COLOR_RGB2GRAY)
        return np.clip(grey + self.noise.normal(0, 2, grey.shape) + 0.5, 0, 255).astype(np.uint8)

    def close(self):
        self.renderer.close()


def away(goal, now):
    """How far ``now`` is from ``goal``, both (R, p): metres and degrees."""
    return float(np.linalg.norm(now[1] - goal[1])), angle(goal[0].T @ now[0])


def run_starts(run, description):
    """Reads the command line and calls ``run(seed, detector, recorder)`` from each start."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--detector", default="sift", choices=["sift", "orb"])
    parser.add_argument("--record", metavar="RUN.npz", help="the last start's run, for quest-cli servo --replay")
    given = parser.parse_args()
    for seed in range(given.seed, given.seed + given.starts):
        recorder = Recorder(given.record) if given.record else None
        run(seed, given.detector, recorder)
        if recorder:
            recorder.save()
