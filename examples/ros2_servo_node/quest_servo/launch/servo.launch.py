"""ros2 launch quest_servo servo.launch.py config:=arm image:=/camera/color/image_raw info:=/camera/color/camera_info"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, TextSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    config = [LaunchConfiguration("config"), TextSubstitution(text=".yaml")]
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", default_value="arm", description="arm or robot"),
            DeclareLaunchArgument("image", default_value="/camera/image_raw"),
            DeclareLaunchArgument("info", default_value="/camera/camera_info"),
            DeclareLaunchArgument("twist", default_value="/servo_node/delta_twist_cmds"),
            DeclareLaunchArgument("cmd_vel", default_value="/cmd_vel"),
            Node(
                package="quest_servo",
                executable="servo",
                name="quest_servo",
                output="screen",
                parameters=[PathJoinSubstitution([FindPackageShare("quest_servo"), "config", config])],
                remappings=[
                    ("image", LaunchConfiguration("image")),
                    ("camera_info", LaunchConfiguration("info")),
                    ("delta_twist_cmds", LaunchConfiguration("twist")),
                    ("cmd_vel", LaunchConfiguration("cmd_vel")),
                ],
            ),
        ]
    )
