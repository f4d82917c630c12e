"""What the skill learner learns from, without a graph."""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.common.configuration import load_yaml
from dart_skill.recording import read_demonstrations
from dart_skill.skills.darts import Darts
from dart_skill.skills.learning import (
    CONFIGURATIONS,
    _preparation,
    configuration,
    learn_prepared,
    outliers,
    prepare,
    save_model,
    unlike,
)
from dart_skill.skills.practice import Learner, changed_skill
from dart_skill.skills.protocol import load_skill
from tests.paths import BAGS
from tests.throw_demonstrations import changed_throw


@pytest.fixture
def throws():
    parameters = load_yaml("skill_learner.yaml")["skill_learner"]["ros__parameters"]
    return Learner(load_skill("throw"), lambda: parameters)


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


def bulged(throw, size):
    """The same throw on a way that lies up to so far aside [m] before the ball leaves the hand."""
    time, motion = throw.time, throw.motion.copy()
    share = (time - throw.start) / (throw.release_time - throw.start)
    aside = np.array([-np.sin(throw.azimuth), np.cos(throw.azimuth), 0.0])
    motion[:, :3] += size * aside * np.sin(np.pi * share.clip(0.0, 1.0))[:, None] ** 2
    return replace(throw, motion=motion)


@pytest.mark.parametrize("name", ["default", "cross_validated", "autonomous"])
def test_a_throw_that_goes_another_way_than_the_others_is_an_outlier(name):
    """What throws differ in was never worked out: the comparison said what the list says without
    it.
    """
    settings = configuration(name)
    shown = [prepare(one, settings) for one in read_demonstrations(BAGS / "demonstrations")]
    alike = unlike(learn_prepared(shown, settings))
    assert np.isfinite(alike).all() and not outliers(alike).any(), alike
    odd = unlike(learn_prepared([*shown[:5], bulged(shown[5], 0.15), *shown[6:]], settings))
    assert np.flatnonzero(outliers(odd)).tolist() == [5] and 0.06 < odd[5] < 0.11, odd


def test_the_standing_of_throws_has_their_distance_from_the_others(throws):
    shown = read_demonstrations(BAGS / "demonstrations")[:4]
    throws.learn(shown)
    standings = throws.standings()
    assert list(standings) == [one.id for one in shown]
    assert all(0.0 < one.unlike < 0.1 and one.weight > 0.0 for one in standings.values())
    throws.learn(shown[:2])
    assert all(np.isnan(one.unlike) for one in throws.standings().values()), "too few to compare"


@pytest.mark.parametrize("name", ["start_speed", "stop_speed"])
def test_speeds_that_cut_throws_are_the_recorders(throws, name):
    parameters = load_yaml("skill_learner.yaml")["skill_learner"]["ros__parameters"]
    throws.check(parameters)
    with pytest.raises(ValueError, match=f"{name} is without effect on 'throw'"):
        throws.check({**parameters, name: 0.1})


def test_a_model_of_another_board_is_refused(tmp_path):
    parameters = load_yaml("skill_learner.yaml")["skill_learner"]["ros__parameters"]
    shown = replace(read_demonstrations(BAGS / "demonstrations")[0], skill="darts")
    save_model(tmp_path / "darts.npz", [shown], Darts().settings)
    elsewhere = Darts.at_board((3.0, 0.0, 1.7))
    with pytest.raises(ValueError, match="learned for another game or board"):
        Learner(elsewhere, lambda: parameters).load(tmp_path / "darts.npz")


NUMBERS = (
    "components",
    "stiffness",
    "orientation_stiffness",
    "start_speed",
    "stop_speed",
    "least_stiffness",
    "most_stiffness",
)
AS_CONFIGURED = {**dict.fromkeys(NUMBERS, 0), "frames": "", "configuration": ""}


@pytest.mark.parametrize(
    ("name", "given", "fields", "said"),
    [
        ("place", {}, {}, ""),
        (
            "place",
            {"components": 5, "stiffness": 250.0, "stop_speed": 0.03, "frames": "holder"},
            {"components": 5, "stiffness": 250.0, "stop_speed": 0.03, "frames": ("holder",)},
            "components 5, stiffness 250.0, stop_speed 0.03, frames holder",
        ),
        ("place", {"most_stiffness": 800.0}, {}, ""),  # one is set before the other
        (
            "throw",
            {"least_stiffness": 50.0, "most_stiffness": 800.0},
            {"stiffness_range": (50.0, 800.0)},
            "stiffness_range (50.0, 800.0)",
        ),
        (
            "throw",
            {"configuration": "thesis_local", "frames": "azimuth"},
            {**CONFIGURATIONS["thesis_local"], "frames": ("azimuth",)},
            "configuration thesis_local, frames azimuth",
        ),
    ],
)
def test_settings_are_changed_where_a_parameter_says_so(name, given, fields, said):
    skill = load_skill(name)
    changed, words = changed_skill(skill, AS_CONFIGURED | given)
    assert changed.settings == replace(skill.settings, **fields) and words == said


@pytest.mark.parametrize(
    ("name", "given", "said"),
    [
        ("place", {"frames": "azimuth, holder"}, "no task frame 'azimuth': choose among hand,"),
        (
            "reach",
            {"least_stiffness": 50.0, "most_stiffness": 800.0},
            "the representation 'autonomous' knows no covariance",
        ),
        ("place", {"least_stiffness": 900.0, "most_stiffness": 800.0}, "stiffness_range is"),
        ("throw", {"frames": "cup"}, "frames 'cup' are unknown: choose one of base, target;"),
        ("place", {"configuration": "thesis"}, "configurations are of throws"),
        (
            "throw",
            {"configuration": "defualt"},
            "no configuration 'defualt': choose one of .distance",
        ),
    ],
)
def test_a_change_that_cannot_be_is_refused(name, given, said):
    with pytest.raises(ValueError, match=said):
        changed_skill(load_skill(name), AS_CONFIGURED | given)
