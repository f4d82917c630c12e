"""What was heard of an arm and its cameras, as arrays: who listens fills this in, the lines of the
check read it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np


@dataclass(frozen=True)
class Endpoint:
    """A publisher or subscriber.

    Parameters
    ----------
    reliability
        "reliable" or "best_effort".
    node
        Its name.
    """

    node: str
    reliability: str = "reliable"


@dataclass(frozen=True)
class HeardTopic:
    """The messages of a topic, in the order of their receipt.

    Parameters
    ----------
    topic
        Its name.
    publishers
        All that there were.
    received_ns
        When each came, on the clock that the nodes use: wall clock, or /clock, (n,) [ns].
    stamp_ns
        What its header says, (n,) [ns].
    frames
        The frame_ids that were used.
    """

    topic: str
    publishers: tuple[Endpoint, ...] = ()
    received_ns: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    stamp_ns: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    frames: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.stamp_ns)

    @property
    def forward(self) -> np.ndarray:
        """Mask (n,) of the messages that are newer than all before them."""
        if not len(self):
            return np.empty(0, dtype=bool)
        newest = np.maximum.accumulate(self.stamp_ns)
        return np.append(True, self.stamp_ns[1:] > newest[:-1])

    @property
    def age(self) -> np.ndarray:
        """Receipt minus stamp (n,) [s]."""
        return (self.received_ns - self.stamp_ns) * 1e-9


@dataclass(frozen=True)
class HeardJoints(HeardTopic):
    """Joint states.

    Parameters
    ----------
    orders
        The lists of names that were used.
    position
        (n, k) [rad], of the arm's joints in their order where all are named, else as they came.
    velocity
        (n, k) [rad/s], or (n, 0) where the driver gives none.
    n_odd
        Messages with another number of positions than k; they are left out.
    """

    orders: tuple[tuple[str, ...], ...] = ()
    position: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    velocity: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    n_odd: int = 0


@dataclass(frozen=True)
class HeardPoses(HeardTopic):
    """Poses of a tracked body: position (n, 3) [m] and quaternion (n, 4)."""

    position: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    quaternion: np.ndarray = field(default_factory=lambda: np.empty((0, 4)))


@dataclass(frozen=True)
class Heard:
    """Everything that was heard.

    Parameters
    ----------
    simulated
        Whether the nodes follow /clock.
    joints
        Of the arm's driver.
    poses
        Of the hand and of the other bodies of the skill, by role.
    commanders, drivers
        Who publishes /wam/command, and who takes it.
    in_hand
        Role of the body that is in the hand when a trial begins; empty if there is none.
    """

    simulated: bool
    joints: HeardJoints
    poses: Mapping[str, HeardPoses]
    commanders: tuple[Endpoint, ...] = ()
    drivers: tuple[Endpoint, ...] = ()
    in_hand: str = ""


class Grade(str, Enum):
    """What a line says of moving the arm."""

    GO = "GO"
    WARN = "WARN"
    NO_GO = "NO-GO"


@dataclass(frozen=True)
class Line:
    """What was measured, what is asked, and what to do about it.

    Parameters
    ----------
    check
        What was looked at.
    verdict
        GO, WARN or NO_GO.
    measured, asked
        Both in words, with units.
    remedy
        Empty if nothing needs to be done.
    """

    check: str
    verdict: Grade
    measured: str
    asked: str
    remedy: str = ""


def line(check: str, verdict: Grade, measured: str, asked: str, remedy: str = "") -> Line:
    """A line; its remedy is left out where nothing needs to be done."""
    return Line(check, verdict, measured, asked, "" if verdict is Grade.GO else remedy)


def graded(value: float, good: float, bearable: float) -> Grade:
    """GO up to a value that is good, WARN up to one that is bearable, NO_GO beyond, and for what
    is not a number.
    """
    if value <= good:
        return Grade.GO
    return Grade.WARN if value <= bearable else Grade.NO_GO


def worst(*verdicts: Grade) -> Grade:
    """The worst of them."""
    return max(verdicts, key=list(Grade).index)
