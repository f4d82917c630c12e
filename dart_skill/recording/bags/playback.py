"""Playing a bag: which message is due when, at any rate, paused, stepped, looped, from an offset;
the caller says what time it is.

Positions are nanoseconds since playing began, at rate 1; they go on rising when a bag is played
again in a loop.
"""

from __future__ import annotations

import itertools
import math
import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from dart_skill.common.constants import NS_PER_S
from dart_skill.recording.bags.reader import BagReader, TopicInfo

CLOCK_TOPIC = "/clock"
CLOCK_TYPE = "rosgraph_msgs/msg/Clock"


class Due(NamedTuple):
    """A message to publish.

    Parameters
    ----------
    position_ns
        When, on the clock of the playback [ns].
    topic
        After remapping.
    stamp_ns
        Log time in the bag [ns].
    data
        CDR bytes.
    """

    position_ns: int
    topic: str
    stamp_ns: int
    data: bytes


@dataclass(frozen=True)
class PlaybackSelection:
    """What of a bag is played.

    Parameters
    ----------
    topics, exclude
        Regular expressions that match a topic as a whole.
    remap
        Published name by recorded name.
    start
        After the bag's first message [s].
    duration
        From there [s].
    loop
        Begin again at the end.
    clock_rate
        Of /clock [1/s of the bag's time], 0 for none; a recorded /clock is played instead.
    """

    topics: Sequence[str] = (".*",)
    exclude: Sequence[str] = ()
    remap: dict[str, str] = field(default_factory=dict)
    start: float = 0.0
    duration: float = math.inf
    loop: bool = False
    clock_rate: float = 100.0

    def __post_init__(self) -> None:
        for name, patterns in (("topics", self.topics), ("exclude", self.exclude)):
            for pattern in patterns:
                try:
                    re.compile(pattern)
                except re.error as error:
                    raise ValueError(
                        f"{name}: '{pattern}' is no regular expression: {error}"
                    ) from error
        if not (math.isfinite(self.start) and self.start >= 0.0):
            raise ValueError(
                f"start = {self.start}: give seconds after the bag's first message, not negative"
            )
        if not self.duration > 0.0:
            raise ValueError(f"duration = {self.duration}: give seconds, more than 0")
        if not (math.isfinite(self.clock_rate) and self.clock_rate >= 0.0):
            raise ValueError(
                f"clock_rate = {self.clock_rate}: give ticks per second, or 0 for no /clock"
            )

    def matches(self, topic: str) -> bool:
        """Whether a topic is chosen."""
        wanted, unwanted = (
            any(re.fullmatch(one, topic) for one in patterns)
            for patterns in (self.topics, self.exclude)
        )
        return wanted and not unwanted


class Playback:
    """The messages of an open bag in the order in which they are due; iterate once.

    Parameters
    ----------
    bag
        Is open.
    selection
        What of the bag is played.

    Attributes
    ----------
    topics
        What the bag says of each topic, by its published name.

    Raises
    ------
    ValueError
        If nothing is left to play.
    """

    def __init__(self, bag: BagReader, selection: PlaybackSelection):
        self._bag, self._selection = bag, selection
        chosen = {name: info for name, info in bag.topics.items() if selection.matches(name)}
        if unknown := set(selection.remap) - set(bag.topics):
            raise ValueError(
                f"{bag.path}: no topic {sorted(unknown)} to remap, only {sorted(bag.topics)}"
            )
        self._names = {name: selection.remap.get(name, name) for name in chosen}
        if len(set(self._names.values())) < len(self._names):
            raise ValueError(
                f"remap = {selection.remap}: two topics would be published under one name"
            )
        self.topics: dict[str, TopicInfo] = {
            self._names[name]: info for name, info in chosen.items()
        }
        self.start_ns = bag.start_ns + round(selection.start * NS_PER_S)
        length = min(selection.duration, (bag.end_ns - self.start_ns) / NS_PER_S)
        if not (chosen and length >= 0.0 and sum(info.count for info in chosen.values())):
            whole = f"the bag is {(bag.end_ns - bag.start_ns) / NS_PER_S:.3f} s long"
            raise ValueError(
                f"{bag.path}: nothing to play of {sorted(bag.topics)} from {selection.start} s on;"
                f" {whole}"
            )
        self.end_ns = self.start_ns + round(length * NS_PER_S)

    @property
    def makes_clock(self) -> bool:
        """Whether /clock is made here: it is wanted and the bag has none that is played."""
        return self._selection.clock_rate > 0.0 and CLOCK_TOPIC not in self.topics

    def __iter__(self) -> Iterator[Due]:
        rounds = itertools.count() if self._selection.loop else range(1)
        # A loop has a moment between its last and its first message, or a bag with one message
        # would never let go.
        length = self.end_ns - self.start_ns + 10_000_000
        for k in rounds:
            yield from self._once(k * length)

    def _once(self, begun_ns: int) -> Iterator[Due]:
        offset = begun_ns - self.start_ns
        tick, period = (
            self.start_ns,
            round(NS_PER_S / self._selection.clock_rate) if self.makes_clock else 0,
        )
        for message in self._bag.messages(
            list(self._names), self.start_ns, self.end_ns + 1, decode=False
        ):
            while period and tick <= message.stamp_ns:
                yield Due(tick + offset, CLOCK_TOPIC, tick, clock_message(tick))
                tick += period
            yield Due(
                message.stamp_ns + offset,
                self._names[message.topic],
                message.stamp_ns,
                message.data,
            )


BEHIND = 0.5
"""Largest delay of playing that it catches up by itself [s of the clock]."""


class PlaybackPace:
    """Position of a playback on a clock.

    Parameters
    ----------
    rate
        Seconds of the bag in a second of the clock; 0: as fast as can be.
    now
        The time of that clock [s]; every method needs it.
    paused
        Begin only when `pause` says so.
    """

    def __init__(self, rate: float, now: float, paused: bool = False):
        self._mark, self._reached_ns, self.paused = now, 0.0, paused
        self.rate = _checked(rate)

    def position_ns(self, now: float) -> float:
        """Where playing is: messages up to here are due."""
        if self.paused or now <= self._mark:
            return self._reached_ns
        return (
            math.inf
            if self.rate == 0.0
            else self._reached_ns + (now - self._mark) * self.rate * NS_PER_S
        )

    def wait(self, position_ns: int, now: float) -> float:
        """How long until a position is due; infinite while paused [s]."""
        if self.paused:
            return math.inf
        if position_ns <= self._reached_ns or self.rate == 0.0:
            return 0.0
        return max(
            0.0, (position_ns - self._reached_ns) / (NS_PER_S * self.rate) - (now - self._mark)
        )

    def reach(self, position_ns: int, now: float) -> None:
        """A message was published: what follows is paced from it, if playing could not keep up."""
        if self.paused or self.rate == 0.0:
            self._reached_ns, self._mark = max(self._reached_ns, position_ns), now

    def hurries(self, position_ns: int, now: float) -> bool:
        """Whether messages follow each other as fast as can be, wanted so, or because playing is
        behind.
        """
        return (
            self.rate == 0.0 or self.position_ns(now) - position_ns > BEHIND * NS_PER_S * self.rate
        )

    def begin(self, now: float) -> None:
        """Playing begins only now."""
        self._mark = now

    def set_rate(self, rate: float, now: float) -> None:
        """Go on from here at another rate."""
        self._stand(now)
        self.rate = _checked(rate)

    def pause(self, paused: bool, now: float) -> None:
        """Stop here, or go on from here.

        Parameters
        ----------
        paused
            Whether to stop.
        """
        self._stand(now)
        self.paused = paused

    def _stand(self, now: float) -> None:
        if not self.paused and self.rate > 0.0:
            self._reached_ns = self.position_ns(now)
        self._mark = now


def clock_message(stamp_ns: int) -> bytes:
    """rosgraph_msgs/msg/Clock as CDR."""
    return struct.pack("<4BiI", 0, 1, 0, 0, *divmod(stamp_ns, NS_PER_S))


def _checked(rate: float) -> float:
    if not (math.isfinite(rate) and rate >= 0.0):
        raise ValueError(
            f"rate = {rate}: give seconds of the bag per second, or 0 for as fast as can be"
        )
    return float(rate)
