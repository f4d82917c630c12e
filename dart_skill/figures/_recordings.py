"""What a bag holds between two resets of the world: one recording, of a guided throw or of one that the arm made by itself.

A reset leaves a gap in the stamps of the hand's poses, much longer than any dropout of the cameras.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from dart_skill.recording import BagError, BagReader, GraphBag, stamp_ns
from dart_skill.robot import Grip
from dart_skill.world import the_world

GAP = 0.5
"""Shortest gap between two recordings [s]. Dropouts last a tenth of a second; resets take one second."""
HAND, BALL, BASKET = the_world().pose_topics().values()
COMMAND = "/wam/command"
SAME_BASKET = 0.02
"""A recording belongs to a plan if its basket stood this near to the plan's target [m]."""


Stamped = tuple[np.ndarray, np.ndarray]
"""Stamps (n,) [ns], and a row of numbers for each."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Everything as it was recorded, in the frame of the world. Stamps are integer nanoseconds and increase.

    * hand_stamps, hand_position: (n,) [ns] and (n, 3) [m].
    * ball_stamps, ball_position: (m,) [ns] and (m, 3) [m].
    * basket: centre of the rim (3,) [m], the median of what was seen, nan if it was not seen.
    * command_stamps: of the controller's commands (k,) [ns].
    * opened_ns: stamp of the one that told the hand to open [ns], None if none did.
    """

    hand_stamps: np.ndarray
    hand_position: np.ndarray
    ball_stamps: np.ndarray
    ball_position: np.ndarray
    basket: np.ndarray
    command_stamps: np.ndarray
    opened_ns: int | None

    @property
    def start_ns(self) -> int:
        """Stamp of the first pose of the hand."""
        return int(self.hand_stamps[0])

    @property
    def stop_ns(self) -> int:
        """Stamp of the last pose of the hand."""
        return int(self.hand_stamps[-1])


def read_recordings(bag_path: str | os.PathLike) -> list[Recording]:
    """All recordings of a bag, in order; BagError if the hand was not recorded."""
    with GraphBag(bag_path) as bag:
        hand = _poses(bag, HAND)
        if not len(hand[0]):
            raise BagError(f"{bag_path}: no poses of the hand on {HAND}: record that topic")
        ball, basket, commands = _poses(bag, BALL), _poses(bag, BASKET), _commands(bag)
    bounds = _bounds(hand[0])
    return [_recording(hand, ball, basket, commands, start_ns, stop_ns) for start_ns, stop_ns in zip(bounds[:-1], bounds[1:], strict=True)]


def _recording(hand: Stamped, ball: Stamped, basket: Stamped, commands: Stamped, start_ns: int, stop_ns: int) -> Recording:
    stamps, opened = _between(commands, start_ns, stop_ns)
    _, places = _between(basket, start_ns, stop_ns)
    return Recording(
        *_between(hand, start_ns, stop_ns),
        *_between(ball, start_ns, stop_ns),
        basket=np.median(places, axis=0) if len(places) else np.full(3, np.nan),
        command_stamps=stamps,
        opened_ns=int(stamps[opened][0]) if opened.any() else None,
    )


def _bounds(stamps: np.ndarray) -> list[int]:
    """Stamps between which recordings lie: the first pose of each, and one beyond the last."""
    first = np.flatnonzero(np.diff(stamps) > GAP * 1e9) + 1
    return [int(stamps[0]), *(int(stamp) for stamp in stamps[first]), int(stamps[-1]) + 1]


def _between(series: Stamped, start_ns: int, stop_ns: int) -> Stamped:
    stamps, rows = series
    kept = slice(*np.searchsorted(stamps, [start_ns, stop_ns]))
    return stamps[kept], rows[kept]


def _poses(bag: BagReader, topic: str) -> Stamped:
    """Stamps (n,) and positions (n, 3) of a body, in order, without repeated stamps and values that are not finite."""
    points = ((item, item.data.pose.position) for item in _messages(bag, topic))
    stamps, rows = _ordered(((stamp_ns(item.data.header.stamp), (point.x, point.y, point.z)) for item, point in points), 3)
    finite = np.isfinite(rows).all(axis=1)
    return stamps[finite], rows[finite]


def _commands(bag: BagReader) -> Stamped:
    """Stamps (n,) of the commands, and which of them told the hand to open (n,)."""
    stamps, opened = _ordered(((stamp_ns(item.data.header.stamp), (item.data.grip == Grip.OPEN,)) for item in _messages(bag, COMMAND)), 1)
    return stamps, opened[:, 0] > 0.0


def _messages(bag: BagReader, topic: str) -> Iterable:
    return bag.messages([topic]) if topic in bag.topics else ()


def _ordered(items: Iterable[tuple[int, tuple]], width: int) -> Stamped:
    items = list(items)
    stamps, first = np.unique(np.array([stamp for stamp, _ in items], dtype=np.int64), return_index=True)
    rows = np.array([row for _, row in items], dtype=float).reshape(-1, width)
    return stamps, rows[first]
