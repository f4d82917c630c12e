"""One line of the table."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


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
