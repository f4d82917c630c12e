"""What a run of any skill amounts to: trial by trial and in figures, as JSON and as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dart_skill.skills.protocol import Situation, TaskOutcome


@dataclass(frozen=True)
class SkillResult:
    """One trial: for which situation, what came of it, and what was wrong with its execution,
    empty if nothing was.

    * outcome: what the skill says.
    """

    situation: Situation
    outcome: TaskOutcome
    message: str = ""

    @property
    def error_m(self) -> float | None:
        """How far it was off [m], None if nobody saw it."""
        return float(self.outcome.error) if math.isfinite(self.outcome.error) else None

    @property
    def why(self) -> str:
        """Why it failed; empty for a success."""
        return "" if self.outcome.success else self.message or self.outcome.reason

    def to_json(self) -> dict[str, Any]:
        """Plain values; what was not seen is None."""
        return {
            "situation": situation_json(self.situation),
            "success": bool(self.outcome.success),
            "error_m": self.error_m,
            "message": self.why,
        }


@dataclass(frozen=True)
class SkillSummary:
    """A whole run.

    * skill: its name; seed: of everything random; bag: folder of its bag; layout: of the graph.
    * demonstrations: how many were learned from; attempts: guided movements that they took.
    * trials: in order.
    * wall_seconds: of the run, the start of the graph included [s].
    * real_time_factor: simulated over wall-clock time of the trials; None if nobody measured it.
    """

    skill: str
    seed: int
    bag: str
    demonstrations: int
    attempts: int
    trials: tuple[SkillResult, ...]
    wall_seconds: float
    layout: str = ""
    real_time_factor: float | None = None

    @property
    def succeeded(self) -> int:
        """How many trials succeeded."""
        return sum(bool(one.outcome.success) for one in self.trials)

    @property
    def median_error_m(self) -> float | None:
        """Median of the errors that were seen; None without one."""
        errors = [one.error_m for one in self.trials if one.error_m is not None]
        return float(np.median(errors)) if errors else None

    def to_json(self) -> dict[str, Any]:
        """The run as a dictionary that strict JSON can hold: no NaN, no infinity."""
        return {
            "skill": self.skill,
            "seed": self.seed,
            "bag": self.bag,
            "layout": self.layout,
            "demonstrations": self.demonstrations,
            "attempts": self.attempts,
            "tried": len(self.trials),
            "succeeded": self.succeeded,
            "median_error_m": self.median_error_m,
            "wall_seconds": self.wall_seconds,
            "real_time_factor": self.real_time_factor,
            "trials": [one.to_json() for one in self.trials],
        }


def situation_json(situation: Situation) -> dict[str, Any]:
    """Poses of the bodies, and the numbers, by name."""
    poses = {
        role: {"position": pose.position.tolist(), "quaternion": pose.quaternion.tolist()}
        for role, pose in situation.poses.items()
    }
    return {**poses, **situation.numbers}


def skill_table(summary: SkillSummary) -> str:
    """Trials as aligned text, and a line about all of them."""
    rows = [("trial", "error [mm]", "result", "")]
    for number, one in enumerate(summary.trials, start=1):
        error = "-" if one.error_m is None else f"{1e3 * one.error_m:.1f}"
        rows.append((str(number), error, "done" if one.outcome.success else "failed", one.why))
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    lines = [
        "  ".join(
            [*(cell.rjust(width) for cell, width in zip(row[:3], widths, strict=True)), row[3]]
        ).rstrip()
        for row in rows
    ]
    return "\n".join([*lines, footer(summary)])


def footer(summary: SkillSummary) -> str:
    """The trials in a line: `place 10/10, median 0.7 mm`."""
    text = f"{summary.skill} {summary.succeeded}/{len(summary.trials)}"
    return (
        text
        if summary.median_error_m is None
        else f"{text}, median {1e3 * summary.median_error_m:.1f} mm"
    )


def in_words(
    situation: Situation, roles: Sequence[str] = (), units: Mapping[str, str] | None = None
) -> str:
    """Where bodies are: `holder at 0.61, 0.12, 1.18 m, turned by +23 degrees`, and numbers:
    `duration 2.4 s`.

    roles: of the bodies to name, default all. units: of numbers, by name (`Skill.units`).
    """
    said = []
    for role, pose in situation.poses.items():
        if roles and role not in roles:
            continue
        x, y, z = pose.position
        turn = math.degrees(math.atan2(pose.rotation[1, 0], pose.rotation[0, 0]))
        said.append(
            f"{role} at {x:.2f}, {y:.2f}, {z:.2f} m"
            + (f", turned by {turn:+.0f} degrees" if abs(turn) > 0.5 else "")
        )
    said += [
        f"{name} {number + 0.0:.3g} {(units or {}).get(name, '')}".rstrip()
        for name, number in situation.numbers.items()
    ]
    return "; ".join(said) or "nothing is said of it"
