"""Linear equations with a handful of unknowns, beside LAPACK's."""

import numpy as np
import pytest

from dart_skill.common import small_matrices
from dart_skill.common.small_matrices import factor_into, invert_into, solve_into
from tests.interpreted import interpreted


def positive_definite(n, rng):
    root = rng.standard_normal((n, n))
    return root @ root.T + 0.1 * np.eye(n)


def solved(matrix, right, module=small_matrices):
    lower, solution = np.empty(np.shape(matrix)), np.empty(len(right))
    module.factor_into(np.asarray(matrix), lower)
    module.solve_into(lower, right, solution)
    return solution


@pytest.mark.parametrize("n", [1, 2, 6, 7, 14])
def test_the_solution_is_that_of_lapack(n):
    rng = np.random.default_rng(n)
    matrix, right = positive_definite(n, rng), rng.standard_normal(n)
    np.testing.assert_allclose(
        solved(matrix, right),
        np.linalg.solve(matrix, right),
        rtol=1e-9,
        atol=1e-12,
    )


@pytest.mark.parametrize("n", [1, 3, 7])
def test_the_factor_is_that_of_lapack_and_may_take_the_matrix_s_place(n):
    matrix = positive_definite(n, np.random.default_rng(n))
    expected, apart = np.linalg.cholesky(matrix), np.zeros((n, n))
    factor_into(matrix, apart)
    factor_into(matrix, matrix)
    np.testing.assert_allclose(apart, expected, atol=1e-12)
    np.testing.assert_array_equal(np.tril(matrix), apart)


@pytest.mark.parametrize("n", [1, 3, 7])
def test_the_inverse_of_a_triangle_is_that_of_lapack(n):
    lower, inverse = (
        np.tril(np.random.default_rng(n).uniform(1.0, 2.0, (n, n))),
        np.full((n, n), np.nan),
    )
    invert_into(lower + np.triu(np.full((n, n), 9.0), 1), inverse)
    np.testing.assert_allclose(inverse, np.linalg.inv(lower), rtol=1e-9, atol=1e-12)
    plain = np.full((n, n), np.nan)
    interpreted("dart_skill.common.small_matrices").invert_into(lower, plain)
    np.testing.assert_array_equal(inverse, plain)


def test_what_is_above_the_diagonal_is_not_read():
    rng = np.random.default_rng(0)
    matrix, right = positive_definite(5, rng), rng.standard_normal(5)
    expected = solved(matrix, right)
    matrix[np.triu_indices(5, 1)] = np.nan
    np.testing.assert_array_equal(solved(matrix, right), expected)


def test_the_solution_may_take_the_place_of_the_right_side():
    rng = np.random.default_rng(1)
    matrix, right = positive_definite(4, rng), rng.standard_normal(4)
    expected, lower = solved(matrix, right), np.zeros((4, 4))
    factor_into(matrix, lower)
    solve_into(lower, right, right)
    np.testing.assert_array_equal(right, expected)


@pytest.mark.parametrize(
    "module", [small_matrices, interpreted("dart_skill.common.small_matrices")]
)
@pytest.mark.parametrize(
    ("matrix", "pivot"), [([[1.0, 0.0], [2.0, 1.0]], 1), ([[0.0]], 0), ([[np.nan]], 0)]
)
def test_a_matrix_that_is_not_positive_definite_is_refused(module, matrix, pivot):
    with pytest.raises(ValueError, match=f"not positive definite: its pivot {pivot} is"):
        solved(matrix, np.ones(len(matrix)), module)


def test_compiled_and_interpreted_have_the_same_bits():
    plain, rng = interpreted("dart_skill.common.small_matrices"), np.random.default_rng(2)
    for n in (1, 4, 7):
        matrix, right = positive_definite(n, rng), rng.standard_normal(n)
        np.testing.assert_array_equal(solved(matrix, right), solved(matrix, right, plain))
