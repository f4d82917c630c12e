"""Throws in process by an arm whose controller takes trajectories."""

import numpy as np
import pytest

from dart_skill.arm import CommanderSettings
from dart_skill.session import Session
from dart_skill.simulation import ControllerSettings


@pytest.mark.parametrize("rate", [500.0, 125.0])
def test_a_throw_lands_where_it_is_planned_at_either_rate(plan, rate):
    """The arm is late by 30 ms, which the commander is told by nobody."""
    session = Session(controller=ControllerSettings(rate, lag=0.03))
    trial = session.throw(plan)
    session.close()
    miss = trial.outcome.landing[:2] - plan.thrown.landing[:2]
    assert np.linalg.norm(miss) < 0.06 and not trial.message, (miss, trial.message)
    assert session.commander.lag == pytest.approx(0.03, abs=0.015)


def test_an_arm_that_takes_torques_gets_no_trajectories():
    with pytest.raises(ValueError, match="--trajectory RATE"):
        Session(commander=CommanderSettings.configured(output="trajectory"))
