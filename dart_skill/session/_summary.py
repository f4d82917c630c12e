"""The result of a run: trial by trial and in figures, as JSON and as a table.

A trial whose result the cameras did not see has no error. Median and 90th percentile are over the
errors that were seen (linear between order statistics).
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.common.files import new_file
from dart_skill.common.situation import Pose, Situation
from dart_skill.skills.protocol import Skill, SkillWords, TaskOutcome

if TYPE_CHECKING:
    from dart_skill.session._darts import DartsRun

LANDINGS = "landings"
"""`Skill.told_by` of a skill that throws at a body: its trials are told by where they landed."""


@dataclass(frozen=True)
class TrialResult:
    """One trial.

    Parameters
    ----------
    situation
        In which it was made.
    outcome
        What the skill says of it.
    message
        What was wrong with its execution, empty if nothing was.
    landing
        (3,), where what was thrown came down [m]; None if it was not seen, or nothing was thrown.
    """

    situation: Situation
    outcome: TaskOutcome
    message: str = ""
    landing: tuple[float, ...] | None = None

    @classmethod
    def of_throw(
        cls,
        target: Sequence[float] | np.ndarray,
        landing: Sequence[float] | np.ndarray | None,
        error: float | None,
        in_basket: bool,
        message: str = "",
    ) -> TrialResult:
        """The result of a throw at a basket.

        Parameters
        ----------
        target
            (3,), centre of the rim [m].
        landing
            (3,), where the ball crossed the plane of the rim [m]; None if it was not seen.
        error
            Horizontal distance of the two [m]; None if the landing was not seen.
        in_basket
            As the cameras saw it.
        message
            What went wrong, empty if nothing did.
        """
        if landing is None or error is None or not np.isfinite([*landing, error]).all():
            landing, error = None, math.nan
        return cls(
            Situation({"basket": Pose(np.array(target, dtype=float))}),
            TaskOutcome(bool(in_basket), float(error)),
            message,
            None if landing is None else tuple(float(value) for value in landing),
        )

    @property
    def success(self) -> bool:
        """Whether the trial did what it was for."""
        return bool(self.outcome.success)

    @property
    def error_m(self) -> float | None:
        """How far it was off [m]; None if that was not seen."""
        return float(self.outcome.error) if math.isfinite(self.outcome.error) else None

    @property
    def why(self) -> str:
        """Why it failed; empty for a success."""
        return "" if self.success else self.message or self.outcome.reason

    @property
    def target(self) -> np.ndarray:
        """Place (3,) of the first body of the situation [m]: of a throw the centre of the rim."""
        return next(iter(self.situation.poses.values())).position

    @property
    def distance(self) -> float:
        """Distance of the target from the base axis [m]."""
        return math.hypot(*self.target[:2])

    @property
    def azimuth(self) -> float:
        """Azimuth of the target [rad]."""
        return math.atan2(self.target[1], self.target[0])

    def in_words(self, words: SkillWords) -> str:
        """Success, error and what there is to say: `done, 0.7 mm`, `out, landing not seen`; where
        the error was not seen, a reason that is known says more than that.

        Parameters
        ----------
        words
            Of the skill.
        """
        unit, scale = words.unit
        done = words.result[not self.success]
        if self.error_m is None:
            return f"{done}, {self.why or self.message or words.unseen}"
        return f"{done}, {scale * self.error_m:.1f} {unit} {self.why or self.message}".rstrip()

    def to_json(self) -> dict[str, Any]:
        """Plain values; what was not seen is None."""
        return {
            "situation": self.situation.to_json(),
            "success": self.success,
            "error_m": self.error_m,
            "message": self.why,
        }

    def to_json_of_throw(self) -> dict[str, Any]:
        """A throw at a basket as plain values; what was not seen is None."""
        return {
            "target": self.target.tolist(),
            "landing": None if self.landing is None else list(self.landing),
            "error_m": self.error_m,
            "in": self.success,
            "message": self.message,
        }


@dataclass(frozen=True)
class RunSummary:
    """A whole run.

    Parameters
    ----------
    skill
        That was shown and tried.
    seed
        Of everything random.
    bag
        Folder of its bag.
    demonstrations
        How many were learned from.
    attempts
        Guided movements that they took.
    trials
        In order of time.
    wall_seconds
        Of the run, the start of the graph included [s].
    layout
        Of the graph.
    real_time_factor
        Simulated over wall-clock time, of the whole job for throws at baskets, of the trials for
        other skills; None if it was not measured.
    trial_real_time_factor
        The same of the trials.
    darts
        Aims and points of darts, and the leg that was played; None for other skills.
    """

    skill: Skill
    seed: int
    bag: str
    demonstrations: int
    attempts: int
    trials: tuple[TrialResult, ...]
    wall_seconds: float
    layout: str = ""
    real_time_factor: float | None = None
    trial_real_time_factor: float | None = None
    darts: DartsRun | None = None

    @property
    def succeeded(self) -> int:
        """Number of trials that succeeded."""
        return sum(one.success for one in self.trials)

    @property
    def median_error_m(self) -> float | None:
        """Median of the errors that were seen; None without one."""
        return error_quantile(self.trials, 0.5)

    def to_json(self) -> dict[str, Any]:
        """The run as a dictionary that strict JSON can hold: no NaN, no infinity."""
        landings = self.skill.told_by == LANDINGS
        factor = self.real_time_factor if landings else self.trial_real_time_factor
        return {
            "skill": self.skill.name,
            "seed": int(self.seed),
            "bag": str(self.bag),
            "layout": self.layout,
            "demonstrations": self.demonstrations,
            "attempts": self.attempts,
            "tried": len(self.trials),
            "succeeded": self.succeeded,
            "median_error_m": self.median_error_m,
            "wall_seconds": _finite(self.wall_seconds),
            "real_time_factor": _finite(factor),
            **(self._for_readers_of_throws() if landings else {}),
            "trials": [one.to_json() for one in self.trials],
            **({} if self.darts is None else self.darts.to_json(seed=False)),
        }

    def _for_readers_of_throws(self) -> dict[str, Any]:
        """Entries that only throws have. Older readers know `thrown`, `in` and `throws`, which say
        the same as `tried`, `succeeded` and `trials`.
        """
        return {
            "throw_real_time_factor": _finite(self.trial_real_time_factor),
            "landings_seen": sum(one.landing is not None for one in self.trials),
            "p90_error_m": error_quantile(self.trials, 0.9),
            "thrown": len(self.trials),
            "in": self.succeeded,
            "throws": [one.to_json_of_throw() for one in self.trials],
        }

    def table(self) -> str:
        """The trials as aligned text, and a line about all of them."""
        if self.darts is not None:
            return self.darts.table()
        landings = self.skill.told_by == LANDINGS
        rows = _landing_rows(self.trials) if landings else _trial_rows(self.trials)
        notes = [one.message if landings else one.why for one in self.trials]
        head = "note" if landings and any(notes) else ""
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = [
            f"{'  '.join(map(str.rjust, row, widths))}  {' '.join(note.split())}".rstrip()
            for row, note in zip(rows, [head, *notes], strict=True)
        ]
        return "\n".join([*lines, self.footer()])

    def footer(self) -> str:
        """The trials in a line: `place 10/10, median 0.7 mm`, or of throws as `throws_in_a_line`."""
        if self.skill.told_by == LANDINGS:
            return throws_in_a_line(self.trials)
        text = f"{self.skill.name} {self.succeeded}/{len(self.trials)}"
        median = self.median_error_m
        return text if median is None else f"{text}, median {1e3 * median:.1f} mm"


def error_quantile(trials: Iterable[TrialResult], share: float) -> float | None:
    """Error [m] that a share of the trials whose error was seen stays below; None if none was."""
    errors = [one.error_m for one in trials if one.error_m is not None]
    return float(np.quantile(errors, share)) if errors else None


def throws_in_a_line(throws: Sequence[TrialResult]) -> str:
    """The throws in a line: `in 10/10, median 1.1 cm, 90 % 2.0 cm`, and how many landings were
    seen if not all.
    """
    if not throws:
        return "no throws"
    seen = sum(one.error_m is not None for one in throws)
    parts = [f"in {sum(one.success for one in throws)}/{len(throws)}"]
    if seen:
        parts += [
            f"median {_in_cm(error_quantile(throws, 0.5))} cm",
            f"90 % {_in_cm(error_quantile(throws, 0.9))} cm",
        ]
    if seen < len(throws):
        parts.append(f"landing seen {seen}/{len(throws)}")
    return ", ".join(parts)


def write_summary(summary: dict[str, Any], folder: Path) -> Path:
    """Write `summary.json`, as `RunSummary.to_json` gives it, into a folder, which is made if need
    be.

    Returns
    -------
    Path
        Its path.
    """
    path = Path(folder) / "summary.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    with new_file(path, replace=True) as file:
        file.write((json.dumps(summary, indent=1, allow_nan=False) + "\n").encode())
    return path


def _trial_rows(trials: Sequence[TrialResult]) -> list[list[str]]:
    rows = [["trial", "error [mm]", "result"]]
    for number, one in enumerate(trials, start=1):
        error = "-" if one.error_m is None else f"{1e3 * one.error_m:.1f}"
        rows.append([str(number), error, "done" if one.success else "failed"])
    return rows


def _landing_rows(throws: Sequence[TrialResult]) -> list[list[str]]:
    head = "throw|target x|y|z [m]|azimuth [deg]|distance [m]|landing x|y [m]|error [cm]|result"
    rows = [head.split("|")]
    for number, one in enumerate(throws, start=1):
        landing = ["not seen", "-"]
        if one.landing is not None:
            landing = [f"{value:.3f}" for value in one.landing[:2]]
        rows.append(
            [
                str(number),
                *(f"{value:.3f}" for value in one.target),
                f"{math.degrees(one.azimuth):+.1f}",
                f"{one.distance:.2f}",
                *landing,
                _in_cm(one.error_m),
                "in" if one.success else "out",
            ]
        )
    return rows


def _in_cm(error: float | None) -> str:
    return "-" if error is None else f"{100.0 * error:.1f}"


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
