"""``examples/mujoco_arm.py`` and ``mujoco_robot.py``: from rendered images to joints and wheels, without a screen."""

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[3] / "examples"
if importlib.util.find_spec("mujoco") is None:
    pytest.skip("MuJoCo is not installed: pip install mujoco", allow_module_level=True)


@pytest.fixture(scope="module")
def examples() -> Any:
    """The modules by name, or a skip where nothing can be rendered."""
    sys.path.insert(0, str(EXAMPLES))
    try:
        world: Any = importlib.import_module("mujoco_world")
        mujoco: Any = importlib.import_module("mujoco")
        model = world.model(*world.scene(0)[:1], '<camera name="eye"/>' + world.scene(0)[1], world.scene(0)[2])
        try:
            mujoco.Renderer(model, 24, 32).close()
        except Exception as error:
            pytest.skip(f"MuJoCo cannot render here ({error}): install libegl1 and libgl1-mesa-dri, or set MUJOCO_GL=osmesa")
        yield {name: importlib.import_module(f"mujoco_{name}") for name in ("world", "arm", "robot")}
    finally:
        sys.path.remove(str(EXAMPLES))


def test_the_arm_turns_about_its_camera(examples: Any) -> None:
    world, arm = examples["world"], examples["arm"]
    assets, body, files = world.scene(1)
    robot = arm.Arm(world.model(assets, arm.arm() + body, files))
    eye = world.Eye(robot.model, robot.data, 1)
    for linear, angular in ([0.05, 0.0, 0.0], [0.0, 0.0, 0.0]), ([0.0, 0.0, 0.0], [0.0, 0.0, 0.2]):
        robot.put(arm.HOME)
        R, p = eye.pose()
        robot.follow(np.array(linear), np.array(angular), eye, 1.0, steps=100)
        now = eye.pose()
        # A lag of 60 ms leaves 6 % of a second undone; damping takes 1e-4 over the squared singular values.
        np.testing.assert_allclose(R.T @ (now[1] - p), np.array(linear) * 0.94, atol=0.002)
        np.testing.assert_allclose(world.angle(R.T @ now[0]), np.degrees(0.94 * np.linalg.norm(angular)), atol=0.3)
    eye.close()


@pytest.mark.parametrize("name", ["arm", "robot"])
def test_it_arrives_by_its_images(name: str, examples: Any, capsys: pytest.CaptureFixture[str]) -> None:
    arrived, (metres, degrees) = examples[name].run(0)
    assert arrived, capsys.readouterr().out
    assert metres < 0.03 and degrees < 1.5
