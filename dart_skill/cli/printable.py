"""Texts of strangers, as names in a bag, on a terminal: what would move its cursor, colour it or
clear it is written as what it is.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dart_skill.recording.imports import RecordingMapping


def printable(text: str) -> str:
    """The text with every control character but the end of a line spelled out, as \\x1b."""
    return "".join(
        one if one.isprintable() or one == "\n" else one.encode("unicode_escape").decode()
        for one in text
    )


def in_a_line(text: str) -> str:
    """The printable text in one line."""
    return printable("; ".join(line.strip() for line in text.splitlines() if line.strip()))


def tell_bag_faults(bag: Path, mapping: RecordingMapping | None = None) -> None:
    """Say on standard error what a glance at a bag finds, for what becomes no recording with
    faults of its own.

    Parameters
    ----------
    mapping
        None for ours.
    """
    from dart_skill.recording.imports import OWN, bag_faults, fault_lines

    for line in fault_lines(bag_faults(bag, mapping or OWN)):
        print(printable(line), file=sys.stderr)
