"""What single messages of an arm say: when the hand was told to open, and by whom; where the joints
are, by the names that the message gives; and when a message is logged that says itself when it was
sent.

Many drivers publish joint states on one topic: that of the arm, that of a gripper, that of another
arm. Each message is read by its own names, in a graph that runs and from a bag, by this module.
"""

from __future__ import annotations

import struct
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dart_skill.common.constants import NS_PER_S, Grip
from dart_skill.common.world import joint_names, joint_order

GUIDED_NS = 500_000_000
"""Longest time from a push to the opening of the hand of an arm that is guided [ns]."""
HELD_NS = 200_000_000
"""Longest time between commands to open the hand that are one [ns]."""
MOST_JOINTS = 64
"""Number of joints that an arm may have in a recorded command: no torque of another layout reads
like such a count.
"""


@dataclass(frozen=True)
class Opening:
    """The hand was told to open.

    Parameters
    ----------
    stamp_ns
        When [ns].
    taught
        During a throw that a person guided.
    """

    stamp_ns: int
    taught: bool


class GripSignal:
    """Instants at which the hand was told to open, and at which the arm was pushed, in order
    of time [ns].
    """

    def __init__(self) -> None:
        self.openings: list[int] = []
        self.pushes: list[int] = []
        self._pressed, self._open_ns = False, -HELD_NS - 1

    def take_command(self, data: bytes) -> bool:
        """Take a serialised WamCommand. Of successive commands that say so only the first one
        counts.

        Returns
        -------
        bool
            Whether it opens the hand.
        """
        stamp, pushed, grip = read_command(data)
        if pushed:
            self.pushes.append(stamp)
        if grip != Grip.OPEN:
            return False
        opens = abs(stamp - self._open_ns) > HELD_NS
        self._open_ns = stamp  # the stray stamp of one command hides no later ones
        if opens:
            self.openings.append(stamp)
        return opens

    def take_button(self, stamp_ns: int, pressed: bool) -> None:
        """A button that is pressed, or is not, at an instant."""
        if pressed and not self._pressed:
            self.openings.append(stamp_ns)
        self._pressed = pressed

    def pushed_before(self, stamp_ns: int) -> bool:
        """Whether the arm was pushed, and so guided, shortly before an instant."""
        k = bisect_right(self.pushes, stamp_ns)
        return k > 0 and self.pushes[k - 1] > stamp_ns - GUIDED_NS

    def forget_before(self, stamp_ns: int) -> None:
        """Forget pushes before an instant."""
        del self.pushes[: bisect_right(self.pushes, stamp_ns)]


def read_command(data: bytes) -> tuple[int, bool, int]:
    """Stamp [ns], whether there is a wrench, and grip of a serialised WamCommand: of 500 in a
    second one opens the hand.

    Raises
    ------
    ValueError
        For bytes that are none.
    """
    try:
        order = "<" if data[1] & 1 else ">"
        sec, nanosec, length = struct.unpack_from(order + "iII", data, 4)
        start = 4 + (12 + length + 7) // 8 * 8
        grip = start + 48 + _torque_bytes(data, start + 48, order)
        return sec * NS_PER_S + nanosec, any(data[start : start + 48]), data[grip]
    except (struct.error, IndexError):
        raise ValueError(f"{len(data)} bytes are no WamCommand") from None


def _torque_bytes(data: bytes, at: int, order: str) -> int:
    """Length in bytes of the joint torques of a serialised WamCommand, which begin at a place; they
    were seven without a count in older recordings.
    """
    count, nothing = struct.unpack_from(order + "II", data, at)
    if 0 < count <= MOST_JOINTS and not nothing:
        return 8 + 8 * count
    # a torque of 0 begins like a count of 0, behind which there is not so much
    return 56 if len(data) >= at + 56 + 8 else 4


def read_commands(payloads: Sequence[bytes]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `read_command` for each of many: stamps (n,) [ns], whether there is a wrench (n,), grip
    (n,).

    Parameters
    ----------
    payloads
        Serialised WamCommands.

    Raises
    ------
    ValueError
        For bytes that are none.
    """
    rows = np.array([read_command(one) for one in payloads], dtype=np.int64).reshape(-1, 3)
    return rows[:, 0], rows[:, 1].astype(bool), rows[:, 2]


# joint states

_OTHERS = "names none of the arm's joints"


@dataclass(frozen=True)
class JointLayout:
    """What messages with the same names and as many numbers have in common.

    Parameters
    ----------
    order
        Places of the arm's joints among the names, as of `joint_order`; None where the message has
        no whole row.
    has_velocity
        Whether there is a velocity for each name.
    joints
        Which of the arm's joints are named, as numbers from 0.
    why
        What keeps the message from having a whole row; empty if nothing does.
    """

    order: list[int] | slice | None
    has_velocity: bool
    joints: tuple[int, ...]
    why: str

    @property
    def is_of_others(self) -> bool:
        """Whether the message says nothing of the arm: it names joints, and none of them is the
        arm's.
        """
        return self.why.startswith(_OTHERS)

    def row(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (..., 7) of the arm's joints; velocities are nan where there
        are none.

        Parameters
        ----------
        position
            Of the message, or of several (..., n).
        velocity
            The same, (..., n) or of another length.

        Raises
        ------
        ValueError
            Says why there is no row.
        """
        if self.order is None:
            raise ValueError(self.why)
        own = position[..., self.order]
        return own, velocity[..., self.order] if self.has_velocity else np.full_like(own, np.nan)


@lru_cache(maxsize=64)
def joint_layout(
    names: tuple[str, ...], n_positions: int, n_velocities: int, wanted: tuple[str, ...] = ()
) -> JointLayout:
    """What a JointState says of the arm.

    Parameters
    ----------
    names
        Of the message.
    n_positions, n_velocities
        How many of each it has.
    wanted
        Names of the arm's joints, default those of config/wam.yaml.
    """
    wanted = wanted or joint_names()
    joints = tuple(k for k, name in enumerate(wanted) if name in names)
    has_velocity = n_velocities == len(names) > 0

    def without(why: str) -> JointLayout:
        return JointLayout(None, has_velocity, joints, why)

    if names and not joints:
        remedy = "let the driver name them so, or put its names into config/wam.yaml"
        return without(f"{_OTHERS} {wanted[0]} to {wanted[-1]}, but {', '.join(names)}: {remedy}")
    if n_positions != len(names):
        return without(
            f"has {len(names)} names and {n_positions} positions: the driver must give one of each"
            " for every joint"
        )
    try:
        return JointLayout(joint_order(names, wanted), has_velocity, joints, "")
    except ValueError as error:
        return without(str(error))


# log times

LEAP_NS = 3_600_000_000_000
"""Largest step of stamps that is believed at once [ns]."""
INSISTING = 10
"""Number of stamps of one topic after which a larger step is believed: its clock was set."""


class LogTime:
    """A time that never goes back, and that no stray stamp carries away. now_ns: the newest stamp
    that was believed [ns].
    """

    def __init__(self) -> None:
        self.now_ns = 0
        # the last stamp that was not believed, and the topics of all that were like it
        self._ahead_ns, self._topics = 0, [""]

    def take(self, topic: str, stamp_ns: int) -> None:
        """Move on to the stamp of a message.

        Raises
        ------
        ValueError
            If it is far ahead, and time stays where it is: until a second topic says the same, or
            this one goes on saying it.
        """
        if not self.now_ns or stamp_ns <= self.now_ns + LEAP_NS:
            self.now_ns = max(self.now_ns, stamp_ns)
            return
        if abs(stamp_ns - self._ahead_ns) > LEAP_NS:
            self._topics = []
        self._ahead_ns = stamp_ns
        self._topics.append(topic)
        if len(set(self._topics)) == 1 and len(self._topics) < INSISTING:
            raise ValueError(
                f"it is stamped {(stamp_ns - self.now_ns) * 1e-9:.0f} s after everything else: set"
                " the clock of its publisher"
            )
        self.now_ns = stamp_ns
