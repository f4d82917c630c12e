"""What is seen of a skill: where a recording is cut, and what became of a movement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dart_skill.common.situation import Pose, Situation
from dart_skill.movement import VelocityThreshold, segment_containing
from dart_skill.recording import HAND, Demonstration, demonstration_id
from dart_skill.skills.observation import SensorLog
from dart_skill.skills.protocol._skill_base import SkillBase

RUN_UP_NS = 1_000_000_000
"""A movement that is judged is looked at from so long before it began [ns]."""


@dataclass(frozen=True, eq=False)
class TaskOutcome:
    """What became of a movement, by what the cameras saw.

    Parameters
    ----------
    success
        Whether it did what it was for.
    error
        How far from perfect it was [m]; nan if it cannot be told.
    reason
        Of a failure, in words; empty for a success.
    miss
        Where the body that practice corrects (`Skill.corrects`) seems to be off (3,) [m], in its
        own axes; nan if it cannot be told.
    observed
        Places (3,) [m] and velocities (3,) [m/s] at instants that the skill names, as the release
        of a ball.
    """

    success: bool
    error: float
    reason: str = ""
    miss: np.ndarray = field(default_factory=lambda: np.full(3, np.nan))
    observed: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)


class JudgedSkill(SkillBase):
    """What a skill sees in recordings and in trials."""

    def cut(self, demonstration: Demonstration) -> tuple[float, float]:
        """First and last instant of the movement in a recording [s].

        Default: from when the fingers were told something for the first time to when they were
        told for the last time. Where they were told nothing, or only once, the movement between
        the velocity thresholds (8.4.3), the one in which they were told.

        Raises
        ------
        ValueError
            If there is none.
        """
        told = demonstration.events
        if len(told) > 1:
            return told[0].time, told[-1].time
        s = self.settings
        thresholds = VelocityThreshold(
            start=s.start_speed, stop=s.stop_speed, min_duration=s.shortest
        )
        time, position = demonstration.hand_time, demonstration.hand_position
        if told:
            found = segment_containing(
                thresholds.segment(time, position, told[0].time), told[0].time
            )
        else:
            found = max(thresholds.segment(time, position), key=lambda one: one.duration)
        return found.motion_start, found.motion_stop

    @property
    def awaited(self) -> tuple[str, ...]:
        """Roles whose poses up to its end are waited for before a demonstration is cut."""
        return (HAND, *self.bodies)

    @property
    def decisive(self) -> tuple[str, ...]:
        """Roles that decide what became of a movement."""
        return (HAND, *self.bodies)

    def check_seen(self, role: str, pose: Pose) -> None:
        """ValueError, with the remedy, if a body cannot be served where it was seen at a pose.
        Default: it can be anywhere.
        """

    def take_world(self, parameters: Mapping[str, Any]) -> None:
        """Take what a node was told of the world. Default: nothing of it matters."""

    def sensor_log(self, joint_period_ns: int = 10_000_000) -> SensorLog:
        """A log of what is seen of its bodies.

        Parameters
        ----------
        joint_period_ns
            As of `SensorLog`.
        """
        return SensorLog((HAND, *self.bodies), joint_period_ns)

    def infer_events(self, log: SensorLog, since_ns: int, until_ns: int) -> None:
        """Add to a log what a recording that tells no events shows of them, between two stamps.
        Default: nothing.
        """

    def record(
        self, log: SensorLog, until_ns: int, thresholds: VelocityThreshold
    ) -> Demonstration:
        """What a log saw of a demonstration, up to a stamp.

        Parameters
        ----------
        thresholds
            Of the recorder. Default: all since the world was set anew.

        Raises
        ------
        ValueError
            Says what is missing.
        """
        since = log.world_begins_ns()
        seen = log.seen(demonstration_id(since), since, until_ns, self.name)
        return self.described(seen)  # what is no movement of the skill is no demonstration

    def is_decided(
        self, log: SensorLog, situation: Situation, told_ns: int, until_ns: int
    ) -> bool:
        """Whether later poses change nothing about what became of a movement. Default: they may.

        Parameters
        ----------
        told_ns
            Stamp at which the fingers were told the last thing.
        """
        return False

    def judged_since(self, begun_ns: int, told_ns: int) -> int:
        """Stamp from which on a log must remember what is judged.

        Parameters
        ----------
        begun_ns, told_ns
            As of `outcome`.
        """
        return begun_ns - RUN_UP_NS

    def outcome(
        self, log: SensorLog, asked: Situation, begun_ns: int, told_ns: int, until_ns: int
    ) -> tuple[TaskOutcome, Situation]:
        """What became of a movement by what a log saw up to a stamp, and in which situation.

        Parameters
        ----------
        asked
            Situation that was asked for, as far as it was.
        begun_ns, told_ns
            Stamps at which it began, and the fingers were told the last thing; 0: not known.

        Raises
        ------
        ValueError
            Where the log does not tell.
        """
        since = self.judged_since(begun_ns, told_ns)
        seen = log.seen("trial", since, until_ns, self.name)
        before = self.situation(seen, (begun_ns - since) * 1e-9)
        situation = Situation({**before.poses, **asked.poses}, {**before.numbers, **asked.numbers})
        return self.judge(seen, situation), situation

    def described(self, seen: Demonstration) -> Demonstration:
        """What was seen with the situation and the instants of the movement that it shows.

        Raises
        ------
        ValueError
            If it shows none.
        """
        start, stop = self.cut(seen)
        return replace(
            seen, situation=self.situation(seen, start), motion_start=start, motion_stop=stop
        )

    def situation(self, demonstration: Demonstration, start: float) -> Situation:
        """Where all bodies are when the movement starts [s]. Default: where they were just before."""
        return Situation(
            {role: demonstration.track(role).pose_at(start) for role in (HAND, *self.bodies)}
        )

    def achieved(self, demonstration: Demonstration, situation: Situation) -> Situation:
        """The situation for which the movement would have been right: a miss can be relabelled.
        Default: the one that there was.
        """
        return situation

    def judge(self, seen: Demonstration, situation: Situation) -> TaskOutcome:
        """What became of a movement that was made in a situation, from what was seen of it.

        Raises
        ------
        NotImplementedError
            If the skill does not say.
        """
        raise NotImplementedError(
            f"the skill '{self.name}' does not say how its outcome is judged: write"
            f" {type(self).__name__}.judge"
        )
