"""What is wrong with a recording, and what was done about it, for people and for programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

MOST_OF_A_KIND = 4
"""Most faults of one kind and body that have a line of their own."""
GAP = "gap"
NOTE = "note"
BAG = "bag"
BACKWARDS = "backwards"
UNSTAMPED = "unstamped"
UNIT = "unit"
SET_BACK = "set_back"
BURSTS = "bursts"
TIMELESS = (UNSTAMPED, UNIT, SET_BACK, BURSTS)
"""Kinds of stamps that tell no time: not filled in, in another unit, of a counter that overflows
or a clock that was set, of receipt.
"""
INFORMATION = (GAP, NOTE)
"""Kinds that are no fault: a body that the cameras do not see is not published, and what else is
good to know.
"""


@dataclass(frozen=True)
class Fault:
    """What is wrong with the poses of a body, the states of the joints, or their stamps.

    Parameters
    ----------
    kind
        Of poses not_finite, zero_pose, not_unit, repeated_stamp, backwards, stale, jitter, swap,
        leap, outlier; of joints those of `joint_streams`; of stamps those of `clocks`; BAG of the
        bag itself; or what is no fault: of INFORMATION.
    body
        Its name; `joints` for the arm's; of a bag its file or topic.
    start_ns, stop_ns
        Stamps of the first and last sample that is concerned.
    count
        Of samples; of a gap, of missing frames.
    message
        What is wrong and what was done, for people.
    remedy
        What mends it in a mapping, below the body's name, or what to do about a bag; empty if
        nothing does.
    repaired
        Whether what is left is right, as far as can be told; samples that were left out count as
        repaired if nothing was known of them.
    """

    kind: str
    body: str
    start_ns: int
    stop_ns: int
    count: int
    message: str
    repaired: bool
    remedy: str = ""

    @classmethod
    def of(
        cls,
        kind: str,
        body: str,
        stamps: np.ndarray,
        message: str,
        repaired: bool = False,
        remedy: str = "",
        count: int | None = None,
    ) -> Fault:
        """A fault of some samples.

        Parameters
        ----------
        kind, body, message, repaired, remedy
            As of the class.
        stamps
            Of the samples that are concerned (n,) [ns].
        count
            Of samples, if not n.
        """
        first, last = (int(stamps.min()), int(stamps.max())) if len(stamps) else (0, 0)
        count = len(stamps) if count is None else count
        return cls(kind, body, first, last, count, message, repaired, remedy)

    @property
    def is_information(self) -> bool:
        """Whether it is no fault but good to know."""
        return self.kind in INFORMATION

    @property
    def is_of_time(self) -> bool:
        """Whether its stamps tell so little that nothing can be said of what it does."""
        return self.kind in TIMELESS and not self.repaired


def fault_lines(faults: Iterable[Fault]) -> list[str]:
    """A line for each fault, and for each body how often it was not seen."""
    faults = list(faults)
    of_bag = [in_words(fault) for fault in faults if fault.kind == BAG]
    faults = [fault for fault in faults if fault.kind != BAG]
    gaps: Counter[str] = Counter()
    missing: Counter[str] = Counter()
    for fault in (fault for fault in faults if fault.kind == GAP):
        gaps[fault.body] += 1
        missing[fault.body] += fault.count
    lines, shown, of_kind = (
        [],
        Counter[tuple](),
        Counter((f.kind, f.body, f.repaired) for f in faults),
    )
    for fault in (fault for fault in faults if fault.kind != GAP):
        kind = fault.kind, fault.body, fault.repaired
        shown[kind] += 1
        if of_kind[kind] <= MOST_OF_A_KIND or shown[kind] < MOST_OF_A_KIND:
            lines.append(f"{1e-9 * fault.start_ns:10.3f} s  {in_words(fault)}")
        elif shown[kind] == of_kind[kind]:
            more = of_kind[kind] - MOST_OF_A_KIND + 1
            lines.append(
                f"{1e-9 * fault.start_ns:10.3f} s  {in_words(fault)}; {more - 1} more of the kind"
                f" '{fault.kind}' before it"
            )
    return (
        of_bag
        + lines
        + [
            f"{body} was not seen {number} times, {missing[body]} frames in all"
            for body, number in gaps.items()
        ]
    )


def in_words(fault: Fault) -> str:
    """What is wrong with which body, and what mends it.

    Parameters
    ----------
    fault
        The fault.
    """
    if fault.kind == BAG:
        return f"{fault.body}: {fault.message}" + (f" ({fault.remedy})" if fault.remedy else "")
    remedy = f"; in a mapping: {fault.body}: {{{fault.remedy}}}" if fault.remedy else ""
    return (
        f"{fault.body}:"
        f" {fault.message}{remedy}{'' if fault.repaired or fault.is_information else ' (NOT REPAIRED)'}"
    )


def spans(mask: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of each stretch of true values of a mask (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(first), int(last) - 1) for first, last in edges.reshape(-1, 2)]
