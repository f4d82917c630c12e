"""A recording into demonstrations and a learner: `ros2 launch dart_skill replay.launch.py
played:=bags/demonstrations`.

Afterwards `ros2 service call /skill_learner/learn dart_skill_msgs/srv/Learn '{at_least: 13}'`.
"""

from dart_skill_nodes.process.launch_description import description
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    return description(["replay"], ["bag", "played", "rate", "skill"])
