"""What `dart-skill status` takes for wrong, and how it says so; no graph runs."""

import argparse
from dataclasses import replace

import pytest

from dart_skill_nodes.client.graph_report import (
    ERROR,
    READY,
    SILENT,
    WARNING,
    GraphReport,
    NodeReport,
    TopicReport,
)
from dart_skill_nodes.verbs import status
from dart_skill_nodes.verbs.status import as_text, table

LIMITS = {"fastest_hand": 5.5, "workspace_low": [-1.2, -1.2, 0.3]}
COMMANDER = NodeReport(
    "commander",
    READY,
    "holding",
    "7",
    {"mode": "holding", "last": "thrown", "/joint_states refused": "3"},
)
STATES = TopicReport("/joint_states", ("wam_driver",), 500.0, 0.01, 0, True)
COMMANDS = TopicReport("/wam/command", ("commander",), 500.0, 0.01, 0, True)
LEARNER = NodeReport("skill_learner", WARNING, "nothing learned yet", "8")
OTHERS = (
    LEARNER,
    *(NodeReport(name, READY, "waiting", "7") for name in ("coach", "demonstration_recorder")),
)
WELL = GraphReport(
    "4",
    2.5,
    (COMMANDER, *OTHERS),
    ("wam_driver",),
    (STATES, COMMANDS),
    {"commander": LIMITS, "effort_bridge": dict(LIMITS)},
    (READY, ""),
)


def with_commander(**changes):
    return replace(WELL, nodes=(replace(COMMANDER, **changes), *WELL.nodes[1:]))


def with_topics(*topics):
    return replace(WELL, topics=topics)


def test_a_graph_that_is_well_is_told_in_full():
    text = as_text(WELL)
    assert text.endswith("nothing is wrong") and WELL.problems == []
    for part in ("ROS domain 4: 4 nodes in 2 processes", "wam_driver", "500.0", "holding; last: thrown", "commanded by   commander",
                 "-1.2, -1.2, 0.3", "commander: /joint_states: 3"):  # fmt: skip
        assert part in text, part


@pytest.mark.parametrize(
    ("report", "problem"),
    [
        (with_commander(state=ERROR, says="tracking error"), "commander: tracking error"),
        (with_commander(state=SILENT, says="it is on the graph"), "commander: it is on the graph"),
        (
            with_commander(
                state=WARNING, says="holding, stopped by ~/stop: call /commander/reset"
            ),
            "call /commander/reset",
        ),
        (
            replace(WELL, nodes=(*WELL.nodes, replace(COMMANDER, process="9"))),
            "2 nodes are called commander, in processes 7 and 9",
        ),
        (replace(WELL, nodes=(COMMANDER, *OTHERS[1:])), "no skill_learner"),
        (
            replace(WELL, safety=(ERROR, "hand at 7 m/s")),
            "stopped it until a reset: hand at 7 m/s",
        ),
        (with_topics(COMMANDS), "no arm: nobody publishes /joint_states"),
        (
            with_topics(STATES, replace(COMMANDS, publishers=("commander", "ros2cli"))),
            "commander and ros2cli command the arm",
        ),
        (with_topics(replace(STATES, lost=4), COMMANDS), "4 messages of /joint_states were lost"),
        (
            replace(
                WELL,
                limits={"commander": LIMITS, "effort_bridge": {**LIMITS, "fastest_hand": 9.0}},
            ),
            "different limits: fastest_hand",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(report, problem):
    (told,) = report.problems
    assert problem in told and f"wrong: {told}" in as_text(report)


@pytest.mark.parametrize(
    "report",
    [
        # one was killed and started again
        with_topics(STATES, replace(COMMANDS, publishers=("commander", "commander"))),
        with_topics(replace(STATES, lost=4, reliable=False), COMMANDS),
        replace(WELL, safety=None, limits={}),
        with_commander(state=WARNING, says="no answer yet"),
        replace(WELL, nodes=(NodeReport("wam_simulator", READY, "running", "5"),), topics=()),
    ],
)
def test_what_is_not_wrong_raises_no_alarm(report):
    assert report.problems == []


def test_what_a_stranger_says_does_not_reach_the_terminal_as_it_is():
    assert "\x1b" not in as_text(with_commander(says="\x1b[2J"))


@pytest.mark.parametrize(
    ("report", "there"),
    [(None, "on this machine: "), (replace(WELL, nodes=()), "on this machine, only wam_driver: ")],
)
def test_where_no_node_of_the_graph_is_found_something_is_wrong(
    report, there, monkeypatch, capsys
):
    monkeypatch.setattr(status, "look", lambda seconds, namespace: report)
    parser = argparse.ArgumentParser()
    status.add_arguments(parser)
    assert status.main(parser.parse_args([]), parser) == 1
    said = capsys.readouterr()
    assert f"{there}'dart-skill up' starts it" in said.err and said.out == ""


def test_a_column_is_as_wide_as_what_stands_in_it_and_no_wider_than_it_may_be():
    rows = [("x" * 9, "y"), ("z", "w")]
    assert table(("a", "b"), rows) == ["a          b", "xxxxxxxxx  y", "z          w"]


@pytest.mark.parametrize(
    ("kept", "says"),
    [
        ("http://127.0.0.1:8080/?websocket=ws://127.0.0.1:8080/secret\n", "whole"),
        (None, "where it is"),  # on another machine
        ("another text of this user\n", "where it is"),
        ("http://127.0.0.1:8080/\x1b[2J\n", "where it is"),
    ],
)
def test_the_page_of_a_viewer_is_told_with_its_token(tmp_path, kept, says):
    file = tmp_path / "address.txt"
    if kept is not None:
        file.write_text(kept)
    values = {"address": "http://127.0.0.1:8080", "address_file": str(file)}
    viewer = NodeReport("viewer", READY, "where it is", "9", values)
    (told,) = status.with_pages(replace(WELL, nodes=(viewer,))).nodes
    assert told.says == (kept.strip() if says == "whole" else says)
