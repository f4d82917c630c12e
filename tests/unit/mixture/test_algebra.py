"""Operations on whole mixtures: against densities and moments of samples."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dart_skill.mixture import Gaussian, GaussianMixture
from tests.unit.mixture.random_mixture import random_mixture, whole

seeds = st.integers(0, 10_000)


def test_samples_of_a_mixture_have_the_moments_of_the_whole():
    mixture = random_mixture(np.random.default_rng(3), 4, 2)
    samples = mixture.sample(200_000, np.random.default_rng(4))
    np.testing.assert_allclose(whole(mixture).mean, samples.mean(0), atol=0.03)
    np.testing.assert_allclose(whole(mixture).covariance, np.cov(samples.T), rtol=0.03, atol=0.03)


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
    before, after = whole(mixture), whole(merged)
    np.testing.assert_allclose(after.mean, before.mean, atol=1e-12)
    np.testing.assert_allclose(after.covariance, before.covariance, rtol=1e-11, atol=1e-11)


def test_two_gaussians_merge_as_the_closed_form_says():
    merged = GaussianMixture.from_parameters(
        [0.75, 0.25], [[0.0], [4.0]], [[[1.0]], [[3.0]]]
    ).merge([0, 1])
    assert merged.means_[0, 0] == pytest.approx(1.0)
    assert merged.covariances_[0, 0, 0] == pytest.approx(
        0.75 * 1.0 + 0.25 * 3.0 + 0.75 * 0.25 * 16.0
    )


def test_marginal_keeps_the_order_asked_for():
    mixture = random_mixture(np.random.default_rng(8), 2, 3)
    marginal = mixture.marginal([2, 0])
    np.testing.assert_array_equal(marginal.means_, mixture.means_[:, [2, 0]])
    np.testing.assert_array_equal(marginal.covariances_[:, 0, 1], mixture.covariances_[:, 2, 0])


@pytest.mark.parametrize(
    ("operation", "message"),
    [
        (lambda m: m.marginal([3]), "within 0..2"),
        (lambda m: m.merge([0, 0]), "distinct"),
        (lambda m: m.merge([]), "indices"),
        (lambda m: m.sample(-1, np.random.default_rng(0)), "at least 0"),
        (lambda m: m.log_density([[1e200, 0.0, 0.0]]), "row 0.*far away"),
        (lambda m: m.log_density([[0.0, 0.0]]), "3 columns"),
        (lambda m: GaussianMixture(2).merge([0]), "call fit"),
    ],
)
def test_impossible_operations_are_refused(operation, message):
    with pytest.raises(ValueError, match=message):
        operation(random_mixture(np.random.default_rng(9), 2, 3))
