"""``Servo`` in a closed loop on rendered rectangles: real features, some of them matched wrongly, no renderer needed."""

from typing import Any

import numpy as np
import pytest
from quest_pose.servo import Command, GoalImage, Recorder, Servo
from rendered import CAMERA, GENERAL, PLANAR, World
from scenes import Array, rotation

DEPTH = 1.0
PERIOD = 0.1
# 2 % of the depth and one degree, as for the rendered scenes of docs/servoing.md.
NEAR, ANGLE = 0.02 * DEPTH, 1.0
STARTS = [
    (np.array([0.05, -0.1, 0.3]), np.array([0.08, -0.05, 0.1])),
    (np.array([-0.12, 0.15, -0.2]), np.array([-0.15, 0.06, 0.12])),
]


def away(R: Array, t: Array) -> tuple[float, float]:
    """Metres and degrees from the goal."""
    sine = np.linalg.norm(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])) / 2
    return float(np.linalg.norm(t)), float(np.degrees(np.arctan2(sine, (np.trace(R) - 1) / 2)))


def drive(world: World, start: int, recorder: Recorder | None = None, **options: Any) -> tuple[Command, list[float], Any]:
    """The last command, the distance in metres after each image, and the last distances in metres and degrees."""
    detector = options.pop("detector", "sift")
    goal = GoalImage(world.image(np.eye(3), np.zeros(3)), CAMERA, detector=detector, max_features=200)
    servo = Servo(goal, recorder=recorder, max_speed=0.2, max_turn_rate=0.4, unit=DEPTH, rate=0.8, period=PERIOD, **options)
    turn, move = STARTS[start]
    R, t = rotation(turn), move.copy()
    metres = [away(R, t)[0]]
    for k in range(250):
        command = servo.step(world.image(R, t), stamp=PERIOD * k)
        if command.arrived:
            break
        # X2 = R X1 + t changes by R' = -[w] R, t' = -w x t - v.
        step = rotation(-PERIOD * command.angular) if command.angular.any() else np.eye(3)
        R, t = step @ R, step @ t - PERIOD * command.linear
        metres.append(away(R, t)[0])
    return command, metres, away(R, t)


@pytest.mark.parametrize("start", range(len(STARTS)))
@pytest.mark.parametrize("scene", ["general", "planar"])
def test_the_camera_comes_home_by_its_images(scene: str, start: int) -> None:
    world = World({"general": GENERAL, "planar": PLANAR}[scene], seed=3 + start)
    command, metres, (distance, angle) = drive(world, start)
    assert command.arrived, command.advice
    assert distance < NEAR and angle < ANGLE, (distance, angle)
    assert max(metres) < metres[0] + 0.05


def test_orb_does_it_too() -> None:
    command, metres, (distance, angle) = drive(World(GENERAL, seed=11), 0, detector="orb", tolerance=0.02)
    assert command.arrived, command.advice
    assert distance < NEAR and angle < ANGLE, (distance, angle)
    assert max(metres) < metres[0] + 0.05


def test_a_covered_lens_stops_it_and_the_recorder_tells(tmp_path: Any) -> None:
    world = World(PLANAR, seed=5)
    goal = GoalImage(world.image(np.eye(3), np.zeros(3)), CAMERA)
    recorder = Recorder(tmp_path / "run.npz")
    servo = Servo(goal, recorder=recorder, max_speed=0.2, max_turn_rate=0.4, unit=DEPTH, period=PERIOD)
    R, t = rotation(STARTS[0][0]), STARTS[0][1]
    seen = world.image(R, t)
    for k in range(60):
        command = servo.step(seen if k < 20 else np.zeros_like(seen), stamp=PERIOD * k)
    assert command.state == "too_few_features" and "0 features seen" in command.advice
    assert not command.linear.any() and not command.angular.any()
    recorder.save()
    columns = np.load(tmp_path / "run.npz")
    assert columns["points"].shape == (60, len(goal), 2)
    assert np.isnan(columns["points"][20:]).all() and np.isfinite(columns["points"][0]).any()
