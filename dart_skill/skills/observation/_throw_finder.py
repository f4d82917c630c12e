"""Throws found in what the sensors see, while they see it or later: a hand that was told to open,
and the motion that it opened in.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from dart_skill.common.world import the_world
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import Demonstration, GripSignal, Opening, demonstration_id
from dart_skill.skills.observation._cutting import THRESHOLDS, ThrowLog, watched_until
from dart_skill.skills.observation._outcome import Outcome, judge_flight
from dart_skill.skills.observation._sensor_log import RESET_NS

MEMORY_NS = 60_000_000_000
"""What was seen longer before the present belongs to no throw any more."""


@dataclass(frozen=True)
class FoundThrow:
    """A throw in a recording.

    Parameters
    ----------
    stamp_ns
        When the hand was told to open, or the ball left it.
    taught
        A person guided it.
    demonstration, outcome
        None if it could not be cut out.
    reason
        Why it is not learned from, empty if it is.
    was
        Id and target (3,) [m] of a demonstration that was forgotten; None of one that is there.
    """

    stamp_ns: int
    taught: bool
    demonstration: Demonstration | None = None
    outcome: Outcome | None = None
    reason: str = ""
    was: tuple[str, np.ndarray] | None = None

    @property
    def shown(self) -> tuple[str, np.ndarray] | None:
        """Id and target (3,) [m] of its demonstration, also of one that was forgotten; None if it
        was not cut out.
        """
        return (
            self.was
            if self.demonstration is None
            else (self.demonstration.id, self.demonstration.target)
        )

    def forgotten(self, reason: str) -> FoundThrow:
        """The throw without what was recorded of it.

        Parameters
        ----------
        reason
            Why that is forgotten.
        """
        return replace(self, demonstration=None, was=self.shown, reason=reason)

    @property
    def shows(self) -> bool:
        """Whether it is a demonstration: a person guided it, and it went into the basket."""
        return self.taught and self.outcome is not None and bool(self.outcome.in_basket)


class ThrowFinder:
    """Finds throws while they are made, in a log that is being filled: tell of every command, then
    ask for the throws that were watched to their end.
    """

    def __init__(self, log: ThrowLog, thresholds: VelocityThreshold = THRESHOLDS):
        self._log, self._thresholds = log, thresholds
        self._teacher, self._controller = GripSignal(), GripSignal()
        self._openings: list[tuple[int, bool]] = []
        self._since = 0

    def add_command(self, data: bytes, guiding: bool) -> None:
        """A serialised WamCommand, of the person who guides the arm or of its controller.

        Parameters
        ----------
        guiding
            Whether a person guides.
        """
        signal = self._teacher if guiding else self._controller
        if signal.take_command(data):
            self._openings.append((signal.openings.pop(), guiding))

    def until(self, arrived_ns: int) -> list[FoundThrow]:
        """The throws that were watched to their end when everything up to a stamp has come [ns],
        in order of time.

        Parameters
        ----------
        arrived_ns
            The stamp.
        """
        self._openings.sort()
        found = []
        while self._openings and watched_until(self._openings[0][0]) <= arrived_ns:
            stamp, guiding = self._openings.pop(0)
            found += self.find(Opening(stamp, guiding or self._teacher.pushed_before(stamp)))
        self.forget_before(min([arrived_ns, *(stamp for stamp, _ in self._openings)]) - MEMORY_NS)
        return found

    def find(self, opening: Opening, has_button: bool = True) -> list[FoundThrow]:
        """The throw in which the hand was told to open, or without a button let go of the ball;
        none if that was told again before the throw was over. Openings come in order of time.
        """
        if opening.stamp_ns < self._since:
            return []
        until = watched_until(opening.stamp_ns)
        since = max(self._since, world_of(opening.stamp_ns, self._log.stamps()))
        log = self._log.part(since, until)
        if has_button:
            log.add_opening(opening.stamp_ns)
        else:
            log.add_release(opening.stamp_ns)
        throw = cut_throw(log, opening, self._thresholds)
        if throw.demonstration is not None:
            self._since = until + 1
        return [throw]

    def forget_before(self, stamp_ns: int) -> None:
        """Forget what was seen before an instant: no throw after it needs it.

        Parameters
        ----------
        stamp_ns
            When [ns].
        """
        self._log.forget_before(stamp_ns)
        self._teacher.forget_before(stamp_ns)


def cut_throw(
    log: ThrowLog, opening: Opening, thresholds: VelocityThreshold = THRESHOLDS
) -> FoundThrow:
    """The throw of a log in which the hand was opened once, and how it ended; its reason says why
    nothing could be cut.
    """
    until = watched_until(opening.stamp_ns)
    try:
        one = log.cut(demonstration_id(opening.stamp_ns), until, thresholds)
        outcome = judge_flight(
            *log.ball_between(opening.stamp_ns, until), one.target, the_world().basket_radius
        )
    except ValueError as error:
        return FoundThrow(opening.stamp_ns, opening.taught, reason=str(error))
    return FoundThrow(opening.stamp_ns, opening.taught, one, outcome)


def worlds(streams: Iterable[np.ndarray]) -> list[tuple[int, int]]:
    """First and last stamp [ns] of each stretch in which something was seen all the time, of the
    stamps (n,) of several sensors: a reset sets the clock on.

    Parameters
    ----------
    streams
        Stamps of each sensor.
    """
    stamps = np.unique(np.concatenate([np.asarray(stream, dtype=np.int64) for stream in streams]))
    if not len(stamps):
        return []
    breaks = np.flatnonzero(np.diff(stamps) > RESET_NS)
    first, last = (
        stamps[np.concatenate([[0], breaks + 1])],
        stamps[np.concatenate([breaks, [len(stamps) - 1]])],
    )
    return list(zip(first.tolist(), last.tolist(), strict=True))


def world_of(stamp_ns: int, streams: Iterable[np.ndarray]) -> int:
    """First stamp [ns] of the stretch in which an instant is, 0 if it is in none."""
    return next((first for first, last in worlds(streams) if first <= stamp_ns <= last), 0)
