"""A motion on an arm that is not there."""

from dataclasses import replace

import pytest

from dart_skill.arm import (
    Commander,
    CommanderSettings,
    Mode,
    Speed,
    rehearse,
    still_plan,
    the_arm,
)


@pytest.mark.parametrize("speed", Speed)
@pytest.mark.parametrize("tracking", ["joints", "hand", "none"])
def test_a_rehearsal_goes_through_a_whole_motion(speed, tracking):
    commander = Commander(CommanderSettings.configured(tracking=tracking))
    plan = still_plan(the_arm(), speed)
    assert plan.speed == speed
    assert rehearse(commander, plan) == [
        Mode.APPROACHING, Mode.SETTLING, Mode.EXECUTING, Mode.HOLDING
    ]  # fmt: skip
    assert not commander.message and commander.reference is not None


def test_a_limit_that_forbids_the_rehearsal_ends_it():
    settings = CommanderSettings.configured()
    low = replace(settings.limits, workspace_high=(1.2, 1.2, 0.5))
    commander = Commander(replace(settings, limits=low))
    rehearse(commander, still_plan(the_arm()))
    assert "stopped" in commander.stopped_by and commander.reference is None
