"""Splines of degree 5 beside SciPy's."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.linalg import expm, solveh_banded

from dart_skill.movement import _quintic
from dart_skill.movement._attractor import _exponential
from tests.interpreted import interpreted

KNOTS = np.repeat(np.array([0.0, 1.0, 1.3, 2.0, 4.0, 4.5, 6.0]), [6, 1, 1, 1, 1, 1, 6])
N = len(KNOTS) - 6
POINTS = np.sort(np.append(np.random.default_rng(0).uniform(0.0, 6.0, 30), [0.0, 2.0, 6.0]))
FIRST = np.clip(np.searchsorted(KNOTS, POINTS, "right") - 1, 5, N - 1) - 5


@pytest.mark.parametrize("order", range(6))
def test_values_and_derivatives_are_those_of_scipy(order):
    coefficients = np.random.default_rng(1).standard_normal((N, 2))
    rows = _quintic.values(KNOTS, FIRST, POINTS, order)
    expected = BSpline(KNOTS, coefficients, 5)(POINTS, order)
    np.testing.assert_allclose(_quintic.combined(FIRST, rows, coefficients), expected, rtol=1e-10, atol=1e-9)


def test_sums_are_those_of_the_dense_matrix():
    rows, samples = _quintic.values(KNOTS, FIRST, POINTS, 0), np.random.default_rng(2).standard_normal((len(POINTS), 3))
    dense = BSpline.design_matrix(POINTS, KNOTS, 5).toarray()
    np.testing.assert_allclose(_quintic.sums(FIRST, rows, samples, N), dense.T @ samples, atol=1e-13)
    bands = _quintic.sum_of_squares(FIRST, rows, N)
    for below, band in enumerate(bands):
        np.testing.assert_allclose(band[: N - below], np.diagonal(dense.T @ dense, -below), atol=1e-13)


@pytest.mark.parametrize("n", [1, 4, 6, 40])
def test_banded_equations_are_solved_as_by_scipy(n):
    rng = np.random.default_rng(n)
    bands, right = rng.uniform(-1.0, 1.0, (6, n)), rng.standard_normal((n, 3))
    bands[0] += 12.0
    np.testing.assert_allclose(_quintic.solve(bands, right), solveh_banded(bands[: min(6, n)], right, lower=True), atol=1e-13)


def test_columns_with_penalties_of_their_own_are_solved_as_one_by_one():
    rng = np.random.default_rng(5)
    bands, roughness, right = rng.uniform(-1.0, 1.0, (6, 20)), rng.uniform(-0.1, 0.1, (6, 20)), rng.standard_normal((20, 4))
    bands[0] += 12.0
    penalties = np.array([0.0, 2.0, 2.0, 0.5])
    expected = [_quintic.solve(bands + penalty * roughness, right[:, dim : dim + 1])[:, 0] for dim, penalty in enumerate(penalties)]
    for module in (_quintic, interpreted("dart_skill.movement._quintic")):
        np.testing.assert_array_equal(module.solve_penalised(bands, roughness, penalties, right), np.transpose(expected))


def test_equations_that_are_not_positive_definite_are_refused():
    with pytest.raises(ValueError, match="its pivot 0 is 0"):
        _quintic.solve(np.zeros((6, 8)), np.ones((8, 1)))


@pytest.mark.parametrize("size", [1e-4, 1.0, 30.0])
def test_the_exponential_of_a_step_is_that_of_scipy(size):
    matrix = size * np.array([[0.0, 1.0, 0.0, 0.0], [-1.0, -2.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0 / size], [0.0] * 4])
    np.testing.assert_allclose(_exponential(matrix), expm(matrix), rtol=1e-11, atol=1e-13)


def test_compiled_and_interpreted_have_the_same_bits():
    samples = np.random.default_rng(3).standard_normal((len(POINTS), 2))

    def all_of(module):
        for order in range(4):
            yield module.values(KNOTS, FIRST, POINTS, order)
        rows = module.values(KNOTS, FIRST, POINTS, 0)
        bands, sums = module.sum_of_squares(FIRST, rows, N), module.sums(FIRST, rows, samples, N)
        yield from (bands, sums, module.factor(bands), module.solve(bands, sums), module.combined(FIRST, rows, sums))

    for ours, plain in zip(all_of(_quintic), all_of(interpreted("dart_skill.movement._quintic")), strict=True):
        np.testing.assert_array_equal(ours, plain)
