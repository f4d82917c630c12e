"""Darts as a skill: what a situation aims at, where the board is, its settings, and the worlds and
demonstrations that go with it.
"""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.arm import DART, the_arm
from dart_skill.common.situation import Pose, Situation
from dart_skill.common.world import the_world
from dart_skill.darts import as_target
from dart_skill.recording import (
    demonstration_from_message,
    demonstration_message,
    types_for,
)
from dart_skill.simulation import Board, PlantSettings, make_world
from dart_skill.skills.darts import Darts, DartsSettings
from dart_skill.skills.learning import DEFAULT, load_model, save_model
from dart_skill.skills.protocol import load_skill
from dart_skill.skills.throw import Throw
from tests.throw_demonstrations import throw_demonstration
from tests.unit.board_points import in_world


@pytest.fixture(scope="module")
def darts():
    return load_skill("darts")


@pytest.mark.parametrize("bed", ["DB", "T20", "D3", "S11"])
def test_a_bed_that_is_aimed_at_is_where_the_board_has_it(darts, bed):
    target = darts.target(darts.aimed(as_target(bed)))
    np.testing.assert_array_equal(target, in_world(darts.face, as_target(bed)))
    assert darts.points(target)[1] == bed
    np.testing.assert_allclose(darts.target(darts.at(target)), target, atol=1e-12)


def test_without_an_aim_it_is_the_bull(darts):
    np.testing.assert_array_equal(darts.target(Situation({})), darts.bull)


@pytest.mark.parametrize(
    ("numbers", "why"),
    [
        ({"down": 0.1}, "number 'down'.*it has only right, up"),
        ({"up": 3.0}, "not on the board"),
        ({"right": np.nan}, "not on the board"),
    ],
)
def test_what_is_no_aim_is_refused(darts, numbers, why):
    with pytest.raises(ValueError, match=why):
        darts.target(Situation({}, numbers))


def test_a_board_that_is_seen_elsewhere_is_refused_with_the_remedy(darts):
    darts.check_seen("board", Pose(np.array(darts.bull) + [0.0, 0.0, 0.01]))
    with pytest.raises(
        ValueError,
        match=(
            r"0\.100 m from where config/world.yaml has its bull .*: hang it there, or say there"
        ),
    ):
        darts.check_seen("board", Pose(np.array(darts.bull) + [0.0, 0.1, 0.0]))


def test_the_points_that_are_shown_are_all_over_the_board(darts):
    shown = np.array([darts.aim(one) for one in darts.draws(np.random.default_rng(0), 8)])
    for axis in range(2):
        strata = np.floor((shown[:, axis] / 240.0 + 0.5) * 8)
        assert sorted(strata) == list(range(8)), "each stratum once"


def test_its_settings_are_those_of_its_file(darts):
    assert darts.settings == replace(DartsSettings(), board=darts.bull), (
        "the file says what the defaults are"
    )
    assert darts.correction.memory == 40 and darts.settings.board == the_world().board_position


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ({"prior": 8.0}, "prior is no setting; there are representation, refinement"),
        ({"of": 1}, "of is no setting"),
        ({"cocked": [0.0, 1.0]}, "three angles"),
        ({"apart": [0.1]}, "two numbers"),
        ({"window": -1}, "window is -1"),
        ({"shown": 0.0}, "must be positive"),
        ({"lengths": []}, "at least one offset, one length"),
    ],
)
def test_a_setting_that_makes_no_sense_is_refused(content, why):
    with pytest.raises(ValueError, match=why):
        DartsSettings().changed(content, "darts.yaml")


def test_the_hand_holds_a_dart(darts):
    assert darts.loaded(the_arm()).ball is DART
    assert Throw().loaded(the_arm()).ball is the_arm().ball


def test_its_world_has_a_dart_and_a_board_that_stays(darts):
    world = make_world("board", PlantSettings(), 0, Board((2.4, 0.1, 1.7)))
    try:
        assert list(world.bodies) == ["hand", "dart", "board"] and world.held_body == "dart"
        np.testing.assert_array_equal(world.bodies["board"][0], [2.4, 0.1, 1.7])
        world.set_up({}, {"right": 0.1, "up": 0.0})
        world.change(replace(PlantSettings(), gravity_error=0.02))
        world.reset()
        np.testing.assert_array_equal(world.bodies["board"][0], [2.4, 0.1, 1.7])
        assert world.settings.gravity_error == 0.02
        with pytest.raises(ValueError, match="the board hangs where it is"):
            world.put("board", np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
        with pytest.raises(ValueError, match="knows no number 'left'; it knows right, up"):
            world.set_up({}, {"left": 0.1})
    finally:
        world.close()


@pytest.fixture
def shown():
    time = np.linspace(0.0, 1.0, 20)
    place, turn = np.tile([1.0, 0.0, 1.5], (20, 1)), np.tile([0.0, 0.0, 0.0, 1.0], (20, 1))
    return throw_demonstration(
        ("dart", "board"),
        id="one",
        stamp_ns=5,
        target=[2.37, 0.0, 1.73],
        hand_time=time,
        hand_position=place,
        hand_quaternion=turn,
        ball_time=time,
        ball_position=place,
        hand_opened=0.5,
        skill="darts",
    )


def test_a_demonstration_says_of_what_it_is_in_messages(shown):
    message = demonstration_message(types_for("dart_skill_msgs/msg/Demonstration"), shown)
    assert (message.skill, [track.body for track in message.tracks], message.situation.bodies) == (
        "darts",
        ["hand", "dart"],
        ["board"],
    )
    again = demonstration_from_message(message)
    assert again.skill == "darts"
    np.testing.assert_array_equal(again.moved.position, shown.moved.position)


def test_a_demonstration_says_of_what_it_is_in_model_files(shown, tmp_path):
    save_model(tmp_path / "darts.npz", [shown], Darts().settings)
    demonstrations, configuration, *_ = load_model(tmp_path / "darts.npz")
    assert demonstrations[0].skill == "darts" and configuration.game == Darts().game
    save_model(tmp_path / "throws.npz", [replace(shown, skill="throw")], DEFAULT)
    assert load_model(tmp_path / "throws.npz")[0][0].skill == "throw"
