"""The number of components: what both criteria find, and what must not change their scores."""

import numpy as np
import pytest

from dart_skill.mixture import GaussianMixture, select_by_bic, select_by_cross_validation

METHODS = [select_by_bic, select_by_cross_validation]


def clusters(rng, n=80, centres=((0, 0), (7, 1), (-3, 8))):
    return np.concatenate([rng.normal(centre, 1.0, (n, 2)) for centre in centres])


@pytest.mark.parametrize("method", METHODS)
def test_three_clusters_are_found_and_the_curve_is_returned(method):
    rng = np.random.default_rng(0)
    selection = method(clusters(rng), range(1, 7), rng=rng, n_starts=2)
    assert selection.best == 3, dict(zip(selection.n_components, selection.scores, strict=True))
    np.testing.assert_array_equal(selection.n_components, np.arange(1, 7))
    assert np.isfinite(
        selection.scores
    ).all() and selection.scores.shape == selection.standard_errors.shape == (6,)
    assert selection.mixture.n_components == 3
    assert selection.simplest_within_error == 3


def test_bic_scores_are_those_of_the_mixtures():
    rng = np.random.default_rng(1)
    samples, weights = clusters(rng), rng.random(240)
    selection = select_by_bic(samples, [2], weights, rng=np.random.default_rng(2))
    alone = GaussianMixture(2).fit(samples, weights, rng=np.random.default_rng(2))
    assert selection.scores[0] == alone.bic(samples, weights)


def test_cross_validation_scores_samples_that_the_fit_did_not_see():
    """By hand: one component, two folds given as groups."""
    rng = np.random.default_rng(3)
    samples, weights, groups = (
        rng.normal(size=(60, 2)),
        rng.random(60),
        np.repeat(["first", "second"], 30),
    )
    selection = select_by_cross_validation(samples, [1], weights, groups=groups, rng=rng)
    total = 0.0
    for name in ("first", "second"):
        seen = groups != name
        fitted = GaussianMixture(1).fit(samples[seen], weights[seen], rng=rng)
        total -= weights[~seen] @ fitted.log_density(samples[~seen])
    assert selection.scores[0] == pytest.approx(total / weights.sum(), rel=1e-12)
    assert selection.standard_errors[0] > 0


def test_groups_keep_a_demonstration_from_telling_its_own_place():
    """Ten demonstrations, each a tight bundle somewhere: neighbours left in make a component for
    each look good.
    """
    rng = np.random.default_rng(4)
    places = rng.normal(size=(10, 2))
    samples = (places[:, None] + 0.01 * rng.normal(size=(10, 20, 2))).reshape(-1, 2)
    groups = np.repeat(np.arange(10), 20)
    mixed = select_by_cross_validation(samples, [1, 8], rng=np.random.default_rng(0))
    apart = select_by_cross_validation(
        samples, [1, 8], groups=groups, n_folds=10, rng=np.random.default_rng(0)
    )
    assert (mixed.best, apart.best) == (8, 1), (mixed.scores, apart.scores)


@pytest.mark.parametrize("method", METHODS)
def test_integer_weights_equal_repeated_samples_and_zero_equals_absence(method):
    rng = np.random.default_rng(5)
    samples, counts, groups = clusters(rng), rng.integers(0, 3, 240), np.tile(np.arange(6), 40)

    def run(given, weights, labels):
        extra = {} if method is select_by_bic else {"groups": labels}
        return method(
            given,
            [1, 2, 3],
            weights,
            rng=np.random.default_rng(6),
            tolerance=1e-12,
            max_iterations=2000,
            **extra,
        )

    weighted = run(samples, counts, groups)
    repeated = run(np.repeat(samples, counts, axis=0), None, np.repeat(groups, counts))
    present = run(samples[counts > 0], counts[counts > 0], groups[counts > 0])
    np.testing.assert_allclose(weighted.scores, repeated.scores, rtol=1e-8)
    np.testing.assert_array_equal(weighted.scores, present.scores)


def test_the_simplest_within_one_standard_error_ignores_a_gain_in_the_noise():
    samples = np.random.default_rng(9).normal(size=(150, 2))
    selection = select_by_cross_validation(samples, range(1, 6), rng=np.random.default_rng(1))
    assert selection.simplest_within_error == 1, (selection.scores, selection.standard_errors)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda x, r: select_by_bic(x, [], rng=r), "n_components is empty"),
        (lambda x, r: select_by_bic(x, [0, 1], rng=r), "at least 1"),
        (lambda x, r: select_by_bic(x[:2], [3], rng=r), "at least as many samples"),
        (lambda x, r: select_by_bic(x * np.nan, [1], rng=r), "nan"),
        (lambda x, r: select_by_cross_validation(x, [1], n_folds=1, rng=r), "n_folds"),
        (
            lambda x, r: select_by_cross_validation(x, [1], groups=np.zeros(240), rng=r),
            "two groups",
        ),
        (
            lambda x, r: select_by_cross_validation(x, [1], groups=np.zeros(3), rng=r),
            "one label per sample",
        ),
        (lambda x, r: select_by_cross_validation(x, [1], np.zeros(240), rng=r), "all zero"),
        (lambda x, r: select_by_cross_validation(x[:1], [1], rng=r), "two groups"),
    ],
)
def test_impossible_choices_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call(clusters(np.random.default_rng(0)), np.random.default_rng(0))
