"""Numbers of safety in config/: the limits of the commander, and the arm's own."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dart_skill.arm import WamDescription
from dart_skill.arm.check._line import Line, Verdict, graded, line

VELOCITY_LIMIT = 1.0
"""At which the WAM's safety system stops the arm (fault VL2), measured at the elbow, unless
setVelocityLimit raises it [m/s].
"""
FIRST_FORCE, STRONGEST_FORCE = 100.0, 250.0
"""Strongest force for first throws, and for any [N]."""
FASTEST, ERROR = 5.5, 0.15
"""Fastest hand [m/s] and farthest error [m] that throws at 2.5 m need."""


def safety_lines(limits: Mapping, description: WamDescription, simulated: bool) -> list[Line]:
    """Lines about the commander's parameters `limits` (config/commander.yaml) and the description
    of the arm.
    """
    force, hand, error = (
        float(limits[name]) for name in ("strongest_force", "fastest_hand", "farthest_error")
    )
    firmest = STRONGEST_FORCE if simulated else FIRST_FORCE
    lower, upper = description.of_joints("lower"), description.of_joints("upper")
    margin = float(limits["joint_margin"])
    inside = bool(np.all(upper - lower > 2.0 * margin))
    height = description.mount_height
    return [
        line(
            "strongest force", graded(force, firmest, STRONGEST_FORCE), f"{force:g} N", f"at most {firmest:g} N at first",
            "begin with a low strongest_force in config/limits.yaml, an empty hand and the nearest basket",
        ),
        _speed_line(hand, simulated),
        line(
            "farthest error", graded(error, ERROR, 0.3), f"{error:g} m", f"at most {ERROR:g} m",
            "lower farthest_error in config/commander.yaml: a throw is stopped that far from its plan",
        ),
        line(
            "joint limits", Verdict.GO if inside else Verdict.NO_GO, f"of {len(lower)} joints, margin {margin:g} rad",
            "lower below upper, with the margin between", "correct lower and upper of config/wam.yaml",
        ),
        line(
            "mount height in config/wam.yaml", graded(abs(height - 0.9), 0.9, 2.0), f"{height:g} m", "0 to 1.8 m above the floor",
            "measure it: the base of the arm above the floor",
        ),
    ]  # fmt: skip


def _speed_line(hand: float, simulated: bool) -> Line:
    asked = f"at most {FASTEST:g} m/s" + (
        "" if simulated else f"; {VELOCITY_LIMIT:g} m/s until the arm's limit is raised"
    )
    verdict = graded(hand, FASTEST, 8.0)
    if verdict is Verdict.GO and not simulated and hand > VELOCITY_LIMIT:
        verdict = Verdict.WARN
    remedy = (
        "the arm stops at its own limit (fault VL2): raise it with setVelocityLimit after each"
        " power-up, begin with less in fastest_hand"
    )
    return line("fastest hand", verdict, f"{hand:g} m/s", asked, remedy)
