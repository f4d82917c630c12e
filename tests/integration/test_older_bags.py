"""Bags of before commands said their level of speed and who sends them are played all the same."""

import pytest
from builtin_interfaces.msg import Time
from dart_skill_msgs.msg import WamCommand
from geometry_msgs.msg import Vector3, Wrench
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header

from dart_skill.recording import BagReader, completed_command, type_hash, types_for
from tests.paths import BAGS

ADDED = 7
"""Bytes of speed and sender, with the padding between them."""


@pytest.mark.parametrize("frame", ["", "w", "world", "a frame of more letters"])
def test_an_older_command_is_completed(frame):
    header = Header(stamp=Time(sec=5, nanosec=7), frame_id=frame)
    wrench = Wrench(force=Vector3(x=1.0, y=2.0, z=3.0), torque=Vector3(z=4.0))
    message = WamCommand(header=header, wrench=wrench, joint_torque=[0.5] * 7, grip=WamCommand.GRIP_OPEN)
    older = bytes(serialize_message(message))[:-ADDED]
    assert deserialize_message(completed_command(older), WamCommand) == message


@pytest.mark.parametrize("name", ["demonstrations", "throws"])
def test_bags_that_are_shipped_are_of_today(name):
    with BagReader(BAGS / name) as bag:
        ours = {topic: info for topic, info in bag.topics.items() if info.type_name.startswith("dart_skill_msgs/")}
        assert {"/demonstrations", "/wam/command"} <= set(ours)
        for topic, info in ours.items():
            assert info.type_hash == type_hash(types_for(info.type_name), info.type_name), f"{topic}: make the bags again (bags/README.md)"
