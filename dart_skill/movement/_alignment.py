"""Whether demonstrations fit together: at each instant, each is compared with what the others
predict for its task.

On the common clock each movement variable is regressed on the task over the other demonstrations.
So a throw at a far basket is not taken for a bad one. With few demonstrations their median is used
instead. The residual is judged relative to the residuals of all demonstrations. Medians are used
throughout, so that bad demonstrations do not change the scale. First a constant lag is looked for:
a demonstration that only starts late must be aligned, not left out.

For a new task (thesis 8.4.2 and chapter 9) there are three ways to weight demonstrations: all
count alike; only those with the n nearest tasks count; or all count with a Gaussian of the
distance between the tasks. The width of this Gaussian is found by cross-validation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_finite, as_number, as_samples, as_vector
from dart_skill.movement._time import as_stamps

N_INSTANTS = 100
"""Number of instants at which demonstrations are compared."""
LEAST_FOR_REGRESSION = 3
"""A regression on the task needs so many demonstrations per unknown; with fewer, the median of the
others is the prediction.
"""


@dataclass(frozen=True)
class AlignmentFit:
    """How a demonstration fits the others.

    Parameters
    ----------
    deviation
        Rms of its residual over time and variables, relative to the usual residual.
    lag : [s]
        Shift in time with which it fits best, positive if it is late.
    deviation_at_lag
        The deviation with this shift.
    reason
        Why it does not fit; empty if it fits.
    """

    deviation: float
    lag: float
    deviation_at_lag: float
    reason: str = ""

    @property
    def fits(self) -> bool:
        return not self.reason


def check_alignment(
    times: Sequence[ArrayLike],
    positions: Sequence[ArrayLike],
    tasks: ArrayLike | None = None,
    *,
    largest_deviation: float = 6.0,
    largest_lag: float = 0.1,
    tolerance: ArrayLike = 0.0,
) -> list[AlignmentFit]:
    """One `AlignmentFit` for each of at least 4 demonstrations.

    Parameters
    ----------
    times
        For each demonstration its stamps (n_i,) [s] on the common clock.
    positions
        For each demonstration its movement variables (n_i, d).
    tasks : (n_demonstrations, q)
        What they were made for, such as the distance of the target; default None.
    largest_deviation
        Float, default 6. Largest deviation that fits, relative to the usual residual.
    largest_lag
        Float, default 0.1 [s]. Largest lag that is accepted.
    tolerance
        One number or one per variable (d,), default 0. The usual residual is taken to be at least
        this large, in the unit of the variable. Without it, demonstrations that are almost equal
        would have a usual residual near zero.

    Raises
    ------
    ValueError
        If tasks are missing, or the demonstrations have no time in common.
    """
    clocks, paths = _checked(times, positions)
    n = len(clocks)
    tasks = np.zeros((n, 0)) if tasks is None else as_samples(tasks, "tasks")
    if len(tasks) != n:
        raise ValueError(f"{n} demonstrations need as many tasks, got {len(tasks)}")
    largest_deviation, largest_lag = (
        as_number(largest_deviation, "largest_deviation"),
        as_number(largest_lag, "largest_lag"),
    )
    first, last = max(clock[0] for clock in clocks), min(clock[-1] for clock in clocks)
    if last <= first:
        raise ValueError(
            f"the demonstrations have no time in common: one starts at {first:g} s, another ends"
            f" at {last:g} s"
        )
    grid = np.linspace(first, last, N_INSTANTS)
    curves = np.stack(
        [_resampled(clock, path, grid) for clock, path in zip(clocks, paths, strict=True)]
    )
    scale = np.median(np.abs(curves - np.median(curves, axis=(0, 1))), axis=(0, 1))
    scale = np.where(scale > 0.0, scale, 1.0)
    curves, paths = curves / scale, [path / scale for path in paths]
    left_over = np.stack([curves[i] - _prediction(curves, tasks, i) for i in range(n)])
    usual = np.median(np.sqrt(np.mean(left_over**2, axis=1)), axis=0)
    usual = np.maximum(
        usual, np.broadcast_to(as_finite(tolerance, "tolerance"), scale.shape) / scale
    )
    usual = np.maximum(usual, 1e-9 * np.ptp(curves, axis=(0, 1)) + np.finfo(float).tiny)
    shifts = np.linspace(-4 * largest_lag, 4 * largest_lag, 81)
    return [
        _judged(
            i, clocks, paths, curves, tasks, grid, usual, shifts, largest_deviation, largest_lag
        )
        for i in range(n)
    ]


def _checked(
    times: Sequence[ArrayLike], positions: Sequence[ArrayLike]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    if len(times) != len(positions) or len(times) < 4:
        raise ValueError(
            f"at least 4 demonstrations with a clock each are needed, got {len(positions)} and"
            f" {len(times)} clocks"
        )
    paths = [
        as_samples(path, f"positions of demonstration {i}") for i, path in enumerate(positions)
    ]
    clocks = [as_stamps(clock, len(path), 2) for clock, path in zip(times, paths, strict=True)]
    for i, path in enumerate(paths):
        if path.shape[1] != paths[0].shape[1]:
            raise ValueError(
                f"demonstration {i} has {path.shape[1]} movement variables, the first has"
                f" {paths[0].shape[1]}"
            )
    return clocks, paths


def _resampled(clock: np.ndarray, path: np.ndarray, grid: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(grid, clock, column) for column in path.T])


def _prediction(curves: np.ndarray, tasks: np.ndarray, i: int) -> np.ndarray:
    """Curve (n_instants, d) that the other demonstrations predict for the task of demonstration i."""
    others = np.arange(len(curves)) != i
    if tasks.shape[1] == 0 or others.sum() < LEAST_FOR_REGRESSION * (tasks.shape[1] + 1):
        return np.median(curves[others], axis=0)
    design = np.column_stack([np.ones(others.sum()), tasks[others] - tasks[i]])
    flat = curves[others].reshape(others.sum(), -1)
    return _robust_intercept(design, flat).reshape(curves.shape[1:])


def _robust_intercept(design: np.ndarray, values: np.ndarray, rounds: int = 5) -> np.ndarray:
    """Value at task zero of a linear fit that gives outlying rows less weight (iteratively
    reweighted, Cauchy weights).
    """
    weights = np.ones(len(design))
    for _ in range(rounds):
        root = np.sqrt(weights)[:, None]
        solution, *_ = np.linalg.lstsq(root * design, root * values, rcond=None)
        size = np.sqrt(np.mean((values - design @ solution) ** 2, axis=1))
        weights = 1.0 / (1.0 + (size / max(np.median(size), np.finfo(float).tiny)) ** 2)
    return solution[0]


def _judged(
    i: int,
    clocks: list[np.ndarray],
    paths: list[np.ndarray],
    curves: np.ndarray,
    tasks: np.ndarray,
    grid: np.ndarray,
    usual: np.ndarray,
    shifts: np.ndarray,
    largest_deviation: float,
    largest_lag: float,
) -> AlignmentFit:
    wanted = _prediction(curves, tasks, i)

    def deviation(shift: float) -> float:
        return float(
            np.sqrt(
                np.mean(((_resampled(clocks[i] - shift, paths[i], grid) - wanted) / usual) ** 2)
            )
        )

    now, at = deviation(0.0), [deviation(shift) for shift in shifts]
    best = int(np.argmin(at))
    lag = float(shifts[best]) if at[best] < 0.8 * now else 0.0
    least = min(now, at[best])
    reason = ""
    if now > largest_deviation and abs(lag) > largest_lag and least < 0.5 * now:
        reason = (
            f"it is {abs(lag):.2f} s {'late' if lag > 0 else 'early'}: align it at another instant"
        )
    elif now > largest_deviation:
        reason = (
            f"it strays {now:.1f} times as far as usual from what the others predict (limit"
            f" {largest_deviation:g}): leave it out"
        )
    return AlignmentFit(now, lag, least, reason)


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
