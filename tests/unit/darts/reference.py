"""Independent integration of Gaussians over the beds of the board, for tests: products of Gauss-Legendre rules in radius and angle."""

import numpy as np

EDGES = np.array([0.0, 6.35, 15.9, 99.0, 107.0, 162.0, 170.0])
NUMBERS = np.array([20, 1, 18, 4, 13, 6, 10, 15, 2, 17, 3, 19, 7, 16, 8, 11, 14, 9, 12, 5])


def nodes(finest):
    """Points (n, 2), weights (n,) and scores (n,) of a rule on every ring and sector for Gaussians no narrower than `finest` [mm]."""
    parts = []
    for ring, (near, far) in enumerate(zip(EDGES[:-1], EDGES[1:], strict=True)):
        radius, radial_weight = _rule(near, far, 12 + int(5 * (far - near) / finest))
        angle, angular_weight = _rule(-np.pi / 20, np.pi / 20, 12 + int(5 * far * np.pi / 10 / finest))
        for sector, number in enumerate(NUMBERS):
            clockwise = angle + sector * np.pi / 10
            x, y = radius[:, None] * np.sin(clockwise), radius[:, None] * np.cos(clockwise)
            value = [50, 25, number, 3 * number, number, 2 * number][ring]
            weight = (radius * radial_weight)[:, None] * angular_weight
            parts.append(np.stack([x.ravel(), y.ravel(), weight.ravel(), np.full(x.size, value)]))
    x, y, weight, value = np.concatenate(parts, axis=1)
    return np.stack([x, y], axis=1), weight, value


def expected_score(aims, covariance, bias=(0.0, 0.0)):
    """Expected scores (n,) of aims (n, 2)."""
    points, weight, value = nodes(np.sqrt(np.linalg.eigvalsh(covariance)[0]))
    return np.array([density(points, aim + np.asarray(bias), covariance) @ (weight * value) for aim in np.asarray(aims, dtype=float)])


def score_probabilities(aim, covariance, scores):
    """Probability (n,) of each of some scores above zero."""
    points, weight, value = nodes(np.sqrt(np.linalg.eigvalsh(covariance)[0]))
    mass = density(points, np.asarray(aim, dtype=float), covariance) * weight
    return np.bincount(value.astype(int), mass, minlength=61)[np.asarray(scores)]


def density(points, mean, covariance):
    """N(x; mean, covariance) of points (n, 2)."""
    offset = points - mean
    exponent = np.einsum("nd,nd->n", offset @ np.linalg.inv(covariance), offset)
    return np.exp(-0.5 * exponent) / (2.0 * np.pi * np.sqrt(np.linalg.det(covariance)))


def _rule(low, high, n):
    node, weight = np.polynomial.legendre.leggauss(n)
    return low + 0.5 * (high - low) * (node + 1.0), 0.5 * (high - low) * weight
