"""Policy gradients against closed forms: gradient, Fisher information and step of a quadratic
under a Gaussian policy are on paper.
"""

from functools import partial

import numpy as np
import pytest

from dart_skill.experiments.studies.policy_gradients import (
    EpisodicNaturalActorCritic,
    Reinforce,
    natural_gradient,
    optimal_baseline,
    reinforce_gradient,
)

MEAN, SIGMA = np.array([0.5, -1.0, 0.2]), np.array([0.5, 1.0, 2.0])
SLOPE, CURVATURE = (
    np.array([1.0, -0.5, 2.0]),
    np.array([[1.0, 0.3, 0.0], [0.3, 2.0, -0.2], [0.0, -0.2, 0.5]]),
)
FISHER = np.diag(np.concatenate([1 / SIGMA**2, np.full(3, 2.0)]))
BOTH = pytest.mark.parametrize("kind", [Reinforce, EpisodicNaturalActorCritic])


def quadratic(x, curvature=CURVATURE):
    """3 + a'x - x'Hx / 2, for x (..., 3)."""
    return 3.0 + x @ SLOPE - 0.5 * np.einsum("...i,ij,...j->...", x, curvature, x)


def gradient(curvature=CURVATURE):
    """Of its expectation by mean and log sigma: a - H mean, and -H_ii sigma_i^2."""
    return np.concatenate([SLOPE - curvature @ MEAN, -np.diagonal(curvature) * SIGMA**2])


def drawn(n, seed=0, curvature=CURVATURE):
    """Scores (n, 6) and returns (n,)."""
    noise = np.random.default_rng(seed).standard_normal((n, 3))
    return np.hstack([noise / SIGMA, noise**2 - 1]), quadratic(MEAN + SIGMA * noise, curvature)


def make(kind, seed=0, start=MEAN, spread=1.0, **options):
    return kind(start, spread, rng=np.random.default_rng(seed), **options)


def with_the_own_return(scores, returns):
    """The usual estimate: the baseline from all trials, also the one that it is subtracted from."""
    return np.mean(scores * (returns[:, None] - optimal_baseline(scores, returns)), axis=0)


def errors_in_standard_errors(estimate, n=10, n_batches=4000):
    scores, returns = drawn(n * n_batches)
    found = np.array(
        [estimate(scores[k : k + n], returns[k : k + n]) for k in range(0, n * n_batches, n)]
    )
    return (found.mean(axis=0) - gradient()) / (found.std(axis=0, ddof=1) / np.sqrt(n_batches))


def test_reinforce_is_unbiased_and_would_not_be_with_the_own_return_in_the_baseline():
    assert np.abs(errors_in_standard_errors(reinforce_gradient)).max() < 3.0
    assert np.abs(errors_in_standard_errors(with_the_own_return)).max() > 10.0


def test_no_constant_baseline_gives_less_variance_than_the_optimal_one():
    scores, returns = drawn(20_000)
    best = optimal_baseline(scores, returns)
    others = best + np.linspace(-3.0, 3.0, 61)[:, None]
    variances = np.array([np.var(scores * (returns[:, None] - one), axis=0) for one in others])
    least = np.var(scores * (returns[:, None] - best), axis=0)
    assert np.all(least <= variances.min(axis=0) * (1 + 1e-3)), least / variances.min(axis=0)
    assert np.all(variances[[0, -1]] > least), "far from it the variance is larger"
    assert np.ptp(best) > 0.5, "each element of the gradient has a baseline of its own"


def test_the_optimal_baseline_is_that_of_its_formula():
    scores, returns = drawn(50)
    np.testing.assert_allclose(
        optimal_baseline(scores, returns),
        (scores**2 * returns[:, None]).sum(axis=0) / (scores**2).sum(axis=0),
    )


def test_leaving_a_trial_out_is_what_a_loop_over_the_trials_does():
    scores, returns = drawn(7)
    left = [
        scores[k] * (returns[k] - optimal_baseline(np.delete(scores, k, 0), np.delete(returns, k)))
        for k in range(7)
    ]
    np.testing.assert_allclose(
        reinforce_gradient(scores, returns), np.mean(left, axis=0), rtol=1e-10
    )


def test_the_natural_gradient_is_the_inverse_fisher_information_times_the_gradient():
    diagonal = np.diag(np.diagonal(CURVATURE))
    natural, baseline = natural_gradient(*drawn(7, curvature=diagonal), FISHER)
    np.testing.assert_allclose(
        natural,
        np.linalg.solve(FISHER, gradient(diagonal)),
        rtol=1e-9,
        err_msg="exact from p + 1 trials",
    )
    assert baseline == pytest.approx(
        quadratic(MEAN, diagonal) - 0.5 * np.diagonal(diagonal) @ SIGMA**2
    ), "the expected return"
    natural, _ = natural_gradient(*drawn(50_000), FISHER)
    np.testing.assert_allclose(
        natural,
        np.linalg.solve(FISHER, gradient()),
        atol=0.03,
        err_msg="with interactions, in the limit",
    )


def test_the_fisher_information_is_the_second_moment_of_the_scores():
    scores, _ = drawn(200_000)
    np.testing.assert_allclose(scores.T @ scores / len(scores), FISHER, atol=0.06)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("ridge", [0.0, 0.1])
def test_the_natural_gradient_is_the_same_in_whatever_parameters_and_that_of_reinforce_is_not(
    seed, ridge
):
    """theta' = A theta: scores A^-1, Fisher information A'^-1 F A^-1; a step in theta' is A times
    that in theta.
    """
    scores, returns = drawn(20, seed)
    change = np.random.default_rng(seed).normal(size=(6, 6)) + 3 * np.eye(6)
    back = np.linalg.inv(change)
    natural, baseline = natural_gradient(scores, returns, FISHER, ridge)
    other, other_baseline = natural_gradient(scores @ back, returns, back.T @ FISHER @ back, ridge)
    np.testing.assert_allclose(other, change @ natural, rtol=1e-6, atol=1e-9)
    assert other_baseline == pytest.approx(baseline)
    vanilla = change @ reinforce_gradient(scores, returns)
    assert np.linalg.norm(
        reinforce_gradient(scores @ back, returns) - vanilla
    ) > 0.1 * np.linalg.norm(vanilla)


@BOTH
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "options", [{"learning_rate": 0.2}, {"learning_rate": 0.05, "step": "plain"}]
)
def test_a_step_improves_the_expected_return(kind, seed, options):
    def expected(search):
        return quadratic(search.parameters) - 0.5 * np.diagonal(CURVATURE) @ search.spread**2

    search = make(kind, seed, spread=SIGMA, batch=300, **options)
    before = expected(search)
    search.maximise(quadratic, 300)
    assert search.n_updates == 1 and expected(search) > before


@BOTH
def test_a_normalised_step_has_the_length_of_the_learning_rate_in_the_fisher_metric(kind):
    search = make(kind, learning_rate=0.25)
    search.maximise(quadratic, search.settings.batch)
    moved = np.concatenate([search.parameters - MEAN, np.log(search.spread)])
    assert np.sqrt(np.concatenate([np.ones(3), np.full(3, 2.0)]) @ moved**2) == pytest.approx(0.25)


@BOTH
def test_a_plain_step_is_the_learning_rate_times_the_direction(kind):
    search = make(kind, learning_rate=0.1, step="plain", batch=20)
    noise = np.array([trial.parameters - MEAN for trial in (search.ask() for _ in range(20))])
    returns = quadratic(MEAN + noise)
    for number, value in enumerate(returns):
        search.tell(number, value)
    scores = np.hstack([noise, noise**2 - 1])
    fisher = np.diag([1.0] * 3 + [2.0] * 3)
    direction = (
        reinforce_gradient(scores, returns)
        if kind is Reinforce
        else natural_gradient(scores, returns, fisher, 0.01)[0]
    )
    np.testing.assert_allclose(search.parameters, MEAN + 0.1 * direction[:3])
    np.testing.assert_allclose(search.spread, np.exp(0.1 * direction[3:]))


@BOTH
def test_unit_and_zero_of_the_return_change_normalised_steps_by_nothing_and_plain_ones_by_much(
    kind,
):
    def found(step, factor, zero=0.0):
        return make(kind, learning_rate=0.01, step=step).maximise(
            lambda x: factor * quadratic(x) + zero, 140
        )

    one = found("normalised", 1.0)
    np.testing.assert_allclose(found("normalised", 1e-200), one, rtol=1e-6)
    np.testing.assert_allclose(found("normalised", 1e200), one, rtol=1e-6)
    np.testing.assert_allclose(found("normalised", 1.0, 1e3), one, rtol=1e-6)
    assert np.linalg.norm(found("plain", 0.01) - MEAN) < 0.1 * np.linalg.norm(
        found("plain", 1.0) - MEAN
    )


@BOTH
def test_a_plain_step_with_too_high_a_learning_rate_leaves_all_numbers_and_says_so(kind):
    with pytest.raises(
        ValueError,
        match=(
            "update 0 is .* with learning_rate 1e\\+20, and leaves all numbers: lower it .*"
            " 'normalised'"
        ),
    ):
        make(kind, learning_rate=1e20, step="plain").maximise(lambda x: 1e300 * quadratic(x), 20)


@BOTH
def test_fixed_exploration_keeps_its_size_and_automatic_exploration_keeps_to_its_limits(kind):
    fixed = make(kind, exploration="fixed", spread=SIGMA)
    fixed.maximise(quadratic, 200)
    np.testing.assert_array_equal(fixed.spread, SIGMA)
    assert fixed.settings.batch == 8 and make(kind).settings.batch == 14
    sizes = []
    for returns in (quadratic, lambda x: float(np.sum(x**2))):
        search = make(kind, learning_rate=1.0, limits=(0.5, 2.0))
        search.maximise(returns, 400)
        sizes.append(search.exploration_size)
    assert 0.5 <= sizes[0] < 1.0 < sizes[1] <= 2.0, sizes


def test_without_a_floor_exploration_vanishes_and_a_hill_that_moves_is_lost():
    def missed(floor):
        search = make(EpisodicNaturalActorCritic, start=np.zeros(2), limits=(floor, 10.0))
        for step, trial in enumerate(search.trials(1500)):
            search.tell(trial, -float(np.sum((trial.parameters - (step > 1000)) ** 2)))
        return np.linalg.norm(search.parameters - 1.0)

    assert missed(0.1) < 0.3 and missed(1e-8) > 1.4, (missed(0.1), missed(1e-8))


def test_the_error_of_the_gradient_grows_with_the_dimension():
    def error(d, n=50):
        rng, slope = np.random.default_rng(0), np.ones(d)
        noise = rng.standard_normal((200, n, d))
        found = np.array([reinforce_gradient(one, one @ slope) for one in noise])
        return np.sqrt(np.mean(np.sum((found - slope) ** 2, axis=1)) / d)

    errors = [error(d) for d in (2, 8, 32)]
    np.testing.assert_allclose(errors, np.sqrt((np.array([2, 8, 32]) + 1) / 50), rtol=0.25)


@BOTH
def test_trials_without_difference_change_nothing(kind):
    search = make(kind)
    np.testing.assert_array_equal(search.maximise(lambda x: 0.1, 100), MEAN)
    assert search.n_updates == 0 and search.exploration_size == 1.0


ESTIMATES = pytest.mark.parametrize(
    "estimate", [optimal_baseline, reinforce_gradient, partial(natural_gradient, fisher=FISHER)]
)


@ESTIMATES
@pytest.mark.parametrize(
    "scores, returns, message",
    [
        (
            np.ones((9, 6)),
            [1.0] * 4 + [np.nan] + [1.0] * 4,
            r"returns holds nan at index \(4,\); remove",
        ),
        (np.full((9, 6), np.inf), np.ones(9), r"scores holds inf at index \(0, 0\); remove"),
        (np.ones((9, 6)), np.ones(8), "returns must have length 9, got 8"),
        (
            np.ones(9),
            np.ones(9),
            r"scores must have 2 dimension\(s\), got shape \(9,\); use reshape",
        ),
        (
            np.ones((9, 6)),
            np.ones((9, 1)),
            r"returns must have 1 dimension\(s\), got shape \(9, 1\)",
        ),
        (np.ones((0, 6)), [], r"scores is empty, shape \(0, 6\); at least one"),
    ],
)
def test_scores_and_returns_that_make_no_gradient_are_refused(estimate, scores, returns, message):
    with pytest.raises(ValueError, match=message):
        estimate(scores, returns)


@pytest.mark.parametrize(
    "estimate, n, least",
    [(reinforce_gradient, 1, 2), (partial(natural_gradient, fisher=FISHER), 6, 7)],
)
def test_too_few_trials_are_refused(estimate, n, least):
    with pytest.raises(
        ValueError,
        match=(
            f"scores has {n} rows, one per trial, but 6 elements .* at least {least}: make more"
            " trials"
        ),
    ):
        estimate(np.ones((n, 6)), np.arange(n))


@BOTH
@pytest.mark.parametrize(
    "start, spread, options, message",
    [
        ([], 1.0, {}, "empty"),
        ([[0.0]], 1.0, {}, "parameters must have 1 dimension"),
        ([np.nan], 1.0, {}, "nan"),
        ([0.0], 0.0, {}, "spread must be above 0"),
        ([0.0], [1.0, 1.0], {}, "spread must be one number or have shape"),
        ([0.0], 1.0, {"learning_rate": 0.0}, "learning_rate must be above 0"),
        ([0.0], 1.0, {"learning_rate": np.nan}, "learning_rate holds nan"),
        ([0.0], 1.0, {"step": "giant"}, "step must be one of .*'normalised'.*got 'giant'"),
        (
            [0.0],
            1.0,
            {"exploration": "proportional"},
            "exploration must be one of .*got 'proportional'",
        ),
        (
            [0.0],
            1.0,
            {"batch": 1},
            "batch is 1, but 2 elements of a gradient need at least [23] trials: raise it",
        ),
        ([0.0], 1.0, {"batch": 5.5}, "batch must be an integer"),
        ([0.0], 1.0, {"limits": (2.0, 3.0)}, "limits must lie on both sides of 1"),
    ],
)
def test_bad_options_are_refused(kind, start, spread, options, message):
    with pytest.raises(ValueError, match=message):
        make(kind, start=start, spread=spread, **options)


def test_the_regression_needs_more_trials_than_unknowns_and_a_ridge_that_is_not_negative():
    with pytest.raises(
        ValueError,
        match="batch is 6, but 6 elements of a gradient need at least 7 trials: raise it",
    ):
        make(EpisodicNaturalActorCritic, batch=6)
    assert make(EpisodicNaturalActorCritic, batch=4, exploration="fixed").settings.batch == 4
    with pytest.raises(ValueError, match="ridge"):
        make(EpisodicNaturalActorCritic, ridge=-1.0)


@BOTH
@pytest.mark.parametrize(
    "outcome, message",
    [(np.inf, r"return is \+inf; give"), ([1.0, 2.0], r"return must have shape \(\), got \(2,\)")],
)
def test_outcomes_that_are_no_return_are_refused_and_a_failure_is_counted(kind, outcome, message):
    search = make(kind)
    with pytest.raises(ValueError, match=message):
        search.tell(search.ask(), outcome)
    search.tell(search.ask(), np.nan)
    assert search.n_failed == 1 and search.n_told == 0
