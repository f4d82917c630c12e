"""How unlike the others each demonstration is: how far its way is from what the others teach for
its situation.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dart_skill.skills.learning._learned import LearnedSkill
from dart_skill.skills.learning._learning import AnySkill, learn
from dart_skill.skills.learning._movement_model import RATE
from dart_skill.skills.learning._pose_features import VECTORS
from dart_skill.skills.learning._reactive import ReactiveSkill

FEWEST = 3
"""Fewest demonstrations of which one can be unlike the others."""
FARTHER, LEAST = 3.0, 0.01
"""An outlier is so many times as far away as the median of the others, and at least so far [m]."""

ASIDE = 0.1
"""A pace that is a little different does not count: points are compared with those of so large a
part of the way before and after.
"""


def unlike(model: AnySkill) -> np.ndarray:
    """Distance of the way of each demonstration from what the others teach in its place (n,) [m]:
    root mean square.

    Each is left out once and asked of a model of the others. nan for fewer than three, and where
    the others teach nothing for it.
    """
    n = len(model.movements)
    if n < FEWEST:
        return np.full(n, np.nan)
    return np.array([_distance(model, i) for i in range(n)])


def outliers(distances: np.ndarray) -> np.ndarray:
    """Which of the distances (n,) are far larger than those of the others: (n,) bool."""
    others = [np.delete(distances, i) for i in range(len(distances))]
    usual = np.array([np.nanmedian(one) if np.isfinite(one).any() else np.inf for one in others])
    return np.nan_to_num(distances) > np.maximum(FARTHER * usual, LEAST)


def _distance(model: AnySkill, i: int) -> float:
    settings = replace(model.skill.settings, least_demonstrations=1)
    others = [one for k, one in enumerate(model.demonstrations) if k != i]
    try:
        way = _way(learn(type(model.skill)(settings), others), model, i)
    except ValueError:
        return float("nan")
    movement, clock = model.movements[i], np.arange(len(way)) / RATE
    shown = movement.features[:, VECTORS["position"]]
    stretched = movement.time * model.duration / movement.duration
    seen = np.column_stack([np.interp(clock, stretched, column) for column in shown.T])
    return float(np.sqrt(np.mean(_nearest(seen, way, round(ASIDE * len(way))) ** 2)))


def _nearest(seen: np.ndarray, way: np.ndarray, window: int) -> np.ndarray:
    """Distance of each point seen (m, 3) from the nearest of those of a way (m, 3) that are at
    most so many samples before or after.
    """
    reached = np.arange(len(seen))[:, None] + np.arange(-window, window + 1)
    return np.linalg.norm(seen[:, None] - way[reached.clip(0, len(way) - 1)], axis=2).min(axis=1)


def _way(others: AnySkill, model: AnySkill, i: int) -> np.ndarray:
    """Where the others would lead the hand in the situation of demonstration i (m, 3), at RATE on
    the clock of the model.
    """
    clock = np.arange(0.0, model.duration, 1.0 / RATE)
    if isinstance(others, LearnedSkill):
        path = others.plan(model.movements[i].situation).path
        stretched = path.time * model.duration / others.duration
        return np.column_stack([np.interp(clock, stretched, column) for column in path.position.T])
    assert isinstance(model, ReactiveSkill)
    return _reacted(others, model, i, clock)


def _reacted(others: ReactiveSkill, model: ReactiveSkill, i: int, clock: np.ndarray) -> np.ndarray:
    """Where the mean of the others is, phase for phase, among the bodies as they moved in
    demonstration i.
    """
    movement = model.movements[i]
    inputs = list(model.skill.inputs(movement.situation)) or None
    first, last = others.model.ends
    frames = zip(*model.frames_along(movement, clock), strict=True)
    phases = first + clock * (last - first) / model.duration
    return np.array(
        [
            others.model.moment(list(here), phase, inputs).state[:3]
            for here, phase in zip(frames, phases, strict=True)
        ]
    )
