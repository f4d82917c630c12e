"""What became of a spoon in a pot, by its track; where pots are drawn; what is refused."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import HAND, Demonstration, Track
from dart_skill.simulation import PlantSettings, Stirrer, Stove, make_world
from dart_skill.skills.protocol import load_skill

POT = Pose(np.array([0.55, -0.1, 1.14]), Rotation.from_rotvec([0.0, 0.0, 0.4]).as_quat())


@pytest.fixture(scope="module")
def skill():
    return load_skill("stir")


def stirred(skill, frequency=0.8, turns=5, radius=0.04, height=0.03, aside=(0.0, 0.0), sense=1.0):
    """A spoon that comes from above, goes round, and rises again: what the cameras see."""
    time = np.arange(0.0, 4.0 + turns / frequency, 0.01)
    phase = sense * np.clip((time - 2.0) * frequency, 0.0, turns)
    angle = 2.0 * np.pi * phase
    above = 0.25 * np.clip(np.abs(time - time[-1] / 2.0) - 0.5 * turns / frequency, 0.0, None)
    local = np.column_stack(
        [radius * np.cos(angle) + aside[0], radius * np.sin(angle) + aside[1], height + above]
    )
    local[:, 2] += 0.5 * skill.settings.size[2]
    spoon = Track(
        time, POT.position + local @ POT.rotation.T, np.tile(POT.quaternion, (len(time), 1))
    )
    pot = Track(
        time, np.tile(POT.position, (len(time), 1)), np.tile(POT.quaternion, (len(time), 1))
    )
    return Demonstration("seen", {HAND: spoon, "spoon": spoon, "pot": pot}, skill="stir")


def asked(**numbers):
    return Situation({"pot": POT}, numbers)


def test_a_circle_as_it_was_asked_for_is_a_success(skill):
    seen = stirred(skill, turns=5)
    made = skill.stirred(seen, asked())
    assert made.turns == pytest.approx(5.0, abs=0.01)
    assert made.frequency == pytest.approx(0.8, rel=1e-3)
    assert made.error < 1e-4 and np.abs(made.middle).max() < 1e-4
    assert skill.judge(seen, asked(frequency=0.8, turns=5.0)).success
    assert skill.judge(stirred(skill, sense=-1.0), asked(frequency=0.8)).success


@pytest.mark.parametrize(
    ("how", "numbers", "said"),
    [
        ({"radius": 0.05}, {}, r"10\.0 mm from its circle"),
        ({"height": 0.045}, {}, r"15\.0 mm from its circle"),
        ({"frequency": 0.8}, {"frequency": 0.9}, r"0\.80 times in a second, not 0\.90"),
        ({"turns": 3}, {"turns": 5.0}, r"3\.0 times, not 5 times"),
        ({"radius": 0.06}, {"amplitude": 1.5}, ""),
    ],
)
def test_what_is_not_as_it_was_asked_for_is_said(skill, how, numbers, said):
    outcome = skill.judge(stirred(skill, **how), asked(**numbers))
    assert outcome.success == (not said)
    assert re.search(said, outcome.reason)


def test_what_practice_corrects_is_where_the_middle_of_the_circle_is(skill):
    outcome = skill.judge(stirred(skill, aside=(0.004, -0.003)), asked())
    assert outcome.miss == pytest.approx([0.004, -0.003, 0.0], abs=2e-4)


def test_a_spoon_that_does_not_go_round_is_no_success(skill):
    for seen, said in (
        (stirred(skill, height=0.3), "not seen in the pot"),
        (stirred(skill, turns=1), "went round 1.0 times"),
    ):
        outcome = skill.judge(seen, asked())
        assert not outcome.success and said in outcome.reason


def test_a_recording_is_cut_from_the_first_to_the_last_rest(skill):
    """The hand rests between the way to the pot and the turns, and is not cut there."""
    seen = stirred(skill)
    start, stop = skill.cut(seen)
    assert start < 2.0 and stop > 2.0 + 5 / 0.8
    still = replace(seen, tracks={**seen.tracks, HAND: seen.tracks["pot"]})
    with pytest.raises(ValueError, match="never faster than 0.05 m/s"):
        skill.cut(still)


def test_pots_are_drawn_where_the_arm_can_stir(skill):
    rng = np.random.default_rng(0)
    for wide in (False, True):
        for _ in range(30):
            drawn = skill.draw(rng, wide)
            skill.check_seen("pot", drawn.pose("pot"))
            assert set(drawn.numbers) == ({"frequency", "turns"} if wide else set())
            assert np.hypot(*(drawn.pose("pot").position[:2] - [0.6, 0.1])) < 0.2
    with pytest.raises(ValueError, match="the pot is 0.90 m from the axis of the base"):
        skill.check_seen("pot", Pose(np.array([0.9, 0.0, 1.1])))


def test_a_circle_that_meets_the_wall_is_refused_with_what_to_ask_for(skill):
    assert skill.refine("plan", asked(amplitude=1.7), None) == "plan"
    with pytest.raises(ValueError, match=r"amplitude 1\.9 brings .* ask for at most 1\.73"):
        skill.refine("plan", asked(amplitude=1.9), None)


def test_the_hand_holds_the_spoon_from_the_beginning_and_the_wall_has_no_gap(skill):
    plant = make_world("stove", PlantSettings(), seed=3, own=skill.world_settings)
    assert isinstance(plant, Stove) and plant.holds and set(plant.bodies) == {HAND, "spoon", "pot"}
    assert plant.inner == pytest.approx(skill.settings.inner)
    sizes, centres, turns = plant._walls()
    corner = Rotation.from_quat(turns[1]).apply([-sizes[1][0], sizes[1][1], 0.0]) + centres[1]
    other = Rotation.from_quat(turns[2]).apply([-sizes[2][0], -sizes[2][1], 0.0]) + centres[2]
    assert np.dot(np.subtract(corner, other), np.cross([0, 0, 1], corner)) >= -1e-9, "they overlap"
    with pytest.raises(ValueError, match="can put the pot somewhere, not 'holder'"):
        plant.put("holder", POT.position, POT.quaternion)
    plant.close()


def test_a_simulated_person_goes_round_as_often_and_as_wide_as_told(skill):
    person = Stirrer(0, radius=0.03, turns=2)
    assert (person.stirring.radius, person.stirring.turns) == (0.03, 2)
    with pytest.raises(TypeError, match="rounds"):
        Stirrer(0, rounds=2)
