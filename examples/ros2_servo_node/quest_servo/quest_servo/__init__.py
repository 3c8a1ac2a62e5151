"""Visual servoing from a goal image, for ROS 2."""
