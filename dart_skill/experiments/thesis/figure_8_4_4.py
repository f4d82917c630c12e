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
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.common.regions import REGION, Region
from dart_skill.experiments.parallel import all_of
from dart_skill.experiments.studies.throws import taught
from dart_skill.figures import BLUE, LIGHT, VERMILION, legend_below, letter_panels
from dart_skill.session import Session
from dart_skill.skills.learning import ThrowingSkill, configuration, learn_throwing

MIDDLE = 2.0
"""Distance of the baskets about which they are nearer and farther [m]."""
CASES = ((6.0, 0.0), (15.0, 0.0), (30.0, 0.0), (45.0, 0.0), (6.0, 0.1), (6.0, 0.25), (6.0, 0.5))
"""Where baskets stand: angle to either side [degrees], and spread of the distance to either side
[m]; first those at one distance.
"""
MODELS = {"global": "thesis", "local": "thesis_local"}
"""Configuration of each model."""
CLOCKS = {"start": "--", "release": "-"}
"""Style of the line of each clock."""
CLAIMED = {"global": (BLUE, 10.0, 15.0), "local": (VERMILION, 45.0, 50.0)}
"""Colour of each model, and its largest angles by the thesis [degrees]."""


def region_of(angle: float, spread: float) -> Region:
    """Where the baskets of a case stand."""
    side = float(np.deg2rad(angle))
    return Region(MIDDLE - spread, MIDDLE + spread, side, REGION.rim)


def successes(
    task: tuple[int, float, float], demonstrations: int, throws: int
) -> list[list[list[int]]]:
    """Whether the throws of the models (2) with the clocks (2) went in, of one teacher in one
    case; a throw without a plan did not. In a list of one, as `all_of` has it.
    """
    teacher, *case = task
    session, region = Session(teacher), region_of(*case)
    rng = np.random.default_rng([teacher, 84])
    try:
        lessons = [taught(session, basket) for basket in region.spread(demonstrations, rng)]
        shown = [lesson.demonstration for lesson in lessons if lesson is not None]
        baskets = region.spread(throws, rng)
        return [
            [
                [
                    _number_in(
                        session,
                        learn_throwing(shown, replace(configuration(name), alignment=clock)),
                        baskets,
                    )
                    for clock in CLOCKS
                ]
                for name in MODELS.values()
            ]
        ]
    finally:
        session.close()


def _number_in(session: Session, skill: ThrowingSkill, baskets: np.ndarray) -> int:
    number = 0
    for basket in baskets:
        try:
            number += session.throw(skill.plan(basket)).ball_was_in
        except ValueError:
            continue
    return number


def draw_8_4_4(
    seed: int = 0,
    teachers: int = 2,
    demonstrations: int = 13,
    throws: int = 6,
    cases: Sequence[tuple[float, float]] = CASES,
) -> tuple[Figure, dict]:
    """Measured: shares that went in [%], over all teachers; each takes some three minutes of a
    core.
    """
    if teachers < 1 or throws < 1:
        raise ValueError(f"{teachers} teachers and {throws} throws: give at least one of each")
    tasks = [(1000 * seed + n, *case) for case in cases for n in range(teachers)]
    done = all_of(successes, tasks, 0, demonstrations=demonstrations, throws=throws)
    shares = 100.0 * np.reshape(done, (len(cases), teachers, len(MODELS), len(CLOCKS))) / throws
    figure = Figure(figsize=(9.6, 4.6), layout="constrained")
    by_angle, by_distance = figure.subplots(1, 2, sharey=True)
    for model, (colour, least, most) in CLAIMED.items():
        by_angle.axvspan(least, most, color=colour, alpha=0.12, linewidth=0)
        look: dict[str, Any] = {"ha": "center", "fontsize": 8.0, "color": colour}
        by_angle.text(0.5 * (least + most), 104.0, f"{model},\nby the thesis", **look)
    at_one = [k for k, (_, spread) in enumerate(cases) if not spread]
    _draw_shares(by_angle, [cases[k][0] for k in at_one], shares[at_one])
    by_angle.set(xlabel="baskets within so many degrees to either side [°]", ylim=(-3, 122))
    by_angle.set(ylabel="throws that went in [%]", yticks=range(0, 101, 25), xlim=(0, 52))
    by_angle.set_title(f"All baskets at {MIDDLE:g} m")
    apart = [0, *range(len(at_one), len(cases))]
    _draw_shares(by_distance, [cases[k][1] for k in apart], shares[apart])
    by_distance.set_xlabel("baskets nearer and farther by up to [m]")
    by_distance.set_title(f"All baskets within {cases[0][0]:g} degrees")
    letter_panels(by_angle, by_distance)
    handles, labels = by_distance.get_legend_handles_labels()
    legend_below(figure, handles, labels, 4)
    said = f"{demonstrations} lessons and {throws} throws each"
    figure.suptitle(f"Simulated teachers: {teachers}; {said}", x=0.01, ha="left")
    return figure, {
        "teachers": teachers,
        "in_percent": {
            f"{angle:g} deg, {MIDDLE:g} +- {spread:g} m": {
                f"{model}, {clock}": round(float(shares[k, :, m, c].mean()))
                for m, model in enumerate(MODELS)
                for c, clock in enumerate(CLOCKS)
            }
            for k, (angle, spread) in enumerate(cases)
        },
    }


def _draw_shares(axes: Axes, places: Sequence[float], shares: np.ndarray) -> None:
    """Means over the teachers with their standard errors, of shares (places, teachers, models,
    clocks).
    """
    axes.axhline(0.0, color=LIGHT, linewidth=0.8)
    mean, teachers = shares.mean(axis=1), shares.shape[1]
    error = shares.std(axis=1, ddof=min(1, teachers - 1)) / np.sqrt(teachers)
    for m, model in enumerate(MODELS):
        for c, (clock, style) in enumerate(CLOCKS.items()):
            # so that no error covers another
            beside = np.asarray(places) + 0.006 * max(places) * (2 * m + c - 1.5)
            look: dict[str, Any] = {"color": CLAIMED[model][0], "linestyle": style}
            look |= {"marker": "so"[c], "markersize": 4.5, "capsize": 2.0}
            label = f"{model}, clock of the {clock}"
            axes.errorbar(beside, mean[:, m, c], error[:, m, c], label=label, **look)


def describe_8_4_4(numbers: dict) -> str:
    """A line for each region."""
    columns = list(next(iter(numbers["in_percent"].values())))
    rows = [
        f"{case:22s} " + "   ".join(f"{row[name]:>{len(name)}}" for name in columns)
        for case, row in numbers["in_percent"].items()
    ]
    head = f"throws that went in [%], simulated teachers: {numbers['teachers']}"
    return "\n".join([head, " " * 23 + "   ".join(columns), *rows])
