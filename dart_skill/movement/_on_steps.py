"""Demonstrations on the steps of one clock: what models that compare them step by step begin with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_learnable, as_weights
from dart_skill.movement._time import as_stamps


class OnSteps(NamedTuple):
    """Demonstrations at the same steps.

    Parameters
    ----------
    time : (n,)
        Steps of the clock [s], equally spaced.
    rows : (N, n, d)
        Movement variables of each demonstration.
    shares : (N,)
        How much each counts; they add up to 1.
    """

    time: np.ndarray
    rows: np.ndarray
    shares: np.ndarray


def on_steps(samples: Sequence[ArrayLike], weights: ArrayLike | None, n_steps: int) -> OnSteps:
    """Demonstrations at n equal steps from the mean first to the mean last stamp.

    Parameters
    ----------
    samples
        [t, y] (n_i, 1 + d) of each. Its stamps are stretched to the clock: one that takes longer is
        the same movement, slower.
    weights
        For each demonstration one number, default None: all count alike.
    n_steps
        n, at least 2.

    Raises
    ------
    ValueError
        Without two samples in each, for different columns, or for stamps that do not increase.
    """
    if len(samples) == 0:
        raise ValueError("there is no demonstration; give one at least")
    rows = [as_learnable(one, f"samples of demonstration {i}") for i, one in enumerate(samples)]
    shares = as_weights(weights, len(rows))
    for i, one in enumerate(rows):
        if one.shape[1] != rows[0].shape[1] or one.shape[1] < 2:
            raise ValueError(
                f"demonstration {i} has {one.shape[1]} columns, the first {rows[0].shape[1]}: give"
                " all of them time and the same movement variables"
            )
        as_stamps(one[:, 0], minimum=2)
    first, last = np.mean([one[[0, -1], 0] for one in rows], axis=0)
    time, phase = np.linspace(first, last, n_steps), np.linspace(0.0, 1.0, n_steps)
    values = np.stack([_at(phase, one) for one in rows])
    return OnSteps(time, values, shares / shares.sum())


def _at(phase: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Movement variables (n, d) at phases (n,) from 0 to 1 of a demonstration [t, y]."""
    time = rows[:, 0]
    passed = (time - time[0]) / (time[-1] - time[0])
    return np.column_stack([np.interp(phase, passed, column) for column in rows[:, 1:].T])
