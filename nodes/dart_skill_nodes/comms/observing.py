"""What the demonstration recorder makes of what it sees: demonstrations that are cut out of it, what
became of a movement, and where bodies are; a skill's own words, between messages.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from dart_skill_msgs.srv import Judge
from rclpy.node import Node

from dart_skill.arm import ArmState, Grip
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import HAND, Demonstration, read_command
from dart_skill.skills.observation import RESET_NS, FoundThrow, ThrowFinder
from dart_skill.skills.protocol import Skill
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.joint_states import StateReader
from dart_skill_nodes.comms.names import COMMANDS, GUIDING, JOINT_STATES, pose_topic
from dart_skill_nodes.comms.presence import NO_CAMERAS, Cameras
from dart_skill_nodes.comms.tracked_bodies import FRAME_NS, REPAIRED, Arrivals, TrackedBodies

STREAM = 25
"""Messages since the beginning that make a topic a stream, which is waited for."""
BLIND_NS = 1_000_000_000
"""Time of the arm without a pose after which cameras see nothing, if none was late [ns]."""


class Observer:
    """What is seen of the arm and of the bodies of a skill, for a node.

    * name_of: names of the tracked bodies by role.
    * parameters: of the node, in force: frame_id, automatic, and the thresholds of the speed of the
      hand.
    * take_all: takes all that has come.

    Attributes: needed, topics that it must be told of; silent, those without which nothing is
    recorded, and that have said nothing yet; recording, whether a demonstration is; up_to_ns, where
    it ends; fault, what is wrong with the arm's states.
    """

    def __init__(
        self,
        node: Node,
        skill: Skill,
        name_of: dict[str, str],
        parameters: dict,
        take_all: Callable[[], None],
    ):
        self._node, self._skill = node, skill
        p = parameters
        self._thresholds = thresholds = VelocityThreshold(
            start=p["start_threshold"],
            stop=p["stop_threshold"],
            window=p["speed_window"],
            **{name: p[name] for name in ("min_duration", "max_pause", "run_up", "settle")},
        )
        self._frame_id = frame_id = p["frame_id"]
        self._take_all, self.log = take_all, skill.sensor_log()
        self.tracked = TrackedBodies(frame_id, node.get_logger().error, log=self.log)
        self.role_of = {pose_topic(name_of[role]): role for role in (HAND, *skill.bodies)}
        self._cameras = [Cameras(node, topic) for topic in sorted(self.role_of)]
        self._finder = ThrowFinder(self.log, thresholds) if p["automatic"] else None
        self._arrivals = Arrivals()
        self.needed = {JOINT_STATES, COMMANDS, GUIDING, *self.role_of}
        self.silent = {JOINT_STATES, COMMANDS, pose_topic(name_of[HAND])}
        self.recording, self.up_to_ns, self.fault = False, 0, ""
        self._reader, self._joints = StateReader(), b""  # the newest state, serialised
        # since the newest pose: on the wall clock [s], and by the arm's states, which may be held
        self._seen_at, self._blind_ns, self._arm_ns = 0.0, 0, 0
        self._newest: dict[str, int] = {}
        self._heard: Counter[str] = Counter()

    # what comes

    def take(self, topic: str, ns: int, data: bytes) -> None:
        """A serialised message, with its stamp; ValueError for one that cannot be used."""
        if role := self.role_of.get(topic):
            self.tracked.take(role, data)
            self._seen_at, self._blind_ns = time.monotonic(), 0
        elif topic == JOINT_STATES:
            self._joints = data
            passed_ns = ns - self._arm_ns
            self._blind_ns += passed_ns if 0 < passed_ns < RESET_NS else 0  # no reset
            self._arm_ns = ns
            if (self.recording or self._finder) and self.log.wants_joints(ns):
                if (state := self.arm_state()) is not None:
                    self.log.add_joints(ns, state.position, state.velocity)
        elif topic in (COMMANDS, GUIDING) and self._finder:
            self._finder.add_command(data, guiding=topic == GUIDING)
        elif topic in (COMMANDS, GUIDING):
            self.log.add_told(ns, Grip(read_command(data)[2]))  # what the fingers are told
        self._newest[topic] = ns
        self._heard[topic] += 1
        self.silent.discard(topic)

    def heard(self, topic: str) -> int:
        """How many messages have come on a topic since the last beginning."""
        return self._heard[topic]

    def arm_state(self) -> ArmState | None:
        """The newest state of the arm; None if it is not one, and what is wrong with it is kept."""
        try:
            state = self._reader.read(self._joints)
            self.fault = ""
            return state
        except ValueError as error:
            if str(error) != self.fault:
                self._node.get_logger().error(str(error))
            self.fault = str(error)
            return None

    def found(self) -> list[FoundThrow]:
        """Throws that are over, where they are found; else what is old is forgotten."""
        if self._finder is None:
            if not self.recording:
                self.tracked.forget_old()
            return []
        sensors = [self._newest.get(topic, 0) for topic in (JOINT_STATES, *self.role_of)]
        return list(self._finder.until(self._arrivals.until(sensors, time.monotonic())))

    # a demonstration

    def check_heard(self, missing: list[str], others: str) -> None:
        """ValueError says what has not been heard of, without which nothing can be recorded.

        * missing: topics without a publisher. others: what those of others than the arm name on its
          topic, if they do.
        """
        if self._finder:
            raise ValueError(
                "throws are cut automatically here: ~/start needs 'automatic' to be false"
            )
        if self.cameras_gone:
            raise ValueError(self.cameras_gone)
        if silent := self.silent | (set(self.role_of) & set(missing)):
            full = self._node.resolve_topic_name
            strange = (
                f" {full(JOINT_STATES)} {others}" if others and JOINT_STATES in silent else ""
            )
            raise ValueError(
                f"nothing has come on {', '.join(sorted(map(full, silent)))} yet: is the node"
                f" running that publishes it?{strange}"
            )

    def begin(self) -> None:
        """From now on what is seen may become a demonstration; ValueError says what is missing."""
        state = self.arm_state()
        if fault := self.tracked.hidden(HAND) or ("" if state is not None else self.fault):
            raise ValueError(fault)
        self.tracked.clear()
        # of this world, in case it is set anew at once
        self.log.add_joints(state.stamp_ns, state.position, state.velocity)
        self._newest.clear()
        self._heard.clear()
        self.recording, self.up_to_ns = True, 0

    def cut(self, until_ns: int, now_ns: int) -> Demonstration | None:
        """What was recorded up to a stamp, or for 0 up to now; None while messages are on their
        way that decide it. ValueError says what is missing.
        """
        # who gives no stamp asks for what there is, and again for the same
        self.up_to_ns = until_ns or self.up_to_ns or now_ns
        is_late = partial(self.tracked.is_late, ns=self.up_to_ns)
        waits, skill = not self.cameras_gone, self._skill
        if waits and (
            (until_ns and self._streams_lag(until_ns)) or any(map(is_late, skill.awaited))
        ):
            return None
        try:
            one = skill.record(self.log, self.up_to_ns, self._thresholds)
            opened_ns = one.stamp_ns + round(1e9 * one.opened) if one.opened == one.opened else 0
            late = any(is_late(role) for role in skill.decisive if role not in skill.awaited)
            if (
                waits
                and late
                and not skill.is_decided(self.log, one.situation, opened_ns, self.up_to_ns)
            ):
                return None
        except ValueError as error:
            if waits and is_late(skill.moves):
                return None
            self.recording = False
            gone = f"not seen: {self.cameras_gone}; " if self.cameras_gone else ""
            raise ValueError(f"{gone}{error}") from error
        self.recording = False
        return one

    def _streams_lag(self, until_ns: int) -> bool:
        """Whether messages up to a stamp are still on their way: a stream that was heard since
        the beginning may lag behind the others. A button that was pressed is no stream.
        """
        steps = [
            self._newest[topic]
            for topic, heard in self._heard.items()
            if heard >= STREAM and topic in self.needed and topic not in self.role_of
        ]
        return min(steps, default=0) < until_ns or not self.tracked.has_frames_until(until_ns)

    @property
    def cameras_gone(self) -> str:
        """What to say when poses have come, and none come any more; empty else."""
        if not self.tracked.newest_ns:
            return ""
        gone = [one.missing for one in self._cameras]
        if all(gone):
            return gone[0]
        silent = time.monotonic() - self._seen_at
        if silent < REPAIRED or self._blind_ns < BLIND_NS:
            return ""
        return f"{NO_CAMERAS}: no pose has come for {silent:.0f} s: do they see, and publish?"

    def come(self, ns: int) -> str:
        """In words, up to when poses have come, for a client that waits for more."""
        role, behind_ns = self.tracked.farthest_behind
        return (
            f"poses have come up to {self.tracked.newest_ns} ns, of the {role or HAND} up to"
            f" {behind_ns} ns only, not {ns} ns"
        )

    # what is asked

    def judge(self, request: Judge.Request, response: Judge.Response) -> None:
        """What became of a movement, or that it is pending; ValueError says why it cannot be told."""
        until_ns, skill = conversions.stamp_ns(request.until), self._skill
        asked = conversions.asked(request.situation, skill)
        begun_ns, told_ns = map(conversions.stamp_ns, (request.begun, request.told))
        come = self.tracked.has_frames_until(until_ns) and (
            not any(self.tracked.is_late(role, until_ns) for role in skill.decisive)
            or skill.is_decided(self.log, asked, told_ns, until_ns)
        )
        if not come and not self.cameras_gone:
            response.pending, response.message = True, self.come(until_ns)
            return
        self._take_all()  # what was sent before the newest pose
        begun_ns = begun_ns or told_ns
        if not begun_ns or not self.tracked.remembers(skill.judged_since(begun_ns, told_ns)):
            raise ValueError(
                f"the movement that began at {begun_ns} ns is too long ago, or never began: it was"
                " forgotten"
            )
        until_ns = until_ns or self.tracked.newest_ns
        outcome, situation = skill.outcome(self.log, asked, begun_ns, told_ns, until_ns)
        if math.isnan(outcome.error) and (gone := self.cameras_gone):
            outcome = replace(outcome, reason=gone)
        response.outcome = conversions.task_outcome_msg(
            outcome,
            conversions.situation_msg(situation),
            skill.name,
            self._frame_id,
            told_ns or begun_ns,
        )

    def look(self, until_ns: int, response) -> None:
        """Where the bodies beside the hand were seen just before a stamp, or that it is pending;
        ValueError says which one was not.
        """
        if gone := self.cameras_gone:
            raise ValueError(gone)
        until_ns = until_ns or self.tracked.newest_ns
        late = not self.tracked.has_frames_until(until_ns - FRAME_NS) or any(
            self.tracked.is_late(role, until_ns) for role in self.role_of.values()
        )
        if late:
            response.pending, response.message = True, self.come(until_ns)
            return
        response.situation = conversions.situation_msg(self.log.situation_at(until_ns))
        response.stamp = conversions.time_msg(until_ns)
