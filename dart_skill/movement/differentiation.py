"""Position, velocity and acceleration from noisy samples: a smoothing spline of degree 5.

The spline minimises  sum_i (x(t_i) - x_i)^2 / sigma^2 + lambda * integral x'''(t)^2 dt  over quintic splines
with a knot at every second stamp, so that gaps and irregular stamps need no special care. lambda minimises
the unbiased estimate of the risk (Mallows; Craven and Wahba 1978), RSS + 2 sigma^2 trace(H), for the given or
estimated noise sigma; without noise the fit is plain least squares and exact on polynomials up to degree 5.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..mixture._checks import as_finite, as_samples
from ._time import as_stamps

DEGREE = 5
MIN_SAMPLES = 8
# Samples per window in which the risk is evaluated; the cost is cubic in this and linear in their number.
RISK_WINDOW = 300
# lambda in units of the mean sample interval, per unit of noise variance.
LOG_PENALTIES = np.linspace(-6.0, 12.0, 181)


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
    """Position, velocity and acceleration (m, d) at the stamps `at` (m,), by default those of the samples,
    from noisy samples (n, d).

    time: (n,) seconds, increasing, possibly irregular. noise: standard deviation of the samples in their
    units, one number (estimated when None) for columns that are coordinates of one vector: they are smoothed
    alike, so that rotating the axes rotates the result; or one number per column (d,) for columns of
    different units. There is no extrapolation: `at` must lie within the stamps.
    """
    samples = as_samples(samples, "samples")
    time = as_stamps(time, len(samples), MIN_SAMPLES)
    at = time if at is None else _within(as_finite(at, "at", 1), time)
    levels, groups = _noise_levels(time, samples, noise)
    interval = (time[-1] - time[0]) / (len(time) - 1)
    stamps = (time - time[0]) / interval
    basis = _QuinticBasis(stamps)
    # The quadratic trend is fitted apart, so that a large penalty, whose system is ill-conditioned, cannot disturb it.
    trend = quadratic_trend(stamps, samples)
    coefficients = basis.fit(trend, 0.0)
    smoother = _Smoother(basis) if levels.any() else None
    for group in groups:
        rest, level = samples[:, group] - trend[:, group], levels[group[0]]
        penalty = smoother.choose_penalty(rest / level) if level > 0 else 0.0
        coefficients[:, group] += basis.fit(rest, penalty)
    return Motion(*(basis.evaluate(coefficients, (at - time[0]) / interval, order) / interval**order for order in range(3)))


def _within(at: np.ndarray, time: np.ndarray) -> np.ndarray:
    slack = 1e-9 * (time[-1] - time[0])
    if len(at) == 0 or at.min() < time[0] - slack or at.max() > time[-1] + slack:
        span = f"{at.min()} to {at.max()}" if len(at) else "nothing"
        raise ValueError(f"at spans {span}, the samples only {time[0]} to {time[-1]}; a spline cannot extrapolate")
    return np.clip(at, time[0], time[-1])


def _noise_levels(time, samples, noise):
    """Noise per column (d,) and the groups of columns that share one penalty."""
    n_dims = samples.shape[1]
    level = estimate_noise(time, samples) if noise is None else as_finite(noise, "noise")
    if level.shape not in ((), (n_dims,)) or level.min() < 0:
        raise ValueError(f"noise must be one number or one per column ({n_dims}), not negative, got {level.tolist()}")
    groups = [np.arange(n_dims)] if level.ndim == 0 else [np.array([dim]) for dim in range(n_dims)]
    return np.broadcast_to(level, n_dims), groups


def estimate_noise(time: ArrayLike, samples: ArrayLike) -> np.ndarray:
    """Standard deviation of the noise in samples (n, d), pooled over the columns: a 0-d array.

    Contrasts of seven neighbours that vanish on polynomials of degree 5 (divided differences, scaled to unit
    norm) hold noise only; their median absolute value is not disturbed by a few bad samples.
    """
    samples = as_samples(samples, "samples")
    time = as_stamps(time, len(samples), MIN_SAMPLES)
    stamps = np.lib.stride_tricks.sliding_window_view(time, 7)
    gaps = stamps[:, :, None] - stamps[:, None, :] + np.eye(7)
    contrast = 1.0 / (gaps / (stamps[:, -1:] - stamps[:, :1])[:, :, None]).prod(axis=2)
    contrast /= np.linalg.norm(contrast, axis=1, keepdims=True)
    windows = np.lib.stride_tricks.sliding_window_view(samples, 7, axis=0)
    return np.asarray(np.median(np.abs(np.einsum("nj,ndj->nd", contrast, windows))) / 0.6744897501960817)


class _Smoother:
    """The penalised least squares fit at the stamps of a basis: what of the choice of the penalty does not depend on the samples."""

    def __init__(self, basis: _QuinticBasis):
        n_windows = max(1, round(len(basis.stamps) / RISK_WINDOW))
        parts = np.array_split(basis.stamps, n_windows)
        self._windows = [_RiskWindow(basis if n_windows == 1 else _QuinticBasis(part)) for part in parts]

    def choose_penalty(self, samples: np.ndarray) -> float:
        """lambda of least estimated risk for samples (n, d) of unit noise, stamps in mean intervals."""
        parts = np.array_split(samples, len(self._windows))
        risk = sum(window.risk(part) for window, part in zip(self._windows, parts, strict=True))
        return float(10.0 ** LOG_PENALTIES[risk.argmin()])


class _RiskWindow:
    """The smoother on some stamps, in the basis that diagonalises it."""

    def __init__(self, basis: _QuinticBasis):
        factor = np.linalg.cholesky(basis.gram.toarray())
        half = scipy.linalg.solve_triangular(factor, basis.roughness.toarray(), lower=True)
        roughness = scipy.linalg.solve_triangular(factor, half.T, lower=True)
        values, vectors = scipy.linalg.eigh(0.5 * (roughness + roughness.T))
        self._stamps = basis.stamps
        self._project = vectors.T @ scipy.linalg.solve_triangular(factor, basis.design.T.toarray(), lower=True)
        self._kept = 1.0 / (1.0 + 10.0 ** LOG_PENALTIES[:, None] * np.maximum(values, 0.0))

    def risk(self, samples: np.ndarray) -> np.ndarray:
        """Residual sum of squares plus twice the trace of the smoother, up to a constant, for every penalty."""
        projected = self._project @ (samples - quadratic_trend(self._stamps, samples))
        return np.square(1.0 - self._kept) @ np.square(projected).sum(1) + 2.0 * samples.shape[1] * self._kept.sum(1)


def quadratic_trend(stamps: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Values (n, d) of the quadratics that fit samples (n, d) best: what no penalty changes."""
    powers = np.polynomial.legendre.legvander(2.0 * (stamps - stamps[0]) / (stamps[-1] - stamps[0]) - 1.0, 2)
    orthonormal = np.linalg.qr(powers)[0]
    return orthonormal @ (orthonormal.T @ samples)


def _design_matrix(stamps: np.ndarray, knots: np.ndarray, degree: int) -> scipy.sparse.csr_array:
    """Values (n, m) of the B-splines on the knots at the stamps (n,)."""
    return scipy.interpolate.BSpline.design_matrix(stamps, knots, degree)


def _bands(matrix: scipy.sparse.csc_matrix) -> np.ndarray:
    """Diagonals (DEGREE + 1, m) of a symmetric matrix, from the main one down."""
    return np.stack([np.pad(matrix.diagonal(-offset), (0, offset)) for offset in range(DEGREE + 1)])


class _QuinticBasis:
    """B-splines of degree 5 on every second stamp, with Gram matrix B'B and roughness matrix of the third
    derivative.
    """

    def __init__(self, stamps: np.ndarray):
        self.stamps = stamps
        inner = stamps[2:-2:2] if len(stamps) >= 12 else stamps[:0]
        self.knots = np.concatenate([np.repeat(stamps[0], DEGREE + 1), inner, np.repeat(stamps[-1], DEGREE + 1)])
        self.n_functions = len(self.knots) - DEGREE - 1
        self.design = _design_matrix(stamps, self.knots, DEGREE)
        self.gram = (self.design.T @ self.design).tocsc()
        self.roughness = self._roughness()
        self._gram_bands, self._roughness_bands = _bands(self.gram), _bands(self.roughness)

    def _derivative(self, order: int) -> tuple[scipy.sparse.csc_matrix, np.ndarray]:
        """Matrix from coefficients to those of the derivative, and the knots of the latter."""
        matrix, knots = scipy.sparse.identity(self.n_functions, format="csc"), self.knots
        for degree in range(DEGREE, DEGREE - order, -1):
            knots = knots[1:-1]
            factor = degree / (knots[degree:] - knots[:-degree])
            n = len(factor)
            step = scipy.sparse.diags([-factor, factor], [0, 1], shape=(n, n + 1), format="csc")
            matrix = step @ matrix
        return matrix, knots

    def _roughness(self) -> scipy.sparse.csc_matrix:
        """integral B'''(t) B'''(t)' dt; three Gauss points are exact for the product of two quadratics."""
        breaks = np.unique(self.knots)
        nodes, node_weights = np.polynomial.legendre.leggauss(3)
        half = 0.5 * np.diff(breaks)
        points = (0.5 * (breaks[1:] + breaks[:-1])[:, None] + half[:, None] * nodes).ravel()
        weights = (half[:, None] * node_weights).ravel()
        matrix, knots = self._derivative(3)
        values = _design_matrix(points, knots, DEGREE - 3) @ matrix
        return (values.T @ values.multiply(weights[:, None])).tocsc()

    def fit(self, samples: np.ndarray, penalty: float) -> np.ndarray:
        """Coefficients (m, d) of the penalised least squares fit."""
        bands = self._gram_bands + penalty * self._roughness_bands
        return scipy.linalg.cho_solve_banded((scipy.linalg.cholesky_banded(bands, lower=True), True), self.design.T @ samples)

    def evaluate(self, coefficients: np.ndarray, stamps: np.ndarray, order: int) -> np.ndarray:
        """Derivative of the given order (n, d) at stamps (n,)."""
        matrix, knots = self._derivative(order)
        return _design_matrix(stamps, knots, DEGREE - order) @ (matrix @ coefficients)
