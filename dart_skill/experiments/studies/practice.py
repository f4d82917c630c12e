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

from typing import Any, NamedTuple

import numpy as np

from dart_skill.common.regions import REGION
from dart_skill.experiments.studies import throws
from dart_skill.recording import Demonstration
from dart_skill.session import Session
from dart_skill.simulation import CHANGES, changed
from dart_skill.skills.learning import Unreachable, configuration
from dart_skill.skills.practice import Curriculum, PractisingSkill
from dart_skill.skills.protocol import PRACTICE_METHODS

CANDIDATES = 48
"""Baskets among which the curriculum chooses."""
DEFAULTS: dict[str, Any] = {
    "method": "both",
    "demonstrations": 13,
    "throws": 50,
    "change": "none",
    "change_after": 0,
    "tested_after": [0, 1, 2, 5, 10, 20, 50],
    "tests": 10,
    "again": 0,
    "arm": "ideal",
    "configuration": "default",
}
"""Options of a task: method of practice, one of PRACTICE_METHODS; how many throws are shown and
practised; change of the plant, one of CHANGES, after so many throws; numbers of practised throws after each of which
there is a test, and throws of it; throws of one plan for each basket of the last test, whose
scatter is what no better plan can take away; arm of config/fleet.yaml, or fleet: the one that the
seed draws; configuration of the skill.
"""


def practice_task(seed: int, **options: Any) -> dict:
    """A task of `run`: demonstrations, then practised throws, with tests between them.

    Parameters
    ----------
    seed
        Of the simulated teacher, the arm and the baskets.
    options
        Those of DEFAULTS that differ.

    Raises
    ------
    ValueError
        For a method, a change or a configuration that does not exist.
    """
    task = {"seed": seed, **DEFAULTS, **options}
    for name, choices in (("method", PRACTICE_METHODS), ("change", CHANGES)):
        if task[name] not in choices:
            raise ValueError(
                f"there is no {name} '{task[name]}': choose one of {', '.join(choices)}"
            )
    configuration(task["configuration"])
    task["tested_after"] = [n for n in task["tested_after"] if n <= task["throws"]]
    return task


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


def run(task: dict) -> dict:
    """One teacher, one arm, one way to practise.

    Returns
    -------
    dict
        errors [m] and in_basket (throws,) of the practised throws; test_errors [m] and
        test_in_basket of each test, its throws; notes: why throws did not come about; spreads: of
        each basket of the last test, how far throws of one plan come down from their centre [m].
        Errors are nan where no throw came about or no landing was seen.
    """
    seed = task["seed"]
    session = Session.on_arm(throws.arm_of(task["arm"], seed), seed)
    try:
        shown = teach(session, seed, task["demonstrations"])
        rng, choosing, testing = (np.random.default_rng([seed, part]) for part in (4, 5, 6))
        learned_as = configuration(task["configuration"])
        skill, curriculum = (
            PractisingSkill(shown, learned_as, task["method"], rng=rng),
            Curriculum(),
        )
        done: list[PractisedThrow] = []
        tests: list[list[PractisedThrow]] = []
        baskets = np.empty((0, 3))
        for n in range(task["throws"] + 1):
            if n == task["change_after"] and task["change"] != "none":
                session.plant.change(changed(session.plant.settings, task["change"]))
            if n in task["tested_after"]:
                baskets = REGION.spread(task["tests"], testing)
                tests.append([practise(session, skill, one, learn=False) for one in baskets])
            if n < task["throws"]:
                target = _choose(skill, curriculum, REGION.spread(CANDIDATES, choosing))
                done.append(practise(session, skill, target))
                if done[-1].came_about:
                    curriculum.tell(target, done[-1].miss)
                else:
                    curriculum.give_up(target)
        again = task["again"]
        return {
            "task": task,
            "errors": [one.error for one in done],
            "in_basket": [one.in_basket for one in done],
            "test_errors": [[one.error for one in test] for test in tests],
            "test_in_basket": [[one.in_basket for one in test] for test in tests],
            "notes": [f"throw {n}: {one.note}" for n, one in enumerate(done, 1) if one.note],
            "spreads": [_spread(session, skill, one, again) for one in baskets if again],
        }
    finally:
        session.close()


def _spread(
    session: Session, skill: PractisingSkill, target: np.ndarray, throws: int
) -> list[float]:
    """Distances (throws,) [m] of the hits of one plan from their centre, as they would be from the
    centre of very many.
    """
    try:
        plan = skill.plan(target)
        hits = np.array([session.throw(plan).outcome.landing for _ in range(throws)])
    except ValueError:
        return [np.nan] * throws
    distances = np.linalg.norm(hits - hits.mean(axis=0), axis=1) * np.sqrt(throws / (throws - 1))
    return distances.tolist()


def _choose(skill: PractisingSkill, curriculum: Curriculum, baskets: np.ndarray) -> np.ndarray:
    """The basket at which a throw teaches most, of those for which there is a plan."""
    for k in curriculum.order(baskets):
        try:
            skill.plan(baskets[k])
        except Unreachable:
            continue
        return baskets[k]
    raise ValueError(f"none of {len(baskets)} baskets can be reached")


class PractisedThrow(NamedTuple):
    """error [m]; miss [m]: the repeatable part of it; came_about: whether there was a throw."""

    error: float
    in_basket: bool
    miss: float
    note: str
    came_about: bool


def practise(
    session: Session, skill: PractisingSkill, target: np.ndarray, learn: bool = True
) -> PractisedThrow:
    """One throw; only one that is practised is learned from."""
    try:
        plan = skill.plan(target, explore=learn)
        trial = session.throw(plan)
    except ValueError as reason:
        return PractisedThrow(np.nan, False, np.nan, str(reason), False)
    error, inside = float(trial.outcome.landing_error), trial.outcome.in_basket
    if not learn:
        return PractisedThrow(error, inside, error, "", True)
    told = skill.tell(plan, trial.demonstration)
    miss = np.hypot(*told.left) if np.isfinite(told.left).all() else error
    return PractisedThrow(error, inside, float(miss), "" if told.kept else told.reason, True)


KIND = ("method", "demonstrations", "change")
"""What makes a group of runs."""


def summarise(results: list[dict]) -> list[dict]:
    """One row per method, demonstrations, change and number of practised throws: throws of the
    tests, share in the basket, median and 90 % of their error [cm], how many had none, and in how
    many runs the mean error was larger than before by more than two standard errors of the
    difference (`worse`); after the last ones floor_cm, the median of what one plan scatters, if
    that was seen.
    """
    groups: dict[tuple, list[dict]] = {}
    for one in results:
        groups.setdefault(tuple(one["task"][name] for name in KIND), []).append(one)
    rows = []
    for kind, group in groups.items():
        scatter = np.array([one for run in group for part in run["spreads"] for one in part])
        scatter = scatter[np.isfinite(scatter)]
        floor = round(100.0 * float(np.median(scatter)), 3) if len(scatter) else None
        tested = group[0]["task"]["tested_after"]
        for k, after in enumerate(tested):
            errors = 100 * np.array([error for one in group for error in one["test_errors"][k]])
            seen, quantiles = errors[np.isfinite(errors)], [np.nan, np.nan]
            if len(seen):
                quantiles = np.percentile(seen, [50, 90]).round(3).tolist()
            inside = [went_in for one in group for went_in in one["test_in_basket"][k]]
            row: dict[str, Any] = dict(zip(KIND, kind, strict=True))
            row |= {"after": after, "runs": len(group), "throws": len(errors)}
            row |= {"in": float(np.mean(inside)), "without_error": len(errors) - len(seen)}
            row |= {"median_cm": quantiles[0], "p90_cm": quantiles[1]}
            tests = [one["test_errors"] for one in group]
            row["worse"] = sum(is_worse(test[0], test[k]) for test in tests)
            row["floor_cm"] = floor if k == len(tested) - 1 else None
            rows.append(row)
    return rows


def is_worse(before: list[float], after: list[float]) -> bool:
    """Whether the mean of `after` is larger by more than two standard errors of the difference
    (Welch); nan does not count.
    """
    samples = [np.array(errors)[np.isfinite(errors)] for errors in (before, after)]
    if min(len(sample) for sample in samples) < 2:
        return False
    doubt = np.sqrt(sum(sample.var(ddof=1) / len(sample) for sample in samples))
    return bool(samples[1].mean() - samples[0].mean() > 2.0 * doubt)


def table(results: list[dict]) -> str:
    """The rows of `summarise` as text: one line per method, one column per number of practised
    throws.
    """
    rows = summarise(results)
    counts = sorted({row["after"] for row in rows})
    with_floor = any(row["floor_cm"] is not None for row in rows)
    heads = [f"{f'after {n}':>23}" for n in counts] + [f"{'floor':>8}"] * with_floor
    lines = [f"{'method':<11}{'shown':>6}  {'change':<15}{'runs':>5}" + "".join(heads)]
    for kind in dict.fromkeys(tuple(row[name] for name in KIND) for row in rows):
        own = {row["after"]: row for row in rows if tuple(row[name] for name in KIND) == kind}
        cells = "".join(_cell(own.get(n)).rjust(23) for n in counts)
        last, (method, demonstrations, change) = own[max(own)], kind
        cells += "" if last["floor_cm"] is None else f"{last['floor_cm']:>8.3f}"
        lines.append(f"{method:<11}{demonstrations:>6}  {change:<15}{last['runs']:>5}{cells}")
    said = (
        "median and 90 % of the landing error [cm], share in the basket, of throws from which"
        " nothing was learned, runs that got worse"
    )
    floor = "; floor: median distance from the centre of one plan's hits" if with_floor else ""
    return "\n".join([*lines, said + floor])


def _cell(row: dict | None) -> str:
    if row is None:
        return "-"
    worse = f" {row['worse']}" if row["after"] else ""
    return f"{row['median_cm']:.2f} {row['p90_cm']:.1f} {100 * row['in']:.0f} %{worse}"
