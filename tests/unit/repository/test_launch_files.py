"""The launch files start executables that there are, with parameters that these have; a stand-in for `launch`, which is not on PyPI."""

import importlib.util
import re
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


def stand_ins(monkeypatch):
    """Modules of launch and launch_ros; every class is a `Recorded` of its own."""
    wanted = {
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "SetEnvironmentVariable"],
        "launch.conditions": ["IfCondition"],
        "launch.substitutions": ["EqualsSubstitution", "LaunchConfiguration"],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
        "launch_ros.parameter_descriptions": ["ParameterValue"],
    }
    for name, classes in wanted.items():
        module = types.ModuleType(name)
        for one in classes:
            setattr(module, one, type(one, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "dart_skill_nodes.process.launch_description", raising=False)


@pytest.fixture(params=FILES, ids=lambda file: file.name)
def entities(request, monkeypatch):
    if importlib.util.find_spec("dart_skill_nodes") is None:
        pytest.skip("the workspace is not built")
    stand_ins(monkeypatch)
    description = runpy.run_path(str(request.param))["generate_launch_description"]()
    yield description.values[0]
    sys.modules.pop("dart_skill_nodes.process.launch_description", None)


def of(entities, kind):
    return [one for one in entities if type(one).__name__ == kind]


def parameters_there_are(executable):
    """Names of the parameters that an executable's nodes declare."""
    from dart_skill_nodes.process.graph_processes import nodes_of

    sources = [(ROOT / "nodes" / "dart_skill_nodes" / "executables" / f"{node}.py").read_text() for node in nodes_of([executable])]
    return {name for source in sources for name in re.findall(r'\("(\w+)", ', source)}


def test_nodes_and_their_parameters_exist(entities):
    setup = (ROOT / "setup.py").read_text()
    nodes = [node for node in of(entities, "Node") if node.options["package"] == "dart_skill"]
    assert nodes
    for node in nodes:
        executable = node.options["executable"]
        assert f'"{executable}",' in setup
        for parameters in node.options.get("parameters", []):
            assert set(parameters) <= parameters_there_are(executable), executable


def test_arguments_are_described_and_all_that_is_used_is_declared(entities):
    declared = {argument.values[0]: argument.options for argument in of(entities, "DeclareLaunchArgument")}
    assert all(options["description"] and isinstance(options["default_value"], str) for options in declared.values())
    used = set()
    for node in of(entities, "Node"):
        if node.options["package"] != "dart_skill":
            continue
        values = [value for parameters in node.options.get("parameters", []) for value in parameters.values()]
        used |= {value.values[0].values[0] for value in values if type(value).__name__ == "ParameterValue"}
    conditions = [node.options["condition"].values[0] for node in of(entities, "Node") if isinstance(node.options["condition"], Recorded)]
    used |= {one.values[0] for one in conditions if type(one).__name__ == "LaunchConfiguration"}
    assert used | {"viewer", "rviz"} <= set(declared) <= used | {"viewer", "rviz", "layout"}


def test_a_real_arm_may_have_the_bridge_and_the_measured_registration(monkeypatch):
    stand_ins(monkeypatch)
    entities = runpy.run_path(str(ROOT / "launch" / "hardware.launch.py"))["generate_launch_description"]().values[0]
    nodes = {node.options["executable"]: node.options for node in of(entities, "Node")}
    assert nodes["effort_bridge"]["condition"].values[0].values[0] == "bridge"
    assert all("registration_file" in nodes[name]["parameters"][0] for name in ("commander", "skill_learner"))
    sys.modules.pop("dart_skill_nodes.process.launch_description", None)


def test_rviz_is_optional_and_its_displays_are_shipped(entities):
    others = [node.options for node in of(entities, "Node") if node.options["package"] != "dart_skill"]
    assert [one["package"] for one in others] == ["robot_state_publisher", "rviz2"]
    assert all(one["condition"].values[0].values[0] == "rviz" for one in others)
    assert Path(others[1]["arguments"][1]).is_file()


def test_discovery_stays_on_this_machine(entities):
    (variable,) = of(entities, "SetEnvironmentVariable")
    assert variable.values[0] == "ROS_AUTOMATIC_DISCOVERY_RANGE"
