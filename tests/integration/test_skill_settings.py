"""Settings of a skill reach the nodes that know it, from the command line on."""

import json

import pytest
from rclpy.node import Node

from dart_skill.common.fleet import NODES_OF_SKILL, arm_with
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.process.parameters import skill_of
from tests.paths import ROOT


def node_with(settings, skill="place"):
    """A node that was started with a text of settings, as `Graph.start` writes it."""
    options = ["--ros-args", "-p", f"skill_settings:={json.dumps(settings)}"]
    node = Node("knows_a_skill", cli_args=options)
    node.declare_parameter("skill", skill)
    return node


def test_settings_of_the_command_line_reach_the_skill_of_a_node(ros):
    given = ["skill.representation=pose", "skill.components=7", "skill.frames=[hand, holder]"]
    text = arm_with("ideal", given)["skill_learner"]["skill_settings"]
    node = node_with(text)
    try:
        settings = skill_of(node).settings
    finally:
        node.destroy_node()
    usual = load_skill("place").settings
    assert (settings.representation, settings.components) == ("pose", 7)
    assert settings.frames == ("hand", "holder") and settings.stiffness == usual.stiffness


@pytest.mark.parametrize("text", ["components", "[8]", "{"])
def test_what_is_no_mapping_is_refused_with_the_parameter_and_its_form(ros, text):
    node = node_with(text)
    try:
        with pytest.raises(ValueError, match="skill_settings is '.*': give a YAML mapping"):
            skill_of(node)
    finally:
        node.destroy_node()


def test_every_node_that_knows_a_skill_is_told():
    folder = ROOT / "nodes/dart_skill_nodes/executables"
    know = {
        path.stem for path in folder.glob("*.py") if "skill_of(self)" in path.read_text("utf-8")
    }
    assert know == set(NODES_OF_SKILL)
