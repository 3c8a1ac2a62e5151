"""``examples/ros2_servo_node`` without ROS: stand-ins with the fields of the messages."""

import ast
import importlib
import re
import sys
import threading
import xml.etree.ElementTree as ET
from dataclasses import fields
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from quest_pose import servo
from rendered import CAMERA, HEIGHT, PLANAR, WIDTH, World

ROOT = Path(__file__).parents[3] / "examples" / "ros2_servo_node"
sys.path.insert(0, str(ROOT / "quest_servo"))
messages: Any = importlib.import_module("quest_servo.messages")
pilot: Any = importlib.import_module("quest_servo.pilot")

Space = SimpleNamespace
SETTINGS = {"max_features": 200, "stale_after": 0.25, "give_up_after": 10.0, "unit": 2.0}


def image_message(pixels: Any, encoding: str = "mono8", stamp: float = 0.0, padding: int = 0) -> Any:
    rows = pixels.reshape(len(pixels), -1)
    data = np.pad(rows, ((0, 0), (0, padding))).tobytes()
    time = Space(sec=int(stamp), nanosec=round(1e9 * (stamp % 1)))
    header = Space(stamp=time, frame_id="camera_optical")
    height, width = pixels.shape[:2]
    return Space(
        header=header, height=height, width=width, encoding=encoding, is_bigendian=0, step=rows.shape[1] + padding, data=data
    )


def info_message(model: str = "plumb_bob", d: Any = (0.0,) * 5, focal: float = 290.0) -> Any:
    k = [focal, 0.0, 159.5, 0.0, focal, 119.5, 0.0, 0.0, 1.0]
    return Space(width=WIDTH, height=HEIGHT, distortion_model=model, d=list(d), k=k)


@pytest.fixture(scope="module")
def view() -> Any:
    return World(PLANAR).image(np.eye(3), np.zeros(3))


@pytest.mark.parametrize("padding", [0, 7])
def test_images_of_all_encodings(padding: int) -> None:
    bgr = np.random.default_rng(0).integers(0, 256, (4, 5, 4), np.uint8)

    def read(pixels: Any, encoding: str) -> Any:
        return messages.pixels(image_message(pixels, encoding, padding=padding))

    np.testing.assert_array_equal(read(bgr[..., 0], "mono8"), bgr[..., 0])
    np.testing.assert_array_equal(read(bgr[..., :3], "bgr8"), bgr[..., :3])
    np.testing.assert_array_equal(read(bgr[..., [2, 1, 0]], "rgb8"), bgr[..., :3])
    np.testing.assert_array_equal(read(bgr, "bgra8"), bgr)
    np.testing.assert_array_equal(read(bgr[..., [2, 1, 0, 3]], "rgba8"), bgr)


def test_images_that_cannot_be_used_are_named() -> None:
    grey = np.zeros((4, 5), np.uint8)
    with pytest.raises(ValueError, match="encoding '16UC1', expected one of mono8"):
        messages.pixels(image_message(grey, "16UC1"))
    with pytest.raises(ValueError, match="20 bytes in rows of 5, expected 4 rows of 5 pixels with 3 bytes"):
        messages.pixels(image_message(grey, "bgr8"))


def test_cameras_of_all_models() -> None:
    assert messages.camera(info_message()) == CAMERA
    bent = messages.camera(info_message(d=[0.1, -0.2, 0.001, 0.002, 0.05]))
    x, y = 0.3, -0.2
    r2 = x * x + y * y
    radial = 1 + 0.1 * r2 - 0.2 * r2**2 + 0.05 * r2**3
    u = x * radial + 2 * 0.001 * x * y + 0.002 * (r2 + 2 * x * x)
    v = y * radial + 0.001 * (r2 + 2 * y * y) + 2 * 0.002 * x * y
    np.testing.assert_allclose(bent.project([[x, y, 1.0]]), [[290 * u + 159.5, 290 * v + 119.5]])
    assert messages.camera(info_message("equidistant", [0.1, 0, 0, 0])).model == "OPENCV_FISHEYE"
    assert messages.camera(info_message("rational_polynomial", [0.1] * 8)).params[-1] == 0.1
    with pytest.raises(ValueError, match="'thin_prism' with 1 numbers, expected plumb_bob"):
        messages.camera(info_message("thin_prism", [0.1]))
    with pytest.raises(ValueError, match="no focal length"):
        messages.camera(info_message(focal=0.0))


def vector() -> Any:
    return Space(x=9.0, y=9.0, z=9.0)


def test_twists_have_the_frames_of_ros() -> None:
    twist = messages.fill_twist(Space(linear=vector(), angular=vector()), [1, 2, 3], [4, 5, 6])
    assert (vars(twist.linear), vars(twist.angular)) == ({"x": 1, "y": 2, "z": 3}, {"x": 4, "y": 5, "z": 6})
    # Forward, and to the right.
    base = messages.fill_cmd_vel(Space(linear=vector(), angular=vector()), [0, 0, 0.2], [0, 0.3, 0])
    assert (vars(base.linear), vars(base.angular)) == ({"x": 0.2, "y": 0, "z": 0}, {"x": 0, "y": 0, "z": -0.3})


def a_command(**said: Any) -> Any:
    plain: dict[str, Any] = {
        "state": "tracking", "advice": "The loop follows 5 of 6 features.", "linear": np.array([0.1, 0, 0.05]),
        "angular": np.array([0, 0.2, 0]), "R": np.eye(3), "t": np.array([0, 0, 0.5]), "arrived": False, "seen": 6,
        "inliers": 5, "inlier_mask": np.array([True] * 5 + [False]), "hypotheses": 1, "residual": 0.001, "holding_seconds": 0.0,
    }  # fmt: skip
    return Space(**{**plain, **said})


class Fake:
    """In the place of ``Servo``: says what it is told to say."""

    says: list[Any] = []

    def __init__(self, goal: Any, controller: Any, **options: Any) -> None:
        self.controller, self.options = controller, options
        self.steps: list[Any] = []
        self.points = np.asarray(goal.points) + 1

    def step(self, seen: Any, *, stamp: float, now: float) -> Any:
        self.steps.append((seen, stamp, now))
        return Fake.says.pop(0)


@pytest.fixture
def ready(view: Any) -> Any:
    made = pilot.Pilot(pilot.Settings(**SETTINGS), servo=Fake)
    made.on_camera_info(info_message())
    assert made.on_image(image_message(view), 0.0) is None
    made.take_goal(made.last_image)
    return made


def is_zero(answer: Any) -> bool:
    return not answer.linear.any() and not answer.angular.any()


def test_nothing_moves_before_there_is_a_goal(view: Any) -> None:
    made = pilot.Pilot(pilot.Settings(**SETTINGS), servo=Fake)
    with pytest.raises(ValueError, match="no camera_info has come"):
        made.take_goal(view)
    with pytest.raises(ValueError, match="no goal image was taken"):
        made.start(0.0)
    assert made.on_timer(100.0) is None


def test_it_ends_with_zero_twists_when_it_arrived(ready: Any, view: Any) -> None:
    Fake.says = [a_command(), a_command(arrived=True)]
    ready.start(1.0)
    answer = ready.on_image(image_message(view, stamp=1.05), 1.1)
    assert answer.arrived is None and answer.linear.tolist() == [0.1, 0, 0.05]
    # |t| = 0.5 of two metres.
    assert (answer.distance, answer.angle) == (1.0, 0.0)
    assert ready.on_timer(1.12) is None
    end = ready.on_image(image_message(view, stamp=1.15), 1.2)
    assert end.arrived is True and is_zero(end) and not ready.is_active
    zeros = [ready.on_timer(1.3) for _ in range(pilot.ZEROS_AT_THE_END)]
    assert all(is_zero(answer) for answer in zeros)
    assert ready.on_timer(1.4) is None and ready.on_image(image_message(view), 1.5) is None


def test_stale_images_stop_it(ready: Any, view: Any) -> None:
    Fake.says = [a_command(), a_command()]
    ready.start(1.0)
    late = ready.on_image(image_message(view, stamp=1.0), 1.3)
    assert is_zero(late) and "0.30 s old, stale_after is 0.25" in late.message and not ready.servo.steps
    assert not is_zero(ready.on_image(image_message(view, stamp=1.3), 1.35))
    assert ready.on_timer(1.55) is None
    gone = ready.on_timer(1.65)
    assert is_zero(gone) and gone.message == "no image for 0.30 s" and gone.arrived is None
    # Images that come again go on.
    assert not is_zero(ready.on_image(image_message(view, stamp=1.7), 1.7))
    ((_, stamp, now), _) = ready.servo.steps
    assert (round(stamp, 6), now) == (1.3, 1.35)


def test_it_gives_up(ready: Any, view: Any) -> None:
    Fake.says = [a_command(state="ambiguous", advice="Two poses.")]
    ready.start(1.0)
    end = ready.on_image(image_message(view, stamp=11.1), 11.1)
    assert end.arrived is False and is_zero(end) and end.message == "not arrived after 10 s; Two poses."
    ready.start(20.0, give_up_after=2.0)
    assert ready.on_timer(22.1).message == "not arrived after 2 s; no image came"
    assert is_zero(ready.on_timer(22.2)) and not ready.is_active


def test_no_twist_follows_a_stop(ready: Any, view: Any) -> None:
    ready.start(1.0)
    servo = ready.servo

    def stopped_meanwhile(*_: Any, **__: Any) -> Any:
        ready.stop()
        return a_command()

    servo.step = stopped_meanwhile
    assert ready.on_image(image_message(view, stamp=1.0), 1.0) is None
    assert is_zero(ready.on_timer(1.1))


@pytest.mark.parametrize(
    ("change", "words"),
    [({"drive": "fly"}, "drive is 'fly', expected twist or cmd_vel"), ({"unit": 0.0}, "unit is 0.0"), ({"rate": np.nan}, "rate is nan")],
)
def test_impossible_parameters_are_named(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        pilot.Pilot(pilot.Settings(**change))


def test_a_robot_gets_its_controller() -> None:
    kind, options = pilot.Settings(drive="cmd_vel", camera_in_base=[0.1, 0.2, 0.0]).controller()
    assert kind is servo.RobotServo and options["camera_in_base"] == (0.1, 0.2, 0.0)
    assert "rate" not in options and "max_acceleration" not in options


def test_an_arm_may_command_its_hand() -> None:
    turned = [0.1, 0.2, 0.3, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    _, options = pilot.Settings(camera_in_hand=turned).check().controller()
    hand: Any = options["camera_in_hand"]
    wanted = np.array([[0.0, -1.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.3], [0.0, 0.0, 0.0, 1.0]])
    np.testing.assert_allclose(hand, wanted, atol=1e-15)
    assert "camera_in_hand" not in pilot.Settings().controller()[1]
    with pytest.raises(ValueError, match="camera_in_hand is .*, expected x, y, z and a unit quaternion"):
        pilot.Settings(camera_in_hand=[0.0] * 7).check()


def test_the_package_s_files_agree() -> None:
    for package in (ROOT / "quest_servo", ROOT / "quest_servo_interfaces"):
        assert ET.parse(package / "package.xml").findtext("name") == package.name
    names = {f.name for f in fields(pilot.Settings)}
    for config in ("arm", "robot"):
        text = (ROOT / "quest_servo" / "config" / f"{config}.yaml").read_text()
        assert set(re.findall(r"^    (\w+):", text, re.MULTILINE)) <= names
    setup = (ROOT / "quest_servo" / "setup.py").read_text()
    assert ".node:main" in setup and ast.parse((ROOT / "quest_servo" / "launch" / "servo.launch.py").read_text())


# The fields of each message, so that a misspelt one is an error.
MESSAGES = {
    "sensor_msgs.msg": {"Image": "header height width encoding is_bigendian step data", "CameraInfo": "width height d k"},
    "geometry_msgs.msg": {"Twist": "linear angular", "TwistStamped": "header twist"},
    "diagnostic_msgs.msg": {
        "DiagnosticArray": "header status", "DiagnosticStatus": "level name message hardware_id values", "KeyValue": "key value",
    },
    "rcl_interfaces.msg": {"SetParametersResult": "successful reason"},
    "std_srvs.srv": {"Trigger": ""},
}  # fmt: skip


def message_class(name: str, slots: str) -> Any:
    def init(self: Any, **given: Any) -> None:
        nested = {"header": Space(stamp=None, frame_id=""), "twist": None, "linear": vector(), "angular": vector()}
        for slot in slots.split():
            setattr(self, slot, given.pop(slot, nested.get(slot)))
        if name == "TwistStamped":
            self.twist = Space(linear=vector(), angular=vector())
        assert not given

    return type(name, (), {"__slots__": slots.split(), "__init__": init})


class FakeNode:
    """rclpy's Node as far as it is used."""

    def __init__(self, _: str) -> None:
        self.sent: dict[str, list[Any]] = {}
        self.time = 0.0

    def create_publisher(self, _: Any, topic: str, __: int) -> Any:
        self.sent[topic] = []
        return Space(publish=self.sent[topic].append, get_subscription_count=lambda: 1)

    def declare_parameter(self, name: str, default: Any) -> Any:
        return Space(value={**SETTINGS, "debug_image": True, "period": 0.01}.get(name, default))

    def get_clock(self) -> Any:
        return Space(now=lambda: Space(nanoseconds=1e9 * self.time, to_msg=lambda: "now"))

    def get_logger(self) -> Any:
        return Space(error=lambda *_, **__: None)

    def __getattr__(self, name: str) -> Any:
        assert name in ("add_on_set_parameters_callback", "create_subscription", "create_service", "create_timer")
        return lambda *_, **__: None


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch, view: Any) -> Any:
    def module(name: str, **content: Any) -> None:
        made = ModuleType(name)
        vars(made).update(content)
        monkeypatch.setitem(sys.modules, name, made)

    anything = lambda *_, **__: None  # noqa: E731
    qos = Space(QoSProfile=anything, ReliabilityPolicy=Space(BEST_EFFORT=1))
    module("rclpy", qos=qos)
    module("rclpy.node", Node=FakeNode)
    module("rclpy.qos", qos_profile_sensor_data=None)
    module("rclpy.executors", MultiThreadedExecutor=anything)
    module("rclpy.callback_groups", MutuallyExclusiveCallbackGroup=anything, ReentrantCallbackGroup=anything)
    module("rclpy.action", ActionServer=anything, CancelResponse=Space(ACCEPT=1), GoalResponse=Space(ACCEPT=1, REJECT=2))
    for name, classes in MESSAGES.items():
        module(name, **{kind: message_class(kind, slots) for kind, slots in classes.items()})
    text = (ROOT / "quest_servo_interfaces" / "action" / "ServoTo.action").read_text()
    parts = [" ".join(re.findall(r"^\w+ (\w+)$", part, re.MULTILINE)) for part in text.split("---")]
    action = {n: message_class(n, slots) for n, slots in zip(("Goal", "Result", "Feedback"), parts, strict=True)}
    module("quest_servo_interfaces.action", ServoTo=Space(**action))
    monkeypatch.delitem(sys.modules, "quest_servo.node", raising=False)
    made = importlib.import_module("quest_servo.node").ServoNode()
    made.pilot._make_servo = Fake
    made._on_info(info_message())
    made._on_image(image_message(view))
    return made


def handle_of(**said: Any) -> Any:
    ends: list[str] = []
    feedback: list[Any] = []
    marks = {name: lambda name=name: ends.append(name) for name in ("succeed", "abort", "canceled")}
    request = Space(goal_image="", timeout=0.0)
    return Space(
        request=request, ends=ends, feedback=feedback, publish_feedback=feedback.append, **{"is_cancel_requested": False, **said}, **marks
    )


def test_the_node_takes_a_goal_and_arrives(node: Any, view: Any) -> None:
    response = node._take_goal(None, Space(success=None, message=""))
    assert response.success and "200 features by sift" in response.message
    mask = np.arange(200) < 150
    Fake.says = [a_command(inlier_mask=mask, arrived=k == 3) for k in range(4)]
    handle = handle_of()
    acting = threading.Thread(target=lambda: setattr(handle, "result", node._execute(handle)))
    acting.start()
    while not node.pilot.is_active:
        pass
    assert node._on_goal(None) == 2
    for k in range(4):
        node.time = 0.1 * (k + 1)
        node._on_image(image_message(view, stamp=node.time))
        if k == 2:
            while not handle.feedback:
                pass
    acting.join(10)
    assert handle.ends == ["succeed"] and handle.result.arrived and handle.result.distance == 1.0
    twists = node.sent["delta_twist_cmds"]
    assert [t.twist.linear.x for t in twists] == [0.1, 0.1, 0.1, 0.0]
    assert {t.header.frame_id for t in twists} == {"camera_optical"}
    assert handle.feedback[0].state == "tracking" and handle.feedback[0].inliers == 5
    status = node.sent["/diagnostics"][0].status[0]
    assert status.level == messages.OK and {v.key: v.value for v in status.values}["seen"] == "6"
    assert node.sent["~/debug_image"][0].step == 3 * WIDTH


def test_the_node_says_why_it_does_not_start(node: Any) -> None:
    for path, words in (("", "no goal image was taken"), ("nowhere.png", "nowhere.png cannot be read")):
        handle = handle_of()
        handle.request.goal_image = path
        assert words in node._execute(handle).message and handle.ends == ["abort"]


def test_cancelled_and_killed_it_stands(node: Any, view: Any) -> None:
    node._take_goal(None, Space(success=None, message=""))
    handle = handle_of(is_cancel_requested=True)
    assert node._execute(handle).message == "cancelled" and handle.ends == ["canceled"]
    for _ in range(9):
        node._on_timer()
    twists = node.sent["delta_twist_cmds"]
    assert len(twists) == pilot.ZEROS_AT_THE_END and not any(t.twist.linear.x for t in twists)
    node.stand()
    assert len(twists) == pilot.ZEROS_AT_THE_END + 1


def test_an_image_that_cannot_be_used_ends_it(node: Any, view: Any) -> None:
    node._take_goal(None, Space(success=None, message=""))
    node.pilot.start(0.0)
    node._on_image(image_message(view, "16UC1"))
    assert not node.pilot.is_active and node._answer.arrived is False and "16UC1" in node._answer.message


def test_parameters_are_checked_when_they_are_set(node: Any) -> None:
    wrong = node._on_parameters([Space(name="max_speed", value=-1.0)])
    assert not wrong.successful and wrong.reason.startswith("max_speed is -1.0")
    assert node._on_parameters([Space(name="max_speed", value=0.3)]).successful
    assert node.pilot.settings.max_speed == 0.3
    assert not node._on_parameters([Space(name="drive", value="cmd_vel")]).successful
