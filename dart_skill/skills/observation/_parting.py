"""The instant at which two paths move alike, from their difference: that of ball and grip is
stationary at the release.

A polynomial through the difference tells the instant, and how well the samples determine it.
"""

import numpy as np
from numpy.polynomial import polynomial

CALIBRATION = 1e-3
"""What grip and ball may be apart at the release, by the errors of both bodies' markers [m]."""
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
    powers = polynomial.polyvander(time, degree)
    gram = powers.T @ powers
    try:
        factor = np.linalg.cholesky(gram)
    except np.linalg.LinAlgError as error:
        raise ValueError(
            f"{len(time)} samples do not determine a polynomial of degree {degree}: not positive"
            " definite"
        ) from error
    curve = np.linalg.solve(factor.T, np.linalg.solve(factor, powers.T @ difference))
    best = _slowest(curve, time[0], time[-1])
    left = np.sum((difference - powers @ curve) ** 2) / max(difference.size - curve.size, 1)
    # the derivative is rate @ curve
    rate = np.append(0.0, polynomial.polyvander(best, degree - 1) * np.arange(1, degree + 1))
    spread = np.linalg.norm(np.linalg.solve(factor, rate))
    bend = np.linalg.norm(polynomial.polyval(best, polynomial.polyder(curve, 2)))
    return (
        best,
        float(np.sqrt(left) * spread / max(bend, 1e-12)),
        float(np.linalg.norm(polynomial.polyval(best, curve))),
    )


def _slowest(curve: np.ndarray, first: float, last: float) -> float:
    """Where in [first, last] a curve (m, 3) has the least speed, of the places where it is nearest
    to the origin: after the release the hand may for a while move as the ball does, millimetres
    away from it.

    The extremes of the squared speed and 0 are compared, as far as they lie in between; else the
    end.
    """
    velocity = polynomial.polyder(curve)
    squared = sum(polynomial.polymul(column, column) for column in velocity.T)
    roots = polynomial.polyroots(polynomial.polyder(squared))
    extremes = roots.real[np.abs(roots.imag) < REAL]
    places = np.clip(np.append(np.sort(extremes), 0.0), first, last)
    far = np.linalg.norm(polynomial.polyval(places, curve), axis=0)
    near = places[far < far.min() + CALIBRATION]
    return float(near[np.argmin(polynomial.polyval(near, squared))])
