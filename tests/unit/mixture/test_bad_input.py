"""Input that breaks mixtures elsewhere: the right answer or a ValueError, never nan, and never a
warning of NumPy.

What is right is told by an identity of EM: after every M step the mixture has the mean of the
samples, and their covariance but for the floor.
"""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dart_skill.mixture import (
    Gaussian,
    GaussianMixture,
    Regression,
    product,
    regress,
    select_by_bic,
    select_by_cross_validation,
)
from dart_skill.movement import TaskFrame, TaskParameterisedMixture
from tests.unit.mixture.random_mixture import whole

pytestmark = pytest.mark.filterwarnings("error")
FLOOR = 1e-6
moderate = settings(max_examples=40, deadline=None)


# samples that are hard, and usable


def identical(rng, n, d):
    return np.tile(rng.normal(size=d), (n, 1))


def constant_column(rng, n, d):
    return np.column_stack([rng.normal(size=(n, d)), np.full(n, rng.normal())])


def collinear(rng, n, d):
    return rng.normal(size=(n, 1)) @ rng.normal(size=(1, d)) + rng.normal(size=d)


def outlier(rng, n, d):
    return np.vstack([rng.normal(size=(n, d)), np.full((1, d), 1e3)])


def offset(rng, n, d):
    return rng.normal(size=(n, d)) + 1e8


def small(rng, n, d):
    return 1e-8 * rng.normal(size=(n, d))


def large_and_small(rng, n, d):
    return rng.normal(size=(n, d)) * 10.0 ** rng.integers(-100, 100, d)


def repeated(rng, n, d):
    return rng.normal(size=(3, d))[rng.integers(0, 3, n)]


def whole_numbers(rng, n, d):
    return rng.integers(-2, 3, (n, d))


HARD = [
    identical,
    constant_column,
    collinear,
    outlier,
    offset,
    small,
    large_and_small,
    repeated,
    whole_numbers,
]
shapes = dict(
    seed=st.integers(0, 10_000),
    n=st.integers(6, 40),
    d=st.integers(1, 4),
    n_components=st.integers(1, 6),
)


def assert_usable(mixture):
    for name in ("priors_", "means_", "covariances_"):
        assert np.isfinite(getattr(mixture, name)).all(), name
    assert mixture.priors_.sum() == pytest.approx(1.0, abs=1e-12) and mixture.priors_.min() > 0.0
    np.linalg.cholesky(mixture.covariances_)


def assert_moments(mixture, samples, weights):
    """Mean and covariance of the mixture are those of the samples, as far as their size and the
    floor let one tell.
    """
    found, mean = whole(mixture), np.average(samples, axis=0, weights=weights)
    magnitude = np.abs(samples).max(0)
    rounding = 1e-13 * magnitude
    assert (np.abs(found.mean - mean) <= 1e-6 * samples.std(0) + rounding + 1e-300).all(), (
        found.mean,
        mean,
    )
    scale = (
        np.sqrt(
            np.average(
                np.square((samples - mean) / np.where(magnitude > 0, magnitude, 1.0)),
                axis=0,
                weights=weights,
            )
        )
        * magnitude
    )
    scale = np.where(scale > 1e-14 * magnitude, scale, np.where(magnitude > 0, magnitude, 1.0))
    standard = (samples - mean) / scale
    expected = (standard * (weights / weights.sum())[:, None]).T @ standard
    allowed = 3.0 * samples.shape[1] * FLOOR + 1e-13 * (magnitude / scale).max() ** 2
    difference = np.abs(found.covariance / scale[:, None] / scale - expected).max()
    assert difference <= min(allowed, 1e-2), (difference, allowed)


@pytest.mark.parametrize("make", HARD)
@given(**shapes)
@moderate
def test_hard_samples_give_a_usable_mixture_with_their_moments(make, seed, n, d, n_components):
    rng = np.random.default_rng(seed)
    samples = make(rng, n, d)
    weights = rng.uniform(0.5, 2.0, len(samples))
    mixture = GaussianMixture(n_components, covariance_floor=FLOOR, max_iterations=50).fit(
        samples, weights, rng=rng
    )
    assert_usable(mixture)
    assert_moments(mixture, samples, weights)
    assert np.isfinite(mixture.log_density(samples)).all()
    np.testing.assert_allclose(mixture.responsibilities(samples).sum(1), 1.0, rtol=1e-12)
    # Columns that are collinear to the floor leave a condition number of 1 / FLOOR and more.
    assert mixture.log_likelihood_ == pytest.approx(
        weights @ mixture.log_density(samples), rel=1e-5, abs=1e-5 * len(samples)
    )


@pytest.mark.parametrize("make", HARD)
@given(**shapes)
@example(seed=2, n=18, d=3, n_components=2)  # lines so steep that their products overflow
@moderate
def test_regression_on_hard_samples_is_right_near_and_far(make, seed, n, d, n_components):
    """The conditional of one of the components far away; between their extremes everywhere."""
    rng = np.random.default_rng(seed)
    samples = make(rng, n, d + 1)
    mixture = GaussianMixture(n_components, max_iterations=20).fit(samples, rng=rng)
    span = np.maximum(np.ptp(samples[:, 0]), 1e-3 * np.abs(samples[:, 0]).max())
    queries = samples[:3, 0].max() + span * np.array([-1e6, -1e3, 0.0, 0.5, 1e3, 1e6])
    outputs = np.arange(1, samples.shape[1])
    mean, covariance = regress(mixture, queries, 0, outputs)
    slopes = mixture.covariances_[:, 1:, 0] / mixture.covariances_[:, :1, 0]
    steps = slopes * (queries[:, None, None] - mixture.means_[:, :1])
    lines = mixture.means_[:, 1:] + steps
    slack = 1e-9 * (np.abs(mixture.means_[:, 1:]) + np.abs(steps)).max(1)
    assert (mean >= lines.min(1) - slack).all() and (mean <= lines.max(1) + slack).all(), (
        mean,
        lines,
    )
    assert np.isfinite(covariance).all() and (np.diagonal(covariance, axis1=1, axis2=2) > 0).all()
    shares = Regression(mixture, 0, outputs).responsibilities(queries)
    np.testing.assert_allclose(shares.sum(1), 1.0, rtol=1e-12)


@given(distance=st.floats(1e3, 1e300), seed=st.integers(0, 100), forward=st.booleans())
@moderate
def test_a_query_however_far_has_an_answer_or_is_refused(distance, seed, forward):
    rng = np.random.default_rng(seed)
    mixture = GaussianMixture(3).fit(rng.normal(size=(40, 3)), rng=rng)
    query = distance if forward else -distance
    try:
        mean, covariance = regress(mixture, [query], [0], [1, 2])
    except ValueError as error:
        assert "so far away that its log density overflows" in str(error) and distance > 1e140
        return
    variances = mixture.covariances_[:, 0, 0]
    slowest = mixture.covariances_[variances.argmax()]
    # So far out one component is all there is, unless two decay alike.
    if distance > 1e4 and np.sort(variances)[-2] < 0.98 * variances.max():
        np.testing.assert_allclose(
            mean[0], slowest[1:, 0] / slowest[0, 0] * query, rtol=1e-2, atol=50.0
        )
        conditional = Gaussian(np.zeros(3), slowest).condition(0, 0.0).covariance
        np.testing.assert_allclose(covariance[0], conditional, rtol=1e-9)
    assert np.isfinite(covariance).all()


@pytest.mark.parametrize("n_inputs", [1, 2])
def test_the_covariance_far_away_is_that_of_one_component_at_any_distance(n_inputs):
    """Also where a mean of the outputs has fewer digits than the covariance: of (3.5) nothing is
    left but one component.
    """
    rng = np.random.default_rng(0)
    means, factors = (
        rng.normal(size=(6, n_inputs + 2)),
        rng.normal(size=(6, n_inputs + 2, n_inputs + 2)),
    )
    covariances = factors @ factors.swapaxes(1, 2) + np.eye(n_inputs + 2)
    covariances[0] *= 10.0
    mixture = GaussianMixture.from_parameters(np.full(6, 1 / 6), means, covariances)
    inputs, outputs = np.arange(n_inputs), [n_inputs, n_inputs + 1]
    slow, cross = covariances[0][:n_inputs, :n_inputs], covariances[0][n_inputs:, :n_inputs]
    conditional = covariances[0][n_inputs:, n_inputs:] - cross @ np.linalg.solve(slow, cross.T)
    for exponent in range(10, 60):
        query = np.full((1, n_inputs), 2.0**exponent)
        np.testing.assert_allclose(
            regress(mixture, query, inputs, outputs)[1][0], conditional, rtol=1e-9
        )


# what no mixture can be made of


def spoiled(value, place):
    samples = np.random.default_rng(0).normal(size=(12, 2))
    samples[place % 12, place % 2] = value
    return samples


@given(
    value=st.sampled_from([np.nan, np.inf, -np.inf]),
    place=st.integers(0, 23),
    as_list=st.booleans(),
)
@settings(max_examples=20, deadline=None)
def test_nan_and_infinity_are_named_with_their_place(value, place, as_list):
    rng = np.random.default_rng(1)
    samples = spoiled(value, place)
    given_samples = samples.tolist() if as_list else samples
    fitted = GaussianMixture(2).fit(np.random.default_rng(0).normal(size=(12, 2)), rng=rng)
    frames = [[TaskFrame(np.eye(2), np.zeros(2))]]
    where = rf"{value} at index \({place % 12}, {place % 2}\)"
    for work in (
        lambda: GaussianMixture(2).fit(given_samples, rng=rng),
        lambda: fitted.log_density(given_samples),
        lambda: fitted.bic(given_samples),
        lambda: select_by_bic(given_samples, [1], rng=rng),
        lambda: select_by_cross_validation(given_samples, [1], rng=rng),
        lambda: TaskParameterisedMixture(2).fit([given_samples], frames),
        lambda: TaskParameterisedMixture(2).fit_in_time([given_samples], frames),
    ):
        with pytest.raises(ValueError, match=where):
            work()
    for work in (
        lambda: GaussianMixture(2).fit(np.zeros((12, 2)), samples[:, place % 2], rng=rng),
        lambda: regress(fitted, [value], [0], [1]),
        lambda: GaussianMixture.from_parameters([1.0], [[value]], [[[1.0]]]),
        lambda: GaussianMixture.from_parameters([1.0], [[0.0]], [[[value]]]),
        lambda: TaskFrame(np.eye(2), [0.0, value]),
    ):
        with pytest.raises(ValueError, match=str(value)):
            work()


@given(
    shape=st.lists(st.integers(0, 5), max_size=3),
    n_components=st.integers(-1, 6),
    as_list=st.booleans(),
)
@settings(max_examples=120, deadline=None)
def test_a_shape_that_does_not_fit_is_refused_and_any_other_is_fitted(
    shape, n_components, as_list
):
    rng = np.random.default_rng(2)
    samples = rng.normal(size=shape)
    given_samples = samples.tolist() if as_list else samples
    fits = samples.ndim == 2 and samples.size > 0 and 1 <= n_components <= len(samples)
    if fits:
        mixture = GaussianMixture(n_components).fit(given_samples, rng=rng)
        assert_usable(mixture)
        assert_moments(mixture, samples, np.ones(len(samples)))
    else:
        with pytest.raises(
            ValueError,
            match=(
                r"samples must have 2 dimension|samples is empty|n_components must be|need at"
                r" least as many"
            ),
        ):
            GaussianMixture(n_components).fit(given_samples, rng=rng)


@pytest.mark.parametrize(
    ("size", "message"),
    [(1e155, "too large"), (1e308, "too large"), (1e-155, "too little"), (1e-300, "too little")],
)
def test_samples_whose_squares_are_no_numbers_are_refused(size, message):
    rng = np.random.default_rng(3)
    samples = size * rng.uniform(-1.0, 1.0, (20, 2))
    for work in (
        lambda: GaussianMixture(2).fit(samples, rng=rng),
        lambda: TaskParameterisedMixture(2).fit([samples], [[TaskFrame(np.eye(2), np.zeros(2))]]),
        lambda: TaskParameterisedMixture(2).fit_in_time(
            [samples], [[TaskFrame(np.eye(2), np.zeros(2))]]
        ),
    ):
        with pytest.raises(ValueError, match=f"samples.*{message} for a variance"):
            work()


def test_points_too_far_for_a_density_and_factors_too_far_for_a_product_are_refused():
    here, there = Gaussian([0.0, 0.0], np.eye(2)), Gaussian([1e200, 0.0], np.eye(2))
    mixture = GaussianMixture.from_parameters(
        [0.5, 0.5], [[0.0, 0.0], [1.0, 0.0]], [np.eye(2)] * 2
    )
    task = TaskParameterisedMixture.from_parameters([1.0], [[[0.0, 0.0]]], [[np.eye(2)]])
    frame = TaskFrame(np.eye(2), np.zeros(2))
    for work in (
        lambda: here.log_density([[1.0, 2.0], [1e200, 0.0]]),
        lambda: product([here, there]),
        lambda: mixture.log_density([[0.0, 0.0], [1e200, 0.0]]),
        lambda: task.log_density(
            [[[0.0, 0.0], [1e140, 0.0], [1e145, 1e145]]],
            [[TaskFrame(np.eye(2) / 1e20, np.zeros(2))]],
        ),
        lambda: task.regress([frame], [[1e200]], [0], [1]),
        lambda: task.regress([[frame]], [[1e200]], [0], [1]),
    ):
        with pytest.raises(ValueError, match="so far a(way|part) that .* overflows"):
            work()


@pytest.mark.parametrize(
    "queries", [[], [[]], [["a"]], [[1.0], [2.0, 3.0]], [[0.0, 0.0]], 0.0, [[[0.0]]]]
)
def test_queries_of_a_wrong_shape_are_refused(queries):
    mixture = GaussianMixture(1).fit(
        np.random.default_rng(4).normal(size=(9, 2)), rng=np.random.default_rng(4)
    )
    with pytest.raises(ValueError, match="inputs"):
        regress(mixture, queries, [0], [1])


# the same in task frames


@pytest.mark.parametrize(
    "make", [identical, constant_column, collinear, outlier, small, repeated, whole_numbers]
)
@given(seed=st.integers(0, 10_000), n_components=st.integers(1, 5))
@settings(max_examples=25, deadline=None)
def test_hard_demonstrations_give_a_mixture_that_can_be_used_in_new_frames(
    make, seed, n_components
):
    rng = np.random.default_rng(seed)
    samples = [
        np.column_stack([np.linspace(0.0, 1.0, len(one)), one[:, :2]])
        for one in (make(rng, 12, 2) for _ in range(3))
    ]
    frames = [[turned(rng), turned(rng)] for _ in samples]
    frames[1][0] = None
    model = TaskParameterisedMixture(n_components).fit(samples, frames)
    assert np.isfinite(np.concatenate(model.log_density(samples, frames))).all()
    assert_usable(model.product([turned(rng), turned(rng)]))
    mean, covariance = model.regress(
        [turned(rng), None], np.array([-1e3, 0.0, 0.5, 1.0, 1e3])[:, None], [0], [1, 2]
    )
    assert np.isfinite(mean).all() and np.isfinite(covariance).all()
    assert (np.diagonal(covariance, axis1=1, axis2=2) > 0).all()


def turned(rng):
    angle, matrix = rng.uniform(-3.0, 3.0), np.eye(3)
    matrix[1:, 1:] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return TaskFrame(matrix, [0.0, *rng.normal(size=2)])


@pytest.mark.parametrize(
    ("samples", "n_components", "message"),
    [
        ([np.zeros((0, 3))], 1, "samples of demonstration 0 is empty"),
        ([np.zeros(3)], 1, "samples of demonstration 0 must have 2 dimension"),
        ([np.zeros((2, 3))], 3, "at least as many samples"),
        ([[["a", "b", "c"]]], 1, "samples of demonstration 0 must be a regular array of numbers"),
        ([np.zeros((4, 2))], 1, "has 3 dimensions, the samples have 2"),
        ([], 1, "one list of frames per demonstration"),
        ([np.zeros((4, 3))], 0, "n_components must be an integer of at least 1"),
    ],
)
def test_demonstrations_that_cannot_be_used_are_refused(samples, n_components, message):
    with pytest.raises(ValueError, match=message):
        TaskParameterisedMixture(n_components).fit(
            samples, [[TaskFrame(np.eye(3), np.zeros(3))]] * max(len(samples), 1)
        )
