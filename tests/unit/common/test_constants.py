"""Numbers that stand in other files, too, are the same there."""

import re

from dart_skill.common.constants import BULL_DISTANCE, BULL_HEIGHT, Grip
from dart_skill.common.world import the_world
from tests.paths import ROOT


def test_the_values_of_a_grip_are_those_of_the_message():
    text = (ROOT / "msg_schemas" / "msg" / "WamCommand.msg").read_text(encoding="utf-8")
    assert {grip.name: grip.value for grip in Grip} == {
        name: int(value) for name, value in re.findall(r"GRIP_(\w+)=(\d+)", text)
    }


def test_the_board_of_the_world_hangs_as_the_game_has_it():
    assert the_world().board_position == (BULL_DISTANCE, 0.0, BULL_HEIGHT)
