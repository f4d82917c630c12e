"""The agent that knows the board: it finds its own precision from its scores, and aims accordingly while that changes."""

import numpy as np
import pytest

from dart_skill.darts import ModelBasedAgent, best_aim, expected_score, score


def play(sigmas, seed):
    """The agent after throws with these sigmas (n,), its estimates of sigma and its regret [points] per throw."""
    rng, agent = np.random.default_rng(seed), ModelBasedAgent()
    believed, regret = np.empty(len(sigmas)), np.empty(len(sigmas))
    best = {sigma: best_aim(sigma).expected_score for sigma in np.unique(sigmas)[:: max(1, len(sigmas) // 20)]}
    for n, sigma in enumerate(sigmas):
        believed[n] = agent.sigma
        regret[n] = best[sigma] - expected_score(agent.aim[None], sigma)[0] if sigma in best else np.nan
        agent.tell(int(score(agent.aim + sigma * rng.standard_normal(2))))
    return agent, believed, regret


@pytest.mark.parametrize("sigma", [8.0, 25.0, 60.0])
def test_a_constant_precision_is_found_and_aimed_for(sigma):
    agent, believed, regret = play(np.full(600, sigma), seed=3)
    assert believed[-1] == pytest.approx(sigma, rel=0.2)
    assert np.mean(regret[300:]) < 0.05
    assert agent.belief.sum() == pytest.approx(1.0)


def test_a_precision_that_grows_is_followed_across_the_jump_of_the_best_aim():
    """At sigma 16.9 mm the best aim jumps from treble 19 to treble 20."""
    agent, believed, regret = play(np.geomspace(40.0, 8.0, 1500), seed=0)
    assert believed[-1] == pytest.approx(8.0, rel=0.2)
    assert np.nanmean(regret[500:]) < 0.1
    np.testing.assert_allclose(agent.aim, best_aim(8.0).point, atol=8.0)


def test_before_the_first_throw_it_aims_where_a_thrower_of_unknown_precision_should():
    agent = ModelBasedAgent()
    scores = [expected_score(np.array([agent.aim, [0.0, 103.0]]), sigma) for sigma in agent.sigmas[::20]]
    assert np.mean(scores, axis=0)[0] > np.mean(scores, axis=0)[1]


@pytest.mark.parametrize("impossible", [23, -1, 61, 20.5, np.nan, None])
def test_a_score_that_cannot_be_thrown_is_refused_and_changes_nothing(impossible):
    agent = ModelBasedAgent()
    before = agent.belief
    with pytest.raises(ValueError, match="one dart cannot score"):
        agent.tell(impossible)
    np.testing.assert_array_equal(agent.belief, before)
