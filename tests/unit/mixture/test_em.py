"""EM for Gaussian mixtures: what a fit finds, what must not change it, and what it refuses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from dart_skill.mixture import (
    GaussianMixture,
    Parameters,
    expectation,
    kmeans_start,
    maximisation,
)


def clusters(rng, n=150, centres=((0, 0), (6, 1), (-3, 7)), widths=(1.0, 0.5, 1.5)):
    return np.concatenate([rng.normal(c, w, (n, 2)) for c, w in zip(centres, widths, strict=True)])


def by_first_mean(mixture):
    order = np.argsort(mixture.means_[:, 0])
    return mixture.priors_[order], mixture.means_[order], mixture.covariances_[order]


def assert_same_mixture(one, other, rtol=1e-8):
    for left, right in zip(by_first_mean(one), by_first_mean(other), strict=True):
        np.testing.assert_allclose(left, right, rtol=rtol, atol=rtol * np.abs(right).max())


def assert_usable(mixture):
    for name in ("priors_", "means_", "covariances_"):
        assert np.isfinite(getattr(mixture, name)).all(), name
    assert mixture.priors_.sum() == pytest.approx(1.0)
    assert mixture.priors_.min() > 0
    np.linalg.cholesky(mixture.covariances_)


def tight(**options):
    return GaussianMixture(3, tolerance=1e-13, max_iterations=2000, **options)


def test_fit_recovers_the_mixture_that_made_the_samples():
    rng = np.random.default_rng(0)
    truth = GaussianMixture.from_parameters(
        [0.2, 0.5, 0.3],
        [[-6.0, 0.0], [0.0, 5.0], [7.0, 1.0]],
        [[[1.0, 0.3], [0.3, 0.5]], [[2.0, -0.8], [-0.8, 1.0]], np.eye(2)],
    )
    fitted = GaussianMixture(3).fit(truth.sample(20_000, rng), rng=rng)
    assert fitted.converged_
    priors, means, covariances = by_first_mean(fitted)
    np.testing.assert_allclose(priors, truth.priors_, atol=0.015)
    np.testing.assert_allclose(means, truth.means_, atol=0.06)
    np.testing.assert_allclose(covariances, truth.covariances_, atol=0.08)


def test_one_component_is_the_weighted_mean_and_covariance():
    rng = np.random.default_rng(1)
    samples, weights = rng.normal(size=(80, 3)), rng.random(80)
    mixture = GaussianMixture(1).fit(samples, weights, rng=rng)
    np.testing.assert_allclose(
        mixture.means_[0], np.average(samples, axis=0, weights=weights), rtol=1e-12
    )
    expected = np.cov(samples.T, aweights=weights, bias=True)
    np.testing.assert_allclose(mixture.covariances_[0], expected, rtol=1e-10, atol=1e-12)


def test_density_and_responsibilities_follow_their_definition():
    rng = np.random.default_rng(2)
    samples = clusters(rng)
    mixture = GaussianMixture(3).fit(samples, rng=rng)
    logs = np.stack(
        [
            np.log(p) + multivariate_normal(m, c).logpdf(samples)
            for p, m, c in zip(mixture.priors_, mixture.means_, mixture.covariances_, strict=True)
        ],
        axis=1,
    )
    expected = logsumexp(logs, axis=1)
    np.testing.assert_allclose(mixture.log_density(samples), expected, rtol=1e-10)
    np.testing.assert_allclose(
        mixture.responsibilities(samples), np.exp(logs - expected[:, None]), atol=1e-10
    )
    assert mixture.log_likelihood_ == pytest.approx(expected.sum(), rel=1e-9)


def test_every_iteration_raises_the_likelihood_with_the_floor_active():
    rng = np.random.default_rng(3)
    samples = np.column_stack([clusters(rng), np.zeros(450)])
    samples[:150, 1] = 0.01 * samples[:150, 0]
    responsibilities = rng.dirichlet(np.ones(4), 450)
    history = []
    for _ in range(60):
        parameters = maximisation([samples], responsibilities, floor=1e-3)
        responsibilities, log_density = expectation([samples], parameters)
        history.append(log_density.mean())
    assert np.diff(history).min() > -1e-10, np.diff(history).min()
    assert history[-1] > history[0] + 0.1


@given(exponents=st.lists(st.integers(-8, 8), min_size=2, max_size=2))
@settings(max_examples=20, deadline=None)
def test_a_change_of_units_changes_nothing_but_units(exponents):
    factors = 10.0 ** np.array(exponents)
    samples = clusters(np.random.default_rng(4))
    plain = GaussianMixture(3).fit(samples, rng=np.random.default_rng(5))
    scaled = GaussianMixture(3).fit(samples * factors, rng=np.random.default_rng(5))
    np.testing.assert_allclose(scaled.priors_, plain.priors_, rtol=1e-9)
    np.testing.assert_allclose(scaled.means_, plain.means_ * factors, rtol=1e-7)
    expected = plain.covariances_ * np.outer(factors, factors)
    np.testing.assert_allclose(scaled.covariances_, expected, rtol=1e-6)
    shift = len(samples) * np.log(factors).sum()
    assert scaled.log_likelihood_ + shift == pytest.approx(plain.log_likelihood_, rel=1e-8)


def test_integer_weights_equal_repeated_samples():
    rng = np.random.default_rng(7)
    samples, counts = clusters(rng, n=50), rng.integers(0, 4, 150)
    weighted = tight().fit(samples, counts, rng=np.random.default_rng(1))
    repeated = tight().fit(np.repeat(samples, counts, axis=0), rng=np.random.default_rng(1))
    assert_same_mixture(weighted, repeated)
    assert weighted.log_likelihood_ == pytest.approx(repeated.log_likelihood_, rel=1e-9)
    everywhere = np.repeat(samples, counts, axis=0)
    assert weighted.bic(samples, counts) == pytest.approx(weighted.bic(everywhere), rel=1e-12)


def test_samples_without_weight_play_no_part():
    rng = np.random.default_rng(9)
    samples = clusters(rng)
    with_junk = np.concatenate([samples, np.full((5, 2), 1e6)])
    weights = np.concatenate([np.ones(450), np.zeros(5)])
    one = GaussianMixture(3).fit(samples, rng=np.random.default_rng(1))
    other = GaussianMixture(3).fit(with_junk, weights, rng=np.random.default_rng(1))
    assert_same_mixture(one, other)


def test_bic_chooses_the_number_of_clusters():
    rng = np.random.default_rng(11)
    samples = clusters(rng)
    scores = {
        k: GaussianMixture(k, n_starts=3).fit(samples, rng=rng).bic(samples) for k in range(1, 6)
    }
    assert min(scores, key=scores.get) == 3, scores


def test_number_of_parameters_counts_priors_means_and_symmetric_covariances():
    mixture = GaussianMixture(2).fit(
        np.random.default_rng(0).normal(size=(30, 3)), rng=np.random.default_rng(0)
    )
    assert mixture.n_parameters == 1 + 2 * (3 + 6)


def test_plus_plus_centres_find_separated_clusters():
    """A start that weighs by the farthest centre instead of the nearest finds them in a third of
    cases.
    """
    samples = clusters(np.random.default_rng(13), centres=((0, 0), (30, 0), (0, 30)))
    weights, found = np.ones(450), 0
    for seed in range(200):
        shares = kmeans_start(samples, weights, 3, np.random.default_rng(seed))
        found += shares.sum(0).tolist() == [150.0, 150.0, 150.0]
    assert found >= 195, f"{found} of 200"


def test_a_component_that_owns_no_sample_is_reseeded():
    samples = clusters(np.random.default_rng(14))
    lost = GaussianMixture.from_parameters(
        np.full(3, 1 / 3), [[0.0, 0.0], [6.0, 1.0], [1e4, 1e4]], [np.eye(2)] * 3
    )
    fit = GaussianMixture(3, tolerance=1e-9, max_iterations=500).fit(samples, start=lost)
    assert fit.priors_.min() > 0.2, fit.priors_


def test_more_components_than_distinct_samples_stay_finite():
    samples = np.repeat([[0.0, 0.0], [1.0, 1.0]], 40, axis=0)
    mixture = GaussianMixture(8).fit(samples, rng=np.random.default_rng(0))
    assert_usable(mixture)


def test_log_likelihood_stop_ignores_where_zero_is():
    """The thesis's ratio of likelihoods would stop at once, or never, when they change sign."""
    samples = clusters(np.random.default_rng(15))
    scale = np.exp(
        -GaussianMixture(3).fit(samples, rng=np.random.default_rng(0)).log_likelihood_ / 900
    )
    centred = GaussianMixture(3).fit(samples / scale, rng=np.random.default_rng(0))
    plain = GaussianMixture(3).fit(samples, rng=np.random.default_rng(0))
    assert centred.n_iterations_ == plain.n_iterations_


def degenerate():
    rng = np.random.default_rng(16)
    base = clusters(rng)
    return {
        "identical": np.ones((20, 3)),
        "zeros": np.zeros((20, 2)),
        "constant column": np.column_stack([base, np.full(450, 0.3)]),
        "collinear": np.column_stack([base, base @ [1.0, 2.0]]),
        "outlier": np.vstack([base, [[1e3, 1e3]]]),
        "offset": base + 1e8,
        "small": base * 1e-8,
        "as many as components": base[:3],
        "line": np.linspace(0, 1, 50)[:, None],
    }


@pytest.mark.parametrize("case", degenerate())
def test_degenerate_samples_give_a_usable_mixture(case):
    samples = degenerate()[case]
    mixture = GaussianMixture(3).fit(samples, rng=np.random.default_rng(0))
    assert_usable(mixture)
    assert np.isfinite(mixture.log_density(samples)).all()
    np.testing.assert_allclose(
        mixture.priors_ @ mixture.means_, samples.mean(0), rtol=1e-2, atol=1e-9
    )


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        (np.zeros((0, 2)), "empty"),
        (np.zeros(10), r"reshape\(-1, 1\)"),
        ([[0.0, 1.0], [np.nan, 1.0]], r"nan at index \(1, 0\)"),
        ([[0.0, 1.0], [np.inf, 1.0]], "inf"),
        (np.zeros((2, 2)), "at least as many samples"),
        ([["a", "b"]], "numbers"),
        ([[1.0, 2.0], [3.0]], "regular array"),
    ],
)
def test_unusable_samples_are_refused_by_name(samples, message):
    with pytest.raises(ValueError, match=message):
        GaussianMixture(3).fit(samples, rng=np.random.default_rng(0))


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        (np.zeros(450), "all zero"),
        (np.full(450, -1.0), "negative"),
        (np.ones(3), "length 450"),
        (np.r_[1.0, np.zeros(449)], "at least as many samples"),
    ],
)
def test_unusable_weights_are_refused(weights, message):
    with pytest.raises(ValueError, match=message):
        GaussianMixture(3).fit(
            clusters(np.random.default_rng(0)), weights, rng=np.random.default_rng(0)
        )


@pytest.mark.parametrize(
    "options",
    [
        {"n_components": 0},
        {"n_components": 2.5},
        {"n_components": True},
        {"n_components": 2, "covariance_floor": 0.0},
        {"n_components": 2, "tolerance": -1.0},
        {"n_components": 2, "max_iterations": 0},
        {"n_components": 2, "n_starts": 0},
    ],
)
def test_impossible_hyper_parameters_are_refused(options):
    with pytest.raises(ValueError):
        GaussianMixture(**options)


def test_an_unfitted_mixture_says_so():
    with pytest.raises(ValueError, match="call fit or from_parameters"):
        GaussianMixture(2).log_density([[0.0]])


@pytest.mark.parametrize(
    ("priors", "means", "covariances", "message"),
    [
        ([0.5, 0.6], [[0.0], [1.0]], np.ones((2, 1, 1)), "sum to one"),
        ([1.0, 0.0], [[0.0], [1.0]], np.ones((2, 1, 1)), "positive"),
        ([1.0], [[0.0], [1.0]], np.ones((2, 1, 1)), "one mean per prior"),
        ([0.5, 0.5], [[0.0], [1.0]], np.ones((1, 1, 1)), "shape"),
        ([0.5, 0.5], [[0.0], [1.0]], [[[1.0]], [[0.0]]], "component 1 is not positive definite"),
    ],
)
def test_impossible_parameters_are_refused(priors, means, covariances, message):
    with pytest.raises(ValueError, match=message):
        GaussianMixture.from_parameters(priors, means, covariances)


def test_blocks_share_their_responsibilities():
    """Two blocks are one mixture over all columns whose covariances are block-diagonal."""
    rng = np.random.default_rng(20)
    samples = clusters(rng)
    parameters = Parameters(
        np.array([0.4, 0.6]),
        [np.array([[0.0], [1.0]]), np.array([[2.0], [3.0]])],
        [np.array([[[1.0]], [[2.0]]]), np.array([[[0.5]], [[3.0]]])],
    )
    joined = GaussianMixture.from_parameters(
        [0.4, 0.6], [[0.0, 2.0], [1.0, 3.0]], [np.diag([1.0, 0.5]), np.diag([2.0, 3.0])]
    )
    shares, log_density = expectation([samples[:, :1], samples[:, 1:]], parameters)
    np.testing.assert_allclose(shares, joined.responsibilities(samples), atol=1e-12)
    np.testing.assert_allclose(log_density, joined.log_density(samples), rtol=1e-12)
