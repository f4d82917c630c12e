"""Gaussian mixture regression against numerical integration of the conditional density."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dart_skill.mixture import Gaussian, GaussianMixture, Regression, regress
from tests.unit.mixture.random_mixture import given_values, random_mixture, whole


@given(seed=st.integers(0, 10_000), query=st.floats(-6, 6))
@settings(max_examples=25, deadline=None)
def test_mean_and_variance_are_those_of_the_integrated_conditional(seed, query):
    mixture = random_mixture(np.random.default_rng(seed), 3, 2)
    grid = np.linspace(-60, 60, 24_001)
    log_density = mixture.log_density(np.column_stack([grid, np.full_like(grid, query)]))
    density = np.exp(log_density - log_density.max())
    density /= density.sum()
    mean = density @ grid
    variance = density @ (grid - mean) ** 2
    found_mean, found_covariance = regress(mixture, [query], 1, 0)
    assert found_mean[0, 0] == pytest.approx(mean, abs=1e-6)
    assert found_covariance[0, 0, 0] == pytest.approx(variance, rel=1e-6)


def test_one_component_is_conditioning_for_any_split():
    rng = np.random.default_rng(1)
    mixture = random_mixture(rng, 1, 5)
    queries = rng.normal(size=(4, 2))
    mean, covariance = regress(mixture, queries, [3, 0], [4, 1, 2])
    gaussian = Gaussian(mixture.means_[0], mixture.covariances_[0])
    for i, query in enumerate(queries):
        conditional = gaussian.condition([3, 0], query)
        order = [2, 0, 1]  # the rest, ascending, is 1, 2, 4
        np.testing.assert_allclose(mean[i], conditional.mean[order], rtol=1e-10)
        np.testing.assert_allclose(
            covariance[i], conditional.covariance[np.ix_(order, order)], atol=1e-10
        )


def test_between_component_spread_is_part_of_the_covariance():
    mixture = GaussianMixture.from_parameters(
        [0.5, 0.5], [[0.0, -3.0], [0.0, 3.0]], [np.eye(2), np.eye(2)]
    )
    mean, covariance = regress(mixture, [0.7], 0, 1)
    assert mean[0, 0] == pytest.approx(0.0, abs=1e-12)
    assert covariance[0, 0, 0] == pytest.approx(1.0 + 9.0)


@given(
    seed=st.integers(0, 10_000),
    n_components=st.integers(1, 7),
    n_outputs=st.integers(1, 6),
    n_inputs=st.integers(1, 2),
)
@settings(max_examples=40, deadline=None)
def test_whichever_way_the_spread_is_summed_it_is_that_of_the_conditional_mixture(
    seed, n_components, n_outputs, n_inputs
):
    rng = np.random.default_rng(seed)
    mixture, queries = (
        random_mixture(rng, n_components, n_inputs + n_outputs),
        rng.normal(0.0, 3.0, size=(5, n_inputs)),
    )
    dims = rng.permutation(n_inputs + n_outputs)
    # `given_values` leaves the others in ascending order
    into, out = (
        dims[:n_inputs],
        np.sort(dims[n_inputs:]),
    )
    regression = Regression(mixture, into, out)
    mean, covariance = regression(queries)
    np.testing.assert_array_equal(regression.mean(queries), mean)
    for i, query in enumerate(queries):
        wanted = whole(given_values(mixture, into, query))
        np.testing.assert_allclose(mean[i], wanted.mean, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(covariance[i], wanted.covariance, rtol=1e-9, atol=1e-9)


def test_components_that_are_narrow_and_far_apart_lose_no_digits():
    """Between them the covariance is 10^12 times that of a component, and where one of them rules
    it is that of the component.
    """
    slopes = np.array([[1e3, -2e3, 5e2, 1.0], [-1e3, 0.0, 5e2, 2.0], [3e3, 1e3, 0.0, -1.0]])
    variance, centres, within = (
        1e-2,
        np.array([0.0, 1.0, 2.0]),
        1e-6 * np.diag([1.0, 2.0, 3.0, 4.0]),
    )
    covariances = np.array(
        [
            np.block(
                [
                    [variance, variance * b[None]],
                    [variance * b[:, None], variance * np.outer(b, b)],
                ]
            )
            for b in slopes
        ]
    )
    covariances[:, 1:, 1:] += within
    mixture = GaussianMixture.from_parameters(
        np.full(3, 1 / 3), np.column_stack([centres, 1e3 * np.eye(3, 4)]), covariances
    )
    _, covariance = regress(mixture, np.array([-8.0, 0.5, 10.0]), [0], [1, 2, 3, 4])
    alone = covariances[[0, 2], 1:, 1:] - variance * slopes[[0, 2], :, None] * slopes[[0, 2], None]
    np.testing.assert_allclose(covariance[[0, 2]], alone, atol=1e-9)
    assert np.linalg.norm(covariance[1]) > 1e5
    wanted = whole(given_values(mixture, [0], 0.5)).covariance
    np.testing.assert_allclose(covariance[1], wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())


def test_many_queries_give_what_each_gives_alone():
    rng = np.random.default_rng(2)
    mixture, queries = random_mixture(rng, 4, 4), 3 * rng.normal(size=(30, 2))
    mean, covariance = regress(mixture, queries, [0, 2], [1, 3])
    single = [regress(mixture, query[None], [0, 2], [1, 3]) for query in queries]
    np.testing.assert_allclose(
        mean, np.concatenate([m for m, _ in single]), rtol=1e-10, atol=1e-12
    )
    np.testing.assert_allclose(
        covariance, np.concatenate([c for _, c in single]), rtol=1e-10, atol=1e-12
    )


def test_far_from_the_data_the_slowest_decaying_component_takes_over():
    mixture = GaussianMixture.from_parameters(
        [0.9, 0.1], [[0.0, 1.0], [0.0, 5.0]], [np.eye(2), [[4.0, 2.0], [2.0, 2.0]]]
    )
    for query in (1e3, -1e6, 1e12):
        mean, covariance = regress(mixture, [query], 0, 1)
        assert mean[0, 0] == pytest.approx(5.0 + 0.5 * query, rel=1e-12)
        assert covariance[0, 0, 0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("inputs", "into", "out", "message"),
    [
        ([[np.nan]], [0], [1], "nan"),
        ([[1e200]], [0], [1], "far away"),
        (np.where(np.arange(3000) == 2500, 1e200, 0.0), [0], [1], "row 2500, .* far away"),
        (np.zeros((0, 1)), [0], [1], "empty"),
        (np.zeros((3, 2)), [0], [1], "1 columns"),
        (np.zeros(3), [0, 2], [1], "2 dimension"),
        ([[0.0]], [0], [0, 1], "both input and output"),
        ([[0.0]], [3], [1], "within 0..2"),
        ([[0.0]], [0], [1, 1], "distinct"),
        ([[0.0]], [0], [], "indices"),
    ],
)
def test_wrong_queries_are_refused(inputs, into, out, message):
    with pytest.raises(ValueError, match=message):
        regress(random_mixture(np.random.default_rng(0), 2, 3), inputs, into, out)
