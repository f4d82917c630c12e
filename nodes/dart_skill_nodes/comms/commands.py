"""Commands of the arm: written as bytes at every state, and obeyed if they come from the publisher
that is obeyed.

One of several publishers of commands is obeyed: the first, and when that has gone, one of the same
name, as after a restart. Each publisher puts a number of its own into its commands
(WamCommand.sender), by which they are told apart. One that was silent and comes back, as after it
was frozen, is obeyed again unless another one has taken its place.
"""

import secrets

import numpy as np
from dart_skill_msgs.msg import WamCommand
from rclpy.node import Node

from dart_skill.arm import Command
from dart_skill.common.arm_choice import joint_count
from dart_skill_nodes.comms.fixed_layout import FixedLayout
from dart_skill_nodes.comms.presence import UNKNOWN, Presence, publishers


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
        nothing = [0.0] * joint_count()
        message = WamCommand(joint_torque=nothing, sender=self._sender, grip=grip, speed=speed)
        message.header.frame_id = self._frame_id
        return message


def new_sender() -> int:
    """A number by which commands of one publisher are known; 0 is that of those who do not say."""
    return secrets.randbelow(2**32 - 1) + 1


class ObeyedPublisher:
    """Whether a command comes from the publisher that is obeyed.

    others: names of the nodes that publish the topic, too, and are not obeyed.
    """

    def __init__(self, node: Node, topic: str):
        self.others: list[str] = []
        self._node, self._topic = node, topic
        self._presence: Presence | None = None
        self._gid, self._name, self._sender, self._gone = b"", "", None, False
        self._replaced: set[bytes] = set()

    def forget(self) -> None:
        """Obey the next publisher, if the last one has gone: a client decided to go on with
        another one.
        """
        self.look()  # it may have gone since the last look
        if not self._gid or self._gone:
            self._name = ""

    def accepts(self, sender: int) -> bool:
        """Whether a command with this number is obeyed."""
        if self._sender is None or sender != self._sender or self._gone:
            self.look()
            if self._gid and self._sender is None and not self.others:
                self._sender = sender
            if self._gone and sender == self._sender:
                self._meet()  # it speaks, so it lives, whatever was heard of it
        return bool(self._gid) and sender == self._sender and (sender != 0 or not self.others)

    def look(self) -> None:
        """See who is there. To be called now and then, too: one that was killed leaves the graph
        long after its end.
        """
        there = {
            bytes(one.endpoint_gid): one.node_name
            for one in self._node.get_publishers_info_by_topic(self._topic)
        }
        self._replaced &= set(there)
        self._gone = bool(self._gid) and (self._gid not in there or self._presence.gone)
        rivals = {
            gid: name
            for gid, name in there.items()
            if gid != self._gid and gid not in self._replaced
        }
        if len(rivals) == 1 and (self._gone or not self._gid):
            self._obey(*next(iter(rivals.items())))
        if self._gid in there and self._name in ("", UNKNOWN):
            self._name = there[self._gid]
        self.others = sorted(name for gid, name in rivals.items() if gid != self._gid)

    def _obey(self, gid: bytes, name: str) -> None:
        if self._name in ("", UNKNOWN, name):
            self._replaced.add(self._gid)
            self._gid, self._name, self._sender = gid, name, None
            self._meet()

    def _meet(self) -> None:
        self._presence, self._gone = publishers(self._node, self._topic), False
