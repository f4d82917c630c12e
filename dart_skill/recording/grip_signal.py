"""When the hand was told to open, and by whom: found in serialised commands and in the button
messages of others.
"""

from __future__ import annotations

import struct
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dart_skill.common.constants import NS_PER_S, Grip

GUIDED_NS = 500_000_000
"""The arm is guided if the person pushed it within this time before the hand opened."""
HELD_NS = 200_000_000
"""Commands to open the hand that follow each other faster are one."""


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
        return sec * NS_PER_S + nanosec, any(data[start : start + 48]), data[start + 104]
    except (struct.error, IndexError):
        raise ValueError(f"{len(data)} bytes are no WamCommand") from None


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
    if not _are_alike(payloads):
        rows = [read_command(one) for one in payloads]
        stamps, pushed, grip = zip(*rows, strict=True) if rows else ((), (), ())
        return (
            np.array(stamps, dtype=np.int64),
            np.array(pushed, dtype=bool),
            np.array(grip, dtype=np.uint8),
        )
    table = np.frombuffer(b"".join(payloads), dtype=np.uint8).reshape(len(payloads), -1)
    heads = np.ascontiguousarray(table[:, 4:12])
    sec, nanosec = heads[:, :4].copy().view("<i4")[:, 0], heads[:, 4:].copy().view("<u4")[:, 0]
    (length,) = struct.unpack_from("<I", payloads[0], 12)
    start = 4 + (12 + length + 7) // 8 * 8
    return (
        sec.astype(np.int64) * NS_PER_S + nanosec,
        np.any(table[:, start : start + 48], axis=1),
        table[:, start + 104],
    )


def _are_alike(payloads: Sequence[bytes]) -> bool:
    """Whether all are little endian, as long as each other, and name a frame of one length, so
    that their parts lie in columns.
    """
    if not payloads or len(payloads[0]) < 16 or not payloads[0][1] & 1:
        return False
    size, head, length = len(payloads[0]), payloads[0][:4], payloads[0][12:16]
    reach = 4 + (12 + int.from_bytes(length, "little") + 7) // 8 * 8 + 104
    return reach < size and all(
        len(one) == size and one[:4] == head and one[12:16] == length for one in payloads
    )
