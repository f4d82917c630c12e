"""The whole graph: `ros2 launch dart_skill throwing.launch.py`. Afterwards, for example:

ros2 action send_goal /teach dart_skill_msgs/action/Teach "{target: {x: 2.0, y: 0.3, z: 0.4}}"
"""

import os

from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

SEPARATE = ("wam_simulator", "mock_optitrack", "commander", "demonstration_recorder", "teacher", "coach")


def generate_launch_description() -> LaunchDescription:
    composed, seed = LaunchConfiguration("composed"), ParameterValue(LaunchConfiguration("seed"), value_type=int)
    bag = ParameterValue(LaunchConfiguration("bag"), value_type=str)
    seeded = [{"seed": seed}]
    of = {"demonstration_recorder": [{"seed": seed, "bag": bag}], "commander": []}
    return LaunchDescription(
        [
            DeclareLaunchArgument("composed", default_value="true", description="all nodes but the learner in one process"),
            DeclareLaunchArgument("seed", default_value="0", description="everything random comes from it"),
            DeclareLaunchArgument("bag", default_value="", description="folder of the bag; empty: a new one in the working directory"),
            SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")),
            Node(
                package="dart_skill",
                executable="composed",
                parameters=[{"seed": seed, "bag": bag}],
                output="screen",
                condition=IfCondition(composed),
            ),
            *(
                Node(
                    package="dart_skill",
                    executable=name,
                    parameters=of.get(name, seeded),
                    output="screen",
                    condition=UnlessCondition(composed),
                )
                for name in SEPARATE
            ),
            Node(package="dart_skill", executable="skill_learner", output="screen"),
        ]
    )
