"""What a real arm and real cameras need besides their own drivers: `ros2 launch dart_skill
hardware.launch.py`.

The arm's driver publishes /joint_states and takes /wam/command; vrpn_mocap publishes
/vrpn_mocap/{hand,ball,basket}/pose. An arm under ros2_control with an effort controller takes
`bridge:=true` instead of a driver.
"""

from dart_skill_nodes.process.launch_description import description
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    return description(["hardware"], ["bag", "registration", "skill"], ("viewer", "bridge"))
