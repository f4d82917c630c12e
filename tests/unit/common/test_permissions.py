"""Permissions by node, and the policy that is made of them; nobody needs ROS for it."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

import dart_skill_nodes
from dart_skill.cli import main
from dart_skill.common.permissions import permissions_of, policy, processes
from dart_skill_nodes.process.graph_processes import NODES, NODES_OF
from tests.policies import allowed, may

ALLOWED = allowed(policy())
COMMANDS = {
    "rt/wam/command": {"commander"},
    "rt/wam/teacher_wrench": {"teacher"},
    "rt/joint_states": {"wam_simulator"},
}


def test_every_node_and_every_process_has_its_enclave():
    assert set(NODES) <= set(processes()) and processes()["composed"] == list(NODES_OF["composed"])
    assert set(ALLOWED) == {f"/dart_skill/{name}" for name in processes()}


def test_every_node_of_a_verb_may_have_its_services():
    folder = Path(dart_skill_nodes.__file__).parent
    texts = [
        file.read_text(encoding="utf-8")
        for part in ("verbs", "client")
        for file in (folder / part).rglob("*.py")
    ]
    made = {
        name
        for text in texts
        for name in re.findall(
            r'(?:create_node\(|node_of_command\(|GraphClient\([^\n]*name=|name: str = )"(\w+)"',
            text,
        )
    }
    assert {"client", "verb", "status", "foxglove_view"} <= made
    serves = {name for _, subscribe in ALLOWED.values() for name in subscribe}
    assert not [name for name in made if f"rq/{name}/describe_parametersRequest" not in serves]


@pytest.mark.parametrize(("topic", "who"), COMMANDS.items())
def test_what_moves_the_arm_is_said_by_one_node_alone(topic, who):
    may_say = {
        path.rsplit("/", 1)[1] for path, (publish, _) in ALLOWED.items() if may(publish, topic)
    }
    assert may_say - {"composed"} == who


def test_names_become_those_of_dds():
    publish, subscribe = ALLOWED["/dart_skill/commander"]
    assert {
        "rt/commander/plan",
        "rr/execute/_action/send_goalReply",
        "rt/execute/_action/feedback",
        "rq/skill_learner/planRequest",
    } <= publish
    assert {
        "rq/execute/_action/send_goalRequest",
        "rq/commander/stopRequest",
        "rr/skill_learner/planReply",
    } <= subscribe
    assert not may(publish, "rq/commander/stopRequest") and not may(subscribe, "rt/wam/command")


def test_in_a_namespace_all_names_are_but_those_that_graphs_share():
    inside = allowed(policy("/arm1"))
    assert set(inside) == {f"/dart_skill/arm1/{name}" for name in processes()}
    publish, subscribe = inside["/dart_skill/arm1/commander"]
    assert {
        "rt/arm1/wam/command",
        "rt/arm1/commander/plan",
        "rt/diagnostics",
        "rt/arm1/execute/_action/feedback",
    } <= publish
    assert (
        may(subscribe, "rt/arm1/joint_states")
        and may(subscribe, "rt/arm1/clock")
        and not may(subscribe, "rt/joint_states")
    )
    recorder = inside["/dart_skill/arm1/recorder"][1]
    assert (
        may(recorder, "rt/arm1/anything")
        and may(recorder, "rt/tf")
        and not may(recorder, "rt/arm2/joint_states")
    )
    for name, ends in inside.items():
        assert not any(may(end, f"r{kind}/arm2/joint_states") for end in ends for kind in "tqr"), (
            name
        )


def test_the_command_writes_the_policy_and_no_file_over_another(tmp_path, capsys):
    path = tmp_path / "policy.xml"
    assert main(["security", str(path)]) == 0
    assert (
        ElementTree.parse(path).getroot().get("version") == "0.2.0"
        and "generate_artifacts" in capsys.readouterr().out
    )
    assert main(["security", str(path)]) == 1 and "exists already" in capsys.readouterr().err


def test_a_node_without_a_section_is_named():
    with pytest.raises(ValueError, match="no section 'nobody'"):
        permissions_of("nobody")
