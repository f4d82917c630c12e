"""A prior on the covariances: closed forms, what it keeps of EM, and what it is for: few samples."""

import warnings

import numpy as np
import pytest
from scipy.stats import invwishart, multivariate_normal

from dart_skill.mixture import GaussianMixture
from tests.unit.mixture.random_mixture import random_mixture


def fitted(samples, prior, n_components=3, seed=0, **options):
    mixture = GaussianMixture(n_components, covariance_prior=prior, **options)
    return mixture.fit(samples, rng=np.random.default_rng(seed))


def test_one_component_averages_the_covariance_with_the_variances_of_the_columns():
    samples = np.random.default_rng(0).normal(size=(12, 3)) @ [
        [1.0, 0.9, 0.0],
        [0.0, 2.0, 0.5],
        [0.0, 0.0, 30.0],
    ]
    found, covariance = fitted(samples, 4.0, 1), np.cov(samples.T, bias=True)
    expected = (12 * covariance + 4.0 * np.diag(np.diag(covariance))) / 16.0
    np.testing.assert_allclose(found.covariances_[0], expected, rtol=1e-10)
    np.testing.assert_allclose(found.means_[0], samples.mean(0), rtol=1e-10)


def test_it_is_the_mode_of_the_inverse_wishart_posterior():
    """Against scipy's density: no covariance nearby is more probable."""
    rng = np.random.default_rng(1)
    samples, strength, d = rng.normal(size=(10, 2)), 5.0, 2
    found = fitted(samples, strength, 1)
    scale = strength * np.diag(samples.var(0))

    def posterior(covariance):
        prior = invwishart(df=strength - d - 1, scale=scale).logpdf(covariance)
        return prior + multivariate_normal(found.means_[0], covariance).logpdf(samples).sum()

    best = posterior(found.covariances_[0])
    for _ in range(50):
        root = np.eye(2) + 0.05 * rng.normal(size=(2, 2))
        assert posterior(root @ found.covariances_[0] @ root.T) < best


def test_the_posterior_rises_with_every_iteration():
    rng = np.random.default_rng(2)
    samples = random_mixture(rng).sample(40, rng)
    scales, posteriors = samples.std(0), []
    prior = 3.0 ** (-2.0 / 3.0) * np.diag(scales**2)
    for n_iterations in range(1, 25):
        found = fitted(samples, 3.0, max_iterations=n_iterations, tolerance=0.0)
        spread = np.linalg.slogdet(found.covariances_)[1] + np.trace(
            np.linalg.solve(found.covariances_, prior[None]), axis1=1, axis2=2
        )
        posteriors.append(found.log_density(samples).sum() - 0.5 * 3.0 * spread.sum())
    assert (np.diff(posteriors) > -1e-8).all() and posteriors[-1] > posteriors[0] + 1.0


def test_units_and_repeated_samples_change_nothing_else():
    rng = np.random.default_rng(3)
    samples, unit = random_mixture(rng).sample(25, rng), np.array([1.0, 1e3, 1e-3])
    metres, other = fitted(samples, 2.0), fitted(samples * unit, 2.0)
    np.testing.assert_allclose(
        other.covariances_, metres.covariances_ * np.outer(unit, unit), rtol=1e-8
    )
    twice = GaussianMixture(3, covariance_prior=2.0).fit(samples, 2.0 * np.ones(25), start=metres)
    repeated = GaussianMixture(3, covariance_prior=2.0).fit(
        np.repeat(samples, 2, axis=0), start=metres
    )
    np.testing.assert_allclose(twice.covariances_, repeated.covariances_, rtol=1e-8)


@pytest.mark.parametrize(("n", "d"), [(15, 8), (30, 8)])
def test_few_samples_are_explained_better_than_by_scikit_learn(n, d):
    """Of 30 sets; `benchmarks/few_samples.py` has more, and docs/learning.md what came of them."""
    peer = pytest.importorskip(
        "sklearn.mixture", reason="scikit-learn is needed: pip install -r requirements/test.txt"
    ).GaussianMixture
    better, gains = 0, []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        truth = random_mixture(rng, 3, d)
        train, test = truth.sample(n, rng), truth.sample(500, rng)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            theirs = peer(3, random_state=seed).fit(train).score(test)
        ours = float(np.mean(fitted(train, float(d), seed=seed).log_density(test)))
        better, gains = better + (ours >= theirs), [*gains, ours - theirs]
    assert better >= 29 and np.median(gains) > 5.0, (better, np.median(gains))


def test_no_component_collapses_where_others_die():
    rng = np.random.default_rng(5)
    samples = np.concatenate([rng.normal(size=(20, 2)), [[50.0, 50.0]] * 3])
    start = GaussianMixture.from_parameters(
        [0.4, 0.4, 0.2],
        [[0.0, 0.0], [0.5, 0.0], [1e4, 1e4]],
        [np.eye(2), np.eye(2), 1e-3 * np.eye(2)],
    )
    found = GaussianMixture(3, covariance_prior=2.0).fit(samples, start=start)
    assert len(found.priors_) >= 2 and np.linalg.eigvalsh(found.covariances_).min() > 0.01, (
        "no component has collapsed on the three"
    )
