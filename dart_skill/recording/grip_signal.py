"""When the hand was told to open, and by whom: found in serialised commands and in the button messages of others."""

from __future__ import annotations

import struct
from bisect import bisect_right
from dataclasses import dataclass

OPEN = 2
"""Of dart_skill_msgs/msg/WamCommand.grip."""
GUIDED_NS = 500_000_000
"""The arm is guided if the person pushed it within this time before the hand opened."""
HELD_NS = 200_000_000
"""Commands to open the hand that follow each other faster are one."""
GIGA = 1_000_000_000


@dataclass(frozen=True)
class Opening:
    """The hand was told to open.

    * stamp_ns: when [ns].
    * taught: during a throw that a person guided.
    """

    stamp_ns: int
    taught: bool


class GripSignal:
    """Instants at which the hand was told to open, and at which somebody pushed the arm, in order of time [ns]."""

    def __init__(self) -> None:
        self.openings: list[int] = []
        self.pushes: list[int] = []
        self._pressed, self._open_ns = False, -HELD_NS - 1

    def take_command(self, data: bytes) -> bool:
        """A serialised WamCommand; whether it opens the hand: whoever holds it open with every command tells it once."""
        stamp, pushed, grip = read_command(data)
        if pushed:
            self.pushes.append(stamp)
        if grip != OPEN:
            return False
        opens, self._open_ns = abs(stamp - self._open_ns) > HELD_NS, stamp  # the stray stamp of one command hides no later ones
        if opens:
            self.openings.append(stamp)
        return opens

    def take_button(self, stamp_ns: int, pressed: bool) -> None:
        """A button that is pressed, or is not, at an instant."""
        if pressed and not self._pressed:
            self.openings.append(stamp_ns)
        self._pressed = pressed

    def pushed_before(self, stamp_ns: int) -> bool:
        """Whether somebody pushed so shortly before an instant that the arm was guided."""
        k = bisect_right(self.pushes, stamp_ns)
        return k > 0 and self.pushes[k - 1] > stamp_ns - GUIDED_NS

    def forget_before(self, stamp_ns: int) -> None:
        """Forget pushes before an instant."""
        del self.pushes[: bisect_right(self.pushes, stamp_ns)]


OLDER_COMMAND = "RIHS01_309ab091da6a01af101f027efd310e3d02b14738f815986b003527407ec706b8"
"""Type hash of WamCommand as it was without `speed` and `sender`, in bags recorded before November 2026."""


def completed_command(data: bytes) -> bytes:
    """A serialised older WamCommand as one of today: at the careful level, of nobody who says who it is."""
    length = struct.unpack_from("<I" if data[1] & 1 else ">I", data, 12)[0]
    end_of_grip = 4 + (12 + length + 7) // 8 * 8 + 105
    return data[:end_of_grip] + bytes(7)  # speed, two bytes of padding, sender


def read_command(data: bytes) -> tuple[int, bool, int]:
    """Stamp [ns], whether there is a wrench, and grip of a serialised WamCommand: of 500 in a second one opens the hand.

    ValueError for bytes that are none.
    """
    try:
        order = "<" if data[1] & 1 else ">"
        sec, nanosec, length = struct.unpack_from(order + "iII", data, 4)
        start = 4 + (12 + length + 7) // 8 * 8
        return sec * GIGA + nanosec, any(data[start : start + 48]), data[start + 104]
    except (struct.error, IndexError):
        raise ValueError(f"{len(data)} bytes are no WamCommand") from None
