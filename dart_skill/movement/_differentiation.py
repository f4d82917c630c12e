"""Position, velocity and acceleration from noisy samples: a smoothing spline of degree 5.

The spline minimises  sum_i (x(t_i) - x_i)^2 / sigma^2 + lambda * integral x'''(t)^2 dt  over
quintic splines with a knot at every second stamp. So gaps and irregular stamps need no special
treatment. lambda minimises the unbiased estimate of the risk, RSS + 2 sigma^2 trace(H) (Mallows;
Craven and Wahba 1978), for the noise sigma that is given or estimated. Without noise the fit is
plain least squares, and exact on polynomials up to degree 5.

The noise is estimated from `contrasts`: combinations of neighbouring samples that are zero on
polynomials of degree 5, so that they contain only noise.
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_finite, as_samples
from dart_skill.common.quantiles import quantile
from dart_skill.movement._time import as_stamps

DEGREE = 5
NEIGHBOURS = 7
MIN_SAMPLES = 8
EVEN_WEIGHTS = np.array([1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0]) / np.sqrt(924.0)
"""Weights of neighbours at equal intervals in `contrasts`: binomial coefficients, of unit norm."""
EVEN = 1e-9
"""Largest relative difference between intervals that are taken for equal."""
# The risk is evaluated in windows of so many samples; the cost is cubic in this number and linear
# in the number of windows.
RISK_WINDOW = 300
# Median of the absolute value of a normal variable of unit variance.
NORMAL_MEDIAN = 0.6744897501960817
# Stamps, in units of their mean interval, are rounded to so many decimals: the rest is rounding of
# the clock.
DECIMALS = 10
# lambda in units of the mean sample interval, per unit of noise variance.
LOG_PENALTIES = np.linspace(-6.0, 12.0, 181)
GAUSS_POINTS = np.polynomial.legendre.leggauss(3)


class Motion(NamedTuple):
    """Position, velocity and acceleration, each (n, d)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


def smooth_derivatives(
    time: ArrayLike,
    samples: ArrayLike,
    *,
    noise: float | ArrayLike | None = None,
    at: ArrayLike | None = None,
) -> Motion:
    """Position, velocity and acceleration (m, d) from noisy samples (n, d), n >= 8.

    Parameters
    ----------
    time : (n,)
        Stamps [s], increasing, possibly irregular.
    samples : (n, d)
    noise
        Standard deviation of the samples in their unit. One number (default None: estimated) if
        the columns are coordinates of one vector: they are smoothed alike, so that a rotation of
        the axes rotates the result. One number per column (d,) if the columns have different
        units.
    at : (m,)
        Stamps of the result, within those of the samples; default None: those of the samples.
    """
    samples = as_samples(samples, "samples")
    time = as_stamps(time, len(samples), MIN_SAMPLES)
    at = time if at is None else _within(as_finite(at, "at", 1), time)
    levels, groups = _noise_levels(time, samples, noise)
    interval = (time[-1] - time[0]) / (len(time) - 1)
    stamps = (time - time[0]) / interval
    smoother = _smoother_at(stamps)
    # The quadratic trend is fitted separately: with a large penalty the system is ill-conditioned
    # and would disturb it.
    along = smoother.trends.T @ samples
    rest, penalties = samples - smoother.trends @ along, np.zeros(samples.shape[1])
    if levels.any():
        risk = smoother.risk(rest / np.where(levels > 0, levels, 1.0))
        for group in groups:
            if levels[group.start] > 0:
                penalties[group] = _best_penalty(risk[:, group])
    coefficients = smoother.trend_coefficients @ along + smoother.basis.fit(rest, penalties)
    spline = smoother.basis.spline(coefficients)
    points = (at - time[0]) / interval
    return Motion(*(spline(points, nu=order) / interval**order for order in range(3)))


def _within(at: np.ndarray, time: np.ndarray) -> np.ndarray:
    slack = 1e-9 * (time[-1] - time[0])
    if len(at) == 0 or at.min() < time[0] - slack or at.max() > time[-1] + slack:
        span = f"{at.min()} to {at.max()}" if len(at) else "nothing"
        raise ValueError(
            f"at spans {span}, the samples only {time[0]} to {time[-1]}; a spline cannot"
            " extrapolate"
        )
    return np.clip(at, time[0], time[-1])


def _noise_levels(
    time: np.ndarray, samples: np.ndarray, noise: ArrayLike | None
) -> tuple[np.ndarray, list[slice]]:
    """Noise per column (d,) and the groups of columns that share one penalty."""
    n_dims = samples.shape[1]
    level = estimate_noise(time, samples) if noise is None else as_finite(noise, "noise")
    if level.shape not in ((), (n_dims,)) or level.min() < 0:
        raise ValueError(
            f"noise must be one number or one per column ({n_dims}), not negative, got"
            f" {level.tolist()}"
        )
    groups = (
        [slice(0, n_dims)] if level.ndim == 0 else [slice(dim, dim + 1) for dim in range(n_dims)]
    )
    return np.broadcast_to(level, n_dims), groups


def estimate_noise(time: ArrayLike, samples: ArrayLike, *, apart: bool = False) -> np.ndarray:
    """Standard deviation of the noise in samples (n, d) at stamps (n,): one for all columns, a 0-d
    array, or one for each, (d,).

    It comes from combinations of seven neighbours that are zero on polynomials of degree 5
    (divided differences, scaled to unit norm): these contain only noise. Their median absolute
    value is not disturbed by a few bad samples.

    Parameters
    ----------
    time
        [s].
    samples
        In any unit.
    apart
        Whether each column has a noise of its own.
    """
    samples = as_samples(samples, "samples")
    time = as_stamps(time, len(samples), MIN_SAMPLES)
    levels = quantile(contrasts(time, samples).T, 0.5) / NORMAL_MEDIAN
    # Columns may differ in noise: an axis of unit length has none along itself. What counts for
    # all together is their mean variance; the median of all at once would be less.
    return levels if apart else np.sqrt(np.mean(np.square(levels)))


def contrasts(time: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Absolute values (d, n - 6) of divided differences of seven neighbours, scaled to unit norm,
    of samples (n, d), n >= 7, at increasing stamps (n,).

    Sample k of them has the weight 1 / prod_j (t_k - t_j), j != k.
    """
    n, rows, steps = len(time) - NEIGHBOURS + 1, samples.T, time[1:] - time[:-1]
    weights = EVEN_WEIGHTS
    if np.ptp(steps) > EVEN * steps[0]:
        windows = time[np.arange(NEIGHBOURS)[:, None] + np.arange(n)]
        apart = (windows[:, None] - windows) / (windows[-1] - windows[0])
        apart[np.diag_indices(NEIGHBOURS)] = 1.0
        weights = 1.0 / np.multiply.reduce(apart, axis=1)
        weights = weights / np.sqrt(np.square(weights).sum(axis=0))
    return np.abs(sum(weight * rows[:, k : k + n] for k, weight in enumerate(weights)))


class _Smoother:
    """The part of the penalised least squares fit that depends on the stamps only, and not on the
    samples.

    trends: orthonormal quadratic polynomials (n, 3), on which the penalty does not act.
    """

    def __init__(self, stamps: np.ndarray):
        self.basis = _QuinticBasis(stamps)
        self.trends = _quadratics(stamps)
        self.trend_coefficients = self.basis.fit(self.trends, np.zeros(3))

    @cached_property
    def _windows(self) -> list[_RiskWindow]:
        stamps = self.basis.stamps
        n_windows = max(1, round(len(stamps) / RISK_WINDOW))
        return [
            _RiskWindow(self.basis if n_windows == 1 else _QuinticBasis(part))
            for part in np.array_split(stamps, n_windows)
        ]

    def risk(self, samples: np.ndarray) -> np.ndarray:
        """Estimated risk (n_penalties, d) of samples (n, d) with noise of standard deviation 1, up
        to a constant.
        """
        parts = np.array_split(samples, len(self._windows))
        risks = (window.risk(part) for window, part in zip(self._windows, parts, strict=True))
        return sum(risks, np.zeros(()))


def _smoother_at(stamps: np.ndarray) -> _Smoother:
    """The smoother for stamps in units of their mean interval.

    Short series with equal stamps share one, since the demonstrations of one camera system are
    often sampled alike.
    """
    stamps = np.round(stamps, DECIMALS)
    return _shared_smoother(stamps.tobytes()) if len(stamps) <= RISK_WINDOW else _Smoother(stamps)


@lru_cache(maxsize=32)
def _shared_smoother(stamps: bytes) -> _Smoother:
    return _Smoother(np.frombuffer(stamps))


def _best_penalty(risk: np.ndarray) -> float:
    """The lambda with the least risk (n_penalties, d), summed over the columns, which are smoothed
    alike.
    """
    return float(10.0 ** LOG_PENALTIES[risk.sum(axis=1).argmin()])


class _RiskWindow:
    """The smoother for one window of stamps, in the basis in which it is diagonal."""

    def __init__(self, basis: _QuinticBasis):
        from scipy.linalg import eigh

        # In these coordinates B'B is the identity, and the roughness diagonal.
        values, vectors = eigh(basis.roughness.toarray(), basis.gram.toarray())
        self._trends = _quadratics(basis.stamps)
        self._project = (basis.design @ vectors).T
        kept = 1.0 / (1.0 + 10.0 ** LOG_PENALTIES[:, None] * np.maximum(values, 0.0))
        self._left, self._trace = np.square(1.0 - kept), kept.sum(axis=1)[:, None]

    def risk(self, samples: np.ndarray) -> np.ndarray:
        """Residual sum of squares plus twice the trace of the smoother, up to constants:
        (n_penalties, d).
        """
        projected = self._project @ (samples - self._trends @ (self._trends.T @ samples))
        return self._left @ np.square(projected) + 2.0 * self._trace


def _quadratics(stamps: np.ndarray) -> np.ndarray:
    """Orthonormal quadratic polynomials (n, 3) at stamps (n,)."""
    return np.linalg.qr(
        np.polynomial.legendre.legvander(
            2.0 * (stamps - stamps[0]) / (stamps[-1] - stamps[0]) - 1.0, 2
        )
    )[0]


class _QuinticBasis:
    """B-splines of degree 5 with a knot at every second stamp. SciPy is imported here, as what
    only segments needs none of it.

    design: their values at the stamps (n, m), the matrix B. gram, roughness: B'B, and the integral
    of the squared third derivative (m, m). All are sparse.
    """

    def __init__(self, stamps: np.ndarray):
        from scipy.interpolate import BSpline

        self.stamps = stamps
        inner = stamps[2:-2:2] if len(stamps) >= 12 else stamps[:0]
        self.knots = np.concatenate(
            [np.repeat(stamps[0], DEGREE + 1), inner, np.repeat(stamps[-1], DEGREE + 1)]
        )
        self.design = BSpline.design_matrix(stamps, self.knots, DEGREE)
        self._transposed = self.design.T.tocsr()
        self.gram = self._transposed @ self.design
        self.roughness = self._roughness()
        self._bands = _bands(self.gram), _bands(self.roughness)

    def _roughness(self) -> Any:
        """integral B'''(t) B'''(t)' dt; three Gauss points are exact for the product of two
        quadratics.
        """
        from scipy.interpolate import BSpline
        from scipy.sparse import diags

        breaks = self.knots[DEGREE:-DEGREE]
        nodes, weights = GAUSS_POINTS
        half = 0.5 * np.diff(breaks)[:, None]
        points = (0.5 * (breaks[1:] + breaks[:-1])[:, None] + half * nodes).ravel()
        values = BSpline.design_matrix(points, self.knots[3:-3], DEGREE - 3)
        for order in (2, 1, 0):  # coefficients of the derivative from those of the spline
            knots, degree = self.knots[order : len(self.knots) - order], DEGREE - order
            rate = degree / (knots[degree + 1 : -1] - knots[1 : -degree - 1])
            values = values @ diags([-rate, rate], [0, 1], shape=(len(rate), len(rate) + 1))
        values = diags(np.sqrt(half * weights).ravel()) @ values
        return values.T @ values

    def fit(self, samples: np.ndarray, penalties: np.ndarray) -> np.ndarray:
        """Coefficients (m, d) of the penalised least squares fit, with penalties (d,), to samples
        (n, d).
        """
        from scipy.linalg.lapack import dpbsv

        found = self._transposed @ samples
        for penalty in set(penalties.tolist()):
            columns = penalties == penalty
            bands = self._bands[0] + penalty * self._bands[1]
            _, found[:, columns], failed = dpbsv(bands, found[:, columns], lower=True)
            if failed:
                raise ValueError(
                    "the stamps do not determine the smoothing spline; drop stamps that nearly"
                    " repeat"
                )
        return found

    def spline(self, coefficients: np.ndarray) -> Any:
        """The SciPy spline with coefficients (m, d)."""
        from scipy.interpolate import BSpline

        return BSpline.construct_fast(self.knots, coefficients, DEGREE)


def _bands(matrix: Any) -> np.ndarray:
    """Main diagonal and those below it (6, m) of a sparse symmetric matrix, as LAPACK has them."""
    wide = min(DEGREE + 1, matrix.shape[0])
    return np.array([np.append(matrix.diagonal(-k), np.zeros(k)) for k in range(wide)])
