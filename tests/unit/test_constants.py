"""Numbers that stand in other files, too, are the same there."""

import re

from dart_skill.constants import Grip
from tests.paths import ROOT


def test_the_values_of_a_grip_are_those_of_the_message():
    text = (ROOT / "msg_schemas" / "msg" / "WamCommand.msg").read_text(encoding="utf-8")
    assert {grip.name: grip.value for grip in Grip} == {name: int(value) for name, value in re.findall(r"GRIP_(\w+)=(\d+)", text)}
