"""Operations on whole mixtures: against densities, moments of samples, and numerical integration."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dart_skill.mixture import Gaussian, GaussianMixture, merge
from tests.unit.mixture.random_mixture import random_mixture

seeds = st.integers(0, 10_000)


@given(seed=seeds)
@settings(max_examples=20, deadline=None)
def test_conditional_times_marginal_is_the_joint_density(seed):
    rng = np.random.default_rng(seed)
    mixture, point = random_mixture(rng, 3, 4), rng.normal(size=4)
    conditional = mixture.condition([2, 0], point[[2, 0]]).log_density(point[None, [1, 3]])
    marginal = mixture.marginal([2, 0]).log_density(point[None, [2, 0]])
    assert (conditional + marginal)[0] == pytest.approx(
        mixture.log_density(point[None])[0], abs=1e-9
    )


def test_conditioning_far_away_leaves_the_component_that_decays_slowest():
    mixture = GaussianMixture.from_parameters(
        [0.9, 0.1], [[0.0, 1.0], [0.0, 5.0]], [np.eye(2), [[4.0, 2.0], [2.0, 2.0]]]
    )
    conditional = mixture.condition(0, 1e3)
    np.testing.assert_array_equal(conditional.priors_, [1.0])
    np.testing.assert_allclose(conditional.means_, [[505.0]])
    with pytest.raises(ValueError, match="far away"):
        mixture.condition(0, 1e200)


@given(seed=seeds)
@settings(max_examples=20, deadline=None)
def test_product_times_its_constant_is_the_product_of_densities(seed):
    rng = np.random.default_rng(seed)
    one, other, points = (
        random_mixture(rng, 2, 3),
        random_mixture(rng, 3, 3),
        rng.normal(size=(10, 3)),
    )
    combined, log_constant = one.product(other)
    assert len(combined.priors_) == 6
    np.testing.assert_allclose(
        combined.log_density(points) + log_constant,
        one.log_density(points) + other.log_density(points),
        atol=1e-8,
    )


def test_product_with_a_gaussian_integrates_to_its_constant():
    mixture = random_mixture(np.random.default_rng(1), 3, 1)
    gaussian = Gaussian([0.5], [[0.7]])
    grid = np.linspace(-30, 30, 60_001)[:, None]
    integral = np.exp(mixture.log_density(grid) + gaussian.log_density(grid)).sum() * 1e-3
    assert np.exp(mixture.product(gaussian)[1]) == pytest.approx(integral, rel=1e-9)


@pytest.mark.parametrize("n_rows", [1, 3, 4])
def test_linear_map_with_any_matrix_maps_the_moments(n_rows):
    rng = np.random.default_rng(n_rows)
    mixture, matrix, offset = (
        random_mixture(rng, 3, 3),
        rng.normal(size=(n_rows, 3)),
        rng.normal(size=n_rows),
    )
    mapped, expected = (
        mixture.linear_map(matrix, offset).collapse(),
        mixture.collapse().linear_map(matrix, offset),
    )
    np.testing.assert_allclose(mapped.mean, expected.mean, atol=1e-12)
    np.testing.assert_allclose(
        mapped.covariance, expected.covariance, atol=1e-12 * np.abs(expected.covariance).max()
    )


def test_a_map_into_more_dimensions_can_be_sampled_but_has_no_density():
    mixture = GaussianMixture.from_parameters([0.5, 0.5], [[0.0], [4.0]], [[[1.0]], [[0.25]]])
    mapped = mixture.linear_map([[1.0], [2.0]])
    samples = mapped.sample(1000, np.random.default_rng(0))
    np.testing.assert_allclose(samples[:, 1], 2.0 * samples[:, 0], atol=1e-6)
    with pytest.raises(ValueError, match="component 0 is not positive definite"):
        mapped.log_density(samples)


def test_an_invertible_map_changes_the_density_by_its_volume():
    rng = np.random.default_rng(2)
    mixture, matrix, points = (
        random_mixture(rng, 3, 2),
        rng.normal(size=(2, 2)),
        rng.normal(size=(9, 2)),
    )
    mapped = mixture.linear_map(matrix, [1.0, 2.0]).log_density(points @ matrix.T + [1.0, 2.0])
    np.testing.assert_allclose(
        mapped, mixture.log_density(points) - np.log(abs(np.linalg.det(matrix))), atol=1e-10
    )


def test_collapse_has_the_moments_of_many_samples():
    mixture = random_mixture(np.random.default_rng(3), 4, 2)
    samples = mixture.sample(200_000, np.random.default_rng(4))
    whole = mixture.collapse()
    np.testing.assert_allclose(whole.mean, samples.mean(0), atol=0.03)
    np.testing.assert_allclose(whole.covariance, np.cov(samples.T), rtol=0.03, atol=0.03)


def test_samples_of_a_gaussian_have_its_moments_even_when_it_is_flat():
    gaussian = Gaussian([1.0, 2.0], [[4.0, 2.0], [2.0, 1.0]])
    samples = gaussian.sample(50_000, np.random.default_rng(5))
    np.testing.assert_allclose(samples[:, 0] - 1.0, 2.0 * (samples[:, 1] - 2.0), atol=1e-6)
    assert samples[:, 0].std() == pytest.approx(2.0, rel=0.02)
    assert gaussian.sample(0, np.random.default_rng(0)).shape == (0, 2)


@given(seed=seeds, n_merged=st.integers(1, 5))
@settings(max_examples=20, deadline=None)
def test_merging_components_keeps_mean_and_covariance_of_the_whole(seed, n_merged):
    rng = np.random.default_rng(seed)
    mixture = random_mixture(rng, 5, 3)
    merged = mixture.merge(rng.permutation(5)[:n_merged])
    assert len(merged.priors_) == 6 - n_merged
    assert merged.priors_.sum() == pytest.approx(1.0, abs=1e-14)
    before, after = mixture.collapse(), merged.collapse()
    np.testing.assert_allclose(after.mean, before.mean, atol=1e-12)
    np.testing.assert_allclose(after.covariance, before.covariance, rtol=1e-11, atol=1e-11)


def test_two_gaussians_merge_as_the_closed_form_says():
    merged = merge([Gaussian([0.0], [[1.0]]), Gaussian([4.0], [[3.0]])], [3.0, 1.0])
    assert merged.mean[0] == pytest.approx(1.0)
    assert merged.covariance[0, 0] == pytest.approx(0.75 * 1.0 + 0.25 * 3.0 + 0.75 * 0.25 * 16.0)


def test_a_component_cut_in_two_is_what_reduction_joins_again():
    mixture = GaussianMixture.from_parameters(
        [0.3, 0.3, 0.4], [[0.0, 0.0], [0.0, 0.0], [5.0, 1.0]], [np.eye(2)] * 3
    )
    reduced = mixture.reduce(2)
    np.testing.assert_allclose(sorted(reduced.priors_), [0.4, 0.6])
    points = np.random.default_rng(6).normal(size=(20, 2))
    np.testing.assert_allclose(
        reduced.log_density(points), mixture.log_density(points), atol=1e-12
    )
    np.testing.assert_allclose(mixture.reduce(1).means_[0], mixture.collapse().mean)
    np.testing.assert_array_equal(mixture.reduce(3).means_, mixture.means_)


def test_mixtures_together_have_the_weighted_mean_of_their_densities():
    rng = np.random.default_rng(7)
    one, other, points = (
        random_mixture(rng, 2, 2),
        random_mixture(rng, 3, 2),
        rng.normal(size=(8, 2)),
    )
    both = GaussianMixture.together([one, other], [1.0, 3.0])
    expected = 0.25 * np.exp(one.log_density(points)) + 0.75 * np.exp(other.log_density(points))
    np.testing.assert_allclose(np.exp(both.log_density(points)), expected, rtol=1e-10)
    absent = GaussianMixture.together([one, other], [1.0, 0.0])
    np.testing.assert_allclose(absent.log_density(points), one.log_density(points), rtol=1e-12)


def test_marginal_keeps_the_order_asked_for():
    mixture = random_mixture(np.random.default_rng(8), 2, 3)
    marginal = mixture.marginal([2, 0])
    np.testing.assert_array_equal(marginal.means_, mixture.means_[:, [2, 0]])
    np.testing.assert_array_equal(marginal.covariances_[:, 0, 1], mixture.covariances_[:, 2, 0])


@pytest.mark.parametrize(
    ("operation", "message"),
    [
        (lambda m: m.marginal([3]), "within 0..2"),
        (lambda m: m.condition([0, 1, 2], np.zeros(3)), "all dimensions"),
        (lambda m: m.condition([0], [np.nan]), "nan"),
        (lambda m: m.condition([0], [0.0, 1.0]), "length 1"),
        (lambda m: m.linear_map(np.eye(2)), "3 columns"),
        (lambda m: m.product(Gaussian([0.0], [[1.0]])), "agree in dimension"),
        (lambda m: m.merge([0, 0]), "distinct"),
        (lambda m: m.merge([]), "indices"),
        (lambda m: m.reduce(0), "at least 1"),
        (lambda m: m.reduce(3), "at most the 2"),
        (lambda m: m.sample(-1, np.random.default_rng(0)), "at least 0"),
        (lambda m: GaussianMixture.together([]), "one or more"),
        (lambda m: GaussianMixture.together([m, m.marginal([0])]), "one dimension"),
        (lambda m: GaussianMixture.together([m, m], [0.0, 0.0]), "all zero"),
        (lambda m: m.log_density([[1e200, 0.0, 0.0]]), "row 0.*far away"),
        (lambda m: m.log_density([[0.0, 0.0]]), "3 columns"),
        (lambda m: GaussianMixture(2).collapse(), "call fit"),
        (lambda m: merge([], []), "one or more"),
        (lambda m: merge([Gaussian([0.0], [[1.0]])], [0.0]), "all zero"),
    ],
)
def test_impossible_operations_are_refused(operation, message):
    with pytest.raises(ValueError, match=message):
        operation(random_mixture(np.random.default_rng(9), 2, 3))
