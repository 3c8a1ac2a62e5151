"""Computes the figures of the page on the paper: `python paper_figures.py FOLDER` writes them as SVG."""

import sys
from pathlib import Path

import matplotlib
import numpy as np
import quest_pose as qp

matplotlib.use("svg")
matplotlib.rcParams["svg.hashsalt"] = "quest-pose"
import matplotlib.pyplot as plt  # noqa: E402  the backend comes first

FOCAL = 600.0


def rotation(vector):
    """The matrix of a rotation vector."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle if angle > 0 else np.zeros(3)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def scene(rng, parallax, noise_px=0.0):
    """Five points of two views on the planes z = 1, and the pose between them."""
    points = rng.uniform([-1, -1, 2], [1, 1, 4], (5, 3))
    R = rotation(rng.uniform(-0.2, 0.2, 3))
    t = rng.normal(size=3)
    t *= parallax * points[:, 2].mean() / np.linalg.norm(t)
    second = points @ R.T + t
    x1, x2 = points[:, :2] / points[:, 2:], second[:, :2] / second[:, 2:]
    noise = rng.normal(scale=noise_px / FOCAL, size=(2, 5, 2))
    return x1 + noise[0], x2 + noise[1], R, t


def error(R, estimate):
    """The angle between two rotations, in degrees."""
    return np.degrees(np.arccos(np.clip((np.trace(R.T @ estimate) - 1) / 2, -1, 1)))


# The plane n_i = x2_i × R x1_i holds the translation. Five of them meet in one line at the true rotation.
def planes(R, x1, x2):
    """How far the five normals are from lying in one plane: the smallest singular value."""
    a = np.column_stack([x1, np.ones(5)])
    b = np.column_stack([x2, np.ones(5)])
    normals = np.cross(b, a @ R.T)
    return np.linalg.svd(normals, compute_uv=False)[2]


def figure_constraint(axes):
    x1, x2, R, _ = scene(np.random.default_rng(5), parallax=0.3)
    reach = np.radians(np.linspace(-25, 25, 121))
    cost = [[planes(rotation(np.array([u, v, 0.0])) @ R, x1, x2) for u in reach] for v in reach]
    picture = axes.contourf(np.degrees(reach), np.degrees(reach), np.log10(np.maximum(cost, 1e-4)), 24, cmap="viridis")
    axes.plot(0, 0, "o", color="white", mec="black", label="the true rotation")
    axes.set(xlabel="turned about x, in degrees", ylabel="turned about y, in degrees", aspect="equal")
    axes.legend(loc="upper right")
    plt.colorbar(picture, label="log10 of the smallest singular value")


def figure_complex(axes):
    noises = [0, 0.5, 1, 2, 3, 5, 7, 10]
    closest = {"real solutions alone": [], "with the real parts of complex ones": []}
    for noise in noises:
        rng = np.random.default_rng(2018)
        errors = []
        for _ in range(400):
            x1, x2, R, _ = scene(rng, parallax=0.3, noise_px=noise)
            found = qp.solve(x1, x2, solver="stewenius")
            every = [error(R, c.R) for c in found if c.kind != "rotation_only"]
            real = [error(R, c.R) for c in found if c.kind == "exact"]
            errors.append((min(real, default=np.nan), min(every, default=np.nan)))
        for values, mean in zip(closest.values(), np.nanmean(errors, axis=0), strict=True):
            values.append(mean)
    for (label, values), style in zip(closest.items(), ["o-", "s-"], strict=True):
        axes.plot(noises, values, style, label=label)
    axes.set(xlabel="noise, in pixels", ylabel="rotation error of the closest candidate, in degrees")
    axes.legend()


def figure_parallax(axes):
    lengths = np.logspace(-4, -0.3, 12)
    found, scatter = [], []
    for length in lengths:
        rng = np.random.default_rng(63)
        values = []
        for _ in range(200):
            x1, x2, R, _ = scene(rng, parallax=length, noise_px=0.5)
            best = min(qp.solve(x1, x2), key=lambda c: error(R, c.R))
            values.append(np.linalg.norm(best.t))
        found.append(np.median(values))
        scatter.append(np.percentile(values, [10, 90]))
    low, high = np.transpose(scatter)
    axes.fill_between(lengths, low, high, alpha=0.25, label="from 10 % to 90 % of the scenes")
    axes.plot(lengths, found, "o-", label="|t| of quest, median")
    axes.plot(lengths, lengths, "k:", label="the truth")
    axes.axhline(1, color="C3", label="a unit vector")
    axes.set(xscale="log", yscale="log", xlabel="true parallax", ylabel="length of the translation")
    axes.legend()


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for draw in (figure_constraint, figure_complex, figure_parallax):
        figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
        draw(axes)
        name = draw.__name__.removeprefix("figure_")
        figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
        plt.close(figure)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
