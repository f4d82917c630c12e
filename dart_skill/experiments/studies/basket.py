"""The experiment of chapter 8 at full size: a few demonstrations, no practice, baskets all around,
for several ways to learn.

    dart-skill experiment basket --models default,weighted,thesis --seeds 20

The teacher shows throws within 45 degrees and 1.5 to 2.5 m; baskets are asked for within 60
degrees and 20 % nearer and farther than that.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dart_skill.common.regions import REGION, Region
from dart_skill.experiments.studies.practice import teach
from dart_skill.session import Session
from dart_skill.skills.learning import ThrowingSkill, configuration, learn_throwing

ASKED = Region(near=0.8 * REGION.near, far=1.2 * REGION.far, side=np.deg2rad(60.0), rim=REGION.rim)
"""Where baskets are put."""
PLACES = ("as shown", "to the side", "beyond")
"""Within the demonstrated angles and distances; at its distances up to 60 degrees; at other
distances.
"""


@dataclass(frozen=True)
class BasketTask:
    """One teacher, all models learned from the same demonstrations and tried on the same baskets.

    Parameters
    ----------
    seed
        Of the teacher.
    models
        Names of configurations.
    demonstrations
        That are shown.
    throws
        Of each model.
    """

    seed: int
    models: tuple[str, ...] = ("default",)
    demonstrations: int = 13
    throws: int = 40

    def __post_init__(self) -> None:
        for name in self.models:
            configuration(name)
        if self.demonstrations < 2 or self.throws < 1:
            raise ValueError(
                f"{self.demonstrations} demonstrations and {self.throws} throws: give at least 2"
                " and 1"
            )


@dataclass(frozen=True)
class BasketRun:
    """targets (throws, 3) [m]; per model (models, throws): along and across [m], nan without a
    landing that was seen, and whether it went in; refused: whether there was no plan, or it was
    stopped; shown (demonstrations, 3): where the demonstrations landed, or their baskets.
    """

    task: BasketTask
    targets: tuple[tuple[float, ...], ...]
    along: tuple[tuple[float, ...], ...]
    across: tuple[tuple[float, ...], ...]
    in_basket: tuple[tuple[bool, ...], ...]
    refused: tuple[tuple[bool, ...], ...]
    shown: tuple[tuple[float, ...], ...]


def run(task: BasketTask) -> BasketRun:
    """Teach once; learn and throw with every model."""
    session = Session(task.seed)
    try:
        shown = teach(session, task.seed, task.demonstrations)
        targets = ASKED.spread(task.throws, np.random.default_rng([task.seed, 7]))
        thrown = []
        for name in task.models:
            skill = learn_throwing(shown, configuration(name))
            thrown.append([_throw(session, skill, target) for target in targets])
        return BasketRun(
            task,
            _rows(targets),
            tuple(tuple(one.along for one in throws) for throws in thrown),
            tuple(tuple(one.across for one in throws) for throws in thrown),
            tuple(tuple(one.in_basket for one in throws) for throws in thrown),
            tuple(tuple(one.refused for one in throws) for throws in thrown),
            _rows([one.target for one in shown]),
        )
    finally:
        session.close()


def _rows(points: Iterable[np.ndarray]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(x) for x in point) for point in points)


class _TriedThrow(NamedTuple):
    along: float
    across: float
    in_basket: bool
    refused: bool


def _throw(session: Session, skill: ThrowingSkill, target: np.ndarray) -> _TriedThrow:
    try:
        outcome = session.throw(skill.plan(target)).outcome
    except ValueError:
        return _TriedThrow(np.nan, np.nan, False, True)
    away, ahead = outcome.landing[:2] - target[:2], target[:2] / np.hypot(*target[:2])
    return _TriedThrow(
        float(away @ ahead), float(away @ [-ahead[1], ahead[0]]), bool(outcome.in_basket), False
    )


def place_of(targets: np.ndarray) -> np.ndarray:
    """Index (n,) into PLACES of targets (n, 3)."""
    distance, azimuth = (
        np.hypot(targets[:, 0], targets[:, 1]),
        np.abs(np.arctan2(targets[:, 1], targets[:, 0])),
    )
    beyond = (distance < REGION.near) | (distance > REGION.far)
    return np.where(beyond, 2, np.where(azimuth > REGION.side, 1, 0))


@dataclass(frozen=True)
class ModelThrows:
    """All throws of a model: targets (n, 3), miss along and across (n, 2) [m], in_basket (n,),
    refused (n,).
    """

    targets: np.ndarray
    miss: np.ndarray
    in_basket: np.ndarray
    refused: np.ndarray

    @property
    def error(self) -> np.ndarray:
        return np.linalg.norm(self.miss, axis=1)

    def only(self, kept: np.ndarray) -> ModelThrows:
        return ModelThrows(
            self.targets[kept], self.miss[kept], self.in_basket[kept], self.refused[kept]
        )


def throws_of(results: list[BasketRun], model: str, demonstrations: int) -> ModelThrows:
    """Throws of one model after so many demonstrations, over all runs that have them.

    Raises
    ------
    ValueError
        If none has.
    """
    parts = [
        (one, one.task.models.index(model))
        for one in results
        if model in one.task.models and one.task.demonstrations == demonstrations
    ]
    if not parts:
        raise ValueError(f"no run has the model '{model}' after {demonstrations} demonstrations")
    miss = [np.column_stack([one.along[k], one.across[k]]) for one, k in parts]
    inside, refused = (
        np.concatenate([getattr(one, name)[k] for one, k in parts])
        for name in ("in_basket", "refused")
    )
    return ModelThrows(
        np.concatenate([one.targets for one, _ in parts]), np.concatenate(miss), inside, refused
    )


def summarise(results: list[BasketRun]) -> list[dict]:
    """One row per model, number of demonstrations and place: throws, in the basket, refused,
    median and 90 % of the error [cm].
    """
    kinds = dict.fromkeys(
        (model, one.task.demonstrations) for one in results for model in one.task.models
    )
    rows = []
    for model, demonstrations in kinds:
        every = throws_of(results, model, demonstrations)
        for k, place in enumerate(PLACES):
            part = every.only(place_of(every.targets) == k)
            seen = part.error[np.isfinite(part.error)]
            median, ninety = 100 * np.percentile(seen, [50, 90]) if len(seen) else (np.nan, np.nan)
            rows.append(
                {
                    "model": model,
                    "demonstrations": demonstrations,
                    "place": place,
                    "throws": len(part.error),
                    "in": int(part.in_basket.sum()),
                    "refused": int(part.refused.sum()),
                    "median_cm": round(float(median), 3) if len(seen) else None,
                    "p90_cm": round(float(ninety), 3) if len(seen) else None,
                }  # fmt: skip
            )
    return rows


def table(results: list[BasketRun]) -> str:
    """The rows of `summarise` as text."""
    lines = [f"{'model':<18}{'shown':>6}" + "".join(f"{place:>44}" for place in PLACES)]
    rows = summarise(results)
    for first in range(0, len(rows), len(PLACES)):
        group = rows[first : first + len(PLACES)]
        lines.append(
            f"{group[0]['model']:<18}{group[0]['demonstrations']:>6}"
            + "".join(_cell(row).rjust(44) for row in group)
        )
    return "\n".join(
        [
            *lines,
            (
                "in the basket of all; median, 90 % of the landing error [cm] of those whose landing"
                " was seen; refused: no plan"
            ),
        ]
    )


def _cell(row: dict) -> str:
    errors = "" if row["median_cm"] is None else f", {row['median_cm']:.1f}, {row['p90_cm']:.1f}"
    share = (
        f"{100 * row['in'] / row['throws']:.1f} % of {row['throws']}" if row["throws"] else "none"
    )
    return share + errors + (f", {row['refused']} refused" if row["refused"] else "")
