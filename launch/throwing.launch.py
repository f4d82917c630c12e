"""The whole graph with the simulated arm: `ros2 launch dart_skill throwing.launch.py`. Afterwards,
for example:

ros2 action send_goal /teach dart_skill_msgs/action/Teach "{situation: {bodies: [basket], poses:
[{position: {x: 2.0, y: 0.3, z: 0.4}}]}}"
"""

from dart_skill_nodes.process.launch_description import description
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    return description(["composed", "processes"], ["seed", "bag", "skill"])
