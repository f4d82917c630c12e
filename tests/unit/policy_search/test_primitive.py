"""PoWER on movement primitives: (7.14)-(7.17) by hand, and a movement through two points."""

import numpy as np
import pytest

from dart_skill.policy_search import PoWER, PrimitivePoWER

# Two basis functions over three steps: one, both, the other.
ACTIVATIONS = np.array([[1.0, 0.0], [0.75, 0.25], [0.0, 1.0]])
REWARDS = [[0.0, 1.0, 1.0], [1.0, 0.0, 0.0]]  # returns to go 2, 2, 1 and 1, 0, 0


def learned(noise, rewards, **options):
    """Weights (2,) after trials whose noise about (1, -1) and rewards are given."""
    choices = {
        "weighting": "returns",
        "exploration": "fixed",
        "best": 2,
        "batch": 2,
        "latest": 2,
        **options,
    }
    search = PrimitivePoWER(
        [[1.0], [-1.0]], ACTIVATIONS, 0.5, rng=np.random.default_rng(0), **choices
    )
    numbers = [search.ask().number for _ in noise]
    state = search.state()
    for entry, eps in zip(state["open"], noise, strict=True):
        entry[2] = (np.array([1.0, -1.0]) + eps).tolist()
    search = PrimitivePoWER.from_state(state)
    for number, reward in zip(numbers, rewards, strict=True):
        search.tell(number, reward)
    return search


def test_the_update_with_new_noise_at_every_step_by_hand():
    noise = [[[1, 0], [0, 2], [3, 0]], [[2, 2], [0, 0], [5, 5]]]
    search = learned(noise, REWARDS, hold=1, credit="uniform")
    # (2*1 + 2*0 + 1*3 + 1*2) / (2 + 2 + 1 + 1) and (2*0 + 2*2 + 1*0 + 1*2) / 6
    np.testing.assert_allclose(search.parameters, [1 + 7 / 6, -1 + 6 / 6])


def test_the_update_with_noise_kept_through_the_trial_by_hand():
    # sum_t Q is 5 and 1.
    search = learned([[1, 2], [2, -1]], REWARDS, credit="uniform")
    np.testing.assert_allclose(
        search.parameters, [1 + (5 * 1 + 1 * 2) / 6, -1 + (5 * 2 - 1 * 1) / 6]
    )


def test_low_rewarded_trials_are_discarded():
    search = learned([[1, 2], [2, -1]], REWARDS, credit="uniform", best=1)
    np.testing.assert_allclose(search.parameters, [1 + 1, -1 + 2])


def test_a_basis_learns_from_the_returns_to_go_while_it_is_active():
    # Parts are 1, 0.9, 0 and 0, 0.1, 1: the first basis has 2 + 1.8 against 1, the second 0.2 + 1
    # against 0.
    search = learned([[1, 2], [2, -1]], REWARDS, credit="activation")
    np.testing.assert_allclose(search.parameters, [1 + (3.8 * 1 + 1 * 2) / 4.8, -1 + 2])


def test_each_variance_becomes_the_weighted_square_plus_sigma_0():
    search = learned(
        [[1, 2], [2, -1]],
        REWARDS,
        credit="activation",
        exploration="constant",
        minimum_exploration=0.2,
    )
    np.testing.assert_allclose(
        search.spread[:, 0] ** 2, [(3.8 * 1 + 1 * 4) / 4.8 + 0.01, 4 + 0.01]
    )


def test_proportional_noise_shares_sigma_0_out():
    search = learned(
        [[1, 2], [2, -1]],
        REWARDS,
        credit="activation",
        exploration="proportional",
        minimum_exploration=0.2,
    )
    squares = np.array([7.8 / 4.8, 4.0])
    np.testing.assert_allclose(search.spread[:, 0] ** 2, squares * (1 + 2 * 0.01 / squares.sum()))


def test_one_return_counts_for_every_step_alike():
    single, uniform = (
        learned([[1, 2], [2, -1]], [5.0, 1.0], credit=credit).parameters
        for credit in ("activation", "uniform")
    )
    np.testing.assert_allclose(single, [1 + 7 / 6, -1 + 9 / 6])
    np.testing.assert_allclose(uniform, single)


@pytest.mark.parametrize("exploration", ["automatic", "constant", "proportional"])
def test_a_basis_that_no_reward_follows_is_left_alone(exploration):
    search = PrimitivePoWER(
        np.zeros((2, 1)), ACTIVATIONS, 0.5, rng=np.random.default_rng(0), exploration=exploration
    )
    for trial in search.trials(60):
        search.tell(trial, [-((trial.output[0, 0] - 0.4) ** 2), 0.0, 0.0])
    assert abs(search.weights[0, 0] - 0.4) < 0.1
    assert search.weights[1, 0] == 0.0
    if exploration != "automatic":
        assert search.spread[1, 0] == 0.5


def test_the_output_is_the_noisy_weights_times_the_activations():
    start = np.array([[1.0, 2.0], [-3.0, 0.0]])
    trial = PrimitivePoWER(start, ACTIVATIONS, 0.5, rng=np.random.default_rng(0)).ask()
    np.testing.assert_allclose(trial.output, ACTIVATIONS @ trial.parameters.reshape(2, 2))


@pytest.mark.parametrize("hold, n_stretches", [(1, 3), (2, 2), (3, 1), (99, 1), (None, 1)])
def test_noise_is_new_in_each_stretch_and_has_the_spread(hold, n_stretches):
    spread = np.array([[0.5], [2.0]])
    search = PrimitivePoWER(
        np.zeros((2, 1)), ACTIVATIONS, spread, rng=np.random.default_rng(0), hold=hold
    )
    noise = np.array([search.ask().parameters.reshape(-1, 2) for _ in range(2000)])
    assert noise.shape[1] == n_stretches
    flat = noise.reshape(2000, -1)
    expected = np.diag(np.tile([0.25, 4.0], n_stretches))
    np.testing.assert_allclose(np.cov(flat.T), expected, atol=5 * 4.0 / np.sqrt(2000))
    np.testing.assert_allclose(search.spread, spread)


def test_with_one_return_and_a_diagonal_it_is_the_vector_search():
    """The weights' mean moves as in `PoWER` when exploration is fixed, whatever the shape of the
    weights.
    """
    target = np.array([1.0, -1.0, 0.5, 2.0])
    shared = {"exploration": "fixed", "batch": 5, "latest": 10, "best": 3}
    vector = PoWER(np.zeros(4), 0.3, rng=np.random.default_rng(6), **shared)
    primitive = PrimitivePoWER(
        np.zeros((2, 2)), ACTIVATIONS, 0.3, rng=np.random.default_rng(6), **shared
    )
    for one, other in zip(vector.trials(50), primitive.trials(50), strict=True):
        np.testing.assert_allclose(one.parameters, other.parameters, atol=1e-12)
        vector.tell(one, -np.sum((one.parameters - target) ** 2))
        primitive.tell(other, -np.sum((other.parameters - target) ** 2))
    np.testing.assert_allclose(vector.parameters, primitive.parameters, atol=1e-12)


# --- a movement through two points
# -------------------------------------------------------------------------------

N_STEPS, VIA = 60, {15: (0.5, -0.3), 45: (-0.4, 0.6)}


def normalised_gaussians(n_basis):
    progress, centres = np.linspace(0, 1, N_STEPS), np.linspace(0, 1, n_basis)
    kernels = np.exp(-0.5 * ((progress[:, None] - centres) * n_basis / 0.6) ** 2)
    return kernels / kernels.sum(axis=1, keepdims=True)


def via_rewards(output):
    rewards = np.zeros(N_STEPS)
    for step, point in VIA.items():
        rewards[step] = -np.sum((output[step] - point) ** 2)
    return rewards


def circle_rewards(output):
    angle = np.linspace(0, 2 * np.pi, N_STEPS)
    return (
        -np.sum((output - np.column_stack([np.sin(angle), np.cos(angle)])) ** 2, axis=1) / N_STEPS
    )


def lost(n_trials, rewards_of=via_rewards, summed=False, noise=0.0, **options):
    """Median over seeds of what the rewards lack; it is 0.86 and 1.0 at the start."""
    activations, losses = normalised_gaussians(8), []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        search = PrimitivePoWER(np.zeros((8, 2)), activations, 0.3, rng=rng, **options)
        for trial in search.trials(n_trials):
            rewards = rewards_of(trial.output)
            rewards = rewards + noise * rng.normal(size=N_STEPS) * (rewards != 0)
            search.tell(trial, rewards.sum() if summed else rewards)
        losses.append(-rewards_of(activations @ search.weights).sum())
    return np.median(losses)


@pytest.mark.parametrize("exploration", ["automatic", "constant", "proportional"])
@pytest.mark.parametrize("summed", [False, True])
def test_a_movement_learns_to_pass_through_two_points(exploration, summed):
    assert lost(200, summed=summed, exploration=exploration) < 0.02


def test_it_does_so_with_noisy_rewards():
    assert lost(200, noise=0.05) < 0.04


def test_credit_where_a_basis_is_active_learns_faster_than_credit_everywhere():
    active, everywhere = (
        lost(300, circle_rewards, exploration="constant", credit=credit)
        for credit in ("activation", "uniform")
    )
    assert active < 0.8 * everywhere, (active, everywhere)


@pytest.mark.parametrize("hold, credit", [(1, "activation"), (20, "activation"), (20, "uniform")])
def test_noise_that_changes_within_a_trial_also_finds_its_way(hold, credit):
    assert lost(300, hold=hold, credit=credit) < 0.2


def test_the_explored_movement_is_as_smooth_as_its_basis():
    """State-dependent exploration shakes an arm far less than new noise at every step."""
    activations = normalised_gaussians(8)
    jerk = {}
    for hold in (1, None):
        search = PrimitivePoWER(
            np.zeros((8, 1)), activations, 1.0, rng=np.random.default_rng(0), hold=hold
        )
        jerk[hold] = np.mean(
            [np.abs(np.diff(search.ask().output, 2, axis=0)).mean() for _ in range(20)]
        )
    assert jerk[None] < 0.1 * jerk[1], jerk


def test_maximise_takes_a_function_of_the_output():
    search = PrimitivePoWER(
        np.zeros((8, 2)), normalised_gaussians(8), 0.3, rng=np.random.default_rng(0)
    )
    parameters = search.maximise(via_rewards, 200)
    np.testing.assert_array_equal(parameters, search.weights.ravel())
    assert -via_rewards(normalised_gaussians(8) @ search.weights).sum() < 0.02
