"""The demo of each skill in one process: its bag teaches what was learned, and what cannot be done
is said.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dart_skill.cli import main
from dart_skill.common.fleet import arm_with
from dart_skill.common.regions import targets_for
from dart_skill.experiments.studies import arm_darts
from dart_skill.recording import BagReader
from dart_skill.session import Job, demo, learn_skill, own_dart
from dart_skill.skills.observation import Outcome
from dart_skill.skills.protocol import Skill, load_skill


@pytest.fixture
def job(tmp_path):
    return Job(seed=0, demonstrations=3, throws=1, bag=tmp_path / "bag")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["reach"])
def test_the_bag_teaches_what_was_learned_to_the_last_bit(name, job):
    said = []
    summary = demo(job, load_skill(name), said.append)
    _, lesson = learn_skill(job.bag, load_skill(name))
    assert not lesson.left_out and any(f"model {lesson.model_id}" in line for line in said)
    assert (
        summary.succeeded == 1
        and summary.layout == "in-process"
        and summary.trial_real_time_factor > 0.0
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
        demo(job, skill, lambda line: None),
        arm_darts.run(0, throws=2, demonstrations=3),
    )
    assert [(dart.aim, dart.hit, dart.score) for dart in summary.darts.darts] == [
        (dart.aim, dart.hit, dart.score) for dart in said.darts
    ]
    assert [one.outcome.success for one in summary.trials] == [
        True,
        True,
    ] and summary.darts.leg is None
    _, lesson = learn_skill(job.bag, skill)
    assert len(lesson.learned_from) == 3 and not lesson.left_out


def test_a_parameter_that_no_session_has_is_refused(job):
    assert arm_with("ideal", ["coach.candidates=3"])
    with pytest.raises(ValueError, match="coach, which no session has"):
        demo(replace(job, settings=("coach.candidates=3",)), load_skill("throw"), print)


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


@pytest.mark.parametrize("differs", [{"world": "kitchen"}, {"told_by": "darts"}])
def test_a_skill_that_has_no_world_in_process_needs_the_graph(job, differs):
    skill = type("Press", (Skill,), {"name": "press", **differs})()
    with pytest.raises(ValueError, match="'press' needs the graph"):
        demo(job, skill, print)
    assert not job.bag.exists()


def test_most_of_the_lessons_must_succeed(job):
    """A situation of which a person cannot show anything is given up, and another one is taken."""

    class Refusing(type(load_skill("place"))):
        def goal(self, situation):
            raise ValueError("out of reach")

    said = []
    with pytest.raises(ValueError, match="only 0 of 3 demonstrations succeeded"):
        demo(job, Refusing.configured(), said.append)
    assert len(said) == 7 and all(line.endswith("given up: out of reach") for line in said[1:])


def test_a_skill_is_tried_in_other_situations_than_those_in_which_it_was_shown():
    place = load_skill("place")
    lessons, trials = place.situations(3, 2, 2)
    shown = [next(lessons) for _ in range(3)]
    rng = np.random.default_rng([3, 7])
    wanted = [*place.draws(rng, 2), place.draw(rng)]
    wanted += [place.draw(rng, wide=True) for _ in range(2)]
    assert [one.to_json() for one in (*shown, *trials)] == [one.to_json() for one in wanted]
    rng = np.random.default_rng([3, 7])
    rng.random(1000)
    [alone] = place.situations(3, 0, 1)[1]
    assert alone.to_json() == place.draw(rng, wide=True).to_json(), "whatever a model was shown"


def test_baskets_are_spread_over_the_region_and_a_lesson_that_fails_goes_on_elsewhere():
    throw = load_skill("throw")
    lessons, trials = throw.situations(3, 2, 2)
    shown = np.array([throw.target(next(lessons)) for _ in range(4)])
    to_show, to_throw = targets_for(3, 2, 2)
    np.testing.assert_array_equal(shown[:2], to_show)
    np.testing.assert_array_equal([throw.target(one) for one in trials], to_throw)
    assert len(np.unique(shown[:, 0])) == 4


class Thrower:
    """Stands for a session, and for what was learned, whose next dart is refused or not seen."""

    release_shift = 0.0

    def __init__(self, refused):
        self._refused = refused

    def plan(self, target):
        return target

    def throw(self, plan):
        if self._refused:
            raise ValueError("out of reach")
        unseen = Outcome(False, np.full(3, np.nan), np.nan, np.nan, False)
        return SimpleNamespace(outcome=unseen)


@pytest.mark.parametrize(
    ("refused", "note"),
    [(True, "out of reach"), (False, "the cameras did not see where the dart went")],
)
def test_an_aim_that_is_refused_is_not_tried_again_and_one_that_was_not_seen_is(refused, note):
    skill, thrower = load_skill("darts"), Thrower(refused)
    agent, given_up = skill.agent(), []
    agent.cannot = lambda: given_up.append(agent.aim)
    dart, hit = own_dart(thrower, thrower, skill, agent)
    assert hit.place is None and dart.note == note and np.isnan(dart.hit).all()
    assert len(given_up) == refused
