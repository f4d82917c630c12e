"""Do the demonstrations fit together? Each is compared with what the others predict for its task, instant by instant.

On the shared clock every movement variable is regressed on the task over the other demonstrations (a mean where there are too few for
more), so that a throw at a far basket is not taken for a bad one. What is left over is judged against what is left over of all the others:
medians throughout, so that the bad ones do not set the measure. A constant lag is looked for first, because demonstrations that merely
start late need another clock, not another teacher.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_finite, as_number, as_samples
from dart_skill.movement._time import as_stamps

N_INSTANTS = 100
LEAST_FOR_REGRESSION = 3
"""Demonstrations per unknown that a regression on the task needs; with fewer, the median of the others is the prediction."""


@dataclass(frozen=True)
class Fit:
    """How a demonstration fits the others.

    deviation: rms over time and variables of what the others do not predict, in units of what is usual; lag [s] at which it fits best,
    positive when it is late; deviation_at_lag: what remains then; reason: empty if it fits.
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
) -> list[Fit]:
    """One `Fit` per demonstration of stamps (n_i,) on the shared clock and movement variables (n_i, d), at least 4 of them.

    tasks (n_demonstrations, q): what they were made for, such as the distance of the target. largest_deviation: in units of what is
    usual; largest_lag [s]; tolerance: rms that is taken for usual at least, one number or one per variable, so that demonstrations that
    hardly differ do not make each other strict.
    """
    clocks, paths = _checked(times, positions)
    n = len(clocks)
    tasks = np.zeros((n, 0)) if tasks is None else as_samples(tasks, "tasks")
    if len(tasks) != n:
        raise ValueError(f"{n} demonstrations need as many tasks, got {len(tasks)}")
    largest_deviation, largest_lag = as_number(largest_deviation, "largest_deviation"), as_number(largest_lag, "largest_lag")
    first, last = max(clock[0] for clock in clocks), min(clock[-1] for clock in clocks)
    if last <= first:
        raise ValueError(f"the demonstrations have no time in common: one starts at {first:g} s, another ends at {last:g} s")
    grid = np.linspace(first, last, N_INSTANTS)
    curves = np.stack([_resampled(clock, path, grid) for clock, path in zip(clocks, paths, strict=True)])
    scale = np.median(np.abs(curves - np.median(curves, axis=(0, 1))), axis=(0, 1))
    scale = np.where(scale > 0.0, scale, 1.0)
    curves, paths = curves / scale, [path / scale for path in paths]
    left_over = np.stack([curves[i] - _prediction(curves, tasks, i) for i in range(n)])
    usual = np.median(np.sqrt(np.mean(left_over**2, axis=1)), axis=0)
    usual = np.maximum(usual, np.broadcast_to(as_finite(tolerance, "tolerance"), scale.shape) / scale)
    usual = np.maximum(usual, 1e-9 * np.ptp(curves, axis=(0, 1)) + np.finfo(float).tiny)
    shifts = np.linspace(-4 * largest_lag, 4 * largest_lag, 81)
    return [_judged(i, clocks, paths, curves, tasks, grid, usual, shifts, largest_deviation, largest_lag) for i in range(n)]


def _checked(times, positions) -> tuple[list[np.ndarray], list[np.ndarray]]:
    if len(times) != len(positions) or len(times) < 4:
        raise ValueError(f"at least 4 demonstrations with a clock each are needed, got {len(positions)} and {len(times)} clocks")
    paths = [as_samples(path, f"positions of demonstration {i}") for i, path in enumerate(positions)]
    clocks = [as_stamps(clock, len(path), 2) for clock, path in zip(times, paths, strict=True)]
    for i, path in enumerate(paths):
        if path.shape[1] != paths[0].shape[1]:
            raise ValueError(f"demonstration {i} has {path.shape[1]} movement variables, the first has {paths[0].shape[1]}")
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
    """Value at task zero of a linear fit in which rows that lie far off count less (iteratively reweighted, Cauchy weights)."""
    weights = np.ones(len(design))
    for _ in range(rounds):
        root = np.sqrt(weights)[:, None]
        solution, *_ = np.linalg.lstsq(root * design, root * values, rcond=None)
        size = np.sqrt(np.mean((values - design @ solution) ** 2, axis=1))
        weights = 1.0 / (1.0 + (size / max(np.median(size), np.finfo(float).tiny)) ** 2)
    return solution[0]


def _judged(i, clocks, paths, curves, tasks, grid, usual, shifts, largest_deviation, largest_lag) -> Fit:
    wanted = _prediction(curves, tasks, i)

    def deviation(shift: float) -> float:
        return float(np.sqrt(np.mean(((_resampled(clocks[i] - shift, paths[i], grid) - wanted) / usual) ** 2)))

    now, at = deviation(0.0), [deviation(shift) for shift in shifts]
    best = int(np.argmin(at))
    lag = float(shifts[best]) if at[best] < 0.8 * now else 0.0
    least = min(now, at[best])
    reason = ""
    if now > largest_deviation and abs(lag) > largest_lag and least < 0.5 * now:
        reason = f"it is {abs(lag):.2f} s {'late' if lag > 0 else 'early'}: align it at another instant"
    elif now > largest_deviation:
        reason = f"it strays {now:.1f} times as far as usual from what the others predict (limit {largest_deviation:g}): leave it out"
    return Fit(now, lag, least, reason)
