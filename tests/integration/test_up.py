"""`dart-skill up`: says which nodes are ready, tells of one that ends, and leaves none behind,
however it ends itself.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from dart_skill.cli import main as command_line
from dart_skill.cli.run_options import GRAPHS
from dart_skill.session import learn_skill
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.process.graph_processes import LAYOUTS, NODES, SIMULATED
from tests.paths import BAGS
from tests.view_client import PageClient
from tests.warm import nodes_of

BAG = BAGS / "demonstrations"
PATIENCE = 200.0


def until(condition, what):
    over = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < over, f"{what} did not happen within {PATIENCE:.0f} s"
        time.sleep(0.05)


@pytest.fixture
def start(tmp_path):
    """Starts `dart-skill up`; its events come line by line. Whatever is left after the test is
    killed. warm: all that starts is forked.
    """
    started = []

    def begin(*arguments, warm=True):
        program = ["dart-skill"] if warm else [sys.executable, "-m", "dart_skill.cli"]
        command = [
            *program,
            "up",
            "--json",
            "--output",
            str(tmp_path / f"up_{len(started)}"),
            *arguments,
        ]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        started.append(process)
        return process

    yield begin
    for process in started:
        for pid in [process.pid] if process.poll() is None else []:
            os.kill(pid, signal.SIGKILL)
        process.communicate()
        until(lambda process=process: not nodes_of(process.pid), "the end of its nodes")


def events_until(process, wanted):
    """The events up to one of a kind."""
    seen = []
    for line in process.stdout:
        if line.startswith("{"):
            seen.append(json.loads(line))
            if seen[-1]["event"] == wanted:
                return seen
    pytest.fail(f"no event '{wanted}': {seen}\n{process.stderr.read()}")


def told_by(*arguments):
    """What a verb of `dart-skill` says as JSON; it must end well."""
    done = subprocess.run(
        ["dart-skill", *arguments, "--json"], capture_output=True, text=True, timeout=2 * PATIENCE
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def end(process):
    """Events until the end after Ctrl-C, which must be a good one that leaves no node."""
    process.send_signal(signal.SIGINT)
    rest = [json.loads(line) for line in process.stdout if line.startswith("{")]
    assert process.wait(PATIENCE) == 0 and not nodes_of(process.pid)
    return rest


def test_every_node_is_told_of_is_taught_learns_throws_and_none_is_left_after_ctrl_c(start):
    process = start("--seed", "3")
    events = events_until(process, "up")
    assert {event["node"] for event in events[:-1]} == set(NODES)
    assert "next" in events[-1]
    assert len(nodes_of(process.pid)) == len(LAYOUTS["composed"])
    for arguments, told in (
        (["teach", "--count", "2"], "lessons"),
        (["learn", "--at-least", "2"], "model_id"),
        (["throw"], "throws"),
    ):
        assert told_by(*arguments)[told]
    assert end(process)[-1]["event"] == "down"


def test_the_page_is_that_of_the_skill_and_its_address_is_told_and_opened(
    start, tmp_path, monkeypatch
):
    opened = tmp_path / "opened.txt"
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {opened}\n')
    browser.chmod(0o755)
    monkeypatch.setenv("BROWSER", str(browser))
    process = start("--skill", "place", "--open", "--port", "0")
    events = events_until(process, "up")
    (url,) = [event["message"] for event in events if event["node"] == "viewer"]
    assert events[-1]["next"] == f"dart-skill teach --count 5, or open {url}"
    (viewer,) = [node for node in told_by("status")["nodes"] if node["name"] == "viewer"]
    assert viewer["says"] == url
    kept = Path(viewer["values"]["address_file"])
    assert kept.read_text().strip() == url and kept.stat().st_mode & 0o777 == 0o600
    until(lambda: opened.is_file() and opened.read_text(), "the browser")
    assert opened.read_text().strip() == url
    with PageClient(url, origin=url) as page:
        page.wait_for(
            lambda: page.says("Press Teach to have place shown"), PATIENCE, "what to press"
        )
    end(process)
    assert not kept.exists()


@pytest.mark.slow
def test_a_recording_is_replayed_into_a_model(start):
    """Without an arm, real or simulated: the demonstrations are cut out of what is played."""
    process = start("--play", str(BAG), "--rate", "0")
    events_until(process, "up")
    learned, (_, lesson) = (
        told_by("learn", "--at-least", "13"),
        learn_skill(BAG, load_skill("throw")),
    )
    assert learned == {"demonstrations": 13, "model_id": lesson.model_id, "ok": True}
    end(process)


@pytest.mark.slow
def test_a_model_that_was_learned_from_a_bag_throws_at_once(start, tmp_path):
    """On a graph that nobody has taught; what is no model is refused, and the graph goes on."""
    model = told_by(
        "learn", str(BAG), "--demonstrations-topic", "--output", str(tmp_path / "model.npz")
    )
    demo = told_by(
        "demo", "--model", model["model"], "--throws", "1", "--output", str(tmp_path / "demo")
    )
    assert (demo["in"], demo["thrown"]) == (1, 1) and (tmp_path / "demo" / "report.html").is_file()
    process = start("--model", model["model"])
    up = events_until(process, "up")[-1]
    assert model["model_id"] in up["message"] and up["next"] == "dart-skill execute"
    listed = subprocess.run(
        ["dart-skill", "demonstrations"], capture_output=True, text=True, timeout=PATIENCE
    )
    assert listed.stdout.splitlines() == [
        "nothing has been shown yet",
        "next: dart-skill teach --count 5",
    ], listed
    (thrown,) = told_by("throw", "--model", model["model"])["throws"]
    assert thrown["in_basket"], thrown
    refused = subprocess.run(
        ["dart-skill", "throw", "--model", __file__],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert (
        refused.returncode == 1
        and "/skill_learner/load: " in refused.stderr
        and "Traceback" not in refused.stderr
    )
    end(process)


@pytest.mark.parametrize("verb", ["throw", "status"])
def test_without_a_graph_the_verbs_say_how_to_start_it(verb):
    done = subprocess.run(["dart-skill", verb], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 1 and "'dart-skill up' starts it" in done.stderr


def test_a_node_that_ends_is_named_and_ends_the_rest(start):
    process = start("--layout", "hardware")
    events_until(process, "up")
    (victim,) = [pid for pid, name in nodes_of(process.pid).items() if name == "commander"]
    os.kill(victim, signal.SIGKILL)
    _, complaint = process.communicate(timeout=PATIENCE)
    assert (
        process.returncode == 1
        and "commander ended with status -9" in complaint
        and "Traceback" not in complaint
    )
    assert not nodes_of(process.pid)


def test_nodes_end_with_whoever_started_them_and_a_second_graph_is_refused(start):
    first = start(warm=False)
    events_until(first, "up")
    second = start()
    _, complaint = second.communicate(timeout=PATIENCE)
    assert second.returncode == 1 and "run already" in complaint
    assert first.poll() is None, "who was there first stays"
    first.kill()
    first.wait()
    until(lambda: not nodes_of(first.pid), "the end of the nodes")


def test_the_options_know_the_layouts_of_a_simulated_graph():
    assert GRAPHS == SIMULATED


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["up", "--layout", "replay"], "needs --play BAG"),
        (["up", "--play", "bag", "--layout", "composed"], "needs --play BAG"),
        (["up", "--seed", "-1"], "--seed is -1"),
        (["up", "--rate", "2"], "--rate 2 is of a replay"),
        (["up", "--port", "8123"], "--port is 8123: it is of the live view"),
        (["up", "--viewer", "--port", "70000"], "from 0 to 65535"),
        (["practice", "--tests", "-1"], "--tests is -1; it must be at least 0"),
        (["up", "--model", "none.npz"], "none.npz: there is no such file"),
        (["up", "--output", "run.png"], "run.png: what is written fills a folder"),
        (["demo", "--output", __file__], "this is the name of a file"),
        (["demo", "--configuration", "nope"], "choose from"),
        (["demo", "--model", "none.npz"], "none.npz: there is no such file"),
        (
            ["demo", "--model", __file__, "--layout", "in-process"],
            "--model is for the learner of a graph",
        ),
        (["demo", "--model", __file__, "--demonstrations", "5"], "nothing is shown"),
        (["throw", "--model", "none.npz"], "none.npz: there is no such file"),
        (["execute", "--model", "none.npz"], "none.npz: there is no such file"),
        (["learn", "--configuration", "nope"], "choose from"),
    ],
)
def test_usage_errors_are_told_before_anything_is_started(arguments, said, capsys):
    with pytest.raises(SystemExit) as ended:
        command_line(arguments)
    assert ended.value.code == 2 and said in capsys.readouterr().err
