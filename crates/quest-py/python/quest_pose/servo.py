"""Visual servoing: a camera or a robot moves to where a goal image was taken.

Frame 1 is the goal, frame 2 the camera now. Give the features of the goal image once, and those of each new image to
``step``; it returns velocities for the camera's own frame: x to the right, y down, z forward.

>>> import numpy as np
>>> from quest_pose.servo import RobotServo
>>> goal = np.array([[0.1, 0.2], [-0.3, 0.1], [0.2, -0.2], [-0.1, -0.3], [0.3, 0.3]])
>>> robot = RobotServo(goal, max_speed=0.3, max_turn_rate=0.5, noise=1e-3, unit=2.0)
>>> command = robot.step(goal)
>>> command.state, command.speed, command.turn_rate
('starting', 0.0, 0.0)
"""

from quest_pose._core import CameraServo, Command, Controller, RobotServo, joint_velocities
from quest_pose._servo_goal import GoalImage
from quest_pose._servo_loop import Servo
from quest_pose._servo_recorder import Recorder

__all__ = [
    "CameraServo",
    "Command",
    "Controller",
    "GoalImage",
    "Recorder",
    "RobotServo",
    "Servo",
    "joint_velocities",
]
