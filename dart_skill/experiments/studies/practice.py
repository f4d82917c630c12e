"""Practice in process: does the arm get better with its own throws, how fast, and how does it
recover from a change that is not announced?

    dart-skill experiment practice --methods residual,bootstrap,both,power,none --demonstrations 13 --throws 50
    dart-skill experiment practice --arms fleet --first-seed 2000 --seeds 40 --methods residual --tested-after 0,10,50

Every seed has its own teacher, demonstrations, baskets and sensor noise; all methods of a seed
start from the same demonstrations. The practised throws go where the curriculum sends them; how
good the arm is after n of them is measured by further throws at baskets of a test set, from which
nothing is learned.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dart_skill.common.regions import REGION
from dart_skill.experiments.studies import throws
from dart_skill.recording import Demonstration
from dart_skill.session import Session
from dart_skill.simulation import CHANGES, changed
from dart_skill.skills.learning import Unreachable, configuration
from dart_skill.skills.practice import METHODS, Curriculum, PractisingSkill

CANDIDATES = 48
"""Baskets among which the curriculum chooses."""


@dataclass(frozen=True)
class PracticeTask:
    """One run: demonstrations, then practised throws, with tests between them.

    Parameters
    ----------
    seed
        Of the simulated teacher, the arm and the baskets.
    method
        Of practice, one of METHODS.
    demonstrations, throws
        How many are shown, and how many are practised.
    change
        One of CHANGES, after `change_after` throws.
    tests
        Throws of each test, after each number of practised throws in `tested_after`.
    again
        Throws of one plan for each basket of the last test: their scatter is what no better plan
        can take away.
    arm
        Of config/fleet.yaml, or fleet: the one that the seed draws.
    configuration
        Of the skill.
    """

    seed: int
    method: str = "both"
    demonstrations: int = 13
    throws: int = 50
    change: str = "none"
    change_after: int = 0
    tested_after: tuple[int, ...] = (0, 1, 2, 5, 10, 20, 50)
    tests: int = 10
    again: int = 0
    arm: str = "ideal"
    configuration: str = "default"

    def __post_init__(self) -> None:
        for name, choices in (("method", METHODS), ("change", CHANGES)):
            if getattr(self, name) not in choices:
                raise ValueError(
                    f"there is no {name} '{getattr(self, name)}': choose one of"
                    f" {', '.join(choices)}"
                )
        configuration(self.configuration)
        object.__setattr__(
            self, "tested_after", tuple(n for n in self.tested_after if n <= self.throws)
        )


@dataclass(frozen=True)
class PracticeRun:
    """What one run gave; errors are nan where no throw came about or no landing was seen.

    Parameters
    ----------
    task
        Of the run.
    errors, in_basket
        (throws,) of the practised throws [m].
    test_errors, test_in_basket
        Of each test, its throws [m].
    notes
        Why throws did not come about.
    spreads
        Of each basket of the last test, how far throws of one plan come down from their centre
        [m].
    """

    task: PracticeTask
    errors: tuple[float, ...]
    in_basket: tuple[bool, ...]
    test_errors: tuple[tuple[float, ...], ...]
    test_in_basket: tuple[tuple[bool, ...], ...]
    notes: tuple[str, ...] = ()
    spreads: tuple[tuple[float, ...], ...] = ()


def teach(session: Session, seed: int, wanted: int) -> list[Demonstration]:
    """As many demonstrations as wanted, each of a throw that went in.

    Parameters
    ----------
    session
        Where the person teaches.

    Raises
    ------
    ValueError
        If the person fails too often.
    """
    kept = throws.teach(session, seed, wanted)
    if len(kept) < wanted:
        raise ValueError(f"seed {seed}: only {len(kept)} of {wanted} demonstrations succeeded")
    return kept


def run(task: PracticeTask) -> PracticeRun:
    """One teacher, one arm, one way to practise."""
    session = Session.on_arm(throws.arm_of(task.arm, task.seed), task.seed)
    try:
        return _run(task, session)
    finally:
        session.close()


def _run(task: PracticeTask, session: Session) -> PracticeRun:
    shown, rng = (
        teach(session, task.seed, task.demonstrations),
        np.random.default_rng([task.seed, 4]),
    )
    skill = PractisingSkill(shown, configuration(task.configuration), task.method, rng=rng)
    curriculum, choosing, testing = (
        Curriculum(),
        np.random.default_rng([task.seed, 5]),
        np.random.default_rng([task.seed, 6]),
    )
    thrown: list[_PractisedThrow] = []
    tests: list[list[_PractisedThrow]] = []
    notes: list[str] = []
    baskets = np.empty((0, 3))
    for n in range(task.throws + 1):
        if n == task.change_after and task.change != "none":
            session.plant.change(changed(session.plant.settings, task.change))
        if n in task.tested_after:
            baskets = REGION.spread(task.tests, testing)
            tests.append([_throw(session, skill, target) for target in baskets])
        if n == task.throws:
            break
        target = _choose(skill, curriculum, REGION.spread(CANDIDATES, choosing))
        throw = _throw(session, skill, target, learn=True)
        if throw.came_about:
            curriculum.tell(target, throw.miss)
        else:
            curriculum.give_up(target)
        thrown.append(throw)
        notes += [f"throw {n + 1}: {throw.note}"] if throw.note else []
    spreads = (
        tuple(_spread(session, skill, target, task.again) for target in baskets)
        if task.again
        else ()
    )
    return PracticeRun(
        task,
        tuple(throw.error for throw in thrown),
        tuple(throw.in_basket for throw in thrown),
        tuple(tuple(throw.error for throw in test) for test in tests),
        tuple(tuple(throw.in_basket for throw in test) for test in tests),
        tuple(notes),
        spreads,
    )


def _spread(
    session: Session, skill: PractisingSkill, target: np.ndarray, throws: int
) -> tuple[float, ...]:
    """Distances (throws,) [m] of the hits of one plan from their centre, as they would be from the
    centre of very many.
    """
    try:
        plan = skill.plan(target)
        hits = np.array([session.throw(plan).outcome.landing for _ in range(throws)])
    except ValueError:
        return (np.nan,) * throws
    distances = np.linalg.norm(hits - hits.mean(axis=0), axis=1) * np.sqrt(throws / (throws - 1))
    return tuple(distances.tolist())


def _choose(skill: PractisingSkill, curriculum: Curriculum, baskets: np.ndarray) -> np.ndarray:
    """The basket where throws are worst, of those for which there is a plan."""
    for k in curriculum.order(baskets):
        try:
            skill.plan(baskets[k])
        except Unreachable:
            continue
        return baskets[k]
    raise ValueError(f"none of {len(baskets)} baskets can be reached")


class _PractisedThrow(NamedTuple):
    """error [m]; miss [m]: the repeatable part of it; came_about: whether there was a throw."""

    error: float
    in_basket: bool
    miss: float
    note: str
    came_about: bool


def _throw(
    session: Session, skill: PractisingSkill, target: np.ndarray, learn: bool = False
) -> _PractisedThrow:
    """One throw; only one that is practised is learned from."""
    try:
        plan = skill.plan(target, explore=learn)
        trial = session.throw(plan)
    except ValueError as reason:
        return _PractisedThrow(np.nan, False, np.nan, str(reason), False)
    error = float(trial.outcome.landing_error)
    if not learn:
        return _PractisedThrow(error, trial.outcome.in_basket, error, "", True)
    told = skill.tell(plan, trial.demonstration)
    miss = np.hypot(*told.left) if np.isfinite(told.left).all() else error
    return _PractisedThrow(
        error, trial.outcome.in_basket, float(miss), "" if told.kept else told.reason, True
    )


def summarise(results: list[PracticeRun]) -> list[dict]:
    """One row per method, demonstrations, change and number of practised throws: throws of the
    tests, share in the basket, median and 90 % of their error [cm], how many had none, and in how
    many runs the mean error was larger than before by more than two standard errors of the
    difference (`worse`); after the last ones floor_cm, the median of what one plan scatters, if
    that was seen.
    """
    groups: dict[tuple, list[PracticeRun]] = {}
    for one in results:
        groups.setdefault((one.task.method, one.task.demonstrations, one.task.change), []).append(
            one
        )
    rows = []
    for (method, demonstrations, change), group in groups.items():
        for k, after in enumerate(group[0].task.tested_after):
            errors = 100 * np.array([error for one in group for error in one.test_errors[k]])
            inside = [went_in for one in group for went_in in one.test_in_basket[k]]
            quantiles = (
                np.nanpercentile(errors, [50, 90]) if np.isfinite(errors).any() else [np.nan] * 2
            )
            rows.append(
                {
                    "method": method,
                    "demonstrations": demonstrations,
                    "change": change,
                    "after": after,
                    "runs": len(group),
                    "throws": len(errors),
                    "in": float(np.mean(inside)),
                    "median_cm": round(float(quantiles[0]), 3),
                    "p90_cm": round(float(quantiles[1]), 3),
                    "without_error": int(np.isnan(errors).sum()),
                    "worse": sum(
                        _is_worse(one.test_errors[0], one.test_errors[k]) for one in group
                    ),
                    "floor_cm": _floor(group)
                    if k == len(group[0].task.tested_after) - 1
                    else None,
                }  # fmt: skip
            )
    return rows


def _is_worse(before: tuple[float, ...], after: tuple[float, ...]) -> bool:
    """Whether the mean of `after` is larger by more than two standard errors of the difference
    (Welch); nan does not count.
    """
    samples = [np.array(errors)[np.isfinite(errors)] for errors in (before, after)]
    if min(len(sample) for sample in samples) < 2:
        return False
    doubt = np.sqrt(sum(sample.var(ddof=1) / len(sample) for sample in samples))
    return bool(samples[1].mean() - samples[0].mean() > 2.0 * doubt)


def _floor(group: list[PracticeRun]) -> float | None:
    distances = [
        distance
        for one in group
        for spread in one.spreads
        for distance in spread
        if np.isfinite(distance)
    ]
    return round(100.0 * float(np.median(distances)), 3) if distances else None


def table(results: list[PracticeRun]) -> str:
    """The rows of `summarise` as text: one line per method, one column per number of practised
    throws.
    """
    rows = summarise(results)
    counts = sorted({row["after"] for row in rows})
    with_floor = any(row["floor_cm"] is not None for row in rows)
    heads = [f"{f'after {n}':>23}" for n in counts] + [f"{'floor':>8}"] * with_floor
    lines = [f"{'method':<11}{'shown':>6}  {'change':<15}{'runs':>5}" + "".join(heads)]
    for method, demonstrations, change in dict.fromkeys(
        (row["method"], row["demonstrations"], row["change"]) for row in rows
    ):
        own = {
            row["after"]: row
            for row in rows
            if (row["method"], row["demonstrations"], row["change"])
            == (method, demonstrations, change)
        }
        cells = "".join(_cell(own.get(n)).rjust(23) for n in counts)
        floor = own[max(own)]["floor_cm"]
        cells += "" if floor is None else f"{floor:>8.3f}"
        lines.append(
            f"{method:<11}{demonstrations:>6} "
            f" {change:<15}{next(iter(own.values()))['runs']:>5}{cells}"
        )
    what = (
        "median and 90 % of the landing error [cm], share in the basket, of throws from which"
        " nothing was learned, runs that got worse"
    )
    return "\n".join(
        [
            *lines,
            what
            + (
                "; floor: median distance from the centre of one plan's hits" if with_floor else ""
            ),
        ]
    )


def _cell(row: dict | None) -> str:
    worse = f" {row['worse']}" if row and row["after"] else ""
    return (
        f"{row['median_cm']:.2f} {row['p90_cm']:.1f} {100 * row['in']:.0f} %{worse}"
        if row
        else "-"
    )
