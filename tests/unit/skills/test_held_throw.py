"""Somebody holds the arm in the middle of a throw (thesis chapter 9): what the state drives waits,
what a clock drives does not.
"""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.arm import Commander, CommanderSettings, Grip, Mode
from dart_skill.session import Session
from dart_skill.skills.learning import configuration, learn_throwing
from tests.unit.held_arm import Holder

BASKET = np.array([2.0, 0.2, 0.4])
BEFORE_RELEASE, HELD = 0.3, 1.0


@pytest.fixture(scope="module")
def driven_by_state(demonstrations):
    return learn_throwing(demonstrations, configuration("autonomous")).plan(BASKET)


class Throw:
    """A throw in which the arm is held from an instant on for some time [s]; what the commander
    said at each time since the throw began.
    """

    def __init__(self, plant, plan, hold_from, hold_for, tracking="hand"):
        plant.reset(BASKET)
        self.commander = Commander(
            CommanderSettings.configured(tracking=tracking), plant.description_of_load
        )
        plant.step(self.commander.step(plant.arm_state))
        self.commander.execute(plan)
        holder, self.time, self.grips, self.attractors, begun = Holder(), [], [], [], None
        while begun is None or self.commander.mode not in (Mode.HOLDING,):
            arm = plant.arm_state
            command = self.commander.step(arm)
            begun = (
                arm.stamp_ns if begun is None and self.commander.mode == Mode.EXECUTING else begun
            )
            time = -1.0 if begun is None else (arm.stamp_ns - begun) * 1e-9
            plant.step(command, holder.push(arm, hold_from <= time < hold_from + hold_for))
            if begun is not None:
                self.time.append(time)
                self.grips.append(command.grip)
                self.attractors.append(self.commander.reference.attractor_position)
            assert time < 20.0
        self.time, self.attractors = np.array(self.time), np.array(self.attractors)

    @property
    def opened(self):
        """When the hand was told to open [s]; None if it never was."""
        return next(
            (time for time, grip in zip(self.time, self.grips, strict=True) if grip == Grip.OPEN),
            None,
        )


@pytest.mark.parametrize("tracking", ["hand", "joints"])
def test_what_the_state_drives_waits_and_goes_on_when_the_arm_is_let_go(
    make_plant, driven_by_state, tracking
):
    begin = driven_by_state.release - BEFORE_RELEASE
    throw = Throw(make_plant(), driven_by_state, begin, HELD, tracking)
    waiting = throw.attractors[(throw.time > begin + 0.25) & (throw.time < begin + HELD)]
    assert np.linalg.norm(waiting - waiting[0], axis=1).max() < 0.05, "the attractor waits"
    assert throw.opened > begin + HELD and not throw.commander.message, (
        "the motion goes on, to its end"
    )


def test_what_a_clock_drives_does_not_wait(make_plant, driven_by_state):
    """The attractor goes on without the hand, until the commander stops the throw: the hand is too
    far from the plan.
    """
    begin = driven_by_state.release - BEFORE_RELEASE
    throw = Throw(make_plant(), replace(driven_by_state, pace=None), begin, HELD)
    assert (
        "from the plan, farther than the limit" in throw.commander.message and throw.opened is None
    )


def test_an_arm_that_is_never_let_go_is_given_up_without_opening_the_hand(
    make_plant, driven_by_state
):
    throw = Throw(make_plant(), driven_by_state, driven_by_state.release - BEFORE_RELEASE, 30.0)
    assert throw.commander.message == "the hand was held back for 5 s" and throw.opened is None


def test_undisturbed_the_ball_goes_where_it_goes_by_the_clock(driven_by_state):
    """What the arm lags by is no disturbance; the throw may begin a little faster or slower."""
    session = Session(seed=8)
    landings = [
        session.throw(plan).outcome.landing
        for plan in (driven_by_state, replace(driven_by_state, pace=None))
    ]
    session.close()
    assert np.linalg.norm(landings[0] - landings[1]) < 0.01
