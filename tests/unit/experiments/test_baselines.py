"""The searches that others are measured against: what each does, and what is refused."""

import sys

import numpy as np
import pytest

from dart_skill.experiments.studies.baselines import (
    CMAES,
    CrossEntropy,
    MonteCarlo,
    RandomRestarts,
)
from dart_skill.experiments.studies.policy_gradients import EpisodicNaturalActorCritic, Reinforce

START, OPTIMUM = np.array([1.0, -1.0]), np.array([2.0, 0.5])


def make(kind, seed=0, start=START, spread=1.0, **options):
    if kind is CMAES:
        pytest.importorskip("cma")
    return kind(start, spread, rng=np.random.default_rng(seed), **options)


def hill(x):
    return -float(np.sum((x - OPTIMUM) ** 2))


ALL = pytest.mark.parametrize(
    "kind",
    [CrossEntropy, RandomRestarts, MonteCarlo, CMAES, Reinforce, EpisodicNaturalActorCritic],
)
CLOSE = {
    CrossEntropy: 0.1,
    RandomRestarts: 0.1,
    MonteCarlo: 0.5,
    CMAES: 1e-3,
    Reinforce: 0.1,
    EpisodicNaturalActorCritic: 1e-3,
}


@ALL
@pytest.mark.parametrize("seed", range(3))
def test_the_top_of_a_hill_is_found(kind, seed):
    search = make(kind, seed)
    assert np.linalg.norm(search.maximise(hill, 600) - OPTIMUM) < CLOSE[kind]
    assert search.n_told == 600 and search.n_updates > 0 and search.exploration_size > 0


@ALL
def test_units_make_no_difference(kind):
    scale = np.array([1e-3, 1e4])
    one = make(kind).maximise(hill, 200)
    other = make(kind, start=START * scale, spread=scale).maximise(lambda x: hill(x / scale), 200)
    np.testing.assert_allclose(other / scale, one, rtol=1e-6)


@ALL
def test_failures_late_answers_and_equal_returns_are_survived(kind):
    rng, search = np.random.default_rng(0), make(kind)
    waiting = [search.ask() for _ in range(9)]
    for step in range(300):
        trial = waiting.pop(rng.integers(9))
        search.tell(
            trial, np.nan if step % 4 == 0 else 1.0 if step > 200 else hill(trial.parameters)
        )
        waiting.append(search.ask())
    assert search.n_failed == 75 and np.isfinite(search.parameters).all()


@ALL
def test_a_search_to_compare_with_cannot_be_saved(kind):
    with pytest.raises(TypeError, match="cannot be saved"):
        make(kind).state()


@ALL
def test_the_same_seed_gives_the_same_trials_whatever_else_is_random(kind):
    first = make(kind, 7).maximise(hill, 100)
    np.random.default_rng().normal()
    np.testing.assert_array_equal(make(kind, 7).maximise(hill, 100), first)


def told(search, tried, returns):
    for row, value in zip(tried, returns, strict=True):
        number = search.ask().number
        search._open[number] = np.zeros(len(row)), np.array(row)
        search.tell(number, value)
    return search


def test_cross_entropy_takes_mean_and_covariance_of_the_best():
    options = {"batch": 4, "best": 2, "minimum_exploration": 0.1}
    tried, returns = [[0.0, 0.0], [2.0, 4.0], [4.0, 0.0], [9.0, 9.0]], [0.0, 3.0, 2.0, -1.0]
    search = told(make(CrossEntropy, start=np.zeros(2), **options), tried, returns)
    np.testing.assert_allclose(search.parameters, [3.0, 2.0])
    np.testing.assert_allclose(
        search.covariance, [[1.0 + 0.01, -2.0], [-2.0, 4.0 + 0.01]], atol=1e-12
    )
    half = told(make(CrossEntropy, start=np.zeros(2), smoothing=0.5, **options), tried, returns)
    np.testing.assert_allclose(half.parameters, [1.5, 1.0])
    np.testing.assert_allclose(
        half.covariance, [[1.0 + 0.01, -1.0], [-1.0, 2.5 + 0.01]], atol=1e-12
    )


def test_cross_entropy_without_noise_stops_and_with_noise_follows():
    def missed(noise):
        search = make(CrossEntropy, minimum_exploration=noise)
        for step, trial in enumerate(search.trials(2000)):
            search.tell(trial, -np.sum((trial.parameters - max(0, step - 1000) / 300) ** 2))
        return np.linalg.norm(search.parameters - 1000 / 300)

    assert missed(0.1) < 0.3 and missed(0.0) > 3.0


def two_hills(x, centres=np.array([[-4.0, 0.0], [4.0, 0.0]]), heights=np.array([0.7, 1.0])):  # noqa: B008
    return float(np.max(heights * np.exp(-0.25 * np.sum((x - centres) ** 2, axis=1))))


@pytest.mark.parametrize("seed", range(3))
def test_restarts_leave_a_lower_hill_and_remember_the_highest(seed):
    search = make(RandomRestarts, seed, start=np.array([-4.0, 0.0]), reach=6.0, restart_below=0.1)
    assert np.linalg.norm(search.maximise(two_hills, 2500) - [4.0, 0.0]) < 0.2
    places, values = search.optima
    assert len(places) == len(values) > 3
    assert np.linalg.norm(places - [-4.0, 0.0], axis=1).min() < 0.2 and values.max() > 0.95


def test_a_run_without_end_is_ended():
    search = make(
        RandomRestarts, exploration="constant", batch=10, restart_below=0.0, longest_run=50
    )
    search.maximise(hill, 500)
    assert len(search.optima[0]) == 10


def test_a_monte_carlo_search_takes_the_middle_of_the_best_neighbourhood():
    options = {"batch": 5, "best": 2, "latest": 5}
    # Alone, the highest return is at 9; with their neighbours, those at 0 and 1 earn most.
    search = told(
        make(MonteCarlo, start=np.zeros(1), **options),
        [[0.0], [1.0], [5.0], [6.5], [9.0]],
        [3.0, 4.0, 1.0, 0.0, 5.0],
    )
    assert search.parameters == pytest.approx(
        [0.5]
    ) and search.neighbourhood_return == pytest.approx(3.5)


def test_a_monte_carlo_search_tries_everywhere_within_reach_alike():
    search = make(MonteCarlo, spread=[1.0, 5.0], reach=2.0)
    tried = (np.array([search.ask().parameters for _ in range(4000)]) - START) / [1.0, 5.0]
    assert np.abs(tried).max() <= 2.0
    np.testing.assert_allclose(tried.std(axis=0), search.exploration_size, rtol=0.05)
    np.testing.assert_allclose(tried.mean(axis=0), 0.0, atol=0.1)


def test_noise_of_returns_is_averaged_out_by_a_neighbourhood():
    rng, search = (
        np.random.default_rng(0),
        make(MonteCarlo, start=np.zeros(2), best=40, latest=1000),
    )
    found = search.maximise(lambda x: np.exp(-0.5 * x @ x) + rng.normal(), 1000)
    assert np.linalg.norm(found) < 0.8, found


def test_cma_es_with_a_least_exploration_keeps_learning():
    def missed(least):
        search = make(CMAES, minimum_exploration=least)
        for step, trial in enumerate(search.trials(2000)):
            search.tell(trial, -np.sum((trial.parameters - max(0, step - 1500) / 250) ** 2))
        assert search.exploration_size >= least
        return np.linalg.norm(search.parameters - 2.0)

    assert missed(0.1) < 0.5


def test_without_cma_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(ImportError, match="pip install cma"):
        CMAES(START, 1.0, rng=np.random.default_rng(0))


@pytest.mark.parametrize("kind", [CrossEntropy, RandomRestarts, MonteCarlo])
@pytest.mark.parametrize(
    "start, spread, options, message",
    [
        ([], 1.0, {}, "empty"),
        ([np.inf], 1.0, {}, "inf"),
        ([0.0], 0.0, {}, "spread must be above 0"),
        ([0.0], 1.0, {"batch": 1.5}, "batch must be an integer"),
        ([0.0], 1.0, {"best": 1000, "batch": 10}, "must be at least"),
    ],
)
def test_bad_options_are_refused(kind, start, spread, options, message):
    with pytest.raises(ValueError, match=message):
        make(kind, start=start, spread=spread, **options)


@pytest.mark.parametrize(
    "kind, options, message",
    [
        (CrossEntropy, {"smoothing": 1.5}, "smoothing must be at most 1"),
        (CrossEntropy, {"smoothing": 0.0}, "smoothing must be above 0"),
        (RandomRestarts, {"longest_run": 0}, "longest_run"),
        (RandomRestarts, {"reach": 0.0}, "reach must be above 0"),
        (MonteCarlo, {"reach": np.nan}, "nan"),
        (CrossEntropy, {"minimum_exploration": -1.0}, "minimum_exploration"),
    ],
)
def test_bad_options_of_their_own_are_refused(kind, options, message):
    with pytest.raises(ValueError, match=message):
        make(kind, **options)


@ALL
def test_a_search_needs_a_generator(kind):
    with pytest.raises(ValueError, match="rng must be a numpy Generator"):
        kind(START, 1.0, rng=0)
