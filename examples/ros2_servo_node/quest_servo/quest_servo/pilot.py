"""What the node does with images and time. No rclpy: it is tested without ROS."""

from dataclasses import dataclass, field

import numpy as np

from quest_pose.servo import CameraServo, GoalImage, RobotServo, Servo

from . import messages

# moveit_servo and many base drivers keep the last twist for a while: the end is said several times.
ZEROS_AT_THE_END = 5


# x, y, z in metres and the quaternion x, y, z, w, as TF has them.
NO_OFFSET = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def transform(numbers):
    """The matrix of x, y, z, qx, qy, qz, qw. Raises ValueError for others."""
    if len(numbers) != 7 or not abs(np.linalg.norm(numbers[3:]) - 1) < 1e-3:
        raise ValueError(f"camera_in_hand is {list(numbers)}, expected x, y, z and a unit quaternion x, y, z, w")
    q = np.array(numbers[3:]) / np.linalg.norm(numbers[3:])
    cross = np.array([[0, -q[2], q[1]], [q[2], 0, -q[0]], [-q[1], q[0], 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += 2 * q[3] * cross + 2 * cross @ cross
    matrix[:3, 3] = numbers[:3]
    return matrix


@dataclass
class Settings:
    """The node's parameters; the units are those of the files in config."""

    drive: str = "twist"
    stamped: bool = True
    detector: str = "sift"
    max_features: int = 500
    max_speed: float = 0.1
    max_turn_rate: float = 0.3
    max_acceleration: float = 0.0
    max_turn_acceleration: float = 0.0
    rate: float = 0.5
    unit: float = 1.0
    period: float = 0.1
    explore: float = 0.0
    tolerance: float = 0.01
    angle_tolerance: float = 0.5
    camera_in_base: list = field(default_factory=lambda: [0.0, 0.0, 0.0])
    camera_in_hand: list = field(default_factory=lambda: list(NO_OFFSET))
    command_frame: str = ""
    stale_after: float = 0.25
    give_up_after: float = 60.0
    debug_image: bool = False

    def check(self):
        """Raises ValueError for a parameter that cannot be: its name, what was found, what was expected."""
        if self.drive not in ("twist", "cmd_vel"):
            raise ValueError(f"drive is {self.drive!r}, expected twist or cmd_vel")
        for name in ("max_speed", "max_turn_rate", "rate", "unit", "period", "tolerance", "angle_tolerance", "stale_after", "give_up_after"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} is {getattr(self, name)}, expected a positive number")
        transform(self.camera_in_hand)
        return self

    def controller(self):
        """The controller's class and its options."""
        names = ("max_speed", "max_turn_rate", "unit", "period", "explore", "tolerance", "angle_tolerance")
        options = {name: getattr(self, name) for name in names}
        # 0 stands for no limit: a ROS parameter cannot be None.
        limits = ("max_acceleration", "max_turn_acceleration")
        options |= {name: getattr(self, name) for name in limits if getattr(self, name) > 0}
        options["largest_gap"] = self.stale_after
        if self.drive == "twist":
            if tuple(self.camera_in_hand) != NO_OFFSET:
                options["camera_in_hand"] = transform(self.camera_in_hand)
            return CameraServo, options | {"rate": self.rate}
        return RobotServo, options | {"camera_in_base": tuple(self.camera_in_base)}


@dataclass
class Answer:
    """What is to be sent: a twist in the optical frame of the camera, what was seen, and the end if it has come."""

    linear: np.ndarray
    angular: np.ndarray
    command: object = None
    distance: float = float("nan")
    angle: float = float("nan")
    # None while the loop goes on, else whether it arrived.
    arrived: bool | None = None
    message: str = ""


def standing(**more):
    return Answer(np.zeros(3), np.zeros(3), **more)


class Pilot:
    """Goal, camera and loop. Every method that needs the time is told it, in seconds on the clock of the stamps.

    ``stop`` and ``on_timer`` may be called by another thread while ``on_image`` is at work.
    """

    def __init__(self, settings, servo=Servo):
        self.settings = settings.check()
        self._make_servo = servo
        self.camera = self.goal = self.servo = self.last_image = None
        self._began = self._last = self._give_up_after = 0.0
        self._zeros, self._points = 0, None

    def on_camera_info(self, info):
        """The camera; a calibration that changes takes effect with the next goal."""
        self.camera = messages.camera(info)

    def take_goal(self, image):
        """The image, an array, is the goal from now on. Raises ValueError before the camera is known."""
        if self.camera is None:
            raise ValueError("no camera_info has come, expected one before the goal image is taken")
        self.goal = GoalImage(image, self.camera, detector=self.settings.detector, max_features=self.settings.max_features)
        return self.goal

    @property
    def is_active(self):
        return self.servo is not None

    def start(self, now, give_up_after=0.0):
        """Begins to move. Raises ValueError without a goal."""
        if self.goal is None:
            raise ValueError("no goal image was taken, expected the service take_goal or a file in goal_image")
        controller, options = self.settings.controller()
        self.servo = self._make_servo(self.goal, controller, **options)
        self._began = self._last = now
        self._give_up_after = give_up_after if give_up_after > 0 else self.settings.give_up_after
        self._zeros = 0

    def stop(self):
        """Ends: the next twists are zero."""
        self.servo, self._zeros = None, ZEROS_AT_THE_END

    def on_image(self, message, now):
        """The answer to a sensor_msgs/Image; None while nothing is to be sent."""
        self.last_image = image = messages.pixels(message)
        servo = self.servo
        if servo is None:
            return None
        stamp = messages.seconds(message.header.stamp)
        if now - stamp > self.settings.stale_after:
            # The image was on its way for too long: the camera is no longer where it was taken.
            return standing(message=f"an image is {now - stamp:.2f} s old, stale_after is {self.settings.stale_after} s")
        self._last = now
        command = servo.step(image, stamp=stamp, now=now)
        self._points = servo.points
        if self.servo is not servo:
            # It was stopped while the image was looked at: no twist may follow the zero.
            return None
        distance, angle = messages.distances(command, self.settings.unit)
        answer = Answer(command.linear, command.angular, command, distance, angle, message=command.advice)
        if command.arrived:
            self.stop()
            return standing(command=command, distance=distance, angle=angle, arrived=True, message="arrived")
        return answer if now - self._began <= self._give_up_after else self._given_up(answer)

    def on_timer(self, now):
        """What is to be sent although no image came: zero where images are stale and at the end; else None."""
        if not self.is_active:
            if self._zeros == 0:
                return None
            self._zeros -= 1
            return standing()
        if now - self._began > self._give_up_after:
            return self._given_up(standing())
        if now - self._last > self.settings.stale_after:
            return standing(message=f"no image for {now - self._last:.2f} s")
        return None

    def _given_up(self, answer):
        self.stop()
        why = f"not arrived after {self._give_up_after:.0f} s; {answer.message or 'no image came'}"
        return standing(command=answer.command, distance=answer.distance, angle=answer.angle, arrived=False, message=why)

    def failed(self, why):
        """The answer where an image could not be used: the loop ends."""
        if not self.is_active:
            return None
        self.stop()
        return standing(arrived=False, message=why)

    def drawn(self, command):
        """The last image with its features: green where the pose rests on them."""
        return self.goal.draw(self.last_image, self._points, command.inlier_mask)
