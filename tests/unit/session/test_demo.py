"""The demo of each skill in one process: its bag teaches what was learned, and what cannot be done
is said.
"""

from dataclasses import replace

import pytest

from dart_skill.cli import main
from dart_skill.common.fleet import arm_with
from dart_skill.experiments.studies import arm_darts
from dart_skill.recording import BagReader
from dart_skill.session import (
    Job,
    darts_demo,
    learn_skill,
    skill_demo,
    throwing_demo,
)
from dart_skill.skills.protocol import load_skill


@pytest.fixture
def job(tmp_path):
    return Job(seed=0, demonstrations=3, throws=1, bag=tmp_path / "bag")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["reach"])
def test_the_bag_teaches_what_was_learned_to_the_last_bit(name, job):
    said = []
    summary = skill_demo(job, load_skill(name), said.append)
    _, lesson = learn_skill(job.bag, load_skill(name))
    assert not lesson.left_out and any(f"model {lesson.model_id}" in line for line in said)
    assert (
        summary.succeeded == 1
        and summary.layout == "in-process"
        and summary.real_time_factor > 0.0
    )
    with BagReader(job.bag) as bag:
        assert {"/joint_states", "/wam/command", "/wam/teacher_wrench", "/demonstrations"} < set(
            bag.topics
        )
        assert len([topic for topic in bag.topics if topic.startswith("/vrpn_mocap/")]) == 1 + len(
            load_skill(name).bodies
        )


@pytest.mark.slow
def test_darts_are_those_of_the_experiment_to_the_last_bit(job):
    """Which are those of the graph (tests/integration/test_darts.py)."""
    skill, job = load_skill("darts"), replace(job, throws=2)
    summary, said = (
        darts_demo(job, skill, lambda line: None),
        arm_darts.run(0, throws=2, demonstrations=3),
    )
    assert [(dart.aim, dart.hit, dart.score) for dart in summary.run.darts] == [
        (dart.aim, dart.hit, dart.score) for dart in said.darts
    ]
    assert [one.outcome.success for one in summary.of.trials] == [
        True,
        True,
    ] and summary.leg is None
    _, lesson = learn_skill(job.bag, skill)
    assert len(lesson.learned_from) == 3 and not lesson.left_out


def test_a_parameter_that_no_session_has_is_refused(job):
    assert arm_with("ideal", ["coach.candidates=3"])
    with pytest.raises(ValueError, match="coach, which no session has"):
        throwing_demo(replace(job, settings=("coach.candidates=3",)), lambda line: None)


def test_what_fails_is_said_in_a_line(tmp_path, capsys):
    arguments = [
        "demo",
        "--layout",
        "in-process",
        "--set",
        "coach.candidates=3",
        "--demonstrations",
        "2",
        "--throws",
        "1",
    ]
    assert main([*arguments, "--output", str(tmp_path / "run")]) == 1
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith("the demo failed: ") and "coach" in said[-1]


def test_a_skill_that_has_no_world_in_process_needs_the_graph(job):
    class Other(type(load_skill("throw")).__mro__[1]):
        name = "press"

    with pytest.raises(ValueError, match="'press' needs the graph"):
        skill_demo(job, Other(), lambda line: None)
