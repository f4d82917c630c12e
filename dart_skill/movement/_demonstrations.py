"""Preparation of demonstrations for a movement primitive: checks, weights, and derivatives that
were not recorded; and the period of a movement that repeats.

The period is the lag at which the movement repeats, refined by a fit of harmonics. The coarse
search uses the squared difference function of A. de Cheveigne and H. Kawahara, "YIN", J. Acoust.
Soc. Am. 111 (2002). The refinement maximises the variance that the first harmonics of the period
explain.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_finite, as_number, as_samples
from dart_skill.movement._differentiation import MIN_SAMPLES, Motion, smooth_derivatives
from dart_skill.movement._time import as_stamps

STENCIL = 7
"""Clean samples are differentiated by the polynomial through so many of them: sixth order, fifth for
accelerations at the ends.
"""
NOISE_SHARE = 0.02
"""If differences would make more noise than this share of the acceleration, the samples are smoothed
instead.
"""


class ShownMovement(NamedTuple):
    """Stamps (n,) from zero, motion (n, d) each, and weights (n,)."""

    time: np.ndarray
    motion: Motion
    weights: np.ndarray


def as_demonstrations(
    time: ArrayLike,
    position: ArrayLike,
    velocity: ArrayLike | None,
    acceleration: ArrayLike | None,
    weights: ArrayLike | None,
    noise: ArrayLike | None,
) -> list[ShownMovement]:
    """Checked demonstrations, without those of weight zero.

    The input is one demonstration, time (n,) and position (n, d), or sequences with an entry for
    each demonstration.
    """
    noise = None if noise is None else as_finite(noise, "noise")
    if noise is not None and noise.min(initial=0.0) < 0:
        raise ValueError(f"noise must be at least 0, got {noise.min():g}")
    if are_several(position):
        demonstrations = _as_several(time, position, velocity, acceleration, weights, noise)
    else:
        demonstrations = [
            _as_demonstration(time, position, velocity, acceleration, weights, noise, "")
        ]
    counting = [demonstration for demonstration in demonstrations if demonstration.weights.any()]
    if not counting:
        raise ValueError("weights are all zero; at least one sample must count")
    return counting


def shares(demonstrations: list[ShownMovement]) -> np.ndarray:
    """Mean weight of each demonstration, normalised to sum to one."""
    weights = np.array([demonstration.weights.mean() for demonstration in demonstrations])
    return weights / weights.sum()


def _as_several(
    time: ArrayLike,
    position: Sequence[ArrayLike],
    velocity: ArrayLike | None,
    acceleration: ArrayLike | None,
    weights: ArrayLike | None,
    noise: np.ndarray | None,
) -> list[ShownMovement]:
    named = [
        ("time", time),
        ("velocity", velocity),
        ("acceleration", acceleration),
        ("weights", weights),
    ]
    columns = [_per_demonstration(name, value, len(position)) for name, value in named]
    several = [
        _as_demonstration(t, x, v, a, w, noise, f" of demonstration {index}")
        for index, (x, t, v, a, w) in enumerate(zip(position, *columns, strict=True))
    ]
    widths = {demonstration.motion.position.shape[1] for demonstration in several}
    if len(widths) > 1:
        raise ValueError(
            f"demonstrations must have the same number of columns, got {sorted(widths)}"
        )
    return several


def are_several(position: ArrayLike) -> TypeGuard[Sequence[ArrayLike]]:
    if isinstance(position, np.ndarray):
        return position.ndim == 3 and len(position) > 0
    try:
        return (
            isinstance(position, (list, tuple)) and len(position) > 0 and np.ndim(position[0]) == 2
        )
    except ValueError:  # ragged: left for the check of one demonstration to name
        return False


def _per_demonstration(name: str, value: Any, count: int) -> Sequence[Any]:
    if value is None:
        return [None] * count
    if not hasattr(value, "__len__") or len(value) != count:
        raise ValueError(f"{name} must have one entry for each of the {count} demonstrations")
    return value


def _as_demonstration(
    time: ArrayLike,
    position: ArrayLike,
    velocity: ArrayLike | None,
    acceleration: ArrayLike | None,
    weights: ArrayLike | None,
    noise: np.ndarray | None,
    place: str,
) -> ShownMovement:
    position = as_samples(position, f"position{place}")
    try:
        time = as_stamps(time, len(position), 2)
    except ValueError as error:
        raise ValueError(f"{error}{place}") from None
    shape = position.shape
    velocity = _like_position(velocity, shape, f"velocity{place}")
    acceleration = _like_position(acceleration, shape, f"acceleration{place}")
    elapsed: np.ndarray = time - time[0]
    motion = complete(elapsed, position, velocity, acceleration, noise)
    return ShownMovement(
        elapsed, motion, _as_sample_weights(weights, len(elapsed), f"weights{place}")
    )


def _as_sample_weights(weights: ArrayLike | None, n_samples: int, name: str) -> np.ndarray:
    """One weight for the demonstration or one per sample, as (n_samples,)."""
    weights = as_finite(1.0 if weights is None else weights, name)
    if weights.shape not in ((), (n_samples,)):
        raise ValueError(
            f"{name} must be one number or one per sample ({n_samples}), got shape {weights.shape}"
        )
    if weights.min() < 0:
        raise ValueError(f"{name} must not be negative, got {weights.min():g}")
    return np.broadcast_to(weights, n_samples)


def _like_position(
    value: ArrayLike | None, shape: tuple[int, int], name: str
) -> np.ndarray | None:
    if value is None:
        return None
    value = as_samples(value, name)
    if value.shape != shape:
        raise ValueError(f"{name} must have the position's shape {shape}, got {value.shape}")
    return value


def complete(
    time: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray | None = None,
    acceleration: np.ndarray | None = None,
    noise: np.ndarray | None = None,
) -> Motion:
    """Motion (n, d) in which missing derivatives are computed.

    A recorded velocity is differentiated by differences. Positions alone are differentiated by
    differences if they are clean (noise is 0, or is estimated to be negligible), otherwise by
    `smooth_derivatives`.
    """
    if velocity is not None:
        return Motion(
            position,
            velocity,
            difference(time, velocity)[0] if acceleration is None else acceleration,
        )
    slope, curvature = difference(time, position)
    motion = Motion(position, slope, curvature)
    if noise is None or np.any(noise):
        if len(time) >= MIN_SAMPLES and (
            noise is not None or _noise_matters(time, position, curvature)
        ):
            motion = smooth_derivatives(time, position, noise=noise)
    return motion if acceleration is None else motion._replace(acceleration=acceleration)


def _noise_matters(time: np.ndarray, position: np.ndarray, acceleration: np.ndarray) -> bool:
    """Whether the noise, estimated from sixth differences, would be visible in the acceleration."""
    contrast = np.diff(position - position[0], 6, axis=0)
    interval = (time[-1] - time[0]) / (len(time) - 1)
    # Differencing a sample twice with seven points multiplies independent noise by about 3.3 per
    # interval squared.
    visible = NOISE_SHARE * np.sqrt(np.mean(np.square(acceleration))) * interval**2 / 3.3
    # The noise is the median of the sizes, in units of that of normal noise: whether it is larger,
    # a count says in a fraction of the time.
    return (
        2 * np.count_nonzero(np.abs(contrast) > 0.6745 * np.sqrt(924.0) * visible) > contrast.size
    )


def difference(time: np.ndarray, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivative (n, d) of samples (n, d), from the polynomial through the
    nearest seven of them.
    """
    n = len(time)
    width = min(STENCIL, n)
    interval = (time[-1] - time[0]) / (n - 1)
    # The first sample is subtracted, so that a large offset costs no digits.
    samples, stamps = samples - samples[0], (time - time[0]) / interval
    first = np.clip(np.arange(n) - width // 2, 0, n - width)
    windows = first[:, None] + np.arange(width)
    stencils = _stencil(stamps[windows] - stamps[:, None])
    slope, curvature = np.einsum("nwk,nwd->knd", stencils, samples[windows])
    return slope / interval, curvature / interval**2


def _stencil(offsets: np.ndarray) -> np.ndarray:
    """Weights (n, width, 2) of samples at offsets (n, width) for the first and second derivative
    at offset zero.
    """
    width = offsets.shape[1]
    powers = np.moveaxis(np.stack([offsets**k for k in range(width)]).astype(float), 0, 1)
    wanted = np.zeros((width, 2))
    wanted[1, 0] = 1.0
    if width > 2:
        wanted[2, 1] = 2.0
    return np.linalg.solve(powers, np.broadcast_to(wanted, (len(offsets), width, 2)))


REPEATS_BELOW = 0.1
"""A lag counts as a repetition if its squared difference, relative to that of unrelated samples, is
below this.
"""
MAX_SAMPLES = 1000
"""Largest number of samples among which a period is looked for."""
N_HARMONICS = 6
"""Number of harmonics by which a period is refined."""


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
