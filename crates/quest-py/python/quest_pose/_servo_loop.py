"""``Servo``: a controller that takes images."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quest_pose._core import CameraServo, Command, QuestError, RobotServo, ShapeMismatch
from quest_pose._servo_goal import GoalImage
from quest_pose._servo_recorder import Recorder

Seen: TypeAlias = Any
"""An image, an array of matches, or a list of matches with None for what is not seen."""


def rows_of(matches: Seen, expected: int) -> NDArray[np.float64]:
    """Matches as (N, 2) with NaN, from that, from OpenCV's (N, 1, 2), or from a list with None.

    Raises
    ------
    ShapeMismatch
        For another number of rows or another shape.
    """
    if isinstance(matches, (list, tuple)):
        missing = (np.nan, np.nan)
        matches = [missing if point is None else np.asarray(point, float).ravel() for point in matches]
        if any(len(point) != 2 for point in matches):
            raise ShapeMismatch("a match has other than two coordinates, expected (u, v) or None")
    rows = np.asarray(matches, float)
    if rows.ndim == 3 and rows.shape[1] == 1:
        rows = rows[:, 0]
    if rows.shape != (expected, 2):
        raise ShapeMismatch(
            f"matches have the shape {rows.shape}, expected ({expected}, 2) or ({expected}, 1, 2) as the goal, NaN for "
            "features that are not seen"
        )
    return rows


class Servo:
    """A controller that takes images: the goal's features are found in each.

    Parameters
    ----------
    goal : GoalImage
        The goal image.
    controller : type
        ``CameraServo`` for a free camera, ``RobotServo`` for a robot with two driven wheels.
    recorder : Recorder, optional
        Every step is added to it.
    **options
        What the controller takes: ``max_speed``, ``max_turn_rate``, ``unit``, ``period``, ``depths`` and the others.
        ``noise`` is that of the detector where it is not given.

    Raises
    ------
    ImportError, QuestError
        As ``GoalImage`` and the controller.

    Examples
    --------
    From an image on the disc to an arm that moves; ``camera``, ``grab`` and ``move`` are the user's::

        goal = GoalImage(cv2.imread("goal.png"), camera)
        servo = Servo(goal, max_speed=0.1, max_turn_rate=0.3, unit=0.6)
        while True:
            image, stamp = grab()
            command = servo.step(image, stamp=stamp)
            move(command.linear, command.angular)
    """

    def __init__(
        self,
        goal: GoalImage,
        controller: type[CameraServo] | type[RobotServo] = CameraServo,
        *,
        recorder: Recorder | None = None,
        **options: Any,
    ) -> None:
        if not isinstance(goal, GoalImage):
            raise QuestError(f"goal is a {type(goal).__name__}, expected a GoalImage; {controller.__name__} takes points")
        self._goal = goal
        self._points = np.full(goal.points.shape, np.nan)
        self._controller = controller(goal.points, goal.camera, **{"noise": goal.noise, **options})
        self._recorder = recorder
        if recorder is not None:
            recorder.begin(goal.points, size=goal.image.shape[::-1], options=options)

    @property
    def goal(self) -> GoalImage:
        """The goal image."""
        return self._goal

    @property
    def controller(self) -> CameraServo | RobotServo:
        """The controller that the matches go to: its settings and what it knows are there."""
        return self._controller

    @property
    def points(self) -> NDArray[np.float64]:
        """(N, 2): the features of the last image, as the controller got them."""
        return self._points

    def step(
        self, seen: Seen, *, stamp: float | None = None, now: float | None = None, mask: ArrayLike | None = None
    ) -> Command:
        """The command for one image.

        Parameters
        ----------
        seen : array_like
            The image, of uint8; or the matches themselves, in the order of the goal's features: (N, 2) with NaN for
            what is not seen, OpenCV's (N, 1, 2), or a list with None.
        stamp : float, optional
            When the image was taken, in seconds.
        now : float, optional
            The present on the clock of the stamps: an image that is too old stops the loop.
        mask : array_like of bool, optional
            As for ``GoalImage.match``.

        Returns
        -------
        Command
            As the controller's ``step``.
        """
        is_image = not isinstance(seen, (list, tuple)) and np.asarray(seen).dtype == np.uint8
        self._points = self._goal.match(seen, mask=mask) if is_image else rows_of(seen, len(self._goal))
        times = {name: time for name, time in (("stamp", stamp), ("now", now)) if time is not None}
        command = self._controller.step(self._points, **times)
        if self._recorder is not None:
            self._recorder.add(self._points, command, stamp=stamp)
        return command

    def __repr__(self) -> str:
        return f"<Servo {type(self._controller).__name__} to {self._goal!r}>"
