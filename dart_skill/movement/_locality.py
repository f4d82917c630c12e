"""Global, local and weighted learning (thesis 8.4.2 and chapter 9): how much each demonstration
counts for a new task.

There are three ways: all count alike; only those with the n nearest tasks count; or all count with
a Gaussian of the distance between the tasks. The width of this Gaussian is found by
cross-validation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number, as_samples, as_vector

NEGLIGIBLE = 1e-4
"""A demonstration with less weight than this gets weight 0: it would only make the fit slower."""


def nearest_weights(tasks: ArrayLike, task: ArrayLike, n_nearest: int) -> np.ndarray:
    """1 for the n demonstrations whose tasks (n_demonstrations, q) are nearest to a task (q,), 0
    for the rest (8.4.2).
    """
    distance = _distances(tasks, task)
    n_nearest = min(as_count(n_nearest, "n_nearest"), len(distance))
    weights = np.zeros(len(distance))
    weights[np.argsort(distance, kind="stable")[:n_nearest]] = 1.0
    return weights


def gaussian_weights(tasks: ArrayLike, task: ArrayLike, width: float) -> np.ndarray:
    """Weights exp(-distance^2 / (2 width^2)) of the tasks (n_demonstrations, q) for a task (q,),
    chapter 9; negligible ones are 0.
    """
    weights = np.exp(-0.5 * (_distances(tasks, task) / as_number(width, "width")) ** 2)
    return np.where(weights < NEGLIGIBLE, 0.0, weights)


def _distances(tasks: ArrayLike, task: ArrayLike) -> np.ndarray:
    tasks = as_samples(tasks, "tasks")
    return np.linalg.norm(tasks - as_vector(task, "task", tasks.shape[1]), axis=1)


@dataclass(frozen=True)
class WidthChoice:
    """Result of `choose_width`.

    Parameters
    ----------
    width
        The one with the best score, in the unit of the tasks.
    widths : (m,)
        All that were tried.
    scores : (m,)
        Nan where a demonstration could not be predicted.
    """

    width: float
    widths: np.ndarray
    scores: np.ndarray


def choose_width(
    tasks: ArrayLike, widths: ArrayLike, score: Callable[[int, np.ndarray], float]
) -> WidthChoice:
    """Width of `gaussian_weights` by leave-one-out cross-validation over at least 3
    demonstrations.

    Only a width that predicts every demonstration can be chosen.

    Parameters
    ----------
    tasks : (n_demonstrations, q)
        What each demonstration was made for.
    widths : (m,)
        To choose from, positive, in the unit of the tasks.
    score
        Function of i and weights (n_demonstrations,), weights[i] = 0. It learns a model with these
        weights and returns how well the model predicts demonstration i: higher is better, nan if
        no model could be learned.

    Raises
    ------
    ValueError
        If there is none.
    """
    tasks, widths = as_samples(tasks, "tasks"), as_vector(widths, "widths")
    if len(tasks) < 3:
        raise ValueError(
            f"{len(tasks)} demonstrations are too few to leave one out: give at least 3"
        )
    scores = np.array(
        [
            np.mean([_left_out(tasks, i, width, score) for i in range(len(tasks))])
            for width in widths
        ]
    )
    if np.isnan(scores).all():
        raise ValueError(
            f"no width of {widths.tolist()} predicts every demonstration from the others: try"
            " wider ones"
        )
    return WidthChoice(float(widths[np.nanargmax(scores)]), widths, scores)


def _left_out(
    tasks: np.ndarray, i: int, width: float, score: Callable[[int, np.ndarray], float]
) -> float:
    weights = gaussian_weights(tasks, tasks[i], width)
    weights[i] = 0.0
    return score(i, weights) if weights.any() else np.nan
