"""The lines of a check as text that is no wider than a terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from textwrap import wrap

from dart_skill.arm.check._check import ArmReport
from dart_skill.arm.check._heard import Grade, Line

WIDEST = 120
"""Greatest width of the text, however wide the terminal is [letters]."""
NARROWEST = 24
"""Least width of what was measured [letters]."""
INDENT = " " * 7
"""Before the name of a check, and before what to do about it."""


def as_text(report: ArmReport, width: int) -> str:
    """Each line with what was measured and asked, and below it what to do about it; their numbers.

    Parameters
    ----------
    width
        Of the terminal [letters].
    """
    width = min(width, WIDEST)
    longest = max(len(one.check) for one in report.lines)
    rows = [row for one in report.lines for row in _rows(one, longest, width)]
    counts = Counter(one.verdict for one in report.lines)
    total = ", ".join(f"{counts[grade]} {grade.value}" for grade in Grade if counts[grade])
    return "\n".join([*rows, total])


def _rows(one: Line, longest: int, width: int) -> Iterator[str]:
    begin = f"{one.verdict.value:<{len(INDENT)}}{one.check:<{longest}}  "
    text = f"{one.measured} (asked: {one.asked})"
    first, *more = wrap(text, max(NARROWEST, width - len(begin)), break_on_hyphens=False)
    yield begin + first
    yield from (" " * len(begin) + part for part in more)
    yield from (
        INDENT + part for part in wrap(one.remedy, width - len(INDENT), break_on_hyphens=False)
    )
