"""Whether demonstrations fit together: at each instant, each is compared with what the others
predict for its task.

On the common clock each movement variable is regressed on the task over the other demonstrations.
So a throw at a far basket is not taken for a bad one. With few demonstrations their median is used
instead. The residual is judged relative to the residuals of all demonstrations. Medians are used
throughout, so that bad demonstrations do not change the scale. First a constant lag is looked for:
a demonstration that only starts late must be aligned, not left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_finite, as_number, as_samples
from dart_skill.movement._time import as_stamps

N_INSTANTS = 100
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
