"""The simulated graph in real time: the world goes on, whether it is answered or not."""

import re
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from dart_skill_msgs.action import Execute

from dart_skill.common.regions import targets_for
from dart_skill.recording import read_demonstrations
from dart_skill.skills.learning import save_model
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.comms import conversions
from tests.integration.conftest import teach_and_learn

BAG = Path(__file__).parents[2] / "bags" / "demonstrations"
AT_THE_START = ("faulthandler", "rclpy.experimental")
"""What rclpy loads for the executor, before any message comes."""

SLOWLY = {"lockstep": False, "speed_factor": 0.2}
"""A fifth as fast as the wall clock, so that a machine that does other things, too, has time to
answer.
"""


@pytest.mark.slow
def test_in_real_time_throws_are_shown_and_learned_and_one_goes_in(make_graph):
    """The hand never opened: whatever was shown missed."""
    _, client = make_graph(
        extra={"composed": {f"wam_simulator:{name}": value for name, value in SLOWLY.items()}}
    )
    shown, (target,) = targets_for(0, 2, 1)
    assert teach_and_learn(client, shown).demonstrations == 2
    results = [client.throw(target)]
    while not results[-1].outcome.success and len(results) < 3:
        results.append(client.throw(target))
    assert results[-1].code == Execute.Goal.OUTCOME_EXECUTED and results[-1].outcome.success, [
        (one.message, one.outcome.error) for one in results
    ]


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A file with what the bag of this repository teaches."""
    file = tmp_path_factory.mktemp("model") / "throws.npz"
    save_model(file, list(read_demonstrations(BAG)), load_skill("throw").settings)
    return file


@contextmanager
def busy(processes):
    """A machine that has other things to do."""
    running = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processes)
    ]
    try:
        yield
    finally:
        for one in running:
            one.kill()
            one.wait()


@pytest.mark.slow
def test_a_commander_that_has_just_started_throws_on_a_busy_machine(make_graph, model):
    """Modules were loaded, and plans read, while the arm waited for an answer: the first throws
    were broken off ("no state of the arm for 0.52 s").
    """
    extra = {"wam_simulator": SLOWLY}
    with busy(4):
        _, client = make_graph("processes", extra=extra)
        client.load(model)
        for target in targets_for(3, 0, 2)[1]:
            result = client.throw(target)
            assert result.code == Execute.Goal.OUTCOME_EXECUTED, result.message


def drawn(skill, number):
    """Situations as a skill draws them."""
    rng, skill = np.random.default_rng(5), load_skill(skill)
    return [conversions.situation_msg(skill.draw(rng)) for _ in range(number)]


@pytest.mark.parametrize("skill", ["", pytest.param("place", marks=pytest.mark.slow)])
def test_nothing_is_loaded_between_the_start_of_a_commander_and_its_first_motion(
    make_graph, monkeypatch, model, skill
):
    monkeypatch.setenv("PYTHONPROFILEIMPORTTIME", "1")
    graph, client = make_graph("processes", skill=skill)
    monkeypatch.delenv("PYTHONPROFILEIMPORTTIME")
    if skill:
        situations = drawn(skill, 4)
        for one in situations[:3]:
            assert client.show(one).success
        client.learn()
        result = client.execute(situations[3], look=True)
    else:
        client.load(model)
        result = client.throw(targets_for(3, 0, 1)[1][0])
    assert result.code == Execute.Goal.OUTCOME_EXECUTED, result.message
    log = (graph.logs / "commander.log").read_text()
    later = re.findall(r"^import time:.*\| +(\S+)$", log[log.index("ready") :], re.MULTILINE)
    assert not [one for one in later if not one.startswith(AT_THE_START)]
