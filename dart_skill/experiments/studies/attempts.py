"""Attempts at one basket: how near does each throw come, and after how many is one near enough?

    dart-skill experiment attempts --arms fleet --first-seed 2000 --seeds 40

Every seed has its own teacher, arm, demonstrations and baskets. Each way to practise throws at each
basket again and again, and begins anew at the next one, with what the teacher showed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dart_skill.common.regions import REGION
from dart_skill.experiments.studies.practice import practise, teach
from dart_skill.experiments.studies.throws import arm_of
from dart_skill.session import Session
from dart_skill.skills.learning import configuration
from dart_skill.skills.practice import PractisingSkill
from dart_skill.skills.protocol import PRACTICE_METHODS

DEFAULTS: dict[str, Any] = {
    "methods": list(PRACTICE_METHODS),
    "demonstrations": 13,
    "baskets": 3,
    "attempts": 6,
    "arm": "ideal",
    "configuration": "default",
}
"""Options of a task: methods of practice; how many throws are shown, how many baskets thrown at,
and how often each; arm of config/fleet.yaml, or fleet: the one that the seed draws; configuration
of the skill.
"""


def attempts_task(seed: int, **options: Any) -> dict:
    """A task of `run`.

    Parameters
    ----------
    seed
        Of the simulated teacher, the arm and the baskets.
    options
        Those of DEFAULTS that differ.

    Raises
    ------
    ValueError
        For a method or a configuration that does not exist.
    """
    task = {"seed": seed, **DEFAULTS, **options}
    for method in task["methods"]:
        if method not in PRACTICE_METHODS:
            raise ValueError(
                f"there is no method '{method}': choose among {', '.join(PRACTICE_METHODS)}"
            )
    configuration(task["configuration"])
    return task


def run(task: dict) -> dict:
    """One teacher, one arm, every method.

    Returns
    -------
    dict
        errors: by method, (baskets, attempts) [m], nan where no throw came about.
    """
    seed = task["seed"]
    session = Session.on_arm(arm_of(task["arm"], seed), seed)
    try:
        shown = teach(session, seed, task["demonstrations"])
        learned_as = configuration(task["configuration"])
        baskets = REGION.spread(task["baskets"], np.random.default_rng([seed, 7]))
        errors: dict[str, list[list[float]]] = {}
        for method in task["methods"]:
            errors[method] = []
            for basket in baskets:
                rng = np.random.default_rng([seed, 8])
                skill = PractisingSkill(shown, learned_as, method, rng=rng)
                thrown = [practise(session, skill, basket) for _ in range(task["attempts"])]
                errors[method].append([one.error for one in thrown])
        return {"task": task, "errors": errors}
    finally:
        session.close()


def summarise(results: list[dict], within: float) -> list[dict]:
    """One row a method: of each attempt the median error [cm] and the share of baskets with a throw
    that came as near as `within` [m]; share of baskets with such a throw until then.
    """
    rows = []
    for method in results[0]["task"]["methods"]:
        errors = np.array([one for run in results for one in run["errors"][method]], dtype=float)
        near = errors <= within  # a throw that did not come about is not near
        rows.append(
            {
                "method": method,
                "baskets": len(errors),
                "median_cm": [_median_cm(one) for one in errors.T],
                "near": near.mean(axis=0).round(3).tolist(),
                "near_until_then": np.logical_or.accumulate(near, axis=1)
                .mean(axis=0)
                .round(3)
                .tolist(),
            }
        )
    return rows


def _median_cm(errors: np.ndarray) -> float | None:
    """Median of those that are known of errors (n,) [m]; None of none."""
    known = errors[np.isfinite(errors)]
    return round(100.0 * float(np.median(known)), 2) if len(known) else None


def table(results: list[dict], within: float) -> str:
    """The rows of `summarise` as text."""
    rows = summarise(results, within)
    attempts = range(1, results[0]["task"]["attempts"] + 1)
    head = "".join(f"{f'attempt {n}':>13}" for n in attempts)
    lines = [
        f"{rows[0]['baskets']} baskets of {len(results)} arms; median error [cm], and throws within"
        f" {100.0 * within:g} cm of the basket's centre [%]",
        f"{'method':<11}{head}",
    ]
    for row in rows:
        cells = (
            f"{'none' if middle is None else f'{middle:.1f}'}, {100.0 * share:.0f} %"
            for middle, share in zip(row["median_cm"], row["near"], strict=True)
        )
        lines.append(f"{row['method']:<11}" + "".join(f"{cell:>13}" for cell in cells))
    return "\n".join(lines)
