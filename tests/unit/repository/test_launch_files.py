"""The launch files start executables that there are, with parameters that these have; a stand-in
for `launch`, which is not on PyPI.
"""

import importlib.util
import runpy
import sys
import types
from pathlib import Path

import pytest

from tests.paths import ROOT

FILES = sorted((ROOT / "launch").glob("*.launch.py"))


class Recorded:
    """Anything of `launch`: remembers what it was made of."""

    def __init__(self, *values, **options):
        self.values, self.options = values, options


class LaunchConfiguration(Recorded):
    """Of an argument; a context is a dictionary of their values here."""

    def perform(self, context):
        return context[self.values[0]]


def stand_ins(monkeypatch):
    """Modules of launch and launch_ros; every class is a `Recorded` of its own."""
    wanted = {
        "launch": ["LaunchContext", "LaunchDescription"],
        "launch.actions": [
            "DeclareLaunchArgument",
            "OpaqueFunction",
            "SetEnvironmentVariable",
            "Shutdown",
        ],
        "launch.events.process": ["ProcessExited"],
        "launch.substitutions": [],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
    }
    for name, classes in wanted.items():
        module = types.ModuleType(name)
        for one in classes:
            setattr(module, one, type(one, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    sys.modules["launch.substitutions"].LaunchConfiguration = LaunchConfiguration
    monkeypatch.delitem(sys.modules, "dart_skill_nodes.process.launch_description", raising=False)


@pytest.fixture(params=FILES, ids=lambda file: file.name)
def launched(request, monkeypatch):
    if importlib.util.find_spec("dart_skill_nodes") is None:
        pytest.skip("the workspace is not built")
    stand_ins(monkeypatch)
    yield Launched(request.param)
    sys.modules.pop("dart_skill_nodes.process.launch_description", None)


class Launched:
    """A launch file with its arguments."""

    def __init__(self, file):
        self.entities = runpy.run_path(str(file))["generate_launch_description"]().values[0]
        self.declared = {
            one.values[0]: one.options
            for one in self.entities
            if type(one).__name__ == "DeclareLaunchArgument"
        }

    def nodes(self, **arguments):
        """Options of the nodes that it starts with these arguments, by executable."""
        assert set(arguments) <= set(self.declared)
        (start,) = [one for one in self.entities if type(one).__name__ == "OpaqueFunction"]
        needed = {"played": "bag"} if "played" in self.declared else {}
        values = (
            {name: options["default_value"] for name, options in self.declared.items()}
            | needed
            | arguments
        )
        return {
            node.options["executable"]: node.options for node in start.options["function"](values)
        }

    @property
    def layouts(self):
        return (
            [{"layout": name} for name in self.declared["layout"]["choices"]]
            if "layout" in self.declared
            else [{}]
        )


def parameters_there_are(executable):
    """Names of the parameters that an executable's nodes declare."""
    of_all = {"use_sim_time", "autostart", "seed"}
    from dart_skill_nodes.process.graph_processes import nodes_of
    from dart_skill_nodes.process.parameters import described

    return {name for node in nodes_of([executable]) for name in described(node)} | of_all


def test_nodes_and_their_parameters_exist(launched):
    setup = (ROOT / "setup.py").read_text()
    for layout in launched.layouts:
        nodes = launched.nodes(viewer="true", **layout)
        assert "viewer" in nodes and len(nodes) > 1
        for executable, options in nodes.items():
            assert options["package"] == "dart_skill" and f'"{executable}",' in setup
            assert set(options["parameters"][0]) <= parameters_there_are(executable), executable


def test_the_skill_is_told_to_every_node_that_has_one(launched):
    beside = {name: "true" for name in ("viewer", "bridge") if name in launched.declared}
    for executable, options in launched.nodes(**beside, skill="place").items():
        assert ("skill" in parameters_there_are(executable)) == (
            options["parameters"][0].get("skill") == "place"
        ), executable


def test_arguments_are_described(launched):
    assert all(
        options["description"] and isinstance(options["default_value"], str)
        for options in launched.declared.values()
    )
    assert {"viewer", "rviz", "namespace", "params_file", "use_sim_time", "log_level"} <= set(
        launched.declared
    )


def test_every_node_has_what_is_given_for_all(launched, tmp_path):
    mine = tmp_path / "mine.yaml"
    mine.touch()
    given = {
        "namespace": "arm1",
        "params_file": str(mine),
        "use_sim_time": "true",
        "log_level": "debug",
        "viewer": "true",
    }
    for options in launched.nodes(**given).values():
        assert options["namespace"] == "arm1" and options["ros_arguments"] == [
            "--log-level",
            "debug",
        ]
        assert (
            options["parameters"][1] == str(mine)
            and options["parameters"][0]["use_sim_time"] is True
        )
        assert options["remappings"] == [("/clock", "clock")]


def test_all_ends_with_a_node_that_is_needed_and_with_no_other(launched):
    nodes = launched.nodes(viewer="true")
    needed = {
        name for name, options in nodes.items() if type(options["on_exit"]).__name__ == "Shutdown"
    }
    assert needed == set(nodes) - {"viewer", "bag_player"}
    if "bag_player" in nodes:
        ends = {
            code: nodes["bag_player"]["on_exit"](types.SimpleNamespace(returncode=code), None)
            for code in (0, 1)
        }
        assert ends[0] is None and type(ends[1]).__name__ == "Shutdown", (
            "a bag that cannot be played leaves nothing to wait for"
        )


WRONG = [
    ("viewer", "yes", "viewer:=yes: give true or false"),
    ("seed", "x", "seed:=x: give a whole number"),
    ("rate", "fast", "rate:=fast: give a number"),
    ("played", "", "played:= is missing: give the bag to play"),
    ("params_file", "nowhere.yaml", "params_file:=nowhere.yaml: there is no such file"),
    ("log_level", "loud", "log_level:=loud: give one of debug, info"),
]
"""An argument, what it cannot be, and what is said of it."""


def test_what_cannot_be_is_refused_before_anything_starts(launched):
    for argument, value, said in WRONG:
        if argument in launched.declared:
            with pytest.raises(ValueError, match=said):
                launched.nodes(**{argument: value})


def test_each_wrong_argument_is_one_of_a_launch_file(monkeypatch):
    stand_ins(monkeypatch)
    declared = {argument for file in FILES for argument in Launched(file).declared}
    assert {argument for argument, *_ in WRONG} <= declared
    sys.modules.pop("dart_skill_nodes.process.launch_description", None)


def test_a_real_arm_may_have_the_bridge_and_the_measured_registration(monkeypatch):
    stand_ins(monkeypatch)
    hardware = Launched(ROOT / "launch" / "hardware.launch.py")
    assert "effort_bridge" not in hardware.nodes() and "effort_bridge" in hardware.nodes(
        bridge="true"
    )
    nodes = hardware.nodes(registration="arm.yaml")
    assert all(
        nodes[name]["parameters"][0]["registration_file"] == "arm.yaml"
        for name in ("commander", "skill_learner")
    )
    sys.modules.pop("dart_skill_nodes.process.launch_description", None)


def test_rviz_is_optional_and_a_real_arm_gets_the_transforms_that_it_needs(launched):
    others = [
        options
        for options in launched.nodes(rviz="true").values()
        if options["package"] != "dart_skill"
    ]
    assert [one["package"] for one in others] in (
        ["rviz2"],
        ["rviz2", "robot_state_publisher", "tf2_ros"],
    )
    assert ("bridge" in launched.declared) == (len(others) == 3)
    assert Path(others[0]["arguments"][1]).is_file()


def test_discovery_stays_on_this_machine(launched):
    (variable,) = [
        one for one in launched.entities if type(one).__name__ == "SetEnvironmentVariable"
    ]
    assert variable.values[0] == "ROS_AUTOMATIC_DISCOVERY_RANGE"
