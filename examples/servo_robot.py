"""A robot drives to where a goal image was taken: the controller in a loop of your own.

``see`` stands for your feature tracker, ``drive`` for your motors; here both are simulated. Needs NumPy and quest-pose.
"""

import numpy as np

import quest_pose as qp
from quest_pose.servo import RobotServo

PERIOD = 0.1
rng = np.random.default_rng(0)
camera = qp.Camera("PINHOLE", [509.5, 510.2, 329.9, 242.9], width=640, height=480)

# What the robot does not know: the features in the goal's frame, its own place, in metres and radians.
features = rng.uniform([-0.6, -0.4, 1.5], [0.6, 0.4, 2.5], (20, 3))
x, z, heading = 0.2, -0.8, np.radians(-20)


def see(x: float, z: float, heading: float) -> np.ndarray:
    """The features as pixels, with noise; NaN for those outside of the image."""
    c, s = np.cos(heading), np.sin(heading)
    seen = (features - [x, 0, z]) @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]).T
    pixels = camera.project(seen) + rng.normal(scale=0.5, size=(len(seen), 2))
    outside = (pixels < 0).any(axis=1) | (pixels > [639, 479]).any(axis=1)
    pixels[outside] = np.nan
    return pixels


def drive(speed: float, turn_rate: float) -> None:
    global x, z, heading
    x += PERIOD * speed * np.sin(heading + 0.5 * PERIOD * turn_rate)
    z += PERIOD * speed * np.cos(heading + 0.5 * PERIOD * turn_rate)
    heading += PERIOD * turn_rate


goal = see(0, 0, 0)
robot = RobotServo(goal, camera, max_speed=0.3, max_turn_rate=0.5, noise=0.5, period=PERIOD, unit=2.0)
for _ in range(600):
    command = robot.step(see(x, z, heading))
    if command.state not in ("tracking", "confirming"):
        print("holding:", command.state)
    drive(command.speed, command.turn_rate)

print(f"{100 * np.hypot(x, z):.1f} cm and {abs(np.degrees(heading)):.2f} degrees from the goal")
