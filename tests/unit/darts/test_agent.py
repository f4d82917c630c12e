"""The agent that knows the board: it finds its own precision from its scores, and aims accordingly
while that changes.
"""

import numpy as np
import pytest

from dart_skill.darts import (
    ModelBasedAgent,
    best_aim,
    estimate_from_points,
    expected_score,
    name_at,
    score,
)


def play(sigmas, seed):
    """The agent after throws with these sigmas (n,), its estimates of sigma and its regret
    [points] per throw.
    """
    rng, agent = np.random.default_rng(seed), ModelBasedAgent()
    believed, regret = np.empty(len(sigmas)), np.empty(len(sigmas))
    best = {
        sigma: best_aim(sigma).expected_score
        for sigma in np.unique(sigmas)[:: max(1, len(sigmas) // 20)]
    }
    for n, sigma in enumerate(sigmas):
        believed[n] = agent.sigma
        regret[n] = (
            best[sigma] - expected_score(agent.aim[None], sigma)[0] if sigma in best else np.nan
        )
        agent.tell(int(score(agent.aim + sigma * rng.standard_normal(2))))
    return agent, believed, regret


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [8.0, 25.0, 60.0])
def test_a_constant_precision_is_found_and_aimed_for(sigma):
    agent, believed, regret = play(np.full(600, sigma), seed=3)
    assert believed[-1] == pytest.approx(sigma, rel=0.2)
    assert np.mean(regret[300:]) < 0.05
    assert agent.belief.sum() == pytest.approx(1.0)


@pytest.mark.slow
def test_a_precision_that_grows_is_followed_across_the_jump_of_the_best_aim():
    """At sigma 16.9 mm the best aim jumps from treble 19 to treble 20."""
    agent, believed, regret = play(np.geomspace(40.0, 8.0, 1500), seed=0)
    assert believed[-1] == pytest.approx(8.0, rel=0.2)
    assert np.nanmean(regret[500:]) < 0.1
    np.testing.assert_allclose(agent.aim, best_aim(8.0).point, atol=8.0)


def test_a_thrower_who_begins_to_improve_after_a_long_time_is_followed():
    """The rate of change that is believed may itself change: after 600 throws without improvement
    it is not too sure that there is none.
    """
    sigmas = np.concatenate([np.full(600, 40.0), 40.0 * np.exp(-0.004 * np.arange(300))])
    agent, rng, believed = ModelBasedAgent(), np.random.default_rng(1), []
    for sigma in sigmas:
        believed.append(agent.sigma)
        agent.tell(int(score(agent.aim + sigma * rng.standard_normal(2))))
    lag = np.log(believed / sigmas)
    assert abs(lag[300:600].mean()) < 0.1
    assert lag[700:].mean() < 0.35


def test_before_the_first_throw_it_aims_where_a_thrower_of_unknown_precision_should():
    agent = ModelBasedAgent()
    scores = [
        expected_score(np.array([agent.aim, [0.0, 103.0]]), sigma) for sigma in agent.sigmas[::20]
    ]
    assert np.mean(scores, axis=0)[0] > np.mean(scores, axis=0)[1]


def test_where_it_aims_has_a_name_and_a_worth():
    agent = ModelBasedAgent()
    assert agent.bed == name_at(agent.aim)
    assert agent.expected_score == pytest.approx(
        agent.belief @ [expected_score(agent.aim, sigma) for sigma in agent.sigmas], rel=1e-9
    )
    assert agent.spread.is_isotropic and agent.spread.sigma == pytest.approx(agent.sigma)


@pytest.mark.parametrize("impossible", [23, -1, 61, 20.5, np.nan, None])
def test_a_score_that_cannot_be_thrown_is_refused_and_changes_nothing(impossible):
    agent = ModelBasedAgent()
    before = agent.belief
    with pytest.raises(ValueError, match="one dart cannot score"):
        agent.tell(impossible)
    np.testing.assert_array_equal(agent.belief, before)


# from hits instead of scores


def told(agent, n, sigmas, rng, bias=(0.0, 0.0)):
    """Tell an agent of so many hits about its aims; the beds that it aims at afterwards."""
    beds = []
    for _ in range(n):
        agent.tell(agent.aim + np.asarray(bias) + rng.normal(0.0, sigmas, 2))
        beds.append(agent.bed)
    return beds


def test_before_the_first_estimate_the_bull_is_aimed_at():
    agent = ModelBasedAgent("hits")
    beds = told(agent, 9, 3.0, np.random.default_rng(0))
    assert (
        set(beds) == {"DB"}
        and agent.spread is None
        and np.isnan([agent.sigma, agent.expected_score]).all()
    )
    told(agent, 1, 3.0, np.random.default_rng(1))
    assert agent.bed == "T20" and agent.sigma == agent.spread.sigma


def test_the_aim_is_the_best_for_the_last_hits_and_chosen_anew_every_so_often():
    agent, rng = ModelBasedAgent("hits", window=20, least=8, every=4), np.random.default_rng(2)
    hits, aims = rng.normal(0.0, [20.0, 6.0], (24, 2)), []
    for hit in hits:
        aims.append(agent.aim)
        agent.tell(agent.aim + hit)
    expected = estimate_from_points(
        np.add(aims, hits)[-20:], np.array(aims[-20:]), model="general"
    ).spread
    np.testing.assert_array_equal(agent.spread.covariance, expected.covariance)
    np.testing.assert_array_equal(agent.aim, best_aim(expected).point)
    changes = [n for n in range(1, 24) if not np.array_equal(aims[n], aims[n - 1])]
    assert changes and all(n >= 8 and n % 4 == 0 for n in changes), changes


def test_a_bias_counts_as_spread():
    agent = ModelBasedAgent("hits", least=50)
    told(agent, 50, [3.0, 8.0], np.random.default_rng(8), bias=[0.0, 5.0])
    np.testing.assert_allclose(
        np.sqrt(np.diag(agent.spread.covariance)), [3.0, np.hypot(8.0, 5.0)], rtol=0.25
    )


def test_old_hits_are_forgotten():
    agent, rng = ModelBasedAgent("hits", window=20), np.random.default_rng(3)
    told(agent, 20, 30.0, rng)
    wide = agent.sigma
    told(agent, 20, 4.0, rng)
    assert wide > 20.0 and agent.sigma < 6.0


def test_a_bed_at_which_no_throw_comes_about_is_left_alone():
    agent, rng = ModelBasedAgent("hits"), np.random.default_rng(10)
    told(agent, 10, 3.0, rng)
    assert agent.bed == "T20"
    agent.cannot()
    assert agent.bed != "T20"
    assert "T20" not in told(agent, 10, 3.0, rng) and agent.expected_score > 30.0


def test_before_the_first_estimate_a_bull_out_of_reach_is_left_for_the_beds_around_it():
    """As of an arm that was shown darts in the lower half of the board only."""
    agent, tried = ModelBasedAgent("hits"), []
    while agent.aim[1] > -40.0:
        tried.append(agent.bed)
        agent.cannot()
    assert tried[0] == "DB" and len(set(tried)) == len(tried) < 22
    assert np.hypot(*agent.aim) < 100.0
    told(agent, 10, 3.0, np.random.default_rng(3))
    assert agent.spread is not None and agent.bed not in tried


def test_so_is_one_by_an_agent_that_learns_from_scores():
    agent = ModelBasedAgent()
    for _ in range(100):
        agent.tell(60)
    assert agent.bed == "T20"
    best, worth = agent.bed, agent.expected_score
    agent.cannot()
    assert agent.bed != best and agent.expected_score < worth
    refused = {best}
    for _ in range(200):
        if agent.bed in refused:
            break
        refused.add(agent.bed)
        agent.cannot()
    assert np.hypot(*agent.aim) < 30.0, "what is left is near the bull"


@pytest.mark.parametrize("hit", [[1.0, np.nan], [1.0], 20, None])
def test_a_hit_that_is_no_point_is_refused_and_changes_nothing(hit):
    agent = ModelBasedAgent("hits")
    with pytest.raises(ValueError, match="hit"):
        agent.tell(hit)
    told(agent, 9, 3.0, np.random.default_rng(0))
    assert agent.spread is None


def test_wrong_use_is_refused_with_the_remedy():
    with pytest.raises(ValueError, match="cannot learn from 'points': choose one of scores, hits"):
        ModelBasedAgent("points")
    with pytest.raises(ValueError, match="least must be an integer of at least 4"):
        ModelBasedAgent("hits", least=2)
    with pytest.raises(ValueError, match="window must be an integer of at least 10"):
        ModelBasedAgent("hits", window=5)
    with pytest.raises(ValueError, match="ask for its spread or sigma"):
        ModelBasedAgent("hits").belief  # noqa: B018
