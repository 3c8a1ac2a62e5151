"""What one process, thread or pool answers, for comparison with another: a module that a process of its own can import."""

from typing import Any

import numpy as np
import quest_pose as qp
from scenes import make_scene


def answers(_: int) -> list[Any]:
    scene = make_scene(seed=3, n=40)
    found = qp.estimate(scene.x1, scene.x2, threshold=1e-3)
    many = np.random.default_rng(2).uniform(-1, 1, (2, 600, 5, 2))
    batch = qp.solve_batch(*many)
    pairs = qp.estimate_batch(np.tile(scene.x1, (6, 1)), np.tile(scene.x2, (6, 1)), np.arange(0, 241, 40), threshold=1e-3)
    return [found.quat_wxyz.tolist(), found.t.tolist(), batch.t.tolist(), np.asarray(pairs.t).tolist()]
