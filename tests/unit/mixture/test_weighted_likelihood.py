"""The likelihood of weighted data against that of repeated and of resampled data, and how
resampling draws.
"""

import numpy as np
import pytest

from dart_skill.mixture import (
    GaussianMixture,
    mean_log_likelihood,
    resampled_mean_log_likelihood,
    stochastic_universal_sampling,
)

MIXTURE = GaussianMixture.from_parameters(
    [0.3, 0.7], [[0.0, 1.0], [3.0, -1.0]], [np.eye(2), [[2.0, 0.5], [0.5, 1.0]]]
)


def weighted_samples(seed=0, n=40):
    rng = np.random.default_rng(seed)
    return MIXTURE.sample(n, rng), rng.gamma(1.0, size=n), rng


def test_the_closed_form_is_the_weighted_mean_of_log_densities():
    standard = GaussianMixture.from_parameters([1.0], [[0.0]], [[[1.0]]])
    # log N(x; 0, 1) = -x^2 / 2 - log(2 pi) / 2; x = 2 weighs three quarters.
    expected = -0.5 * (0.25 * 1.0 + 0.75 * 4.0) - 0.5 * np.log(2 * np.pi)
    assert mean_log_likelihood(standard, [[1.0], [2.0]], [1.0, 3.0]) == pytest.approx(
        expected, abs=1e-14
    )


def test_an_integer_weight_is_a_repeated_sample_and_the_scale_of_weights_does_not_matter():
    samples, _, rng = weighted_samples()
    counts = rng.integers(0, 4, len(samples))
    repeated = MIXTURE.log_density(np.repeat(samples, counts, axis=0)).mean()
    assert mean_log_likelihood(MIXTURE, samples, counts) == pytest.approx(repeated, abs=1e-13)
    assert mean_log_likelihood(MIXTURE, samples, 1e6 * counts) == pytest.approx(
        repeated, abs=1e-13
    )
    assert mean_log_likelihood(MIXTURE, samples) == pytest.approx(
        MIXTURE.log_density(samples).mean(), abs=1e-13
    )


@pytest.mark.parametrize("seed", range(5))
def test_resampled_data_tend_to_the_closed_form(seed):
    samples, weights, rng = weighted_samples(seed)
    exact = mean_log_likelihood(MIXTURE, samples, weights)
    size = np.abs(MIXTURE.log_density(samples)).sum()
    for n_drawn in (100, 1000, 100_000):
        # Every sample is drawn as often as its weight says, give or take one.
        error = abs(resampled_mean_log_likelihood(MIXTURE, samples, weights, n_drawn, rng) - exact)
        assert error <= size / n_drawn, (n_drawn, error)


@pytest.mark.parametrize("n_drawn", [1, 7, 50, 1001])
def test_everything_is_drawn_as_often_as_its_weight_says_give_or_take_one(n_drawn):
    rng = np.random.default_rng(n_drawn)
    weights = rng.gamma(0.5, size=30)
    drawn = stochastic_universal_sampling(weights, n_drawn, rng)
    expected = n_drawn * weights / weights.sum()
    assert len(drawn) == n_drawn and np.all(np.diff(drawn) >= 0)
    assert np.abs(np.bincount(drawn, minlength=30) - expected).max() < 1


def test_on_average_everything_is_drawn_as_often_as_its_weight_says():
    rng, weights = np.random.default_rng(3), np.array([0.05, 0.6, 0.0, 0.35])
    counts = np.array(
        [
            np.bincount(stochastic_universal_sampling(weights, 3, rng), minlength=4)
            for _ in range(4000)
        ]
    )
    np.testing.assert_allclose(counts.mean(axis=0), 3 * weights, atol=0.03)
    assert counts[:, 2].max() == 0


def test_equal_weights_are_drawn_equally_often_and_a_single_one_always():
    rng = np.random.default_rng(0)
    for _ in range(50):
        np.testing.assert_array_equal(
            np.bincount(stochastic_universal_sampling(np.full(7, 0.1), 21, rng)), 3
        )
        np.testing.assert_array_equal(stochastic_universal_sampling([0.0, 2.0, 0.0], 5, rng), 1)
    assert stochastic_universal_sampling([1.0], 0, rng).size == 0


@pytest.mark.parametrize(
    "weights, message",
    [
        ([], "empty"),
        ([0.0, 0.0], "all zero"),
        ([1.0, -1.0], "negative"),
        ([np.nan, 1.0], "nan"),
        ([[1.0]], "dimension"),
    ],
)
def test_weights_that_are_none_are_refused(weights, message):
    with pytest.raises(ValueError, match=message):
        stochastic_universal_sampling(weights, 3, np.random.default_rng(0))


def test_bad_samples_are_refused():
    with pytest.raises(ValueError, match="length 1"):
        mean_log_likelihood(MIXTURE, [[0.0, 0.0]], [1.0, 2.0])
    with pytest.raises(ValueError, match="columns"):
        mean_log_likelihood(MIXTURE, [[0.0]])
    with pytest.raises(ValueError, match="n_drawn"):
        resampled_mean_log_likelihood(MIXTURE, [[0.0, 0.0]], [1.0], -1, np.random.default_rng(0))
