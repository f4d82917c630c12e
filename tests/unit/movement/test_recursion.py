"""Recursions of position and velocity, beside NumPy's steps one after the other."""

import numpy as np
import pytest

from dart_skill.movement._runge_kutta import recur, respond

TRANSITION, NOW, LATER = (
    np.array([[0.99, 0.01], [-0.3, 0.9]]),
    np.array([0.02, 0.1]),
    np.array([0.01, 0.2]),
)


@pytest.mark.parametrize("n", [1, 2, 50])
def test_each_state_follows_from_the_one_before(n):
    rng = np.random.default_rng(n)
    attractor, start = rng.normal(size=(n, 3)), rng.normal(size=(2, 3))
    forcing = np.concatenate(
        [
            start[:, None],
            np.multiply.outer(NOW, attractor[:-1]) + np.multiply.outer(LATER, attractor[1:]),
        ],
        axis=1,
    )
    expected = forcing.copy()
    for k in range(1, n):
        expected[:, k] += TRANSITION @ expected[:, k - 1]
    np.testing.assert_allclose(recur(TRANSITION, forcing), expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(
        respond(TRANSITION, NOW, LATER, attractor, start),
        expected,
        rtol=1e-12,
        atol=1e-12,
    )
