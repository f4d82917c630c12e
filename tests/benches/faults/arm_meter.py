"""How fast and how strong the joints of the simulated arm were, and who pushed: the ground truth,
whatever is done to the topics.
"""

import time

import numpy as np
from dart_skill_msgs.msg import SimulationState, WamCommand
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from dart_skill_nodes.comms.conversions import leading_stamp_ns
from dart_skill_nodes.comms.names import COMMANDS, GUIDING
from dart_skill_nodes.comms.raw_batches import RawBatches, RawMessage

TRUTH, REPLAYED = "simulation/state", "joint_states"
STANDS_NS = 700_000_000
"""Without a new state for so long the time of the arm stands still [ns, wall clock]."""
PUSHERS = {COMMANDS: "commander", GUIDING: "teacher"}
LOOKED_AT_NS = 40_000_000
"""Commands are looked at whose stamps are whole multiples of this, so that those of commander and
teacher can be compared [ns].
"""
CARRYING = 4
"""The joints before the wrist: those of the wrist may turn at 13 rad/s when a person lets go of
the hand.
"""
STRANGER = "stranger"


class ArmMeter:
    """What was since `clear`.

    fastest: of the joints that carry the arm [rad/s]; strongest: of all that are driven, not
    braked [N m]; last: of the fastest of all at the newest state [rad/s].
    """

    def __init__(self, node: Node):
        self._batches = RawBatches(node)
        for topic in (TRUTH, REPLAYED, *PUSHERS):
            self._batches.listen(topic)
        self._stamp, self.newest_ns, self._true = (0, 0), 0, False
        self._senders: dict[str, int] = {}
        self.begin()

    def begin(self) -> None:
        """Begin a new case: the node that pushes before the fault is the one that is allowed to."""
        self._hurt = False
        self.clear()

    def begin_anew(self) -> None:
        """The fault has come: forget what was before it."""
        self._hurt = True
        self.clear()

    def clear(self) -> None:
        """Forget what was."""
        self.fastest = self.strongest = self.last = 0.0
        self._pushed: dict[str, set[int]] = {}

    @property
    def speed(self) -> float:
        """Speed of the fastest joint now [rad/s]; 0 where the arm's time stands still."""
        return self.last if time.time_ns() - self.newest_ns < STANDS_NS else 0.0

    @property
    def pushed(self) -> tuple[str, ...]:
        """Who sent commands that push; a stranger's are not obeyed."""
        return tuple(sorted(self._pushed))

    @property
    def at_once(self) -> bool:
        """Whether commander and teacher pushed in one step of the arm."""
        return bool(self._pushed.get("commander", set()) & self._pushed.get("teacher", set()))

    def take(self) -> None:
        """Look at what has come."""
        for message in self._batches.take():
            if message.topic == TRUTH:
                self._true = True
                state = deserialize_message(message.data, SimulationState)
                self._take_state(
                    message, state, np.array(state.joint_velocity), np.array(state.joint_effort)
                )
            elif message.topic == REPLAYED and not self._true:
                state = deserialize_message(message.data, JointState)
                self._take_state(message, state, np.array(state.velocity), np.array(state.effort))
            elif message.topic in PUSHERS:
                self._take_push(message)

    def _take_state(
        self,
        message: RawMessage,
        state: SimulationState | JointState,
        velocity: np.ndarray,
        effort: np.ndarray,
    ) -> None:
        self.last = float(np.abs(velocity).max())
        self.fastest = max(self.fastest, float(np.abs(velocity[:CARRYING]).max()))
        self.strongest = max(
            self.strongest,
            float(np.abs(effort[effort * velocity[: effort.size] >= 0.0]).max(initial=0.0)),
        )
        stamp = (state.header.stamp.sec, state.header.stamp.nanosec)
        if stamp != self._stamp:  # the simulator repeats a state that nobody answers
            self._stamp, self.newest_ns = stamp, message.received_ns

    def _take_push(self, message: RawMessage) -> None:
        try:
            if (ns := leading_stamp_ns(message.data)) % LOOKED_AT_NS:
                return
            command = deserialize_message(message.data, WamCommand)
        except Exception:  # noqa: BLE001 - damaged on purpose, and refused by the arm
            return
        if np.abs(command.joint_torque).max() > 0.0 or _force(command) > 0.0:
            if not self._hurt:
                self._senders[message.topic] = command.sender
            who = (
                PUSHERS[message.topic]
                if command.sender == self._senders.get(message.topic)
                else STRANGER
            )
            self._pushed.setdefault(who, set()).add(ns)

    def close(self) -> None:
        """Hear nothing any more."""
        self._batches.close()


def _force(command: WamCommand) -> float:
    force = command.wrench.force
    return abs(force.x) + abs(force.y) + abs(force.z)
