"""The instant at which two paths move alike, from their difference: that of ball and grip is stationary at the release.

A polynomial through the difference tells the instant, and how well the samples determine it. This module is compiled
(docs/development.md): _parting.pxd beside it has the types.
"""

import math

import numpy as np

from dart_skill.small_matrices import factor_into, solve_into

CALIBRATION = 1e-3
"""What grip and ball may be apart at the release, by the errors of both bodies' markers [m]."""
MOST_STEPS, CLOSE = 200, 4e-16
"""Of the search for a root: how many there are, and which is the last, as a share of the root."""


def parting(time: np.ndarray, difference: np.ndarray, degree: int) -> tuple[float, float, float]:
    """Where a polynomial through the differences is slowest, the deviation of that instant, and the distance then.

    * time: (n,), increasing.
    * difference: (n, 3) [m].
    * degree: of the polynomial, at least 2.

    ValueError if the samples do not determine the polynomial.
    """
    n, m = time.shape[0], degree + 1
    factor, curve, squared = np.zeros((m, m)), np.empty((m, 3)), np.zeros(2 * degree - 1)
    rate, roots = np.empty(2 * degree - 2), np.empty(2 * degree - 2)
    _fit(time, difference, factor, curve)
    _square_speed(curve, squared)
    for i in range(1, 2 * degree - 1):
        rate[i - 1] = i * squared[i]
    best = _slowest(curve, squared, roots[: _real_roots(rate, roots)], time[0], time[n - 1])
    return best, _deviation(time, difference, factor, curve, best), math.sqrt(_square_distance(curve, best))


def _fit(time: np.ndarray, difference: np.ndarray, factor: np.ndarray, curve: np.ndarray) -> None:
    """Write coefficients (m, 3) of the polynomial through differences (n, 3), and Cholesky's factor (m, m) of its normal equations."""
    m, sums = curve.shape[0], np.zeros((3, curve.shape[0]))
    for i in range(time.shape[0]):
        power = 1.0
        for row in range(m):
            product = power * power
            for column in range(row, m):
                factor[column, row] += product
                product *= time[i]
            for k in range(3):
                sums[k, row] += power * difference[i, k]
            power *= time[i]
    factor_into(factor, factor)
    for k in range(3):
        solve_into(factor, sums[k], curve[:, k])


def _square_speed(curve: np.ndarray, squared: np.ndarray) -> None:
    """Add the coefficients (2 m - 3,) of the squared speed of a curve with coefficients (m, 3)."""
    for k in range(3):
        for i in range(1, curve.shape[0]):
            for j in range(1, curve.shape[0]):
                squared[i + j - 2] += i * curve[i, k] * (j * curve[j, k])


def _real_roots(coefficients: np.ndarray, roots: np.ndarray) -> int:
    """Write the real roots of a polynomial with coefficients (m,), from the constant on, in order (m,); returns how many there are.

    Between two neighbouring roots of its derivative there is one at most. So the roots of its highest derivatives are found first.
    """
    degree, count = coefficients.shape[0] - 1, 0
    while degree > 0 and coefficients[degree] == 0.0:
        degree -= 1
    derivative, edges, bound = np.empty(degree + 1), np.empty(degree + 2), 1.0
    for i in range(degree):
        bound = max(bound, 1.0 + abs(coefficients[i] / coefficients[degree]))
    for order in range(degree - 1, -1, -1):
        n = degree - order
        for i in range(n + 1):
            derivative[i] = coefficients[i + order]
            for factor in range(i + 1, i + order + 1):
                derivative[i] *= factor
        edges[0], edges[count + 1] = -bound, bound
        for i in range(count):
            edges[i + 1] = roots[i]
        pieces, count = count + 1, 0
        for i in range(pieces):
            if _value(derivative[: n + 1], edges[i]) * _value(derivative[: n + 1], edges[i + 1]) < 0.0:
                roots[count] = _root_between(derivative[: n + 1], edges[i], edges[i + 1])
                count += 1
    return count


def _root_between(coefficients: np.ndarray, low: float, high: float) -> float:
    """The root of a polynomial between two places at which its signs differ: Newton's method, kept in between by bisection."""
    rises, place = _value(coefficients, low) < 0.0, 0.5 * (low + high)
    for _ in range(MOST_STEPS):
        value = slope = 0.0
        for i in range(coefficients.shape[0] - 1, -1, -1):
            slope = slope * place + value
            value = value * place + coefficients[i]
        if (value < 0.0) == rises:
            low = place
        else:
            high = place
        after = place - value / slope if slope != 0.0 else low
        if not low < after < high:
            after = 0.5 * (low + high)
        if abs(after - place) <= CLOSE * (1.0 + abs(place)):
            return after
        place = after
    return place


def _slowest(curve: np.ndarray, squared: np.ndarray, extremes: np.ndarray, first: float, last: float) -> float:
    """Where in [first, last] a curve has the least speed, of the places where it is nearest to the origin: after the release the hand may
    for a while move as the ball does, millimetres away from it.

    The extremes (e,) of the squared speed and 0 are compared, as far as they lie in between; else the end.
    """
    n = extremes.shape[0]
    best, least, nearest = 0.0, 1e300, 1e300
    for i in range(n + 1):
        place = min(max(extremes[i] if i < n else 0.0, first), last)
        nearest = min(nearest, math.sqrt(_square_distance(curve, place)))
    for i in range(n + 1):
        place = min(max(extremes[i] if i < n else 0.0, first), last)
        speed = _value(squared, place)
        if math.sqrt(_square_distance(curve, place)) < nearest + CALIBRATION and speed < least:
            best, least = place, speed
    return best


def _value(coefficients: np.ndarray, place: float) -> float:
    """Of a polynomial with coefficients (m,), from the constant on."""
    total, power = 0.0, 1.0
    for i in range(coefficients.shape[0]):
        total += coefficients[i] * power
        power *= place
    return total


def _square_distance(curve: np.ndarray, place: float) -> float:
    """Square of the distance from the origin of a curve with coefficients (m, 3)."""
    x, y, z = _value(curve[:, 0], place), _value(curve[:, 1], place), _value(curve[:, 2], place)
    return x * x + y * y + z * z


def _deviation(time: np.ndarray, difference: np.ndarray, factor: np.ndarray, curve: np.ndarray, place: float) -> float:
    """Deviation of a root of the derivative: that of the derivative, over the second derivative."""
    n, m = time.shape[0], curve.shape[0]
    rate, spread, power = np.zeros(m), np.empty(m), 1.0  # the derivative is the sum of rate times coefficients
    left = slope = variance = 0.0
    for i in range(n):
        for k in range(3):
            misfit = difference[i, k] - _value(curve[:, k], time[i])
            left += misfit * misfit
    for row in range(1, m):
        rate[row] = row * power
        power *= place
    for k in range(3):
        bend = 0.0
        for row in range(2, m):
            bend += row * rate[row - 1] * curve[row, k]
        slope += bend * bend
    solve_into(factor, rate, spread)
    for row in range(m):
        variance += rate[row] * spread[row]
    return math.sqrt(left / max(3 * (n - m), 1)) * math.sqrt(variance) / max(math.sqrt(slope), 1e-12)
