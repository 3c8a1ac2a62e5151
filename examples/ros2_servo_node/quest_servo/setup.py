from glob import glob

from setuptools import setup

NAME = "quest_servo"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
        (f"share/{NAME}/config", glob("config/*.yaml")),
    ],
    install_requires=["setuptools", "quest-pose"],
    zip_safe=True,
    maintainer="quest-pose maintainers",
    maintainer_email="maintainers@quest-pose.example",
    description="Visual servoing from a goal image: Image and CameraInfo in, twists out",
    license="MIT OR Apache-2.0",
    entry_points={"console_scripts": [f"servo = {NAME}.node:main"]},
)
