"""A robot with two driven wheels drives to where the goal image was taken. Rendered by MuJoCo.

    pip install quest-pose opencv-python-headless mujoco
    python mujoco_robot.py --starts 3
"""

import mujoco_world as world  # before MuJoCo: it chooses how that renders
import mujoco
import numpy as np

from quest_pose.servo import GoalImage, RobotServo, Servo

PERIOD = 0.1
# The camera: metres ahead of the axle and above it, radians by which it looks down.
FORWARD, HEIGHT, TILT = 0.08, 0.15, 0.0
# The camera shakes by so many radians while the robot drives.
SHAKE = 0.003


class Robot:
    """x to the right and z ahead in metres, heading to the right in radians; the camera is where it is mounted."""

    def __init__(self, model, seed):
        self.model, self.data = model, mujoco.MjData(model)
        self.place = np.zeros(3)
        self.shaking = np.random.default_rng(seed)

    def put(self, x, z, heading):
        self.place = np.array([x, z, heading], float)
        turn = world.rotation([0, heading, 0]) @ world.rotation([-TILT, 0, 0])
        turn = turn @ world.rotation(self.shaking.normal(0, SHAKE, 3) * [1, 0, 1])
        position = np.array([x, -HEIGHT, z]) + world.rotation([0, heading, 0]) @ [0, 0, FORWARD]
        self.data.mocap_pos[0] = position
        mujoco.mju_mat2Quat(self.data.mocap_quat[0], np.ascontiguousarray(turn @ world.FLIP).ravel())
        mujoco.mj_forward(self.model, self.data)

    def drive(self, speed, turn_rate, seconds):
        x, z, heading = self.place
        middle = heading + 0.5 * seconds * turn_rate
        self.put(x + seconds * speed * np.sin(middle), z + seconds * speed * np.cos(middle), heading + seconds * turn_rate)

    def away(self):
        """Metres and degrees from the goal, which is at the origin."""
        return float(np.hypot(*self.place[:2])), float(abs(np.degrees(self.place[2])))


def run(seed, detector="sift", recorder=None, images=350):
    """One start; whether it arrived and where it ended."""
    rng = np.random.default_rng(seed)
    assets, body, files = world.scene(seed, p=np.array([0, -HEIGHT, FORWARD]))
    eye_body = f'<body name="mount" mocap="true"><camera name="eye" fovy="{world.FOVY}"/></body>'
    robot = Robot(world.model(assets, eye_body + body, files), seed)
    eye = world.Eye(robot.model, robot.data, seed)
    robot.put(0, 0, 0)
    image = GoalImage(eye.image(), world.CAMERA, detector=detector)
    # Behind the goal and beside it, looking about at the scene.
    x, z = rng.uniform(-0.2, 0.2), -rng.uniform(0.25, 0.55)
    robot.put(x, z, np.arctan2(-x, world.DEPTH - z) + np.radians(rng.uniform(-8, 8)))
    metres, degrees = robot.away()
    options = {"max_speed": 0.25, "max_turn_rate": 0.4, "unit": world.DEPTH, "period": PERIOD, "speed_gain": 0.4, "turn_gain": 0.9}
    servo = Servo(image, RobotServo, recorder=recorder, camera_in_base=(FORWARD, HEIGHT, TILT), tolerance=0.02, **options)
    for k in range(images):
        command = servo.step(eye.image(), stamp=k * PERIOD)
        if command.arrived:
            break
        robot.drive(command.speed, command.turn_rate, PERIOD)
    end = robot.away()
    eye.close()
    print(f"start {seed}: {100 * metres:.1f} cm, {degrees:.1f}° -> {100 * end[0]:.2f} cm, {end[1]:.2f}° after {k + 1} images: {command.advice}")
    return command.arrived, end


if __name__ == "__main__":
    world.run_starts(run, __doc__)
