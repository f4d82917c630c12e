"""The period of a repeating movement: the lag at which it repeats, refined by a fit of harmonics.

The coarse search uses the squared difference function of A. de Cheveigne and H. Kawahara, "YIN",
J. Acoust. Soc. Am. 111 (2002). The refinement maximises the variance that the first harmonics of
the period explain.
"""

import numpy as np

from dart_skill.common.checks import as_number

# A lag counts as a repetition if its squared difference, relative to that of unrelated samples, is
# below this.
REPEATS_BELOW = 0.1
MAX_SAMPLES = 1000
N_HARMONICS = 6


def estimate_period(time: np.ndarray, position: np.ndarray) -> float:
    """Period [s] of positions (n, d) at stamps (n,) that start at zero and span at least 1.5
    periods.

    Raises
    ------
    ValueError
        If the positions do not repeat.
    """
    grid = np.linspace(0.0, time[-1], min(len(time), MAX_SAMPLES))
    samples = _at(grid, time, position)
    lag = _first_repetition(samples - samples.mean(axis=0))
    if lag is None:
        raise ValueError(
            f"position does not repeat within its {time[-1]:g} s; give period= or record two"
            " periods or more"
        )
    return _refine(time, position, lag * grid[1])


def as_period(period: float, time: np.ndarray, position: np.ndarray) -> float:
    """The period [s] that the caller gave.

    Raises
    ------
    ValueError
        If positions (n, d) at stamps (n,) from zero do not repeat after it.
    """
    period, interval = as_number(period, "period"), time[-1] / (len(time) - 1)
    # The sample at the end of the period equals the one at its start, so it may be missing.
    if time[-1] < period - 1.5 * interval:
        raise ValueError(
            f"position spans {time[-1]:g} s, less than the period of {period:g} s; record a whole"
            " period or more"
        )
    later = time >= period - 1e-9 * time[-1]
    change = position[later] - _at(time[later] - period, time, position)
    unrelated = 2.0 * np.sum(np.var(position, axis=0))
    if later.any() and np.mean(np.sum(np.square(change), axis=1)) > REPEATS_BELOW * unrelated:
        raise ValueError(
            f"position does not repeat after the period of {period:g} s: it comes back off by"
            f" {np.abs(change).max():g}; give the right period, or learn a discrete primitive"
        )
    return period


def mean_over_periods(time: np.ndarray, position: np.ndarray, period: float) -> np.ndarray:
    """Mean position (d,) over all whole periods, or over all samples if there is no whole period."""
    whole = np.floor(time[-1] / period + 1e-9) * period
    if whole == 0:
        return position.mean(axis=0)
    inside = time < whole
    stamps = np.append(time[inside], whole)
    values = np.vstack([position[inside], _at(np.array([whole]), time, position)])
    return np.sum(0.5 * np.diff(stamps)[:, None] * (values[1:] + values[:-1]), axis=0) / whole


def _at(stamps: np.ndarray, time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Positions (m, d) at stamps (m,), linear between samples."""
    return np.stack([np.interp(stamps, time, column) for column in position.T], axis=1)


def _first_repetition(samples: np.ndarray) -> int | None:
    """Smallest lag, up to two thirds of the samples, with a deep minimum of the squared
    difference.
    """
    lags = np.arange(1, max(2, 2 * len(samples) // 3))
    spread = 2.0 * np.mean(np.square(samples))
    if spread == 0 or len(samples) < 8:
        return None
    distance = (
        np.array([np.mean(np.square(samples[lag:] - samples[:-lag])) for lag in lags]) / spread
    )
    away = np.flatnonzero(distance > 3 * REPEATS_BELOW)
    if len(away) == 0:
        return None
    inner = np.arange(max(away[0], 1), len(lags) - 1)
    minima = inner[
        (distance[inner] <= distance[inner - 1]) & (distance[inner] <= distance[inner + 1])
    ]
    deep = minima[distance[minima] < REPEATS_BELOW]
    # A movement with two similar strokes per period nearly repeats after one; the best repetition
    # decides.
    good = deep[distance[deep] <= 4.0 * distance[deep].min() + 0.01] if len(deep) else deep
    return int(lags[good[0]]) if len(good) else None


def _refine(time: np.ndarray, position: np.ndarray, period: float) -> float:
    # Imported on first use: discrete movements do not need it.
    from scipy.optimize import minimize_scalar

    centred = position - position.mean(axis=0)

    def unexplained(candidate: float) -> float:
        angle = 2.0 * np.pi * np.outer(time / candidate, np.arange(1, N_HARMONICS + 1))
        waves = np.linalg.qr(np.column_stack([np.ones(len(time)), np.sin(angle), np.cos(angle)]))[
            0
        ]
        return float(np.sum(np.square(centred - waves @ (waves.T @ centred))))

    margin = 0.06 * period
    bounds = (period - margin, period + margin)
    return float(
        minimize_scalar(
            unexplained, bounds=bounds, method="bounded", options={"xatol": 1e-10 * period}
        ).x
    )
