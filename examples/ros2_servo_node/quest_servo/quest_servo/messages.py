"""From ROS messages to what quest-pose takes, and back. No rclpy: any object with the fields of the message will do."""

import numpy as np

import quest_pose as qp

# Channels of an encoding, and their order as BGR.
ENCODINGS = {"mono8": (1, None), "8UC1": (1, None), "bgr8": (3, None), "rgb8": (3, [2, 1, 0]), "bgra8": (4, None), "rgba8": (4, [2, 1, 0, 3])}

# levels of diagnostic_msgs/DiagnosticStatus
OK, WARN, ERROR, STALE = b"\x00", b"\x01", b"\x02", b"\x03"


def seconds(stamp):
    """A builtin_interfaces/Time as seconds."""
    return stamp.sec + 1e-9 * stamp.nanosec


def pixels(message):
    """A sensor_msgs/Image as an array: grey (height, width), or BGR (height, width, 3 or 4).

    Raises ValueError for another encoding, and for data that are too short.
    """
    if message.encoding not in ENCODINGS:
        raise ValueError(f"the image has the encoding {message.encoding!r}, expected one of {', '.join(ENCODINGS)}")
    channels, order = ENCODINGS[message.encoding]
    data = np.frombuffer(bytes(message.data), np.uint8)
    if message.step < channels * message.width or len(data) < message.step * message.height:
        raise ValueError(
            f"the image has {len(data)} bytes in rows of {message.step}, expected {message.height} rows of "
            f"{message.width} pixels with {channels} bytes"
        )
    # Rows may be longer than the image is wide.
    rows = data[: message.step * message.height].reshape(message.height, message.step)
    image = rows[:, : channels * message.width].reshape(message.height, message.width, channels)
    if channels == 1:
        return np.ascontiguousarray(image[..., 0])
    return np.ascontiguousarray(image if order is None else image[..., order])


def camera(info):
    """A sensor_msgs/CameraInfo as a Camera. Pixel centres agree.

    Raises ValueError for a distortion model that is not known, and where the camera was not calibrated.
    """
    fx, fy, cx, cy = info.k[0], info.k[4], info.k[2], info.k[5]
    if not (fx > 0 and fy > 0):
        raise ValueError("camera_info has no focal length, expected that of a calibrated camera in k")
    size = {"width": info.width, "height": info.height}
    d = list(info.d)
    if info.distortion_model == "equidistant":
        return qp.Camera("OPENCV_FISHEYE", [fx, fy, cx, cy, *(d + [0.0] * 4)[:4]], **size)
    if info.distortion_model not in ("", "plumb_bob", "rational_polynomial") or len(d) > 8:
        raise ValueError(
            f"camera_info has the distortion model {info.distortion_model!r} with {len(d)} numbers, expected plumb_bob, "
            "rational_polynomial or equidistant"
        )
    if not any(d):
        return qp.Camera("PINHOLE", [fx, fy, cx, cy], **size)
    return qp.Camera("FULL_OPENCV", [fx, fy, cx, cy, *(d + [0.0] * 8)[:8]], **size)


def fill_twist(twist, linear, angular):
    """Velocities into a geometry_msgs/Twist in the camera's optical frame: x right, y down, z forward."""
    twist.linear.x, twist.linear.y, twist.linear.z = (float(v) for v in linear)
    twist.angular.x, twist.angular.y, twist.angular.z = (float(w) for w in angular)
    return twist


def fill_cmd_vel(twist, linear, angular):
    """The same for a base: x forward, z up, so that a turn to the right is negative."""
    return fill_twist(twist, (linear[2], 0, 0), (0, 0, -angular[1]))


def fill_image(message, drawn, header):
    """A BGR array into a sensor_msgs/Image."""
    message.header = header
    message.height, message.width = drawn.shape[:2]
    message.encoding, message.is_bigendian, message.step = "bgr8", 0, 3 * drawn.shape[1]
    message.data = drawn.tobytes()
    return message


def fill_status(status, name, command, key_value):
    """A Command into a diagnostic_msgs/DiagnosticStatus. ``key_value`` is the class KeyValue."""
    acts = command.state in ("tracking", "confirming", "rotation_only", "exploring")
    status.name, status.hardware_id, status.message = name, "", command.advice
    status.level = ERROR if command.state == "diverging" else STALE if command.state == "stale" else OK if acts else WARN
    numbers = {
        "state": command.state,
        "seen": command.seen,
        "inliers": command.inliers,
        "hypotheses": command.hypotheses,
        "residual": command.residual,
        "holding_seconds": command.holding_seconds,
        "arrived": command.arrived,
    }
    status.values = [key_value(key=key, value=str(value)) for key, value in numbers.items()]
    return status


def distances(command, unit):
    """How far the goal is: |t| in metres and the angle of R in degrees; NaN without a pose."""
    if command.t is None:
        return float("nan"), float("nan")
    R = command.R
    sine = 0.5 * np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    angle = np.degrees(np.arctan2(sine, 0.5 * (np.trace(R) - 1)))
    return unit * float(np.linalg.norm(command.t)), float(angle)
