"""Combinations of seven samples: zero on polynomials, noise of unit norm otherwise."""

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator

from dart_skill.movement import estimate_noise
from dart_skill.movement._differentiation import contrasts


@pytest.fixture
def stamps():
    return np.cumsum(np.random.default_rng(0).uniform(0.005, 0.015, 40))


def test_polynomials_of_degree_5_leave_nothing(stamps):
    samples = np.stack([((stamps - 0.2) * 5.0) ** k for k in range(6)], axis=1)
    assert contrasts(stamps, samples).max() < 1e-12


def test_weights_are_those_of_the_barycentric_formula(stamps):
    samples = np.random.default_rng(1).standard_normal((40, 2))
    found = contrasts(stamps, samples)
    assert found.shape == (2, 34)
    for first in (0, 11, 33):
        seven = slice(first, first + 7)
        weights = BarycentricInterpolator(stamps[seven]).wi
        np.testing.assert_allclose(
            found[:, first], np.abs(weights @ samples[seven]) / np.linalg.norm(weights), rtol=1e-9
        )


def test_noise_is_told_of_all_columns_together_or_of_each(stamps):
    samples = np.random.default_rng(2).standard_normal((40, 3)) * [1.0, 5.0, 0.1]
    each = estimate_noise(stamps, samples, apart=True)
    np.testing.assert_array_equal(
        each, [estimate_noise(stamps, samples[:, k : k + 1]) for k in range(3)]
    )
    assert each[2] < estimate_noise(stamps, samples) < each[1]
