"""``quest_pose.servo``: commands from images."""

import doctest
import inspect
import json
import pickle
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
        # Ten images are averaged; samples and adjustments take some more.
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
    moving = loop.step(now)
    command = loop.step(lost)
    # One bad image coasts.
    assert command.state == "coasting" and command.R is None and command.inliers == 0
    np.testing.assert_array_equal(command.linear, moving.linear)
    command = loop.step(lost)
    assert command.state == "too_few_features" and "3 features seen" in command.advice
    for _ in range(10):
        before, command = command, loop.step(lost)
        # Twice the limit in a second: full speed in half of one.
        assert np.linalg.norm(command.linear - before.linear) <= 0.6 * 0.1 + 1e-12
    assert not command.linear.any() and not command.angular.any()
    assert command.holding_images == 12 and command.holding_seconds == pytest.approx(1.2)


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
    R, t = np.eye(3), np.array([0.0, 0.0, 0.3])
    states = []
    for k in range(400):
        command = loop.step(bad if 80 <= k < 130 else image(R, t))
        states.append(command.state)
        assert np.isfinite([command.linear, command.angular]).all()
        assert np.linalg.norm(command.linear) <= 0.3
        assert np.linalg.norm(command.angular) <= 0.4
        turn = rotation(-0.1 * command.angular) if command.angular.any() else np.eye(3)
        R, t = turn @ R, turn @ t - 0.1 * command.linear
    # It was under way, its depths learnt, when the bad images came.
    assert states[79] == "tracking"
    assert np.linalg.norm(t) < 0.6


def test_at_the_goal_it_stands_still() -> None:
    loop = servo.CameraServo(GOAL, **LIMITS, noise=1e-3, unit=2.0)
    for _ in range(60):
        command = loop.step(GOAL)
        assert np.abs([command.linear, command.angular]).max() < 1e-6
    # Without parallax only the rotation is known, and nothing says that the camera is there.
    assert command.state == "rotation_only" and "no parallax" in command.advice and not command.arrived


def test_an_arm_arrives_and_says_so() -> None:
    loop = servo.CameraServo(GOAL, **LIMITS, noise=1e-4, depths=FEATURES[:, 2], tolerance=0.005, rate=1.0)
    assert loop.unit == pytest.approx(len(FEATURES) / (1 / FEATURES[:, 2]).sum())
    R, t = np.eye(3), np.array([0.3, 0.1, -0.2])
    arrived = []
    for _ in range(150):
        command = loop.step(image(R, t))
        arrived.append(command.arrived)
        assert not command.arrived or np.linalg.norm(t) < 0.006
        t = t - 0.1 * command.linear
        turn = rotation(-0.1 * command.angular) if command.angular.any() else np.eye(3)
        R, t = turn @ R, turn @ t
    assert arrived[-1] and not arrived[0]
    assert command.inlier_mask.all() and command.inliers == 6 == command.seen
    assert command.covariance is not None and np.linalg.eigvalsh(command.covariance).min() > 0
    loop.reset()
    assert not loop.step(image(R, t)).arrived


def test_commands_are_values() -> None:
    loop = servo.CameraServo(GOAL, **LIMITS, noise=1e-3, depths=FEATURES[:, 2])
    for seen in (GOOD, np.full((6, 2), np.nan)):
        command = loop.step(seen)
        copy = pickle.loads(pickle.dumps(command))
        assert copy.to_dict() == command.to_dict()
        assert json.loads(json.dumps(command.to_dict()))["state"] == command.state


def test_stale_images_stop() -> None:
    loop = servo.CameraServo(GOAL, **LIMITS, noise=1e-3, depths=FEATURES[:, 2], max_acceleration=np.inf)
    # The first image finds the pose, the second one follows it, slowly until the camera is seen to move.
    assert loop.step(GOOD, stamp=9.9).state == "starting"
    assert loop.step(GOOD, stamp=10.0).state == "confirming"
    moving = loop.step(GOOD, stamp=10.1)
    assert moving.linear.any()
    assert loop.idle(10.3)[0].any()
    assert not loop.idle(10.7)[0].any()
    for stamp, now in ((10.1, 10.1), (10.0, 10.0), (10.2, 11.0), (np.nan, 0.0)):
        command = loop.step(GOOD, stamp=stamp, now=now)
        assert command.state == "stale" and not command.linear.any()
    assert loop.step(GOOD, stamp=11.0).state == "confirming"


def test_depths_go_out_and_in() -> None:
    loop = servo.CameraServo(GOAL, **LIMITS, noise=1e-4, unit=2.0)
    assert np.isnan(loop.depths()[0]).all()
    R, t = np.eye(3), np.array([0.3, 0.1, -0.2])
    for _ in range(60):
        command = loop.step(image(R, t))
        turn = rotation(-0.1 * command.angular) if command.angular.any() else np.eye(3)
        R, t = turn @ R, turn @ t - 0.1 * command.linear
    depths, precision = loop.depths()
    np.testing.assert_allclose(depths / depths.mean(), FEATURES[:, 2] / FEATURES[:, 2].mean(), rtol=0.05)
    other = servo.CameraServo(GOAL, **LIMITS, noise=1e-4, unit=2.0)
    other.set_depths(np.where(np.arange(6) == 5, np.nan, depths), precision)
    # Five known depths of six: the sixth is no reason to wait.
    assert other.step(image(R, t)).state in ("tracking", "confirming", "starting")


def test_axes_and_mounts() -> None:
    options: dict[str, Any] = {**LIMITS, "noise": 1e-4, "depths": FEATURES[:, 2]}
    seen = image(rotation(np.array([0.1, 0.2, 0.1])), np.array([0.1, 0.1, 0.1]))
    free = servo.CameraServo(GOAL, **options, max_acceleration=np.inf, max_turn_acceleration=np.inf)
    some = servo.CameraServo(
        GOAL, **options, max_acceleration=np.inf, max_turn_acceleration=np.inf, axes=["x", "rz"]
    )
    for _ in range(2):
        all_axes, two = free.step(seen), some.step(seen)
    assert all_axes.linear.all() and all_axes.angular.all()
    assert (two.linear != 0).tolist() == [True, False, False]
    assert (two.angular != 0).tolist() == [False, False, True]
    with pytest.raises(qp.QuestError, match="yaw"):
        servo.CameraServo(GOAL, **options, axes=["yaw"])
    with pytest.raises(qp.QuestError, match="rigid"):
        servo.CameraServo(GOAL, **options, camera_in_hand=2 * np.eye(4))
    robot = servo.RobotServo(GOAL, **options, camera_in_base=(0.2, 0.5, 0.1), turn_gain=2.0)
    assert robot.step(GOOD).state in ("tracking", "confirming", "starting")


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
        ({"depths": [1.0, 2.0, 3.0, 4.0, -1.0, 2.0]}, qp.ShapeMismatch),
        ({"explore": -1.0}, qp.QuestError),
        ({"camera_in_base": (np.nan, 0.0, 0.0)}, qp.QuestError),
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


SETTINGS = {
    "max_speed": 0.1,
    "max_turn_rate": 0.2,
    "max_acceleration": 0.7,
    "max_turn_acceleration": np.inf,
    "explore": 0.04,
    "tolerance": 0.002,
    "angle_tolerance": 0.25,
    "arrival_time": 2.0,
    "coasting_images": 3,
    "largest_gap": 0.2,
}


@pytest.mark.parametrize("kind", [servo.CameraServo, servo.RobotServo])
def test_settings_are_those_given_and_can_be_set(kind: Any) -> None:
    made = kind(GOAL, **{**LIMITS, **SETTINGS}, noise=1e-3, unit=2.0, period=0.05)
    changed = kind(GOAL, **LIMITS, noise=1e-3, unit=2.0, period=0.05)
    assert isinstance(made, servo.Controller) and made.watchdog
    assert made.period == 0.05 and made.unit == 2.0
    # Twice the limits where it is not given.
    assert changed.max_acceleration == pytest.approx(0.6) and changed.max_turn_acceleration == pytest.approx(0.8)
    for name, value in SETTINGS.items():
        assert getattr(made, name) == pytest.approx(value), name
        setattr(changed, name, value)
        assert getattr(changed, name) == pytest.approx(value), name
        if name != "coasting_images":
            with pytest.raises(qp.QuestError, match=f"{name} is -1"):
                setattr(changed, name, -1.0)
    # What the constructor does not ask for.
    for name, value in {"rotation_uncertainty": 5.0, "translation_uncertainty": 0.1}.items():
        assert getattr(changed, name) == pytest.approx(getattr(made, name)), name
        setattr(changed, name, value)
        assert getattr(changed, name) == pytest.approx(value), name
        with pytest.raises(qp.QuestError, match=f"{name} is 0"):
            setattr(changed, name, 0.0)
        setattr(changed, name, getattr(made, name))
    changed.watchdog = False
    assert not changed.watchdog
    for _ in range(20):
        one, other = made.step(GOOD), changed.step(GOOD)
        np.testing.assert_array_equal(one.linear, other.linear)
        assert np.linalg.norm(one.linear) <= 0.1


def test_gains_can_be_set() -> None:
    camera = servo.CameraServo(GOAL, **LIMITS, noise=1e-3, depths=FEATURES[:, 2])
    camera.rate = 2.0
    assert camera.rate == 2.0
    robot = servo.RobotServo(GOAL, **LIMITS, noise=1e-3, unit=2.0)
    robot.turn_gain, robot.speed_gain = 1.5, 0.75
    assert (robot.speed_gain, robot.turn_gain) == (0.75, 1.5)
    with pytest.raises(qp.QuestError, match="speed_gain / unit = 2: the law would not converge"):
        robot.speed_gain = 4.0
    assert robot.speed_gain == 0.75


def test_a_tighter_limit_of_the_uncertainty_holds() -> None:
    strict = servo.CameraServo(GOAL, **LIMITS, noise=1e-3)
    strict.rotation_uncertainty = 1e-9
    steps = [strict.step(GOOD) for _ in range(30)]
    assert steps[-1].state == "uncertain"
    assert all(np.linalg.norm(step.linear) == 0 for step in steps)


def test_the_robot_s_distances_can_be_set() -> None:
    robot = servo.RobotServo(GOAL, **LIMITS, noise=1e-3, unit=2.0)
    assert robot.stop_distance == pytest.approx(0.005)
    assert robot.sideways_distance == pytest.approx(0.06)
    assert robot.start_distance == pytest.approx(0.24)
    robot.start_distance = 0.3
    robot.stop_distance = 0.02
    assert robot.start_distance == pytest.approx(0.3) and robot.stop_distance == pytest.approx(0.02)
    with pytest.raises(qp.QuestError, match="stop_distance is 0.4, expected start_distance"):
        robot.stop_distance = 0.4
    with pytest.raises(qp.QuestError, match="start_distance is -1"):
        robot.start_distance = -1.0
    assert robot.stop_distance == pytest.approx(0.02)


def test_a_controller_of_no_kind_cannot_be_made() -> None:
    kind: Any = servo.Controller
    with pytest.raises(TypeError):
        kind(GOAL, **LIMITS, noise=1e-3)


def test_joints_make_the_twist_within_their_limits() -> None:
    jacobian = np.sin(1.3 * np.arange(7) + 0.7 * np.arange(6)[:, None] + 0.2 * np.outer(np.arange(6), np.arange(7)))
    twist = np.array([0.1, -0.05, 0.2, 0.1, 0.2, -0.1])
    for most in (100.0, 0.01):
        velocities, factor = servo.joint_velocities(
            twist[:3], twist[3:], jacobian, max_speeds=np.full(7, most), damping=1e-9
        )
        assert (factor < 1) == (most == 0.01) and np.abs(velocities).max() <= most * (1 + 1e-12)
        np.testing.assert_allclose(jacobian @ velocities, factor * twist, atol=1e-6 * factor)
    ends = np.where(velocities[:, None] < 0, [0.0, 1.0], [-1.0, 1.0])
    still, factor = servo.joint_velocities(
        twist[:3], twist[3:], jacobian, max_speeds=np.ones(7), positions=np.zeros(7), ends=ends
    )
    assert factor == 0 and not still.any()


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"jacobian": np.eye(5)}, qp.ShapeMismatch, "transpose of jacobian has the shape"),
        ({"jacobian": np.full((6, 6), np.nan)}, qp.NotFinite, "jacobian has the number NaN"),
        ({"linear": [1.0, 2.0]}, qp.ShapeMismatch, "linear has 2 numbers, expected three"),
        ({"angular": [np.inf, 0.0, 0.0]}, qp.NotFinite, "angular has the number inf"),
        ({"max_speeds": np.ones(5)}, qp.ShapeMismatch, "max_speeds has 5 numbers, expected 6"),
        ({"positions": np.zeros(6)}, qp.ShapeMismatch, "without the other"),
        ({"positions": np.zeros(6), "ends": np.zeros((5, 2))}, qp.ShapeMismatch, "ends has 5 rows, expected 6"),
        ({"damping": -1.0}, qp.QuestError, "damping is -1"),
        ({"seconds": 0.0}, qp.QuestError, "seconds is 0"),
    ],
)
def test_bad_arguments_of_joints(arguments: dict[str, Any], error: type[Exception], words: str) -> None:
    given: dict[str, Any] = {"linear": np.ones(3), "angular": np.ones(3), "jacobian": np.eye(6), **arguments}
    named = {name: given.pop(name) for name in ("linear", "angular", "jacobian")}
    with pytest.raises(error, match=words):
        servo.joint_velocities(*named.values(), **{"max_speeds": np.ones(6), **given})


@pytest.mark.parametrize("name", servo.__all__)
def test_everything_is_documented(name: str) -> None:
    public = getattr(servo, name)
    assert inspect.getdoc(public)
    for member in (n for n in getattr(public, "__dict__", {}) if not n.startswith("_")):
        assert inspect.getdoc(getattr(public, member)), member
