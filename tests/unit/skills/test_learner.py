"""What the skill learner learns from, without a graph."""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.common.configuration import load_yaml
from dart_skill.recording import read_demonstrations
from dart_skill.skills.darts import Darts
from dart_skill.skills.learning import DEFAULT, _preparation, save_model
from dart_skill.skills.practice import learner_of
from dart_skill.skills.protocol import load_skill, part_of
from tests.paths import BAGS
from tests.throw_demonstrations import changed_throw


@pytest.fixture
def throws():
    parameters = load_yaml("skill_learner.yaml")["skill_learner"]["ros__parameters"]
    return learner_of(load_skill("throw"), lambda: parameters)


@pytest.fixture
def prepared(monkeypatch):
    """Ids of the demonstrations that are worked out, as it happens."""
    ids, work = [], _preparation._prepare
    monkeypatch.setattr(
        _preparation, "_prepare", lambda one, reading: ids.append(one.id) or work(one, reading)
    )
    return ids


def test_a_demonstration_is_worked_out_as_it_comes_and_not_again_by_lessons(throws, prepared):
    shown = read_demonstrations(BAGS / "demonstrations")[:4]
    for one in shown[:3]:
        throws.expect(one)
    assert prepared == [one.id for one in shown[:3]]
    assert len(throws.learn(shown[:3]).learned_from) == 3
    assert throws.finding(shown[0], "") and prepared == [one.id for one in shown[:3]]
    throws.learn(shown, "")  # one more
    assert prepared == [one.id for one in shown]


def test_one_that_cannot_be_learned_from_is_left_to_the_lesson(throws):
    shown = read_demonstrations(BAGS / "demonstrations")[:3]
    blind = changed_throw(
        shown[2], id="blind", ball_time=np.empty(0), ball_position=np.empty((0, 3))
    )
    throws.expect(blind)
    lesson = throws.learn([*shown, blind], "")
    assert len(lesson.learned_from) == 3 and "blind" in lesson.left_out["blind"]


@pytest.mark.parametrize("name", ["start_speed", "stop_speed"])
def test_speeds_that_cut_throws_are_the_recorders(throws, name):
    parameters = load_yaml("skill_learner.yaml")["skill_learner"]["ros__parameters"]
    throws.check(parameters)
    with pytest.raises(ValueError, match=f"{name} is of the demonstration_recorder"):
        throws.check({**parameters, name: 0.1})


def test_a_model_of_another_board_is_refused(tmp_path):
    parameters = load_yaml("skill_learner.yaml")["skill_learner"]["ros__parameters"]
    shown = replace(read_demonstrations(BAGS / "demonstrations")[0], skill="darts")
    save_model(tmp_path / "darts.npz", [shown], Darts().configured_for(DEFAULT))
    elsewhere = Darts.at_board((3.0, 0.0, 1.7))
    with pytest.raises(ValueError, match="learned for another game or board"):
        learner_of(elsewhere, lambda: parameters).load(tmp_path / "darts.npz")


@pytest.mark.parametrize("what", ["learner", "target_choice"])
def test_a_part_that_cannot_be_imported_is_named(what):
    odd = type("Odd", (Darts,), {what: "nowhere.at_all:Thing"})()
    with pytest.raises(ValueError, match=f"the {what} of the skill 'darts' .nowhere.at_all:Thing"):
        part_of(odd, what)
