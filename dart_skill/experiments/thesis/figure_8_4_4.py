"""Section 8.4.4: how far to the side, and over which distances, the thesis's models throw balls
into baskets.

The thesis has no figure of it. It says that the global model worked "in a narrow range of angles
(up to 10-15 degree)", as beta was not consistent, and the local one "at wider angles (up to 45-50
degree)". It does not say over which distances, with how many throws, or which clock the
demonstrations had. Here both models have both clocks, that of the motion's start (8.4.3) and that
of the release, and baskets are shown and asked for in one region: to either side of 0 degrees at 2
m, or 6 degrees to either side and nearer and farther.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.common.regions import REGION, Region
from dart_skill.experiments.parallel import run_all
from dart_skill.experiments.studies.throws import taught
from dart_skill.figures import (
    BLUE,
    LIGHT,
    VERMILION,
    house_style,
    legend_below,
    letter_panels,
    save,
)
from dart_skill.session import Session
from dart_skill.skills.learning import ThrowingSkill, configuration, learn_throwing

TITLE_8_4_4 = "Success of both models against the range of angles and of distances"
ANGLES, SPREADS = (6.0, 15.0, 30.0, 45.0), (0.1, 0.25, 0.5)
"""To either side [degrees], at one distance; nearer and farther [m], at the smallest angle."""
MIDDLE, N_DEMONSTRATIONS, N_THROWS = 2.0, 13, 6
N_TEACHERS = 2
"""Unless `--teachers` says more; each takes some three minutes of a core."""
MODELS, CLOCKS = {"global": "thesis", "local": "thesis_local"}, ("start", "release")
CLAIMED = {"global": (10.0, 15.0), "local": (45.0, 50.0)}
"""Largest angles by the thesis [degrees]."""
COLOURS, STYLES = {"global": BLUE, "local": VERMILION}, {"start": "--", "release": "-"}


@dataclass(frozen=True)
class BasketCase:
    """Where baskets stand: angle to either side [degrees], and spread of the distance to either
    side [m].
    """

    angle: float
    spread: float

    @property
    def region(self) -> Region:
        return Region(
            MIDDLE - self.spread, MIDDLE + self.spread, float(np.deg2rad(self.angle)), REGION.rim
        )


CASES = (
    *(BasketCase(angle, 0.0) for angle in ANGLES),
    *(BasketCase(ANGLES[0], spread) for spread in SPREADS),
)


@dataclass(frozen=True)
class SuccessTask:
    """One teacher in one case.

    Parameters
    ----------
    throws
        Of each model with each clock.
    """

    teacher: int
    case: BasketCase
    throws: int


def successes(task: SuccessTask) -> list[list[int]]:
    """How many throws of the models (2) with the clocks (2) went in; a throw without a plan did
    not.
    """
    session = Session(task.teacher)
    try:
        rng = np.random.default_rng([task.teacher, 84])
        lessons = [
            taught(session, basket) for basket in task.case.region.spread(N_DEMONSTRATIONS, rng)
        ]
        shown = [lesson.demonstration for lesson in lessons if lesson is not None]
        baskets = task.case.region.spread(task.throws, rng)
        skills = [
            [
                learn_throwing(shown, replace(configuration(name), alignment=clock))
                for clock in CLOCKS
            ]
            for name in MODELS.values()
        ]
        return [
            [sum(_goes_in(session, skill, basket) for basket in baskets) for skill in row]
            for row in skills
        ]
    finally:
        session.close()


def _goes_in(session: Session, skill: ThrowingSkill, basket: np.ndarray) -> bool:
    try:
        return session.throw(skill.plan(basket)).ball_was_in
    except ValueError:
        return False


def compute_8_4_4(
    seed: int = 0,
    teachers: int = N_TEACHERS,
    throws: int = N_THROWS,
    cases: Sequence[BasketCase] = CASES,
) -> np.ndarray:
    """Share of throws that went in: (cases, teachers, models, clocks)."""
    if teachers < 1 or throws < 1:
        raise ValueError(f"{teachers} teachers and {throws} throws: give at least one of each")
    tasks = [
        SuccessTask(1000 * seed + teacher, case, throws)
        for case in cases
        for teacher in range(teachers)
    ]
    found = dict(run_all(successes, tasks))
    return (
        np.array([found[k] for k in range(len(tasks))]).reshape(
            len(cases), teachers, len(MODELS), len(CLOCKS)
        )
        / throws
    )


def draw_8_4_4(
    folder: str | Path, seed: int = 0, teachers: int | None = None
) -> tuple[list[Path], dict]:
    shares = compute_8_4_4(seed, N_TEACHERS if teachers is None else teachers, N_THROWS, CASES)
    with house_style():
        figure = Figure(figsize=(9.6, 4.6), layout="constrained")
        by_angle, by_distance = figure.subplots(1, 2, sharey=True)
        for model, (least, most) in CLAIMED.items():
            by_angle.axvspan(least, most, color=COLOURS[model], alpha=0.12, linewidth=0)
            by_angle.text(
                0.5 * (least + most),
                104.0,
                f"{model},\nby the thesis",
                ha="center",
                fontsize=8.0,
                color=COLOURS[model],
            )
        _draw_shares(by_angle, ANGLES, shares[: len(ANGLES)])
        by_angle.set(
            xlabel="baskets within so many degrees to either side [°]",
            ylabel="throws that went in [%]",
            ylim=(-3, 122),
        )
        by_angle.set(title=f"All baskets at {MIDDLE:g} m", yticks=range(0, 101, 25), xlim=(0, 52))
        _draw_shares(by_distance, (0.0, *SPREADS), shares[[0, *range(len(ANGLES), len(CASES))]])
        by_distance.set(
            xlabel="baskets nearer and farther by up to [m]",
            title=f"All baskets within {ANGLES[0]:g} degrees",
        )
        letter_panels(by_angle, by_distance)
        handles, labels = by_distance.get_legend_handles_labels()
        legend_below(figure, handles, labels, 4)
        figure.suptitle(
            f"Simulated teachers: {shares.shape[1]}; {N_DEMONSTRATIONS} lessons and {N_THROWS}"
            " throws each",
            x=0.01,
            ha="left",
        )
        return save(figure, folder, "figure_8_4_4"), measured_8_4_4(shares)


def _draw_shares(axes: Axes, places: Sequence[float], shares: np.ndarray) -> None:
    """Means over the teachers with their standard errors, of shares (places, teachers, models,
    clocks).
    """
    axes.axhline(0.0, color=LIGHT, linewidth=0.8)
    mean = 100.0 * shares.mean(axis=1)
    error = 100.0 * shares.std(axis=1, ddof=min(1, shares.shape[1] - 1)) / np.sqrt(shares.shape[1])
    for m, model in enumerate(MODELS):
        for c, clock in enumerate(CLOCKS):
            look: dict[str, Any] = {
                "color": COLOURS[model],
                "linestyle": STYLES[clock],
                "marker": "so"[c],
                "markersize": 4.5,
            }
            # so that no error covers another
            beside = np.asarray(places) + 0.006 * max(places) * (2 * m + c - 1.5)
            axes.errorbar(
                beside,
                mean[:, m, c],
                error[:, m, c],
                capsize=2.0,
                label=f"{model}, clock of the {clock}",
                **look,
            )


def measured_8_4_4(shares: np.ndarray) -> dict:
    """Shares that went in [%], over all teachers."""
    return {
        "teachers": shares.shape[1],
        "in_percent": {
            f"{case.angle:g} deg, {MIDDLE:g} +- {case.spread:g} m": {
                f"{model}, {clock}": round(100.0 * float(shares[k, :, m, c].mean()))
                for m, model in enumerate(MODELS)
                for c, clock in enumerate(CLOCKS)
            }
            for k, case in enumerate(CASES)
        },
    }


def describe_8_4_4(numbers: dict) -> str:
    """A line for each region."""
    columns = list(next(iter(numbers["in_percent"].values())))
    rows = [
        f"{case:22s} " + "   ".join(f"{row[name]:>{len(name)}}" for name in columns)
        for case, row in numbers["in_percent"].items()
    ]
    return "\n".join(
        [
            f"throws that went in [%], simulated teachers: {numbers['teachers']}",
            " " * 23 + "   ".join(columns),
            *rows,
        ]
    )
