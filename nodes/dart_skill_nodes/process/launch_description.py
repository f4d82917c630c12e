"""The node graph for `ros2 launch`, from the same description as `dart-skill up`
(`graph_processes`).
"""

import os
from functools import partial

from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable, Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from dart_skill.arm import fixed_transforms, the_arm, write_urdf
from dart_skill.common.configuration import config_path
from dart_skill.common.world import the_world
from dart_skill_nodes.comms.names import CLOCK
from dart_skill_nodes.process.graph_processes import LAYOUTS, parameters_of
from launch import LaunchContext, LaunchDescription

ARGUMENTS = {
    "seed": (int, "0", "everything random in the simulation comes from it"),
    "bag": (
        str,
        "",
        "folder of the bag of demonstrations; empty: a new one in the working directory",
    ),
    "played": (str, "", "the bag to play"),
    "rate": (float, "1.0", "of playing: seconds of the bag per second; 0: as fast as can be"),
    "skill": (
        str,
        "",
        (
            "throw, darts, place, reach, stir, or one of an installed package; empty: as"
            " config/world.yaml says"
        ),
    ),
    "registration": (str, "", "of cameras and arm: the file of `dart-skill check arm --write`"),
}
"""What a layout is started with: type, default and description."""
LEVELS = ("debug", "info", "warn", "error", "fatal")
OF_ALL = {
    "namespace": ("", "of all nodes, where several arms share a ROS domain, as arm1"),
    "params_file": (
        "",
        (
            "YAML file of nodes' parameters, which override those of config/ and of the other"
            " arguments"
        ),
    ),
    "use_sim_time": (
        "false",
        (
            "nodes' own clocks follow the graph's; what they do goes by the stamps of what they"
            " hear in any case"
        ),
    ),
    "log_level": ("info", f"of all nodes: {', '.join(LEVELS)}"),
}
"""Arguments of every launch file: default and description."""
EXTRAS = {
    "viewer": ("viewer", "the live view, too"),
    "bridge": ("effort_bridge", "the bridge to an effort controller of ros2_control, too"),
}
"""Nodes beside a layout that an argument of this name starts: executable and description."""
ENDS_BY_ITSELF = "bag_player"


def description(
    layouts: list[str], arguments: list[str], extras: tuple[str, ...] = ("viewer",)
) -> LaunchDescription:
    """A launch description of one layout, or of several among which the argument `layout` chooses,
    with these arguments and extras.

    When a node of the layout ends, everything does.
    """
    choice = [
        DeclareLaunchArgument(
            "layout", default_value=layouts[0], choices=layouts, description="how many processes"
        )
    ]
    beside = [
        DeclareLaunchArgument(name, default_value="false", description=EXTRAS[name][1])
        for name in extras
    ]
    rviz = DeclareLaunchArgument(
        "rviz",
        default_value="false",
        description="RViz, too, and with a real arm what it needs of transforms",
    )
    declared = [
        DeclareLaunchArgument(
            name, default_value=ARGUMENTS[name][1], description=ARGUMENTS[name][2]
        )
        for name in arguments
    ]
    of_all = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in OF_ALL.items()
    ]
    start = OpaqueFunction(
        function=partial(_started, layouts=layouts, arguments=arguments, extras=extras)
    )
    choice = choice if len(layouts) > 1 else []
    return LaunchDescription(
        [*choice, *beside, rviz, *declared, *of_all, _this_machine_only(), start]
    )


def _started(
    context: LaunchContext, layouts: list[str], arguments: list[str], extras: tuple[str, ...]
) -> list[Node]:
    """All nodes that the arguments ask for."""

    def given(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    layout = given("layout") if len(layouts) > 1 else layouts[0]
    values = {name: _value(name, given(name)) for name in arguments}
    if values.get("played") == "":
        raise ValueError("played:= is missing: give the bag to play")
    of_all = {name: given(name) for name in OF_ALL}
    _check(of_all)
    nodes = [
        _node(executable, of_all, parameters_of(executable, layout, **values))
        for executable in LAYOUTS[layout]
    ]
    beside = [EXTRAS[name][0] for name in extras if _is_true(name, given(name))]
    nodes += [
        _node(executable, of_all, parameters_of(executable, layout, **values), required=False)
        for executable in beside
    ]
    return nodes + (_rviz(of_all, layout) if _is_true("rviz", given("rviz")) else [])


def _node(
    executable: str, of_all: dict[str, str], parameters: dict, required: bool = True
) -> Node:
    over = Shutdown(reason=f"{executable} has ended")
    fails = partial(_ends_if_it_failed, over)
    return Node(
        package="dart_skill",
        executable=executable,
        namespace=of_all["namespace"],
        parameters=_parameters(of_all, parameters),
        remappings=[("/clock", CLOCK)],
        ros_arguments=["--log-level", of_all["log_level"]],
        output="screen",
        on_exit=None if not required else fails if executable == ENDS_BY_ITSELF else over,
    )


def _ends_if_it_failed(
    over: Shutdown, event: ProcessExited, context: LaunchContext
) -> Shutdown | None:
    """End the launch if the bag cannot be played; after a bag that was played to its end the
    learner goes on, for its clients.
    """
    return over if event.returncode else None


def _value(name: str, text: str):
    """Value of an argument, as its type has it; ValueError that names it."""
    kind = ARGUMENTS[name][0]
    try:
        return kind(text)
    except ValueError as error:
        raise ValueError(
            f"{name}:={text}: give {'a whole number' if kind is int else 'a number'}"
        ) from error


def _check(of_all: dict[str, str]) -> None:
    """ValueError for what a node would refuse at its start, or `ros2 launch` would leave out with
    a warning.
    """
    if (file := of_all["params_file"]) and not os.path.isfile(file):
        raise ValueError(f"params_file:={file}: there is no such file")
    if of_all["log_level"].lower() not in LEVELS:
        raise ValueError(f"log_level:={of_all['log_level']}: give one of {', '.join(LEVELS)}")


def _parameters(of_all: dict[str, str], own: dict) -> list:
    """The later ones override the earlier ones."""
    use_sim_time = {"use_sim_time": _is_true("use_sim_time", of_all["use_sim_time"])}
    return [own | use_sim_time, *([of_all["params_file"]] if of_all["params_file"] else [])]


def _is_true(name: str, text: str) -> bool:
    if text.lower() not in ("true", "false"):
        raise ValueError(f"{name}:={text}: give true or false")
    return text.lower() == "true"


def _rviz(of_all: dict[str, str], layout: str) -> list[Node]:
    """RViz with its displays chosen; beside a real arm the transforms, too, from packages that a
    desktop installation of ROS has.
    """
    space = {"namespace": of_all["namespace"]}
    view = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(config_path("viewers/throwing.rviz"))],
        **space,
    )
    if layout != "hardware":
        return [view]
    arm, (base, *_) = the_arm(), fixed_transforms(the_arm(), the_world().frame_id)
    pose = [f"{number:.6g}" for number in (*base.translation, *base.quaternion)]
    names = ("--x", "--y", "--z", "--qx", "--qy", "--qz", "--qw")
    arguments = [part for pair in zip(names, pose, strict=True) for part in pair]
    arguments += ["--frame-id", base.parent, "--child-frame-id", base.child]
    return [
        view,
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            parameters=[{"robot_description": write_urdf(arm)}],
            **space,
        ),
        Node(
            package="tf2_ros",
            executable="static_transform_publisher",
            arguments=arguments,
            **space,
        ),
    ]


def _this_machine_only() -> SetEnvironmentVariable:
    return SetEnvironmentVariable(
        "ROS_AUTOMATIC_DISCOVERY_RANGE",
        os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"),
    )
