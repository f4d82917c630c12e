"""Commands of the arm as bytes: at every state one is written, and one is read."""

import numpy as np
from dart_skill_msgs.msg import WamCommand

from dart_skill.arm import Command
from dart_skill_nodes.comms.fixed_layout import FixedLayout, LayoutReader


class CommandWriter:
    """Serialised commands of one publisher.

    * sender: number by which its commands are known, see `new_sender`.
    * frame_id: axes of the wrenches.
    """

    def __init__(self, sender: int, frame_id: str):
        self._sender, self._frame_id = sender, frame_id
        self._layouts: dict[tuple[int, int], FixedLayout] = {}

    def write(self, command: Command) -> bytes:
        """The bytes of a command."""
        kind = int(command.grip), int(command.speed)
        if kind not in self._layouts:
            self._layouts[kind] = FixedLayout(self._example(*kind))
        return self._layouts[kind].pack(
            command.stamp_ns, np.concatenate([command.wrench, command.joint_torque])
        )

    def _example(self, grip: int, speed: int) -> WamCommand:
        message = WamCommand(sender=self._sender, grip=grip, speed=speed)
        message.header.frame_id = self._frame_id
        return message


def command_reader() -> LayoutReader:
    """Reads serialised commands; `conversions.command_of_numbers` makes the command of what it
    gives.
    """
    return LayoutReader(WamCommand)
