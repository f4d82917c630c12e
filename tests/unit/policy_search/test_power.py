"""PoWER on a vector: (5.1), (5.2) and 5.2.1 by hand, what it converges on, and what changes
nothing.
"""

import numpy as np
import pytest

from dart_skill.policy_search import PoWER, return_weights

SEEDS = range(5)


def with_trials(search, tried):
    """The same search with these trials (n, d) asked, and the trials' numbers."""
    numbers = [search.ask().number for _ in tried]
    state = search.state()
    noise = {number: noise for number, noise, _ in state["open"]}
    state["open"] = [
        [number, noise[number], list(map(float, row))]
        for number, row in zip(numbers, tried, strict=True)
    ]
    return type(search).from_state(state), numbers


def told(tried, returns, **options):
    """A search about the origin after these trials and returns."""
    choices = {
        "rng": np.random.default_rng(0),
        "weighting": "returns",
        "minimum_exploration": 0.1,
        **options,
    }
    search, numbers = with_trials(PoWER(np.zeros(2), choices.pop("spread", 1.0), **choices), tried)
    for number, value in zip(numbers, returns, strict=True):
        search.tell(number, value)
    return search


# The best three weigh 1/2, 1/4, 1/4; the fourth, far off, must not count.
TRIED, RETURNS = [[9.0, 9.0], [2.0, 4.0], [0.0, 4.0], [2.0, 0.0]], [1.0, 4.0, 2.0, 2.0]
THREE_OF_FOUR = {"best": 3, "batch": 4, "latest": 4}
SECOND_MOMENT = np.array([[3.0, 4.0], [4.0, 12.0]])


@pytest.mark.parametrize("exploration", ["constant", "proportional", "fixed", "automatic"])
def test_the_mean_moves_by_the_weighted_relative_exploration_of_the_best(exploration):
    np.testing.assert_allclose(
        told(TRIED, RETURNS, exploration=exploration, **THREE_OF_FOUR).parameters, [1.5, 3.0]
    )


def test_constant_noise_adds_sigma_0_to_the_weighted_covariance():
    search = told(TRIED, RETURNS, exploration="constant", spread=[1.0, 2.0], **THREE_OF_FOUR)
    np.testing.assert_allclose(search.covariance, SECOND_MOMENT + np.diag([0.1, 0.2]) ** 2)


def test_proportional_noise_adds_as_much_in_total_and_keeps_the_shape():
    options = {"minimum_exploration": 0.5, **THREE_OF_FOUR}
    proportional = told(TRIED, RETURNS, exploration="proportional", **options).covariance
    constant = told(TRIED, RETURNS, exploration="constant", **options).covariance
    # 2 * 0.5^2 is shared out over a trace of 15.
    np.testing.assert_allclose(proportional, SECOND_MOMENT * (1 + 0.5 / 15))
    assert np.trace(proportional) == pytest.approx(np.trace(constant))
    assert np.linalg.cond(constant) < 0.9 * np.linalg.cond(SECOND_MOMENT)
    np.testing.assert_allclose(np.linalg.cond(proportional), np.linalg.cond(SECOND_MOMENT))


def test_proportional_noise_alone_lets_a_short_axis_die_unless_limits_hold_it():
    line = [[1.0, 1.0], [2.0, 2.0], [-1.0, -1.0], [3.0, 3.0]]
    lowest = {}
    for low in (None, (1e-6, 1e4)):
        search = told(line, RETURNS, exploration="proportional", limits=low, **THREE_OF_FOUR)
        lowest[low] = np.sqrt(np.linalg.eigvalsh(search.covariance)[0])
    assert lowest[None] == pytest.approx(0.1)
    assert lowest[(1e-6, 1e4)] < 1e-5


def test_fixed_exploration_keeps_its_covariance():
    search = told(TRIED, RETURNS, exploration="fixed", spread=[1.0, 2.0], **THREE_OF_FOUR)
    np.testing.assert_allclose(search.covariance, np.diag([1.0, 4.0]))


def test_the_relative_exploration_is_from_the_present_mean_also_for_old_trials():
    choices = {
        "rng": np.random.default_rng(0),
        "weighting": "returns",
        "exploration": "fixed",
        "best": 2,
        "batch": 1,
        "latest": 3,
    }
    search, numbers = with_trials(PoWER([0.0], 1.0, **choices), [[4.0], [0.0], [-2.0]])
    means = []
    for number, value in zip(numbers, [1.0, 1.0, 3.0], strict=True):
        search.tell(number, value)
        means.append(search.parameters[0])
    # Nothing from one trial; then (4 + 0) / 2; then -2 counts 3, and the other two share the last
    # place.
    np.testing.assert_allclose(means, [0.0, 2.0, (-2.0 * 3 + 4 * 0.5 + 0 * 0.5) / 4])


@pytest.mark.parametrize(
    "best, expected",
    [(1, 8.0), (2, (5 * 8.0 + 4 * 1.0) / 9), (4, (5 * 8.0 + 4 * 1.0 + 3 * 2.0 + 2 * 3.0) / 14)],
)
def test_good_trials_of_an_earlier_batch_are_used_again(best, expected):
    choices = {
        "rng": np.random.default_rng(0),
        "weighting": "returns",
        "exploration": "fixed",
        "batch": 2,
        "latest": 4,
        "best": best,
    }
    search, numbers = with_trials(PoWER([0.0], 1.0, **choices), [[8.0], [1.0], [2.0], [3.0]])
    for number, value in zip(numbers, [5.0, 4.0, 3.0, 2.0], strict=True):
        search.tell(number, value)
    assert search.parameters[0] == pytest.approx(expected)


def test_trials_older_than_the_latest_are_forgotten():
    choices = {
        "rng": np.random.default_rng(0),
        "exploration": "fixed",
        "batch": 2,
        "latest": 2,
        "best": 1,
    }
    search, numbers = with_trials(PoWER([0.0], 1.0, **choices), [[8.0], [1.0], [2.0], [3.0]])
    for number, value in zip(numbers, [5.0, 4.0, 3.0, 2.0], strict=True):
        search.tell(number, value)
    assert search.parameters[0] == pytest.approx(2.0)


def test_automatic_exploration_grows_on_a_slope_and_shrinks_about_an_optimum():
    slope, hill = (PoWER(np.zeros(4), 1.0, rng=np.random.default_rng(1)) for _ in range(2))
    slope.maximise(lambda x: x[0], 200)
    hill.maximise(lambda x: -(x @ x), 200)
    assert slope.exploration_size > 10.0
    assert hill.exploration_size < 0.1


def test_without_preference_automatic_exploration_keeps_its_size():
    rng = np.random.default_rng(2)
    sizes = []
    for _ in range(40):
        search = PoWER(np.zeros(5), 1.0, rng=rng)
        search.maximise(lambda _: rng.normal(), 160)
        sizes.append(np.log(np.linalg.det(search.covariance)) / 10)
    # 20 updates; a drift would show, chance stays within the standard error of 40 searches.
    assert abs(np.mean(sizes)) < 3 * np.std(sizes) / np.sqrt(40) + 0.05, sizes


def test_a_large_batch_makes_the_covariance_that_of_its_best():
    search = PoWER(np.zeros(2), 1.0, rng=np.random.default_rng(0), batch=400)
    search.maximise(lambda x: -(x @ x), 400)
    # The better half about the optimum has standard deviations of 0.5; size and path change by
    # less than a half more.
    axes = np.sqrt(np.linalg.eigvalsh(search.covariance))
    assert 0.2 < axes[0] and axes[-1] < 0.8, axes


# --- convergence
# -------------------------------------------------------------------------------------------------

ROTATION = np.linalg.qr(np.random.default_rng(7).normal(size=(5, 5)))[0]


def sphere(x):
    return x @ x


def ellipsoid(x):
    return 10.0 ** np.linspace(0, 4, 5) @ (ROTATION @ x) ** 2


def rosenbrock(x):
    return np.sum(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2)


def lost(function, n_trials, noise=0.0, offset=0.0, scale=1.0, **options):
    """Median over seeds of the function at the policy's mean, from starts in (-1.5, 1.5)^5."""
    values = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        search = PoWER(rng.uniform(-1.5, 1.5, 5), 0.5, rng=rng, **options)
        for trial in search.trials(n_trials):
            search.tell(
                trial, offset - scale * (function(trial.parameters) + noise * rng.normal())
            )
        values.append(function(search.parameters))
    return np.median(values)


@pytest.mark.parametrize(
    "function, n_trials", [(sphere, 800), (ellipsoid, 2000), (rosenbrock, 3200)]
)
def test_automatic_exploration_converges(function, n_trials):
    assert lost(function, n_trials) < 1e-8


@pytest.mark.parametrize("exploration", ["constant", "proportional"])
@pytest.mark.parametrize("function, start", [(sphere, 4.0), (ellipsoid, 5e3), (rosenbrock, 500.0)])
def test_exploration_with_a_minimum_comes_as_near_as_its_noise_allows(
    exploration, function, start
):
    # Noise of 0.05 in each parameter; the start is what the median start loses, to an order of
    # magnitude.
    assert lost(function, 600, exploration=exploration) < start / 100


@pytest.mark.parametrize("exploration", ["automatic", "constant", "proportional"])
def test_noisy_returns_are_averaged_out(exploration):
    # A single return errs by 0.1; the median start loses 4.
    assert lost(sphere, 800, noise=0.1, exploration=exploration) < 0.1


@pytest.mark.parametrize("offset, scale", [(1e6, 1.0), (-3.0, 1e-9), (0.0, 1e12)])
@pytest.mark.parametrize("weighting", ["rank", "exponential"])
def test_offset_and_scale_of_returns_do_not_matter(offset, scale, weighting):
    assert lost(sphere, 500, offset=offset, scale=scale, weighting=weighting) < 1e-3


def test_returns_as_weights_need_only_be_positive():
    values = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        search = PoWER(
            rng.uniform(-1.5, 1.5, 3),
            0.5,
            rng=rng,
            exploration="constant",
            weighting="returns",
            best=5,
            latest=40,
        )
        values.append(sphere(search.maximise(lambda x: np.exp(-(x @ x)), 600)))
    assert np.median(values) < 0.02, values


# --- what changes nothing
# ----------------------------------------------------------------------------------------


def path_of(n_trials=120, return_function=sphere, units=(1.0, 1.0, 1.0), seed=3, **options):
    """Parameters (n_trials, 3), in the first units, that a search tries."""
    units = np.asarray(units)
    search = PoWER(
        units * [1.0, -2.0, 0.5], 0.3 * units, rng=np.random.default_rng(seed), **options
    )
    tried = []
    for trial in search.trials(n_trials):
        tried.append(trial.parameters / units)
        search.tell(trial, -return_function(tried[-1]))
    return np.array(tried)


EXPLORATIONS = pytest.mark.parametrize(
    "exploration", ["automatic", "constant", "proportional", "fixed"]
)


@EXPLORATIONS
def test_the_same_generator_gives_the_same_search(exploration):
    np.testing.assert_array_equal(
        path_of(exploration=exploration), path_of(exploration=exploration)
    )
    assert not np.allclose(
        path_of(exploration=exploration), path_of(exploration=exploration, seed=4)
    )


@EXPLORATIONS
def test_units_of_parameters_change_only_units(exploration):
    # Powers of two, so that rounding is the same as well and the comparison is sharp.
    scaled = path_of(exploration=exploration, units=(2.0**20, 1.0, 2.0**-17))
    np.testing.assert_allclose(scaled, path_of(exploration=exploration), rtol=1e-9, atol=1e-12)


@EXPLORATIONS
def test_ranks_know_only_the_order_of_returns(exploration):
    monotone = path_of(
        return_function=lambda x: np.arctan(sphere(x)) ** 3, exploration=exploration
    )
    np.testing.assert_array_equal(monotone, path_of(exploration=exploration))


@EXPLORATIONS
@pytest.mark.parametrize("weighting", ["rank", "exponential"])
def test_the_order_of_telling_changes_nothing(exploration, weighting):
    ends = []
    for order in (1, -1):
        search = PoWER(
            np.ones(3),
            0.5,
            rng=np.random.default_rng(5),
            exploration=exploration,
            weighting=weighting,
            batch=10,
            latest=10,
        )
        for _ in range(6):
            for trial in [search.ask() for _ in range(10)][::order]:
                search.tell(trial, -np.round(sphere(trial.parameters), 1))
        ends.append((search.parameters, search.covariance))
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    np.testing.assert_array_equal(ends[0][1], ends[1][1])


@pytest.mark.parametrize("exploration", ["automatic", "constant", "proportional"])
def test_equal_returns_teach_nothing(exploration):
    search = PoWER(np.ones(3), 0.5, rng=np.random.default_rng(5), exploration=exploration)
    search.maximise(lambda _: 7.0, 60)
    np.testing.assert_array_equal(search.parameters, np.ones(3))
    np.testing.assert_allclose(search.covariance, 0.25 * np.eye(3))
    assert search.n_updates == 0


@EXPLORATIONS
def test_exploration_stays_within_its_limits(exploration):
    limits = (0.2, 2.0)
    for function in (sphere, lambda x: -1e3 * x.sum()):
        search = PoWER(
            np.zeros(3),
            [1.0, 10.0, 0.1],
            rng=np.random.default_rng(5),
            exploration=exploration,
            limits=limits,
        )
        for _ in range(20):
            search.maximise(lambda x, function=function: -function(x), 20)
            axes = np.sqrt(
                np.linalg.eigvalsh(search.covariance / np.outer(*2 * [[1.0, 10.0, 0.1]]))
            )
            assert 0.2 - 1e-9 < axes[0] and axes[-1] < 2.0 + 1e-9, axes


@pytest.mark.parametrize("exploration", ["automatic", "constant", "proportional"])
def test_an_optimum_that_moves_after_a_long_rest_is_found_again(exploration):
    search = PoWER(
        np.zeros(3), 1.0, rng=np.random.default_rng(0), exploration=exploration, limits=(0.1, 10.0)
    )
    search.maximise(lambda x: -(x @ x), 1000)
    assert np.abs(search.parameters).max() < 0.3
    assert 0.1 <= search.state()["policy"]["size"] <= 10.0
    search.maximise(lambda x: -((x - 5.0) @ (x - 5.0)), 600)
    assert np.abs(search.parameters - 5.0).max() < 0.5, search.parameters


def test_one_parameter_is_enough():
    search = PoWER([3.0], 1.0, rng=np.random.default_rng(0))
    assert abs(search.maximise(lambda x: -(x[0] ** 2), 200)[0]) < 1e-4


# --- weights
# -----------------------------------------------------------------------------------------------------


def test_weights_by_hand():
    np.testing.assert_allclose(return_weights([3.0, 0.0, 1.0], 2, "returns"), [0.75, 0.0, 0.25])
    np.testing.assert_allclose(
        return_weights([3.0, 0.0, 1.0], 3, "exponential"),
        np.array([1, np.exp(-10), np.exp(-20 / 3)]) / 1.0013180339,
    )
    log = np.log([2.5, 1.25])
    np.testing.assert_allclose(
        return_weights([-3.0, 0.0, -1.0], 2, "rank"), [0.0, *log / log.sum()]
    )


@pytest.mark.parametrize("weighting", ["rank", "exponential", "returns"])
def test_equal_returns_weigh_the_same_also_at_the_limit_of_the_best(weighting):
    weights = return_weights([1.0, 5.0, 1.0, 1.0, 0.0], 2, weighting)
    assert weights.sum() == pytest.approx(1.0)
    assert weights[0] == weights[2] == weights[3] > 0.0 == weights[4]
    one, other = return_weights([5.0, 1.0], 2, weighting)
    assert weights[1] == pytest.approx(one) and 3 * weights[0] == pytest.approx(other)


@pytest.mark.parametrize("weighting", ["rank", "exponential", "returns"])
def test_weights_over_time_are_those_of_each_step(weighting):
    returns = np.random.default_rng(0).integers(0, 5, size=(8, 20)).astype(float)
    together = return_weights(returns, 3, weighting)
    np.testing.assert_allclose(
        together, np.column_stack([return_weights(step, 3, weighting) for step in returns.T])
    )


def test_ranks_tell_neighbouring_numbers_apart():
    returns = np.nextafter(3.0, [0.0, 3.0, 9.0])
    np.testing.assert_array_equal(return_weights(returns, 2), return_weights([1.0, 2.0, 3.0], 2))


@pytest.mark.parametrize("weighting", ["exponential", "returns"])
def test_weights_survive_extreme_returns(weighting):
    for scale in (1e-300, 1e300):
        np.testing.assert_allclose(
            return_weights(np.array([1.0, 0.25, 0.5]) * scale, 3, weighting),
            return_weights([1.0, 0.25, 0.5], 3, weighting),
        )


def test_returns_of_zero_weigh_nothing():
    np.testing.assert_array_equal(return_weights(np.zeros(3), 2, "returns"), np.zeros(3))
    np.testing.assert_allclose(return_weights(np.ones(4), 2, "returns"), np.full(4, 0.25))
    assert return_weights([], 2).shape == (0,)


@pytest.mark.parametrize(
    "arguments, message",
    [
        (([1.0, np.nan], 1), "returns holds nan at index"),
        (([1.0, 2.0], 0), "best must be an integer of at least 1"),
        (([1.0, 2.0], 1, "loud"), "weighting must be one of .*rank.*got 'loud'"),
        (([1.0, -2.0], 1, "returns"), "holds -2.*use 'rank' or 'exponential'"),
        ((np.zeros((1, 1, 1)), 1), r"shape \(n,\) or"),
    ],
)
def test_weights_refuse(arguments, message):
    with pytest.raises(ValueError, match=message):
        return_weights(*arguments)
