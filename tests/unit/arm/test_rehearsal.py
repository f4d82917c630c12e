"""A motion on an arm that is not there."""

import pytest

from dart_skill.arm import (
    Commander,
    CommanderSettings,
    Mode,
    Speed,
    rehearse,
    still_plan,
    wam_description,
)


@pytest.mark.parametrize("speed", Speed)
@pytest.mark.parametrize("tracking", ["joints", "hand", "none"])
def test_a_rehearsal_goes_through_a_whole_motion(speed, tracking):
    commander = Commander(CommanderSettings.configured(tracking=tracking))
    plan = still_plan(wam_description(), speed)
    assert plan.speed == speed
    assert rehearse(commander, plan) == [
        Mode.APPROACHING, Mode.SETTLING, Mode.EXECUTING, Mode.HOLDING
    ]  # fmt: skip
    assert not commander.message and commander.reference is not None
