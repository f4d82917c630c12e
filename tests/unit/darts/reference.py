"""For tests: independent integration of Gaussians over the beds of the board, by products of
Gauss-Legendre rules in radius and angle, and an independent solution of a leg, by bisection.
"""

from functools import lru_cache

import numpy as np
from scipy.optimize import brentq

from dart_skill.darts import BED_IS_DOUBLE, BED_SCORES, bed_centres, bed_probabilities

EDGES = np.array([0.0, 6.35, 15.9, 99.0, 107.0, 162.0, 170.0])
NUMBERS = np.array([20, 1, 18, 4, 13, 6, 10, 15, 2, 17, 3, 19, 7, 16, 8, 11, 14, 9, 12, 5])


def nodes(finest):
    """Points (n, 2), weights (n,) and scores (n,) of a rule on every ring and sector for Gaussians
    no narrower than `finest` [mm].
    """
    parts = []
    for ring, (near, far) in enumerate(zip(EDGES[:-1], EDGES[1:], strict=True)):
        radius, radial_weight = _rule(near, far, 12 + int(5 * (far - near) / finest))
        angle, angular_weight = _rule(
            -np.pi / 20, np.pi / 20, 12 + int(5 * far * np.pi / 10 / finest)
        )
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
    return np.array(
        [
            density(points, aim + np.asarray(bias), covariance) @ (weight * value)
            for aim in np.asarray(aims, dtype=float)
        ]
    )


def score_probabilities(aim, covariance, scores):
    """Probability (n,) of each of some scores above zero."""
    points, weight, value = nodes(np.sqrt(np.linalg.eigvalsh(covariance)[0]))
    mass = density(points, np.asarray(aim, dtype=float), covariance) * weight
    return np.bincount(value.astype(int), mass, minlength=61)[np.asarray(scores)]


def leg(sigma, highest, spacing, dart, turn):
    """Expected cost (highest + 1,) to finish from each score, by bisection of V(s) = turn +
    W_3(s); spacing: of the aims [mm].
    """
    scores, double, chance = _alike(_chances(sigma, spacing), highest)
    value = np.zeros(highest + 1)

    def turn_from(score, guess):
        after = value.copy()
        after[score] = guess
        remaining = np.arange(2, score + 1)
        left = remaining[:, None] - scores
        bust = (left < 0) | (left == 1) | ((left == 0) & ~double)
        for _ in range(3):
            outcomes = np.where(bust, guess, after[np.maximum(left, 0)])
            after = np.zeros(highest + 1)
            after[remaining] = dart + (outcomes @ chance).min(axis=1)
        return turn + after[score]

    for score in range(2, highest + 1):
        value[score] = brentq(
            lambda guess, score=score: turn_from(score, guess) - guess, 0.5, 1e5, rtol=1e-8
        )
    return value


def _alike(chances, highest):
    """Scores (k,) and doubles (k,) of the kinds of beds that differ from so many remaining on, and
    the chance (k, n) of each kind.
    """
    kinds, which = np.unique(
        np.stack([np.minimum(BED_SCORES, highest + 1), BED_IS_DOUBLE]), axis=1, return_inverse=True
    )
    return kinds[0], kinds[1].astype(bool), np.eye(kinds.shape[1])[which.ravel()].T @ chances.T


@lru_cache(maxsize=2)
def _chances(sigma, spacing):
    """Chance (n, 83) of each bed at aims that lie so far apart on and about the board."""
    steps = np.arange(-170.0 - 2.0 * sigma, 171.0 + 2.0 * sigma, spacing)
    aims = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    return bed_probabilities(
        np.concatenate([aims[np.hypot(*aims.T) < 170.0 + 2.0 * sigma], bed_centres()]), sigma
    )


def density(points, mean, covariance):
    """N(x; mean, covariance) of points (n, 2)."""
    offset = points - mean
    exponent = np.einsum("nd,nd->n", offset @ np.linalg.inv(covariance), offset)
    return np.exp(-0.5 * exponent) / (2.0 * np.pi * np.sqrt(np.linalg.det(covariance)))


def _rule(low, high, n):
    node, weight = np.polynomial.legendre.leggauss(n)
    return low + 0.5 * (high - low) * (node + 1.0), 0.5 * (high - low) * weight
