"""Split and merge: moments, the thesis's numbers by hand, and when they happen."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dart_skill.mixture import (
    GaussianMixture,
    SplitMerge,
    mean_log_likelihood,
    split,
    split_and_merge,
)
from tests.unit.mixture.random_mixture import random_mixture

inside = st.floats(0.05, 0.95)


def raw_moments(priors, means, covariances):
    """Weight, first and second moment, summed over the last but one axes that components run
    along.
    """
    second = covariances + means[..., :, None] * means[..., None, :]
    return (
        np.sum(priors, -1),
        np.einsum("...k,...ki->...i", priors, means),
        np.einsum("...k,...kij->...ij", priors, second),
    )


def parameters(mixture):
    return mixture.priors_, mixture.means_, mixture.covariances_


def assert_same_moments(got, expected):
    for one, other in zip(got, expected, strict=True):
        np.testing.assert_allclose(one, np.broadcast_to(other, one.shape), rtol=0, atol=1e-12)


@given(seed=st.integers(0, 10_000), axis=st.integers(0, 2), alpha=inside, beta=inside, u=inside)
@settings(max_examples=60, deadline=None)
def test_a_split_keeps_weight_mean_and_second_moment_for_all_parameters(
    seed, axis, alpha, beta, u
):
    rng = np.random.default_rng(seed)
    mixture, index = random_mixture(rng), int(rng.integers(3))
    halved = split(mixture, index, axis, SplitMerge(alpha=alpha, beta=beta, u=u))
    assert_same_moments(raw_moments(*parameters(halved)), raw_moments(*parameters(mixture)))
    assert np.linalg.eigvalsh(halved.covariances_).min() > 0
    both = [index, 3]
    assert halved.priors_[both] == pytest.approx(
        [alpha * mixture.priors_[index], (1 - alpha) * mixture.priors_[index]]
    )
    others = np.delete(np.arange(3), index)
    np.testing.assert_array_equal(halved.means_[others], mixture.means_[others])


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_a_merger_is_that_of_the_mixture(seed):
    rng = np.random.default_rng(seed)
    mixture = random_mixture(rng, 4)
    always = SplitMerge(split_threshold=1e9, merge_threshold=1e9)
    adapted = split_and_merge(mixture, rng.normal(size=(50, 3)), rule=always)
    first, second = adapted.merged
    known = mixture.merge([first, second])  # which puts it last
    order = np.insert(np.arange(2), first, 2)
    for got, expected in zip(parameters(adapted.mixture), parameters(known), strict=True):
        np.testing.assert_allclose(got, expected[order], atol=1e-12)


def test_the_thesis_s_split_by_hand():
    """alpha = beta = 1/2, u^2 = 3/4: means -+ sqrt(3)/2 a, both covariances Sigma - 3/4 a a';
    (5.9) of the thesis has a wrong sign.
    """
    mixture = GaussianMixture.from_parameters([1.0], [[1.0, 2.0]], [[[1.0, 0.0], [0.0, 16.0]]])
    halved = split(mixture, 0)
    np.testing.assert_allclose(halved.priors_, 0.5)
    np.testing.assert_allclose(
        np.sort(halved.means_[:, 1]), [2 - 2 * np.sqrt(3), 2 + 2 * np.sqrt(3)]
    )
    np.testing.assert_allclose(halved.means_[:, 0], 1.0)
    np.testing.assert_allclose(halved.covariances_, [[[1.0, 0.0], [0.0, 4.0]]] * 2, atol=1e-13)
    shorter = split(mixture, 0, axis=1)
    np.testing.assert_allclose(
        np.sort(shorter.means_[:, 0]), [1 - np.sqrt(0.75), 1 + np.sqrt(0.75)]
    )


def two_clusters(rng, apart=8.0, n=300):
    return np.concatenate([rng.normal(size=(n, 2)), rng.normal(size=(n, 2)) + [apart, 0.0]])


def one_gaussian(samples, weights=None):
    weights = np.ones(len(samples)) if weights is None else weights
    mean = np.average(samples, axis=0, weights=weights)
    return GaussianMixture.from_parameters(
        [1.0], mean[None], np.cov(samples.T, aweights=weights, ddof=0)[None]
    )


def test_two_clusters_are_split_and_stay_split_and_one_is_left_whole():
    samples = two_clusters(np.random.default_rng(0))
    once = split_and_merge(one_gaussian(samples), samples)
    assert (once.split, once.merged) == (0, None) and once.split_gain > 0.16
    np.testing.assert_allclose(np.sort(once.mixture.means_[:, 0]), [0.0, 8.0], atol=0.8)
    again = split_and_merge(once.mixture, samples)
    assert (
        (again.split, again.merged) == (None, None)
        and again.split_gain < 0.16
        and again.merge_loss > 0.16
    )
    whole = split_and_merge(one_gaussian(samples[:300]), samples[:300])
    assert (whole.split, whole.merged) == (None, None) and whole.merge_loss == np.inf


def test_only_what_has_weight_is_split():
    samples, weights = two_clusters(np.random.default_rng(1)), np.repeat([1.0, 1e-9], 300)
    assert split_and_merge(one_gaussian(samples, weights), samples, weights).split is None


def test_duplicates_are_merged_and_the_closest_first():
    samples = two_clusters(np.random.default_rng(2))
    thrice = GaussianMixture.from_parameters(
        [0.25, 0.5, 0.25], [[0.0, 0.0], [8.0, 0.0], [0.1, 0.0]], [np.eye(2)] * 3
    )
    adapted = split_and_merge(thrice, samples)
    assert adapted.split is None and adapted.merged == (0, 2) and adapted.merge_loss < 0.01
    np.testing.assert_allclose(adapted.mixture.means_, [[0.05, 0.0], [8.0, 0.0]], atol=1e-12)


@pytest.mark.parametrize("normalise", [True, False])
def test_gain_and_loss_are_differences_of_the_weighted_likelihood(normalise):
    rng = np.random.default_rng(3)
    mixture, samples, weights = (
        random_mixture(rng, 2),
        rng.normal(size=(50, 3)),
        rng.gamma(1.0, size=50),
    )
    adapted = split_and_merge(
        mixture,
        samples,
        weights,
        SplitMerge(split_threshold=1e9, merge_threshold=0.0, normalise=normalise),
    )
    scale = 1.0 if normalise else weights.sum()
    present = mean_log_likelihood(mixture, samples, weights)
    best = max(mean_log_likelihood(split(mixture, i), samples, weights) for i in (0, 1))
    assert adapted.split_gain == pytest.approx(scale * (best - present), abs=1e-10)
    merged = mean_log_likelihood(mixture.merge([0, 1]), samples, weights)
    assert adapted.merge_loss == pytest.approx(scale * (present - merged), abs=1e-10)


def test_refined_candidates_are_steps_of_em():
    """One component and its only split, refined five times, against the fit of the mixture from
    the same start.
    """
    samples = two_clusters(np.random.default_rng(4), apart=5.0)
    whole = one_gaussian(samples)
    refined = split_and_merge(whole, samples, rule=SplitMerge(refine=5)).mixture
    fitted = GaussianMixture(2, max_iterations=5, tolerance=0.0).fit(
        samples, start=split(whole, 0)
    )
    for got, known in zip(parameters(refined), parameters(fitted), strict=True):
        np.testing.assert_allclose(got, known, atol=1e-9)


def test_more_axes_find_a_split_across_the_longest():
    """Two bars side by side, longer than they are apart."""
    rng = np.random.default_rng(6)
    bars = np.concatenate([rng.normal(size=(400, 2)) * [6.0, 0.3] + [0, y] for y in (-3.0, 3.0)])
    assert split_and_merge(one_gaussian(bars), bars).split is None
    across = split_and_merge(one_gaussian(bars), bars, rule=SplitMerge(n_axes=2))
    assert across.split == 0
    np.testing.assert_allclose(np.sort(across.mixture.means_[:, 1]), [-3.0, 3.0], atol=0.6)


@pytest.mark.parametrize("refine", [0, 3])
def test_a_component_that_owns_nothing_does_no_harm(refine):
    mixture = GaussianMixture.from_parameters(
        [0.5, 0.5], [[0.0, 0.0], [1e6, 0.0]], [np.eye(2)] * 2
    )
    adapted = split_and_merge(
        mixture, np.random.default_rng(0).normal(size=(100, 2)), rule=SplitMerge(refine=refine)
    )
    assert np.isfinite(adapted.mixture.means_).all() and adapted.split is None


@pytest.mark.parametrize(
    "options, message",
    [
        ({"alpha": 0.0}, "alpha must be above 0"),
        ({"u": 1.0}, "u must be below 1"),
        ({"beta": np.nan}, "beta holds nan"),
        ({"n_axes": 0}, "n_axes"),
        ({"refine": -1}, "refine"),
        ({"split_threshold": -0.1}, "split_threshold"),
    ],
)
def test_a_bad_rule_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        SplitMerge(**options)


def test_bad_input_is_refused():
    mixture = random_mixture(np.random.default_rng(0))
    for arguments, message in (
        ((3,), "index must be below 3"),
        ((0, 3), "axis must be below 3"),
        ((-1,), "index"),
    ):
        with pytest.raises(ValueError, match=message):
            split(mixture, *arguments)
    for samples, weights, message in (
        (np.zeros((5, 2)), None, "columns"),
        (np.zeros((0, 3)), None, "empty"),
        (np.zeros((5, 3)), np.zeros(5), "all zero"),
        (np.full((5, 3), np.nan), None, "nan"),
    ):
        with pytest.raises(ValueError, match=message):
            split_and_merge(mixture, samples, weights)
    with pytest.raises(ValueError, match="fit or from_parameters"):
        split(GaussianMixture(2), 0)
