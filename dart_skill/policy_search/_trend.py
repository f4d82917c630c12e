"""Forecast of the value of a hill: a line through the values at its visits, against the clock of
the landscape.

    value(t) = v + s (t - last),    s ~ N(0, drift^2) before any visit,    a visit's variance = error^2 + (drift (last - t) / 2)^2

This is Bayesian linear regression. Old visits have a larger variance and count less, because the
real curve is not a line. The standard deviation of the slope ahead is at least drift / 2.
"""

from __future__ import annotations

import numpy as np

REMEMBERED = 8  # number of latest visits through which the line is fitted


def forecast(
    visits: list[tuple[float, float, float]], now: float, drift: float
) -> tuple[float, float]:
    """Value and its standard deviation at the time `now`; visits: (clock, value, error) of each,
    the latest last.
    """
    clocks, values, errors = np.array(visits, dtype=float).T
    before, bend = clocks - clocks[-1], 0.5 * drift
    weights = 1 / (np.square(errors) + np.square(bend * before) + 1e-12 * drift**2 + 1e-300)
    design = np.column_stack([np.ones(len(clocks)), before])
    covariance = np.linalg.inv(
        design.T @ (weights[:, None] * design) + np.diag([0.0, 1 / drift**2])
    )
    middle = values[-1]
    value, slope = covariance @ design.T @ (weights * (values - middle))
    ahead = np.array([1.0, now - clocks[-1]])
    variance = ahead @ covariance @ ahead + np.square(bend * ahead[1])
    return float(middle + value + slope * ahead[1]), float(np.sqrt(variance))
