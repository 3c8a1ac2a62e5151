"""A seven-joint arm with a camera in its hand finds back to where the goal image was taken. Rendered by MuJoCo.

    pip install quest-pose opencv-python-headless mujoco
    python mujoco_arm.py --starts 3 --record run.npz && quest-cli servo --replay run.npz --plot run.html
"""

import mujoco_world as world  # before MuJoCo: it chooses how that renders
import mujoco
import numpy as np

from quest_pose.servo import GoalImage, Servo, joint_velocities

PERIOD = 0.1
HOME = np.array([0, 0.3, 0, -1.8, 0, 2.1, 0.6])
JOINT_LIMITS = np.array([2.9, 1.8, 2.9, 3.0, 2.9, 3.7, 2.9])
ENDS = np.stack([-JOINT_LIMITS, JOINT_LIMITS], axis=1)
JOINT_SPEEDS = np.full(7, 1.2)
# Seconds in which a joint follows its command to 63 %.
LAG = 0.06
# Where the camera is in the hand: MuJoCo's frame of the camera, turned and beside the flange.
EYE = '<camera name="eye" fovy="{fovy}" pos="0.05 -0.03 0.06" quat="{turn}"/>'


def arm():
    """Seven revolute joints, about as long as a Franka's, with the camera in the hand."""
    joints = [  # axis, offset from the joint before
        ("0 0 1", "0 0 0.33"), ("0 1 0", "0 0 0"), ("0 0 1", "0 0 0.316"), ("0 -1 0", "0.08 0 0"),
        ("0 0 1", "-0.08 0 0.384"), ("0 -1 0", "0 0 0"), ("0 0 1", "0.08 0 0.1"),
    ]  # fmt: skip
    turn = world.quaternion(world.rotation([0, 0, 0.3]) @ world.rotation([0.2, 0, 0]) @ world.FLIP)
    hand = f'<site name="hand" pos="0 0 0.1"/><body pos="0 0 0.1">{EYE.format(fovy=world.FOVY, turn=turn)}</body>'
    text = ""
    for k, (axis, offset) in enumerate(joints):
        limit = JOINT_LIMITS[k]
        text += (
            f'<body pos="{offset}"><inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'
            f'<joint name="j{k}" axis="{axis}" range="{-limit} {limit}"/>'
        )
    return text + hand + "</body>" * len(joints)


class Arm:
    """Joints that follow commanded velocities with a lag."""

    def __init__(self, model):
        self.model, self.data, self.speeds = model, mujoco.MjData(model), np.zeros(7)

    def put(self, joints):
        self.data.qpos[:] = joints
        self.speeds[:] = 0
        mujoco.mj_forward(self.model, self.data)

    def follow(self, linear, angular, eye, seconds, steps=10):
        """The twist of the camera in its own frame, for so many seconds."""
        camera = self.model.camera("eye").id
        for _ in range(steps):
            R, p = eye.pose()
            translation, turn = np.zeros((3, 7)), np.zeros((3, 7))
            mujoco.mj_jac(self.model, self.data, translation, turn, p, self.model.cam_bodyid[camera])
            # Near a singularity the arm is slow instead of wild; it stops before a joint's end.
            wanted, _ = joint_velocities(
                R @ linear, R @ angular, np.vstack([translation, turn]),
                max_speeds=JOINT_SPEEDS, damping=0.01, positions=self.data.qpos, ends=ENDS,
            )  # fmt: skip
            dt = seconds / steps
            self.speeds += (wanted - self.speeds) * min(1.0, dt / LAG)
            self.data.qpos[:] = np.clip(self.data.qpos + self.speeds * dt, -JOINT_LIMITS, JOINT_LIMITS)
            mujoco.mj_forward(self.model, self.data)


def start(arm, eye, goal, rng):
    """Other joints, so that the camera is 10 to 50 cm away, turned by up to 60 degrees, the scene's middle in view."""
    while True:
        joints = HOME + rng.normal(0, 0.35, 7)
        arm.put(joints)
        metres, degrees = world.away(goal, eye.pose())
        R, p = eye.pose()
        middle = R.T @ (goal[0] @ [0, 0, world.DEPTH] + goal[1] - p)
        in_view = middle[2] > 0.4 and abs(middle[0] / middle[2]) < 0.2 and abs(middle[1] / middle[2]) < 0.15
        if 0.1 < metres < 0.5 and 5 < degrees < 60 and in_view:
            return metres, degrees


def run(seed, detector="sift", recorder=None, images=250):
    """One start; whether it arrived and where it ended."""
    alone = Arm(world.model("", arm(), {}))
    alone.put(HOME)
    camera = alone.data.camera("eye")
    home = camera.xmat.reshape(3, 3) @ world.FLIP, camera.xpos.copy()
    assets, body, files = world.scene(seed, *home)
    robot = Arm(world.model(assets, arm() + body, files))
    eye = world.Eye(robot.model, robot.data, seed)
    robot.put(HOME)
    image = GoalImage(eye.image(), world.CAMERA, detector=detector)
    metres, degrees = start(robot, eye, home, np.random.default_rng(seed))
    servo = Servo(image, recorder=recorder, max_speed=0.2, max_turn_rate=0.4, unit=world.DEPTH, period=PERIOD, rate=0.8)
    for k in range(images):
        command = servo.step(eye.image(), stamp=k * PERIOD)
        if command.arrived:
            break
        robot.follow(command.linear, command.angular, eye, PERIOD)
    end = world.away(home, eye.pose())
    eye.close()
    print(f"start {seed}: {100 * metres:.1f} cm, {degrees:.1f}° -> {100 * end[0]:.2f} cm, {end[1]:.2f}° after {k + 1} images: {command.advice}")
    return command.arrived, end


if __name__ == "__main__":
    world.run_starts(run, __doc__)
