"""``quest_pose.servo``: commands from images."""

import doctest
import inspect
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import quest_pose as qp
from quest_pose import servo
from scenes import Array, rotation

FEATURES = np.array(
    [[0.3, -0.2, 1.8], [-0.4, 0.3, 2.1], [0.1, 0.2, 2.4], [-0.2, -0.3, 1.6], [0.5, 0.1, 2.0], [-0.5, 0.0, 2.2]]
)
LIMITS: dict[str, Any] = {"max_speed": 0.3, "max_turn_rate": 0.4}


def image(R: Array, t: Array) -> Array:
    seen = FEATURES @ R.T + t
    return seen[:, :2] / seen[:, 2:]


GOAL = image(np.eye(3), np.zeros(3))


def test_examples() -> None:
    result = doctest.testmod(servo)
    assert result.attempted > 0
    assert result.failed == 0


def test_a_free_camera_arrives() -> None:
    loop = servo.CameraServo(GOAL, **LIMITS, noise=1e-4, unit=2.0, rate=1.0)
    R, t = rotation(np.array([0.2, -0.3, 0.4])), np.array([0.3, 0.1, -0.4])
    for k in range(300):
        command = loop.step(image(R, t))
        # Ten images are averaged, and their candidates, 25 at most, tried in some more.
        if k < 10 or k > 40:
            assert command.state == ("starting" if k < 10 else "tracking")
        assert np.linalg.norm(command.linear) <= 0.3
        assert np.linalg.norm(command.angular) <= 0.4
        # X2 = R X1 + t changes by R' = -[w] R, t' = -w x t - v.
        turn = rotation(-0.1 * command.angular) if command.angular.any() else np.eye(3)
        R, t = turn @ R, turn @ t - 0.1 * command.linear
    assert np.linalg.norm(t) < 1e-3
    assert np.arccos(min(1.0, (np.trace(R) - 1) / 2)) < 1e-3
    assert command.R is not None and command.t is not None
    np.testing.assert_allclose(command.R, R, atol=1e-3)


def test_the_robot_s_example(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(Path(__file__).parents[3] / "examples" / "servo_robot.py"))
    last = capsys.readouterr().out.splitlines()[-1].split()
    assert float(last[0]) < 2.0 and float(last[3]) < 1.0


def test_lost_features_hold() -> None:
    loop = servo.RobotServo(GOAL, **LIMITS, noise=1e-3, unit=2.0)
    now = image(np.eye(3), np.array([0.0, 0.0, 0.3]))
    while loop.step(now).state == "starting":
        pass
    assert loop.step(now).speed > 0.0 and not loop.has_arrived
    lost = now.copy()
    lost[:3] = np.nan
    command = loop.step(lost)
    assert command.state == "too_few_features" and command.R is None and command.inliers == 0
    assert not command.linear.any() and not command.angular.any()
    assert loop.step(now).state == "tracking"


GOOD = image(np.eye(3), np.array([0.0, 0.0, 0.3]))
BAD = {
    "not a number": np.full((6, 2), np.nan),
    "infinite": np.full((6, 2), np.inf),
    "huge": np.full((6, 2), -1e300),
    "all at one place": np.full((6, 2), 0.1),
    "on a line": np.outer(np.arange(6), [0.1, 0.05]),
    "swapped": GOOD[[4, 1, 2, 3, 0, 5]],
    "in another order": GOOD[::-1],
    "mirrored": GOOD * [-1, 1],
    "four, at the border": np.vstack([np.full((4, 2), 0.6), np.full((2, 2), np.nan)]),
    "the goal": GOAL,
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD.keys())
@pytest.mark.parametrize("kind", [servo.CameraServo, servo.RobotServo])
@pytest.mark.parametrize("depths", [None, FEATURES[:, 2]])
def test_bad_images_make_no_wild_command(kind: Any, bad: Array, depths: Any) -> None:
    loop = kind(GOAL, **LIMITS, noise=1e-3, unit=2.0, depths=depths)
    for now in [*[GOOD] * 50, *[bad] * 50, *[GOOD] * 100]:
        command = loop.step(now)
        assert np.isfinite([command.linear, command.angular]).all()
        assert np.linalg.norm(command.linear) <= 0.3
        assert np.linalg.norm(command.angular) <= 0.4
        if command.state != "tracking":
            assert not command.linear.any() and not command.angular.any()
    assert command.state == "tracking"


def test_at_the_goal_it_stands_still() -> None:
    loop = servo.CameraServo(GOAL, **LIMITS, noise=1e-3, unit=2.0)
    for _ in range(60):
        command = loop.step(GOAL)
        assert np.abs([command.linear, command.angular]).max() < 1e-6
    assert command.state == "tracking"


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"goal": GOAL[:4]}, qp.TooFewMatches),
        ({"goal": GOAL[:, :1]}, qp.ShapeMismatch),
        ({"goal": np.full((5, 2), np.nan)}, qp.NotFinite),
        ({"max_speed": -1.0}, qp.QuestError),
        ({"noise": 0.0}, qp.QuestError),
        ({"period": np.inf}, qp.QuestError),
        ({"depths": [1.0, 2.0]}, qp.ShapeMismatch),
        ({"solver": "magic"}, qp.QuestError),
        ({"turn_gain": 0.1}, qp.QuestError),
    ],
)
def test_bad_arguments(arguments: dict[str, Any], error: type[Exception]) -> None:
    given: dict[str, Any] = {"goal": GOAL, **LIMITS, "noise": 1e-3, **arguments}
    with pytest.raises(error):
        servo.RobotServo(**given)


def test_another_number_of_points_is_refused() -> None:
    loop = servo.CameraServo(GOAL, **LIMITS, noise=1e-3)
    with pytest.raises(qp.ShapeMismatch, match="5 rows, expected 6"):
        loop.step(GOAL[:5])


@pytest.mark.parametrize("name", servo.__all__)
def test_everything_is_documented(name: str) -> None:
    public = getattr(servo, name)
    assert inspect.getdoc(public)
    for member in (n for n in vars(public) if not n.startswith("_")):
        assert inspect.getdoc(getattr(public, member)), member
