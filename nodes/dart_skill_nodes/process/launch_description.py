"""The node graph for `ros2 launch`, from the same description as `dart-skill up` (`graph`)."""

import os

from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import EqualsSubstitution, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from dart_skill.configuration import config_path
from dart_skill.robot import wam_description, write_urdf
from dart_skill_nodes.process.graph_processes import LAYOUTS, parameters_of
from launch import LaunchDescription

ARGUMENTS = {
    "seed": (int, "0", "everything random in the simulation comes from it"),
    "bag": (str, "", "folder of the bag of demonstrations; empty: a new one in the working directory"),
    "played": (str, "", "the bag to play"),
    "rate": (float, "1.0", "of playing: seconds of the bag per second; 0: as fast as can be"),
    "skill": (str, "throw", "what the arm learns and does: throw, place, or one of an installed package"),
    "registration": (str, "", "of cameras and arm: the file of `dart-skill check arm --write`"),
}
"""Type, default and description."""
EXTRAS = {
    "viewer": ("viewer", "the live view, too"),
    "bridge": ("effort_bridge", "the bridge to an effort controller of ros2_control, too"),
}
"""Nodes beside a layout that an argument of this name starts: executable and description."""


def description(layouts: list[str], arguments: list[str], extras: tuple[str, ...] = ("viewer",)) -> LaunchDescription:
    """A launch description of one layout, or of several among which the argument `layout` chooses, with these arguments and extras."""
    chosen = [DeclareLaunchArgument("layout", default_value=layouts[0], choices=layouts, description="how many processes")]
    beside = [DeclareLaunchArgument(name, default_value="false", description=EXTRAS[name][1]) for name in extras]
    declared = [DeclareLaunchArgument(name, default_value=ARGUMENTS[name][1], description=ARGUMENTS[name][2]) for name in arguments]
    values = {name: ParameterValue(LaunchConfiguration(name), value_type=ARGUMENTS[name][0]) for name in arguments}
    nodes = [_node(executable, layout, values, len(layouts) > 1) for layout in layouts for executable in LAYOUTS[layout]]
    nodes += [
        Node(package="dart_skill", executable=EXTRAS[name][0], output="screen", condition=IfCondition(LaunchConfiguration(name)))
        for name in extras
    ]
    rviz = DeclareLaunchArgument("rviz", default_value="false", description="RViz, too, and robot_state_publisher for it")
    return LaunchDescription([*(chosen if len(layouts) > 1 else []), *beside, rviz, *declared, _this_machine_only(), *nodes, *_rviz()])


def _rviz() -> list[Node]:
    """RViz with its displays chosen, and the transforms of the arm, from packages that a desktop installation of ROS has."""
    wanted = IfCondition(LaunchConfiguration("rviz"))
    arm = {"robot_description": ParameterValue(write_urdf(wam_description()), value_type=str)}
    return [
        Node(package="robot_state_publisher", executable="robot_state_publisher", parameters=[arm], condition=wanted),
        Node(package="rviz2", executable="rviz2", arguments=["-d", str(config_path("viewers/throwing.rviz"))], condition=wanted),
    ]


def _node(executable: str, layout: str, values: dict, is_choice: bool) -> Node:
    condition = IfCondition(EqualsSubstitution(LaunchConfiguration("layout"), layout)) if is_choice else None
    parameters = parameters_of(executable, layout, **values)
    return Node(package="dart_skill", executable=executable, parameters=[parameters], output="screen", condition=condition)


def _this_machine_only() -> SetEnvironmentVariable:
    return SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"))
