"""The commands that a world holds which does not wait for them, and when it is held back."""

import time
from types import SimpleNamespace

import pytest

from dart_skill.arm import Command
from dart_skill_nodes.arm.world_pace import HeldAnswers, WorldPace

MS = 1_000_000


@pytest.fixture
def plant():
    """One whose time the test makes up."""
    settings = SimpleNamespace(step=0.002)
    return SimpleNamespace(state_stamp_ns=0, settings=settings, braking=lambda: "brakes")


def test_a_command_holds_until_it_is_too_old_and_then_the_arm_is_braked(plant):
    complaints = []
    held = HeldAnswers(plant, ("commander", "teacher"), 0.010, complaints.append)
    assert held.now(("commander",)) == ("brakes", None, False) and not complaints
    held.take("commander", Command(0))
    plant.state_stamp_ns = 10 * MS
    command, push, are_fresh = held.now(("commander",))
    assert command.stamp_ns == 10 * MS and push is None and are_fresh
    plant.state_stamp_ns = 12 * MS
    assert held.now(("commander",)) == ("brakes", None, False)
    assert complaints == ["no command of the commander for more than 0.01 s: the arm is braked"]


def test_a_teacher_who_is_late_brakes_the_arm_and_one_who_has_pushed_is_awaited(plant):
    held = HeldAnswers(plant, ("commander", "teacher"), 0.010, lambda text: None)
    assert not held.awaits("teacher"), "who has not pushed yet"
    held.take("teacher", Command(0))
    assert not held.awaits("teacher"), "the push for this state is there"
    plant.state_stamp_ns = 12 * MS
    assert held.awaits("teacher")
    held.take("commander", Command(12 * MS))
    assert held.now(("commander", "teacher"))[0] == "brakes"
    assert held.now(("commander",))[2], "nobody guides the arm any more"


@pytest.mark.parametrize(
    ("factor", "watched", "least"), [(0.0, False, 0.0), (0.1, False, 0.035), (0.0, True, 0.003)]
)
def test_steps_are_held_back_to_the_factor_and_to_real_time_for_who_watches(
    plant, factor, watched, least
):
    pace = WorldPace(plant)
    pace.speed_factor, pace.watched = factor, watched
    begun = time.monotonic()
    for _ in range(2):
        pace.hold_back()
    assert time.monotonic() - begun >= least
