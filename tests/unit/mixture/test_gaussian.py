"""The algebra of Gaussians against closed forms, densities and samples (thesis table 3.1)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from dart_skill.mixture import Gaussian, linear_combination, product


def random_gaussian(rng, n_dims):
    root = rng.normal(size=(n_dims, n_dims))
    return Gaussian(rng.normal(size=n_dims), root @ root.T + 0.1 * np.eye(n_dims))


@given(seed=st.integers(0, 10_000), n_dims=st.integers(1, 5))
@settings(max_examples=30, deadline=None)
def test_log_density_is_that_of_scipy(seed, n_dims):
    rng = np.random.default_rng(seed)
    gaussian = random_gaussian(rng, n_dims)
    points = rng.normal(size=(7, n_dims))
    expected = multivariate_normal(gaussian.mean, gaussian.covariance).logpdf(points)
    np.testing.assert_allclose(
        gaussian.log_density(points), np.atleast_1d(expected), rtol=1e-10, atol=1e-10
    )


@given(seed=st.integers(0, 10_000), n_factors=st.integers(1, 4))
@settings(max_examples=30, deadline=None)
def test_product_times_its_constant_is_the_product_of_densities(seed, n_factors):
    rng = np.random.default_rng(seed)
    factors = [random_gaussian(rng, 3) for _ in range(n_factors)]
    combined, log_constant = product(factors)
    points = rng.normal(size=(10, 3))
    expected = sum(factor.log_density(points) for factor in factors)
    np.testing.assert_allclose(
        combined.log_density(points) + log_constant, expected, rtol=1e-9, atol=1e-9
    )


def test_product_with_a_singular_factor_stays_in_its_subspace():
    line = Gaussian([1.0, 2.0], np.outer([1.0, 1.0], [1.0, 1.0]))
    combined, _ = product([line, Gaussian([0.0, 0.0], np.eye(2))])
    # Along the line x = (1, 2) + s (1, 1): precision 1 + 2, linear term -(1 + 2).
    np.testing.assert_allclose(combined.mean, np.array([1.0, 2.0]) - 1.0, atol=1e-14)
    np.testing.assert_allclose(combined.covariance, np.full((2, 2), 1 / 3), atol=1e-14)


@pytest.mark.parametrize("n_rows", [1, 3, 5])
def test_linear_map_with_any_matrix_has_the_moments_of_mapped_samples(n_rows):
    rng = np.random.default_rng(n_rows)
    gaussian, matrix, offset = (
        random_gaussian(rng, 3),
        rng.normal(size=(n_rows, 3)),
        rng.normal(size=n_rows),
    )
    samples = (
        rng.multivariate_normal(gaussian.mean, gaussian.covariance, 40_000) @ matrix.T + offset
    )
    mapped = gaussian.linear_map(matrix, offset)
    spread = np.sqrt(np.diagonal(mapped.covariance))
    assert np.abs(mapped.mean - samples.mean(0)).max() < 0.03 * spread.max()
    error = np.abs(mapped.covariance - np.atleast_2d(np.cov(samples.T))).max()
    assert error < 0.03 * spread.max() ** 2, error


def test_linear_combination_adds_the_second_covariance():
    """(3.6) as printed repeats the first covariance."""
    combined = linear_combination(
        [Gaussian([1.0], [[1.0]]), Gaussian([2.0], [[4.0]])], [[[2.0]], [[3.0]]], offset=[5.0]
    )
    assert combined.mean[0] == pytest.approx(2.0 + 6.0 + 5.0)
    assert combined.covariance[0, 0] == pytest.approx(4.0 * 1.0 + 9.0 * 4.0)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_conditional_times_marginal_is_the_joint_density(seed):
    rng = np.random.default_rng(seed)
    gaussian, point = random_gaussian(rng, 4), rng.normal(size=4)
    given_dims, rest = [2, 0], [1, 3]
    conditional = gaussian.condition(given_dims, point[given_dims]).log_density(point[rest])
    marginal = gaussian.marginal(given_dims).log_density(point[given_dims])
    assert conditional + marginal == pytest.approx(gaussian.log_density(point), abs=1e-9)


@pytest.mark.parametrize(
    ("mean", "covariance", "message"),
    [
        ([], np.zeros((0, 0)), "empty"),
        ([0.0, np.nan], np.eye(2), "nan at index"),
        ([0.0, 0.0], np.eye(3), r"shape \(2, 2\)"),
        ([0.0, 0.0], [[1.0, 0.5], [0.0, 1.0]], "symmetric"),
        ([0.0, 0.0], [[1.0, 2.0], [2.0, 1.0]], "semi-definite"),
        ([0.0, 0.0], [[1.0, 0.0], [0.0, -1.0]], "variance -1"),
        ([[0.0]], [[1.0]], "1 dimension"),
    ],
)
def test_impossible_parameters_are_refused(mean, covariance, message):
    with pytest.raises(ValueError, match=message):
        Gaussian(mean, covariance)


def test_density_of_a_singular_gaussian_is_refused_with_the_reason():
    with pytest.raises(ValueError, match="not positive definite"):
        Gaussian([0.0, 0.0], np.ones((2, 2))).log_density([0.0, 0.0])


def test_wrong_widths_are_refused_and_not_broadcast():
    gaussian = Gaussian([0.0, 0.0], np.eye(2))
    with pytest.raises(ValueError, match="2 columns"):
        gaussian.log_density(np.zeros((5, 1)))
    with pytest.raises(ValueError, match="2 columns"):
        gaussian.linear_map(np.eye(3))
    with pytest.raises(ValueError, match="within 0..1"):
        gaussian.condition([2], [0.0])
    with pytest.raises(ValueError, match="all dimensions"):
        gaussian.condition([0, 1], [0.0, 0.0])
    with pytest.raises(ValueError, match="agree in dimension"):
        product([gaussian, Gaussian([0.0], [[1.0]])])
    with pytest.raises(ValueError, match="at least one"):
        product([])
