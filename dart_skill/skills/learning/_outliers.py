"""How unlike the others each demonstration is: how far its way is from what the others teach for
its situation.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dart_skill.skills.learning._pose_features import VECTORS
from dart_skill.skills.learning._prepared import RATE

if TYPE_CHECKING:
    from dart_skill.skills.learning._learned import LearnedSkill
    from dart_skill.skills.learning._throwing import ThrowingSkill

FEWEST = 3
"""Fewest demonstrations of which one can be unlike the others."""
FARTHER = 3.0
"""An outlier is so many times as far away as the median of the others."""
LEAST = 0.01
"""Least distance of an outlier [m]."""

ASIDE = 0.1
"""A pace that is a little different does not count: points are compared with those of so large a
part of the way before and after.
"""


def unlike(model: LearnedSkill | ThrowingSkill) -> np.ndarray:
    """Distance of the way of each demonstration from what the others teach in its place (n,) [m]:
    root mean square; of a throw, the way until the release.

    Each is left out once and asked of a model of the others. nan for fewer than three, and where
    the others teach nothing for it.
    """
    n = len(model.ids)
    if n < FEWEST:
        return np.full(n, np.nan)
    return np.array([model.unlike_the_others(i) for i in range(n)])


def outliers(distances: np.ndarray) -> np.ndarray:
    """Which of the distances (n,) are far larger than those of the others: (n,) bool."""
    others = [np.delete(distances, i) for i in range(len(distances))]
    usual = np.array([np.nanmedian(one) if np.isfinite(one).any() else np.inf for one in others])
    return np.nan_to_num(distances) > np.maximum(FARTHER * usual, LEAST)


def unlike_movement(model: LearnedSkill, i: int) -> float:
    """Distance of the way of one movement from what the others teach for its situation [m]."""
    settings = replace(model.skill.settings, least_demonstrations=1)
    others = [one for k, one in enumerate(model.demonstrations) if k != i]
    movement, clock = model.movements[i], np.arange(0.0, model.duration, 1.0 / RATE)
    try:
        taught = type(model)(model.skill.with_settings(settings), others)
        way = taught.encoded.way(movement, clock * taught.duration / model.duration)
    except ValueError:
        return float("nan")
    shown = movement.features[:, VECTORS["position"]]
    stretched = movement.time * model.duration / movement.duration
    seen = np.column_stack([np.interp(clock, stretched, column) for column in shown.T])
    return ways_apart(seen, way)


def ways_apart(seen: np.ndarray, way: np.ndarray) -> float:
    """Distance of a way that was seen from another one (n, 3) at the same instants: root mean
    square [m].
    """
    return float(np.sqrt(np.mean(_nearest(seen, way, round(ASIDE * len(way))) ** 2)))


def _nearest(seen: np.ndarray, way: np.ndarray, window: int) -> np.ndarray:
    """Distance of each point seen (m, 3) from the nearest of those of a way (m, 3) that are at
    most so many samples before or after.
    """
    reached = np.arange(len(seen))[:, None] + np.arange(-window, window + 1)
    return np.linalg.norm(seen[:, None] - way[reached.clip(0, len(way) - 1)], axis=2).min(axis=1)
