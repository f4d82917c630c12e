"""The instant at which two paths move alike, from their difference: that of ball and grip is
stationary at the release.

A polynomial through the difference tells the instant, and how well the samples determine it.
"""

import math

import numpy as np

CALIBRATION = 2e-3
"""What grip and ball may be apart at the release, by the errors of both bodies' markers [m]."""
AS_SLOW = 2.0
"""Two instants tell nothing from each other whose speeds differ by less than this factor."""
REAL = 1e-7
"""Largest imaginary part of a root that is taken for a real one."""


def parting(time: np.ndarray, difference: np.ndarray, degree: int) -> tuple[float, float, float]:
    """Where a polynomial through the differences is slowest, the deviation of that instant, and
    the distance then.

    Parameters
    ----------
    time
        (n,), increasing.
    difference
        (n, 3) [m].
    degree
        Of the polynomial, at least 2.

    Raises
    ------
    ValueError
        If the samples do not determine the polynomial.
    """
    powers, whitener, curve = _polynomial(time, difference, degree)
    places, squared_speeds = _slow_places(curve, time[0], time[-1])
    best = float(places[squared_speeds.argmin()])
    off = (difference - powers @ curve).ravel()
    left = off @ off / max(difference.size - curve.size, 1)
    at_best = best ** np.arange(degree + 1)
    # the derivative is rate @ curve
    rate = np.append(0.0, at_best[:-1] * np.arange(1, degree + 1))
    bend = _length(at_best[:-2] @ _derivative(_derivative(curve)))
    noise = math.sqrt(left) * _length(whitener @ rate)  # of the speed, along each axis
    as_slow = squared_speeds <= AS_SLOW**2 * (squared_speeds.min() + 3.0 * noise**2)
    ambiguous = float(np.abs(places[as_slow] - best).max())
    return best, math.hypot(noise / max(bend, 1e-12), ambiguous), _length(at_best @ curve)


def parting_instant(time: np.ndarray, difference: np.ndarray, degree: int) -> float:
    """The instant of `parting` alone."""
    places, squared_speeds = _slow_places(
        _polynomial(time, difference, degree)[2], time[0], time[-1]
    )
    return float(places[squared_speeds.argmin()])


def _polynomial(
    time: np.ndarray, difference: np.ndarray, degree: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Powers of time (n, m), a root W (m, m) of their covariance, which is W'W, and the
    coefficients (m, 3).
    """
    powers = np.vander(time, degree + 1, increasing=True)
    try:
        whitener = np.linalg.inv(np.linalg.cholesky(powers.T @ powers))
    except np.linalg.LinAlgError as error:
        raise ValueError(
            f"{len(time)} samples do not determine a polynomial of degree {degree}: not positive"
            " definite"
        ) from error
    return powers, whitener, whitener.T @ (whitener @ (powers.T @ difference))


def _slow_places(curve: np.ndarray, first: float, last: float) -> tuple[np.ndarray, np.ndarray]:
    """Where in [first, last] the speed of a curve (m, 3) has minima (k,), and its squares there: of
    the minima that are nearest to the origin, as after the release the hand may for a while move
    as the ball does, millimetres away from it.

    Where there is no minimum in between, the ends and 0.
    """
    x, y, z = _derivative(curve).T
    squared = np.convolve(x, x) + np.convolve(y, y) + np.convolve(z, z)
    slope = _derivative(squared)
    roots = np.roots(slope[::-1])
    places = np.sort(roots.real[np.abs(roots.imag) < REAL])
    rises = np.vander(places, len(slope) - 1, increasing=True) @ _derivative(slope) >= 0.0
    places = places[rises & (places > first) & (places < last)]
    if not len(places):
        places = np.array([first, 0.0, last])
    powers = np.vander(places, len(squared), increasing=True)
    far = np.sqrt(np.square(powers[:, : len(curve)] @ curve).sum(axis=1))
    near = far < far.min() + CALIBRATION
    return places[near], (powers[near] @ squared).clip(0.0)


def _derivative(curve: np.ndarray) -> np.ndarray:
    """Coefficients of the derivative, from those of a polynomial (m,) or of several (m, d)."""
    return (curve[1:].T * np.arange(1, len(curve))).T


def _length(vector: np.ndarray) -> float:
    return math.sqrt(vector @ vector)
