"""Marks of demonstrations: which of them shall not be learned from. The newest mark of a
demonstration counts.

A demonstration is called after the instant at which the hand was told to open, so that its name is
unique: among those of a recorder that was started again, too, and a reader that finds the throw in a
recording again calls it the same.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Any

from dart_skill.common.world import MARK_TOPIC
from dart_skill.recording.bags import BagError, GraphBag
from dart_skill.recording.demonstration import stamp_ns

AS_ASKED = "as asked"
"""The reason why a demonstration is left out that was named."""
DROPPED = "dropped while it was recorded"
"""The reason why a demonstration is left out that was dropped by its mark."""
MARK_TYPE = "dart_skill_msgs/msg/DemonstrationMark"


def demonstration_id(opened_ns: int) -> str:
    """Name of the demonstration in which the hand was told to open, or the ball left it, at a
    stamp [ns].
    """
    return f"demonstration_{opened_ns}"


class Marks:
    """What is known of demonstrations by their marks, in whatever order and however often those
    come.
    """

    def __init__(self) -> None:
        self._newest: dict[str, tuple[int, bool]] = {}

    def take(self, mark: Any) -> bool:
        """Whether a message of type MARK_TYPE is news: no mark of its demonstration is as new."""
        marked_ns = stamp_ns(mark.header.stamp)
        if mark.id in self._newest and marked_ns <= self._newest[mark.id][0]:
            return False
        self._newest[mark.id] = marked_ns, bool(mark.dropped)
        return True

    @property
    def dropped(self) -> set[str]:
        """Ids of the demonstrations that were dropped in the end."""
        return {name for name, (_, dropped) in self._newest.items() if dropped}


def read_dropped(bag_path: str | os.PathLike) -> set[str]:
    """Ids of the demonstrations that were dropped in the end, by the marks of a bag; none without
    marks.

    Raises
    ------
    BagError
        If the marks are of another type.
    """
    with GraphBag(bag_path) as bag:
        if MARK_TOPIC not in bag.topics:
            return set()
        if bag.topics[MARK_TOPIC].type_name != MARK_TYPE:
            raise BagError(
                f"{bag_path}: {MARK_TOPIC} has type {bag.topics[MARK_TOPIC].type_name}, not"
                f" {MARK_TYPE}"
            )
        marks = Marks()
        for item in bag.messages([MARK_TOPIC]):
            marks.take(item.data)
    return marks.dropped


def unwanted(bag_path: str | os.PathLike, without: Iterable[str]) -> dict[str, str]:
    """By its id, the reason why a demonstration of a bag is left out: it was dropped, or it was
    asks for that now.

    Parameters
    ----------
    without
        Ids that are named.

    Raises
    ------
    BagError
        If the marks are of another type.
    """
    return {**dict.fromkeys(read_dropped(bag_path), DROPPED), **dict.fromkeys(without, AS_ASKED)}


def ids_named(given: Iterable[str], known: Sequence[str], where: str) -> list[str]:
    """The ids of demonstrations that are named by their ids or by their numbers.

    Parameters
    ----------
    known
        Ids in the order in which they were shown, of which the first has the number 1; empty where
        there is none to be named.
    where
        They are, for the message.

    Raises
    ------
    ValueError
        For what names none.
    """
    return [_named(name, known, where) for name in given]


def _named(name: str, known: Sequence[str], where: str) -> str:
    if name.isdecimal() and 1 <= int(name) <= len(known) and known[int(name) - 1]:
        return known[int(name) - 1]
    if not name or name not in known:
        numbers = f"numbers 1 to {len(known)}, or " if known else ""
        there = numbers + (", ".join(filter(None, known)) or "none")
        raise ValueError(f"{where} has no demonstration '{name}': there are {there}")
    return name
