"""Scenes with photographs and procedural textures, a free camera, random starts. Software rendering, no screen."""

import os

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "1")

import cv2
import mujoco
import numpy as np
import skimage

import quest_pose as qp

cv2.setNumThreads(1)
WIDTH, HEIGHT, FOVY = 320, 240, 45.0
FOCAL = 0.5 * HEIGHT / np.tan(np.radians(FOVY) / 2)
K = np.array([[FOCAL, 0, (WIDTH - 1) / 2], [0, FOCAL, (HEIGHT - 1) / 2], [0, 0, 1]])
CAMERA = qp.Camera("PINHOLE", [FOCAL, FOCAL, K[0, 2], K[1, 2]], width=WIDTH, height=HEIGHT)
# From MuJoCo's cameras, which look along -z with y up, to z forward and y down.
FLIP = np.diag([1.0, -1.0, -1.0])
# Metres to the middle of the scenes.
DEPTH = 1.1
PHOTOGRAPHS = (
    "astronaut.png", "coffee.png", "chelsea.png", "rocket.jpg", "gravel.png", "brick.png", "page.png", "motorcycle_left.png",
    "hubble_deep_field.jpg", "coins.png",
)  # fmt: skip


def rotation(vector):
    return cv2.Rodrigues(np.asarray(vector, float))[0]


def logarithm(R):
    return cv2.Rodrigues(R)[0].ravel()


def textures():
    """Squares of 512 pixels as PNG files: the photographs of scikit-image that are installed, and four procedural ones."""
    folder = os.path.join(os.path.dirname(skimage.__file__), "data")
    found = [cv2.imread(os.path.join(folder, name)) for name in PHOTOGRAPHS]
    squares = []
    for image in (f for f in found if f is not None):
        side = min(image.shape[:2])
        v, u = (image.shape[0] - side) // 2, (image.shape[1] - side) // 2
        squares.append(cv2.resize(image[v : v + side, u : u + side], (512, 512), interpolation=cv2.INTER_AREA))
    for seed in range(4):
        rng, image = np.random.default_rng(seed), np.full((512, 512, 3), 128, np.uint8)
        for _ in range(260):
            colour = tuple(int(c) for c in rng.integers(20, 236, 3))
            u, v = (int(x) for x in rng.integers(0, 512, 2))
            a, b = (int(x) for x in rng.integers(8, 60, 2))
            if rng.random() < 0.6:
                cv2.rectangle(image, (u, v), (u + a, v + b), colour, -1)
            else:
                cv2.circle(image, (u, v), a // 2, colour, -1, cv2.LINE_AA)
        squares.append(image)
    return [cv2.imencode(".png", image)[1].tobytes() for image in squares]


def quaternion(R):
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(R).ravel())
    return q


def box(material, middle, half, turn=(0, 0, 0)):
    numbers = {"size": half, "pos": middle, "quat": quaternion(rotation(turn))}
    text = " ".join(f'{name}="{" ".join(map(str, values))}"' for name, values in numbers.items())
    return f'<geom type="box" {material} {text}/>'


class Scene:
    """``general``: nine boxes before a wall. ``planar``: a wall. ``weak``: four boxes before a blank wall."""

    def __init__(self, kind, seed):
        rng = np.random.default_rng(seed)
        pictures = textures()
        order = rng.permutation(len(pictures))

        def painted(k):
            return f'material="m{order[k % len(order)]}"'

        geoms = []
        if kind == "planar":
            places = [(x, y) for y in (0, 1.3, -1.3) for x in (-0.65, 0.65)]
            geoms = [box(painted(k), (x, y, 1.05), (0.65, 0.65, 0.05)) for k, (x, y) in enumerate(places)]
        else:
            if kind == "weak":
                geoms.append(box('rgba="0.5 0.5 0.55 1"', (0, 0, 1.5), (3, 3, 0.05)))
            else:
                corners = [(x, y) for y in (-0.8, 0.8) for x in (-0.8, 0.8)]
                geoms = [box(painted(k), (x, y, 1.5), (0.8, 0.8, 0.05)) for k, (x, y) in enumerate(corners)]
            spots = rng.permutation([(x, y) for x in (-0.36, 0, 0.36) for y in (-0.26, 0, 0.26)])
            for k, (x, y) in enumerate(spots[: 4 if kind == "weak" else 9]):
                half = np.full(3, rng.uniform(0.08, 0.13))
                middle = (x + rng.uniform(-0.05, 0.05), y + rng.uniform(-0.05, 0.05), rng.uniform(0.75, 1.25))
                geoms.append(box(painted(4 + k), middle, half, rng.uniform(-0.6, 0.6, 3)))
        assets = "".join(
            f'<texture name="t{k}" type="cube" file="t{k}.png"/><material name="m{k}" texture="t{k}" specular="0.1" shininess="0.2"/>'
            for k in range(len(pictures))
        )
        text = f"""<mujoco><visual><quality offsamples="4" shadowsize="0"/><map znear="0.005" zfar="20"/>
        <headlight ambient="0.55 0.55 0.55" diffuse="0.1 0.1 0.1" specular="0 0 0"/></visual><asset>{assets}</asset><worldbody>
        <light directional="true" pos="0 -2 -2" dir="0.3 0.5 1" diffuse="0.4 0.4 0.4" specular="0.1 0.1 0.1"/>
        <body name="hand" mocap="true"><camera name="eye" fovy="{FOVY}"/></body>{"".join(geoms)}</worldbody></mujoco>"""
        self.model = mujoco.MjModel.from_xml_string(text, {f"t{k}.png": p for k, p in enumerate(pictures)})
        self.data = mujoco.MjData(self.model)
        self.renderer = mujoco.Renderer(self.model, HEIGHT, WIDTH)
        self.noise = np.random.default_rng(seed)

    def place(self, R, p):
        self.data.mocap_pos[0], self.data.mocap_quat[0] = p, quaternion(R @ FLIP)
        mujoco.mj_forward(self.model, self.data)
        self.renderer.update_scene(self.data, camera="eye")

    def image(self, R, p, sigma=2.0):
        """Grey, with the noise of a sensor, from the camera at p with axes R in the goal's frame."""
        self.place(R, p)
        grey = cv2.cvtColor(self.renderer.render(), cv2.COLOR_RGB2GRAY)
        return np.clip(grey + self.noise.normal(0, sigma, grey.shape), 0, 255).astype(np.uint8)

    def depth(self, R, p):
        self.place(R, p)
        self.renderer.enable_depth_rendering()
        depth = self.renderer.render().copy()
        self.renderer.disable_depth_rendering()
        return depth


def start(seed, turned=60):
    """A camera up to half the depth away, turned by up to so many degrees, the scene's middle about in its middle."""
    rng = np.random.default_rng(seed)
    while True:
        direction = rng.normal(size=3)
        p = direction / np.linalg.norm(direction) * rng.uniform(0.15, 1) * 0.5 * DEPTH
        if p[2] > 0.25 * DEPTH:
            continue
        forward = np.array([rng.uniform(-0.12, 0.12), rng.uniform(-0.1, 0.1), DEPTH]) - p
        forward /= np.linalg.norm(forward)
        right = np.cross([0, 1, 0], forward)
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(forward, right), forward], 1) @ rotation([0, 0, rng.uniform(-1, 1) * np.radians(turned)])
        if np.degrees(np.linalg.norm(logarithm(R))) <= turned:
            return R, p
