"""Poses of bodies for who reacts to them at every state of the arm, in step with the states.

Real cameras deliver when they do, and a node that reacts takes what has come. A simulated world may
wait for the answer to every state: there it is said of every state what the cameras had delivered
by then (/simulation/delivered), and a state is answered when that has come. So the answer is the
same on every machine. In a world that goes on all the same, a state is answered when the next one
comes at the latest.
"""

import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from dart_skill_msgs.msg import FramesDelivered
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.names import pose_topic
from dart_skill_nodes.comms.qos import FRAMES, WALL, MatchingSubscriptions
from dart_skill_nodes.comms.this_machine import LOOK

DELIVERED = "simulation/delivered"
PATIENCE = 3.0
"""For poses that were said to be published [s, wall clock]; what is lost on the way is repeated
within.
"""
KEPT = 500
"""Poses of a body that are kept until they are taken: 5 s of 100 Hz."""


class Sighting(NamedTuple):
    """A pose of a body by its role: stamp [ns], position (3,) [m], quaternion (4,)."""

    body: str
    stamp_ns: int
    position: np.ndarray
    quaternion: np.ndarray


class SeenInStep:
    """Hears poses, and hands over each state of the arm with the poses that were delivered since
    the last one.

    * name_of: names of the tracked bodies by role. frame_id: poses in another frame are left out,
      and the log says so.
    * answer: called with a state and its sightings, in order of their stamps.
    """

    def __init__(
        self,
        node: Node,
        name_of: dict[str, str],
        frame_id: str,
        answer: Callable[[object, list[Sighting]], None],
    ):
        self._node, self._frame_id, self._answer = node, frame_id, answer
        self._seen: dict[str, deque[Sighting]] = {role: deque(maxlen=KEPT) for role in name_of}
        self._newest = dict.fromkeys(name_of, 0)  # stamps of what has come [ns]
        self._told: deque[tuple[int, dict[str, int]]] = deque(maxlen=KEPT)
        self._waiting: tuple[int, object, float] | None = (
            None  # a state with its stamp [ns], and since when [s, wall clock]
        )
        self._since_ns: int | None = None
        self._silent = False  # who tells what was delivered told nothing for PATIENCE
        self._subscriptions = MatchingSubscriptions(node)
        for role, name in name_of.items():
            self._subscriptions.subscribe(
                pose_topic(name), partial(self._on_pose, role), PoseStamped
            )
        node.create_subscription(FramesDelivered, DELIVERED, self._on_delivered, FRAMES)
        node.create_timer(LOOK, self._look, clock=WALL)

    def begin(self, since_ns: int) -> None:
        """From now on every state is offered; what was seen before a stamp [ns] does not count."""
        self._since_ns = since_ns

    def end(self) -> None:
        """States are not offered any more; one that waits is answered."""
        self._since_ns = None
        self._release()

    @property
    def goes_on(self) -> bool:
        """Whether states shall be offered."""
        return self._since_ns is not None

    def offer(self, stamp_ns: int, state: object) -> None:
        """Answer a state, once everything has come that was delivered by its stamp [ns]. The one
        before it waits no longer.
        """
        if self._waiting is not None and self._waiting[0] != stamp_ns:
            self._release()
        if self._waiting is None:
            self._waiting = stamp_ns, state, time.monotonic()
        if self._is_complete(stamp_ns):
            self._release()

    def _is_complete(self, stamp_ns: int) -> bool:
        """Whether nothing is on its way that was delivered by a stamp; so it is, for all that
        anybody knows, where nobody tells.
        """
        if self._silent or not self._node.count_publishers(DELIVERED):
            return True
        while self._told and self._told[0][0] < stamp_ns:
            self._told.popleft()
        return bool(self._told) and all(
            self._newest[role] >= newest for role, newest in self._told[0][1].items()
        )

    def _release(self) -> None:
        if self._waiting is None:
            return
        stamp_ns, state, _ = self._waiting
        self._waiting = None
        self._answer(state, self._take(stamp_ns))

    def _take(self, stamp_ns: int) -> list[Sighting]:
        newest = next((said for told, said in self._told if told >= stamp_ns), None)
        taken = []
        for role, seen in self._seen.items():
            until = stamp_ns if newest is None else newest.get(role, 0)
            while seen and seen[0].stamp_ns <= until:
                taken.append(seen.popleft())
        return sorted(
            (one for one in taken if one.stamp_ns >= (self._since_ns or 0)),
            key=lambda one: one.stamp_ns,
        )

    def _on_pose(self, role: str, message: PoseStamped) -> None:
        if message.header.frame_id != self._frame_id:
            raise ValueError(
                f"a pose of the {role} is in frame '{message.header.frame_id}', not"
                f" '{self._frame_id}'"
            )
        stamp_ns, pose = (
            conversions.checked_stamp_ns(message.header.stamp),
            conversions.body_pose(message.pose, f"the {role}"),
        )
        self._newest[role] = stamp_ns
        self._seen[role].append(Sighting(role, stamp_ns, pose.position, pose.quaternion))
        self._try_again()

    def _on_delivered(self, message: FramesDelivered) -> None:
        newest = dict(zip(message.bodies, map(conversions.stamp_ns, message.newest), strict=True))
        self._silent = False
        self._told.append((conversions.stamp_ns(message.stamp), newest))
        self._try_again()

    def _try_again(self) -> None:
        if self._waiting is not None and self._is_complete(self._waiting[0]):
            self._release()

    def _look(self) -> None:
        """Cameras that died, or whose poses got lost for good, do not hold up the arm."""
        if self._waiting is not None and time.monotonic() - self._waiting[2] > PATIENCE:
            self._silent = True
            self._release()
