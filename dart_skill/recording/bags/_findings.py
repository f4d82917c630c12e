"""What a check of a bag has to say, and what log times tell: jumps back and forward, and gaps of a
topic against its usual rate.

Of each topic a histogram of its intervals is kept, and the longest of them: as much memory for a
day as for a minute.

A topic is regular if most of its intervals are much alike, or if they come in bursts that are.
Only such topics have gaps: messages on /rosout, of buttons, of parameters and latched ones come
when there is something to say. What is silent for more than a fifth of the time, and more than
twice, is taken for such a topic, too (a joystick, a teleoperator). Where all regular topics are
silent together, the recorder or the world was paused, which is told once.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dart_skill.common.constants import NS_PER_S

RECOVER = "make a new bag of what is in it: dart-skill bag recover"
REWRITE = "write its index anew: dart-skill bag recover"
SEVERITIES = ("error", "warning", "note")
BATCH = 1024
"""Number of messages whose log times are looked at together."""
N_LONGEST = 32
"""Number of the longest intervals of a topic that are remembered."""
FEWEST = 20
"""Fewest intervals of a regular topic."""
FEWEST_IN_BURSTS = 200
"""Fewest intervals of a regular topic whose messages come in bursts."""
SHORTEST_GAP_NS = 200_000_000
"""Shortest silence of a topic that is told [ns]."""
SHORTEST_PAUSE_NS = 5 * NS_PER_S
"""Shortest silence of all topics together that is told [ns]; a world that is reset, or a player
that waits, makes shorter ones.
"""
LEAP_NS = 86_400 * NS_PER_S
"""Shortest pause that means that a clock was set [ns]."""
SHORTEST_LEAP_NS = 60 * NS_PER_S
"""Shortest pause that means so if it is longer than half of the bag [ns]."""
SHORTEST_SET_BACK_NS = NS_PER_S
"""A clock is rarely set back by less [ns]; publishers with delays of their own make steps back that
are shorter.
"""
SHUFFLED = 0.01
"""Share of the messages of a topic after shorter steps back from which on no clock was set."""
_LATEST_NS = 2**63 - 1
"""Largest log time; later ones count as this one [ns]."""
_PER_OCTAVE = 8
"""Number of classes of the histogram of intervals between one and twice as long."""


@dataclass(frozen=True)
class Finding:
    """Something about a bag.

    Parameters
    ----------
    severity
        "error" (something is lost or unreadable), "warning" (look at it) or "note".
    place
        File, topic or byte.
    remedy
        What to do about it; empty if nothing needs to be done.
    message
        What it is.
    """

    severity: str
    place: str
    message: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.severity}: {self.place}: {self.message}" + (
            f" ({self.remedy})" if self.remedy else ""
        )


@dataclass
class _StepsBack:
    """Steps back of log times: their number, the largest of them, and where the first begins."""

    n: int = 0
    most_ns: int = 0
    first_ns: int = 0

    def take(self, stamps: np.ndarray, steps: np.ndarray) -> None:
        """Log times before steps, and the steps (n,) [ns]."""
        if len(steps):
            self.first_ns = self.first_ns if self.n else int(stamps[0])
            self.n += len(steps)
            self.most_ns = max(self.most_ns, int(-steps.min()))

    def in_words(self) -> str:
        """Where the first is, and how large the largest."""
        return f"by up to {self.most_ns / NS_PER_S:.6f} s, first at {self.first_ns} ns"


@dataclass
class _Intervals:
    """Times between successive messages of one kind."""

    first_ns: int | None = None
    last_ns: int = 0
    n: int = 0
    back: _StepsBack = field(default_factory=_StepsBack)
    histogram: np.ndarray = field(default_factory=lambda: np.zeros(64 * _PER_OCTAVE, np.int64))
    longest: list[tuple[int, int]] = field(default_factory=list)  # and when each began

    def take(self, stamps: np.ndarray) -> None:
        if self.first_ns is None:
            self.first_ns = int(stamps[0])
        else:
            stamps = np.concatenate(([self.last_ns], stamps))
        self.last_ns = int(stamps[-1])
        steps = np.diff(stamps)
        self.n += len(steps)
        self.back.take(stamps[:-1][steps < 0], steps[steps < 0])
        classes = (np.log2(np.maximum(steps, 1)) * _PER_OCTAVE).astype(int)
        self.histogram += np.bincount(classes[steps >= 0], minlength=len(self.histogram))
        new = [(int(steps[k]), int(stamps[k])) for k in np.argsort(steps)[-N_LONGEST:]]
        self.longest = sorted([*self.longest, *(gap for gap in new if gap[0] > 0)])[-N_LONGEST:]

    @property
    def is_turned(self) -> bool:
        """Whether a step back is as long as the usual interval: smaller disorder is usual."""
        return self.back.n > 0 and self.back.most_ns >= self.share(0.5) * 0.9

    @property
    def is_shuffled(self) -> bool:
        """Whether small steps back come again and again, as where several publish the topic."""
        often = self.back.n >= max(FEWEST, SHUFFLED * self.n)
        return often and self.back.most_ns < SHORTEST_SET_BACK_NS

    @property
    def extent(self) -> tuple[int, int]:
        """Log times of the first and the last message [ns]."""
        return self.first_ns or 0, self.last_ns

    def share(self, share: float) -> float:
        """An interval that this share of them does not exceed [ns]."""
        total = np.cumsum(self.histogram)
        place = np.searchsorted(total, share * total[-1])
        return float(2.0 ** ((place + 0.5) / _PER_OCTAVE)) if total[-1] else 0.0

    def usual(self) -> float | None:
        """The usual interval of a regular topic, or between its bursts [ns]; None of an irregular
        one.
        """
        n, half, most = int(self.histogram.sum()), self.share(0.5), self.share(0.9)
        if n >= FEWEST and most <= 2.0 * half:
            return half
        return most if n >= FEWEST_IN_BURSTS and self.share(0.99) <= 1.5 * most else None

    def gaps(self, usual: float) -> list[tuple[int, int]]:
        """Length and begin of intervals that are much longer than the usual ones [ns], in order."""
        limit = max(10.0 * usual, 3.0 * self.share(0.95), SHORTEST_GAP_NS)
        return sorted((gap for gap in self.longest if gap[0] > limit), key=lambda gap: gap[1])


class TimeLine:
    """The log times of a bag, in the order in which its messages were written."""

    def __init__(self) -> None:
        self._all = _Intervals()
        self._topics: dict[str, _Intervals] = {}
        self._events: set[str] = set()
        self._numbers: dict[str, int] = {}  # of topics, by name
        self._waiting: list[tuple[np.ndarray, np.ndarray]] = []  # numbers of topics, and log times

    def number(self, topic: str) -> int:
        """The number by which a topic is told."""
        return self._numbers.setdefault(topic, len(self._numbers))

    def extend(self, numbers: np.ndarray, stamps: np.ndarray) -> None:
        """The next messages: numbers of their topics and log times (n,) [ns]."""
        self._waiting.append((numbers, np.minimum(stamps, _LATEST_NS).astype(np.int64)))
        if sum(len(waiting) for _, waiting in self._waiting) >= BATCH:
            self._take()

    def is_of_events(self, topic: str) -> None:
        """Its messages come when there is something to say: it is latched, or of such a type."""
        self._events.add(topic)

    def findings(self, place: str) -> list[Finding]:
        """What is to be said of the bag.

        Parameters
        ----------
        place
            Its name.
        """
        self._take()
        regular = {
            name: (usual, topic.gaps(usual))
            for name, topic in self._topics.items()
            if name not in self._events and (usual := topic.usual()) is not None
        }
        pauses = self._pauses({name: gaps for name, (_, gaps) in regular.items()})
        found = [*self._back(place), *self._pause_findings(place, pauses)]
        for name, (usual, gaps) in regular.items():
            gaps = [gap for gap in gaps if not _covers(gap, *pauses)]
            if gaps and len(gaps) < N_LONGEST:
                found += self._gap_findings(name, usual, gaps)
        return found

    def _take(self) -> None:
        if not self._waiting:
            return
        numbers, stamps = (np.concatenate(column) for column in zip(*self._waiting, strict=True))
        self._waiting = []
        if not len(stamps):
            return
        self._all.take(stamps)
        for name, number in self._numbers.items():
            if (of_topic := numbers == number).any():
                self._topics.setdefault(name, _Intervals()).take(stamps[of_topic])

    def _back(self, place: str) -> list[Finding]:
        turned = {name: one for name, one in self._topics.items() if one.is_turned}
        shuffled = {name: one for name, one in turned.items() if one.is_shuffled}
        found = [_shuffled(name, one) for name, one in shuffled.items()]
        turned = {name: one for name, one in turned.items() if name not in shuffled}
        if turned:
            return [*found, _set_back(place, turned)]
        if found or self._all.back.most_ns < NS_PER_S:
            return found
        text = (
            "messages do not stand in order of log time, by up to"
            f" {self._all.back.most_ns / NS_PER_S:.3f} s: readers sort them"
        )
        return [Finding("note", place, text)]

    def _pauses(self, regular: dict[str, list[tuple[int, int]]]) -> list[tuple[int, int]]:
        """Length and begin of what no regular topic has messages in, in order: in gaps, before it
        begins, or when it has ended.

        That takes two of them, unless it is longer than all the rest, or than any recording is
        paused. regular: gaps of each.
        """
        start, end = self._all.extent
        least = max(SHORTEST_LEAP_NS, 0.5 * (end - start)) if regular else LEAP_NS
        found = [gap for gap in self._all.longest if gap[0] >= min(least, LEAP_NS)]
        silences = []
        for name, gaps in regular.items():
            first, last = self._topics[name].extent
            silences.append([*gaps, (first - start, start), (end - last, last)])
        for gap in (gap for gaps in regular.values() for gap in gaps if len(regular) > 1):
            if not _covers(gap, *found) and all(_covers(gap, *silence) for silence in silences):
                found.append(gap)
        return sorted(found, key=lambda gap: gap[1])

    def _pause_findings(self, place: str, pauses: list[tuple[int, int]]) -> list[Finding]:
        pauses = [pause for pause in pauses if pause[0] >= SHORTEST_PAUSE_NS]
        if not pauses:
            return []
        longest, begin = max(pauses)
        start, end = self._all.extent
        if longest >= LEAP_NS or (longest >= SHORTEST_LEAP_NS and longest >= 0.5 * (end - start)):
            times = f"{len(pauses)} times, by up to " if len(pauses) > 1 else "by "
            return [
                Finding(
                    "warning",
                    place,
                    f"log time jumps forward {times}{_length(longest)}, after {begin} ns",
                    "a clock was set, or the recorder was paused",
                )
            ]
        more = f" ({len(pauses)} such pauses)" if len(pauses) > 1 else ""
        text = f"no topic of a regular rate has messages for {_length(longest)} after {begin} ns{more}"
        cause = "the recorder or the world was paused, or a clock was set"
        return [Finding("note", place, text, cause)]

    def _gap_findings(self, name: str, usual: float, gaps: list[tuple[int, int]]) -> list[Finding]:
        start, end = self._topics[name].extent
        is_short = sum(length for length, _begin in gaps) <= 0.2 * (end - start)
        if not is_short and len(gaps) > 2:
            return []
        longest, begin = max(gaps)
        times = f"{len(gaps)} gaps, the longest of " if len(gaps) > 1 else "a gap of "
        text = (
            f"{times}{_length(longest)} after {begin} ns, where a message usually comes after"
            f" {usual / NS_PER_S:.2g} s"
        )
        cause = "what published it was silent, or its messages were lost"
        return [Finding("warning" if is_short else "note", f"topic {name}", text, cause)]


def _set_back(place: str, turned: dict[str, _Intervals]) -> Finding:
    """A clock that was set back, as topics show it."""
    name, worst = max(turned.items(), key=lambda item: item[1].back.most_ns)
    others = f" and {len(turned) - 1} other topics" if len(turned) > 1 else ""
    text = f"log time jumps back {worst.back.n} times, {worst.back.in_words()}, on {name}{others}"
    return Finding("warning", place, text, "a clock was set, or a simulation began anew")


def _shuffled(name: str, topic: _Intervals) -> Finding:
    """Messages of a topic that do not stand in order, though no clock was set."""
    text = (
        f"{topic.back.n} of {topic.n + 1} messages stand after later ones,"
        f" {topic.back.in_words()}: readers sort them"
    )
    cause = "several publishers with delays of their own are the usual case; no clock was set"
    return Finding("note", f"topic {name}", text, cause)


def _covers(gap: tuple[int, int], *pauses: tuple[int, int]) -> bool:
    """Whether at least four fifths of a gap lie in pauses, which do not overlap."""
    length, begin = gap
    shared = (min(begin + length, start + lasted) - max(begin, start) for lasted, start in pauses)
    return sum(max(0, one) for one in shared) >= 0.8 * length


def _length(interval_ns: int) -> str:
    seconds = interval_ns / NS_PER_S
    for unit, size in (("years", 31_556_952.0), ("days", 86_400.0), ("hours", 3600.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.3f} s"
