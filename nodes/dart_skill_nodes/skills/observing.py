"""What the demonstration recorder makes of what it sees, of a throw and of every other skill."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from dart_skill_msgs.msg import Demonstration as DemonstrationMsg
from dart_skill_msgs.msg import Outcome as OutcomeMsg
from dart_skill_msgs.msg import Situation as SituationMsg
from dart_skill_msgs.srv import Judge
from rosbags.typesys.store import Typestore

from dart_skill.arm import Grip
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import (
    Demonstration,
    demonstration_id,
    demonstration_message,
    read_command,
)
from dart_skill.skills.learning import DEFAULT, check_movement, prepare
from dart_skill.skills.observation import SensorLog, judged, seen_down
from dart_skill.skills.protocol import HAND, Situation, Skill
from dart_skill.skills.throw import Throw
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.tracked_bodies import TrackedBodies

RUN_UP_NS = 1_000_000_000
"""A movement that is judged is looked at from so long before it began."""


class Observer(Protocol):
    """One skill, as the recorder needs it.

    roles: of the bodies that are tracked. awaited: those whose poses up to the end are waited for
    before a demonstration is cut. loose: the one that decides what becomes of a movement. log:
    what was seen.
    """

    roles: tuple[str, ...]
    awaited: tuple[str, ...]
    loose: str
    log: SensorLog

    def hear_command(self, stamp_ns: int, data: bytes, recording: bool) -> None:
        """A serialised command: what the fingers are told."""

    def cut(self, up_to_ns: int) -> Demonstration | Demonstration:
        """What was recorded, up to a stamp; ValueError says what is missing."""

    def lags(self, tracked: TrackedBodies, one, up_to_ns: int) -> bool:
        """Whether poses may be on their way that decide what became of a demonstration."""

    def check(self, one) -> None:
        """ValueError says why it cannot be learned from."""

    def message(self, one) -> DemonstrationMsg:
        """As it is published."""

    def recorded(self, types: Typestore, one) -> object:
        """As it is written into the bag, an object of `types`."""

    def late(self, tracked: TrackedBodies, request: Judge.Request, until_ns: int) -> bool:
        """Whether poses may be on their way that decide what is asked for."""

    def judge(self, tracked: TrackedBodies, request: Judge.Request, until_ns: int) -> OutcomeMsg:
        """What became of a movement; ValueError says why nobody can tell."""

    def look(self, until_ns: int) -> SituationMsg:
        """Where the bodies beside the hand were seen just before a stamp; ValueError says which
        one was not.
        """


class ThrowObserver:
    """Throws of whatever game: cut where the hand was opened, judged by where the ball came down,
    or the dart met the board.
    """

    def __init__(
        self, skill: Throw, thresholds: VelocityThreshold, rim_radius: float, frame_id: str
    ):
        self.loose, self._aimed_at = skill.bodies
        self.roles, self.awaited = (HAND, *skill.bodies), (HAND, self._aimed_at)
        self.log = skill.sensor_log()
        self._skill, self._thresholds, self._rim_radius, self._frame_id = (
            skill,
            thresholds,
            rim_radius,
            frame_id,
        )

    def hear_command(self, stamp_ns: int, data: bytes, recording: bool) -> None:
        if recording and read_command(data)[2] == Grip.OPEN:
            self.log.add_opening(stamp_ns)

    def cut(self, up_to_ns: int) -> Demonstration:
        return self.log.cut(demonstration_id(self.log.opened_ns or 0), up_to_ns, self._thresholds)

    def lags(self, tracked: TrackedBodies, one: Demonstration, up_to_ns: int) -> bool:
        return self._flight_lags(tracked, one.target, self.log.opened_ns or 0, up_to_ns)

    def _flight_lags(self, tracked: TrackedBodies, target, opened_ns: int, until_ns: int) -> bool:
        late = tracked.is_late(self.loose, until_ns)
        return late and not seen_down(self.log, target, opened_ns, until_ns, self._skill.game)

    def check(self, one: Demonstration) -> None:
        prepare(one, self._skill.configured_for(DEFAULT))

    def message(self, one: Demonstration) -> DemonstrationMsg:
        return conversions.demonstration_msg(one)

    def recorded(self, types: Typestore, one: Demonstration) -> object:
        return demonstration_message(types, one)

    def late(self, tracked: TrackedBodies, request: Judge.Request, until_ns: int) -> bool:
        return self._flight_lags(
            tracked, self._target(request), conversions.stamp_ns(request.told), until_ns
        )

    def _target(self, request: Judge.Request) -> np.ndarray:
        return self._skill.target(conversions.aimed(request.situation, self._skill))

    def judge(self, tracked: TrackedBodies, request: Judge.Request, until_ns: int) -> OutcomeMsg:
        target, opened = self._target(request), conversions.stamp_ns(request.told)
        if not tracked.remembers(opened):
            raise ValueError(f"the throw at {opened} ns is too long ago: it was forgotten")
        self._check_target()
        outcome, release = judged(
            self.log,
            target,
            self._rim_radius,
            opened,
            until_ns or tracked.newest_ns,
            self._skill.game,
        )
        about = conversions.situation_msg(conversions.aimed(request.situation, self._skill))
        return conversions.outcome_msg(
            outcome, about, self._frame_id, opened, release, self._skill.name
        )

    def _check_target(self) -> None:
        """ValueError if what is thrown at was last seen where it cannot be."""
        if self.log.basket.rows:
            self._skill.check_seen(self.log.basket.rows[-1])

    def look(self, until_ns: int) -> SituationMsg:
        seen = self.log.basket.part(until_ns - RUN_UP_NS, until_ns)
        if not seen.stamps:
            raise ValueError(f"the {self._aimed_at} was not seen: is it tracked and published?")
        return conversions.at_place(seen.rows[-1], self._aimed_at)


class TaskObserver:
    """Every other skill: cut and judged by its own class."""

    def __init__(self, skill: Skill, frame_id: str):
        self._skill, self._frame_id, self.log = skill, frame_id, skill.sensor_log()
        self.roles = self.awaited = (HAND, *skill.bodies)
        self.loose = skill.moves

    def hear_command(self, stamp_ns: int, data: bytes, recording: bool) -> None:
        self.log.add_told(stamp_ns, Grip(read_command(data)[2]))

    def cut(self, up_to_ns: int) -> Demonstration:
        since = self.log.world_begins_ns()
        one = self.log.seen(demonstration_id(since), since, up_to_ns, self._skill.name)
        self._skill.cut(one)  # what is no movement of the skill is no demonstration
        return one

    def lags(self, tracked: TrackedBodies, one: Demonstration, up_to_ns: int) -> bool:
        return False  # all that it needs was waited for

    def check(self, one: Demonstration) -> None:
        check_movement(self._skill, one)

    def message(self, one: Demonstration) -> DemonstrationMsg:
        return conversions.demonstration_msg(self._skill.described(one))

    def recorded(self, types: Typestore, one: Demonstration) -> object:
        return demonstration_message(types, self._skill.described(one))

    def late(self, tracked: TrackedBodies, request: Judge.Request, until_ns: int) -> bool:
        return any(tracked.is_late(role, until_ns) for role in self.roles)

    def judge(self, tracked: TrackedBodies, request: Judge.Request, until_ns: int) -> OutcomeMsg:
        begun = conversions.stamp_ns(request.begun) or conversions.stamp_ns(request.told)
        if not begun or not tracked.remembers(begun - RUN_UP_NS):
            raise ValueError(
                f"the movement that began at {begun} ns is too long ago, or never began: it was"
                " forgotten"
            )
        since = begun - RUN_UP_NS
        seen = self.log.seen("trial", since, until_ns or tracked.newest_ns, self._skill.name)
        asked = conversions.situation(request.situation)
        before = self._skill.situation(seen, (begun - since) * 1e-9)
        situation = Situation({**before.poses, **asked.poses}, {**before.numbers, **asked.numbers})
        outcome = self._skill.judge(seen, situation)
        told = conversions.stamp_ns(request.told) or begun
        return conversions.task_outcome_msg(
            outcome, conversions.situation_msg(situation), self._skill.name, self._frame_id, told
        )

    def look(self, until_ns: int) -> SituationMsg:
        return conversions.situation_msg(self.log.situation_at(until_ns))
