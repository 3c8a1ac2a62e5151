"""The node: topics, services, parameters and the action around ``Pilot``."""

import threading
from dataclasses import fields

import cv2
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Twist, TwistStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image
from std_srvs.srv import Trigger

from quest_servo_interfaces.action import ServoTo

from . import messages
from .pilot import Pilot, Settings

# How often stale images are looked for; moveit_servo and base drivers wait for about 0.1 s themselves.
TIMER = 0.02


class ServoNode(Node):
    """Image and CameraInfo in, twists out, while the action ServoTo runs."""

    def __init__(self):
        super().__init__("quest_servo")
        self.pilot = Pilot(self._settings())
        # Who changes goal, camera or settings holds the first; twists go out one after the other by the second. The watchdog
        # waits for neither an image nor a goal.
        self._lock, self._sending = threading.RLock(), threading.Lock()
        self._ended = threading.Event()
        self._answer, self._frame = None, ""
        self.add_on_set_parameters_callback(self._on_parameters)
        images = MutuallyExclusiveCallbackGroup()
        anything = ReentrantCallbackGroup()
        self.create_subscription(CameraInfo, "camera_info", self._on_info, qos_profile_sensor_data)
        # One image at a time, the newest: older ones are dropped while one is looked at.
        newest = rclpy.qos.QoSProfile(depth=1, reliability=rclpy.qos.ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(Image, "image", self._on_image, newest, callback_group=images)
        arm = self.pilot.settings.drive == "twist"
        kind = TwistStamped if arm or self.pilot.settings.stamped else Twist
        self._twists = self.create_publisher(kind, "delta_twist_cmds" if arm else "cmd_vel", 10)
        self._debug = self.create_publisher(Image, "~/debug_image", 1)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_service(Trigger, "~/take_goal", self._take_goal)
        self.create_timer(TIMER, self._on_timer, callback_group=anything)
        self._action = ActionServer(
            self,
            ServoTo,
            "~/servo_to",
            self._execute,
            goal_callback=self._on_goal,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=anything,
        )

    def now(self):
        return 1e-9 * self.get_clock().now().nanoseconds

    def _settings(self):
        values = {}
        for f in fields(Settings):
            default = getattr(Settings(), f.name)
            values[f.name] = self.declare_parameter(f.name, default).value
        return Settings(**values)

    def _on_parameters(self, changed):
        """Limits and gains take effect with the next action."""
        values = {f.name: getattr(self.pilot.settings, f.name) for f in fields(Settings)}
        values |= {p.name: p.value for p in changed if p.name in values}
        if values["drive"] != self.pilot.settings.drive:
            return SetParametersResult(successful=False, reason="drive is chosen when the node starts")
        try:
            settings = Settings(**values).check()
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        with self._lock:
            self.pilot.settings = settings
        return SetParametersResult(successful=True)

    def _on_info(self, info):
        try:
            with self._lock:
                self.pilot.on_camera_info(info)
        except ValueError as error:
            self.get_logger().error(str(error), throttle_duration_sec=5.0)

    def _take_goal(self, _, response):
        try:
            with self._lock:
                if self.pilot.last_image is None:
                    raise ValueError("no image has come yet")
                goal = self.pilot.take_goal(self.pilot.last_image)
            response.success, response.message = True, f"{goal!r}"
        except (ValueError, ImportError) as error:
            response.success, response.message = False, str(error)
        return response

    def _on_image(self, message):
        self._frame = message.header.frame_id
        try:
            with self._lock:
                answer = self.pilot.on_image(message, self.now())
        except ValueError as error:
            self.get_logger().error(str(error), throttle_duration_sec=5.0)
            answer = self.pilot.failed(str(error))
        if answer is not None:
            self._send(answer)
            self._report(answer, message.header)

    def _on_timer(self):
        answer = self.pilot.on_timer(self.now())
        if answer is not None:
            self._send(answer)

    def _send(self, answer):
        arm = self.pilot.settings.drive == "twist"
        fill = messages.fill_twist if arm else messages.fill_cmd_vel
        if arm or self.pilot.settings.stamped:
            message = TwistStamped()
            message.header.stamp = self.get_clock().now().to_msg()
            message.header.frame_id = self.pilot.settings.command_frame or (self._frame if arm else "base_link")
            fill(message.twist, answer.linear, answer.angular)
        else:
            message = fill(Twist(), answer.linear, answer.angular)
        with self._sending:
            moves = answer.linear.any() or answer.angular.any()
            if moves and not self.pilot.is_active:
                return  # it was stopped meanwhile
            self._twists.publish(message)
        self._answer = answer
        if answer.arrived is not None:
            self._ended.set()

    def _report(self, answer, header):
        if answer.command is None:
            return
        array = DiagnosticArray()
        array.header.stamp = header.stamp
        array.status = [messages.fill_status(DiagnosticStatus(), "quest_servo: loop", answer.command, KeyValue)]
        self._diagnostics.publish(array)
        if self.pilot.settings.debug_image and self._debug.get_subscription_count():
            self._debug.publish(messages.fill_image(Image(), self.pilot.drawn(answer.command), header))

    def _on_goal(self, _):
        return GoalResponse.REJECT if self.pilot.is_active else GoalResponse.ACCEPT

    def _execute(self, handle):
        request, result = handle.request, ServoTo.Result()
        self._ended.clear()
        self._answer = None
        try:
            with self._lock:
                if request.goal_image:
                    image = cv2.imread(request.goal_image)
                    if image is None:
                        raise ValueError(f"{request.goal_image} cannot be read, expected an image file")
                    self.pilot.take_goal(image)
                self.pilot.start(self.now(), request.timeout)
        except (ValueError, ImportError) as error:
            result.message = str(error)
            handle.abort()
            return result
        while not self._ended.wait(self.pilot.settings.period):
            if handle.is_cancel_requested:
                self.pilot.stop()
                result.message = "cancelled"
                handle.canceled()
                return result
            if self._answer is not None:
                handle.publish_feedback(self._feedback(self._answer))
        answer = self._answer
        result.arrived, result.message = bool(answer.arrived), answer.message
        result.distance, result.angle = answer.distance, answer.angle
        if answer.arrived:
            handle.succeed()
        else:
            handle.abort()
        return result

    def _feedback(self, answer):
        feedback = ServoTo.Feedback()
        feedback.advice = answer.message
        feedback.distance, feedback.angle = answer.distance, answer.angle
        if answer.command is not None:
            feedback.state = answer.command.state
            feedback.seen, feedback.inliers = answer.command.seen, answer.command.inliers
        return feedback

    def stand(self):
        """A zero twist, for the end of the program."""
        self.pilot.stop()
        answer = self.pilot.on_timer(self.now())
        if answer is not None:
            self._send(answer)


def main(args=None):
    rclpy.init(args=args)
    node = ServoNode()
    executor = MultiThreadedExecutor(num_threads=3)
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass
    finally:
        if rclpy.ok():
            node.stand()
        node.destroy_node()
        rclpy.try_shutdown()
