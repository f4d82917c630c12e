"""Two players: the game against a value iteration of every state, simulated legs, symmetry, and
what more skill is worth.
"""

import itertools

import numpy as np
import pytest

from dart_skill.darts import (
    BED_IS_DOUBLE,
    BED_SCORES,
    Spread,
    aims_apart,
    bed_probabilities,
    checkout_table,
    match_chance,
    match_player,
    professional,
    solve_match,
)
from tests.unit.darts.simulated import simulate_match_legs

START = 31
PLAYS = list(itertools.product(["best", "turns"], repeat=2))
BEST, FEWEST = ("best", "best"), ("turns", "turns")


@pytest.fixture(scope="module")
def players():
    return match_player(12.0, START), match_player(
        Spread([[500.0, 80.0], [80.0, 300.0]], [5.0, -6.0]), START
    )


@pytest.fixture(scope="module")
def solved(players):
    return {plays: solve_match(*players, START, plays) for plays in PLAYS}


def chances_of_turn(chances, after, begun, aims_of):
    """The best chances (m,) to win at the start of a turn from the score `begun`.

    Parameters
    ----------
    chances : (n, 83)
        Probabilities of the beds at each aim.
    after : (m, s)
        Chances to win with s left at the end of the turn, in m cases.
    aims_of
        Gives the indices of the aims for a number of darts left and a remaining score.
    """
    values = after
    for darts in (1, 2, 3):
        now = np.zeros((len(after), begun + 1))
        now[:, 0] = 1.0
        for remaining in range(max(2, begun - 60 * (3 - darts)), begun + 1):
            left = remaining - BED_SCORES
            bust = (left < 0) | (left == 1) | ((left == 0) & ~BED_IS_DOUBLE)
            outcomes = np.where(bust, after[:, [begun]], values[:, np.maximum(left, 0)])
            now[:, remaining] = (outcomes @ chances[aims_of(darts, remaining)].T).max(axis=1)
        values = now
    return values[:, begun]


def iterated(players, sigmas, start):
    """Chances (2, start + 1, start + 1) of both players to win at the start of their own turn, by
    what they and the other have left: all turns are computed again until nothing changes.
    """
    first = np.zeros((2, start + 1, start + 1))
    chances = [
        bed_probabilities(player.aims, sigma)
        for player, sigma in zip(players, sigmas, strict=True)
    ]
    for _ in range(200):
        before = first.copy()
        for own, me in itertools.product(range(2, start + 1), range(2)):
            after = 1.0 - first[1 - me, 2:, : own + 1]
            after[:, 0] = 1.0
            first[me, own, 2:] = chances_of_turn(
                chances[me], after, own, players[me].choice.allowed
            )
        if np.abs(first - before).max() < 1e-8:
            return first
    raise AssertionError("the value iteration does not converge")


@pytest.mark.slow
def test_a_small_game_has_the_chances_that_value_iteration_finds():
    start, sigmas = 31, (11.0, 27.0)
    players = [match_player(sigma, start) for sigma in sigmas]
    found = solve_match(*players, start)
    for side, chances in zip(
        (found.me, found.them), iterated(players, sigmas, start), strict=True
    ):
        np.testing.assert_allclose(side.first[2:, 2:], chances[2:, 2:], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("plays", PLAYS)
def test_no_turn_can_be_played_better_than_the_chances_say(solved, plays):
    """Their own turn computed dart by dart from what the other player makes of it: the one fixed
    point is the solution.
    """
    for side in (solved[plays].me, solved[plays].them):
        beds = bed_probabilities(side.aims, side.player.leg.spreads[0])
        for begun, against in np.random.default_rng(2).integers(2, START + 1, (30, 2)):
            fewest = side.player.leg.choices
            aims_of = {
                "best": side.player.choice.allowed,
                "turns": lambda darts, left: fewest[3 - darts][begun, [begun - left]],  # noqa: B023
            }[side.play]
            after = side.second[None, : begun + 1, against]
            [chance] = chances_of_turn(beds, after, begun, aims_of)
            assert side.first[begun, against] == pytest.approx(chance, abs=1e-6), (begun, against)


@pytest.mark.parametrize("begins", ["me", "them"])
@pytest.mark.parametrize("plays", PLAYS)
def test_simulated_legs_are_won_as_often_as_expected(solved, plays, begins):
    policy = solved[plays]
    expected = (policy.me.first if begins == "me" else policy.me.second)[START, START]
    won = simulate_match_legs(policy, 6000, np.random.default_rng(4), begins)
    error = np.sqrt(expected * (1.0 - expected) / len(won))
    assert won.mean() == pytest.approx(expected, abs=3 * error), (won.mean(), expected, error)


def test_simulated_matches_are_won_as_often_as_expected(solved):
    policy, rng, legs, n = solved[BEST], np.random.default_rng(6), 5, 2000
    sides = ["them" if leg % 2 == 0 else "me" for leg in range(legs)]
    won = (
        sum(simulate_match_legs(policy, n, rng, begins).astype(int) for begins in sides)
        > legs // 2
    )
    expected = match_chance(
        policy.me.first[START, START], policy.me.second[START, START], legs, "them"
    )
    error = np.sqrt(expected * (1.0 - expected) / n)
    assert won.mean() == pytest.approx(expected, abs=3 * error), (won.mean(), expected, error)


def test_the_turns_of_the_policy_come_to_its_expected_number(players):
    """V(s) = 1 + the mean of V over what is left after a turn from s."""
    for player in players:
        outcomes, expected = player.outcomes[2:], player.leg.expected[2:]
        np.testing.assert_allclose(outcomes.sum(axis=1), 1.0, atol=1e-12)
        np.testing.assert_allclose(1.0 + outcomes[:, 2:] @ expected, expected, rtol=1e-6)


def test_the_best_answer_wins_more_than_the_fewest_turns_in_every_state(solved):
    fewest, answer, best = (
        solved[plays].me.first[2:, 2:] for plays in (FEWEST, ("best", "turns"), BEST)
    )
    assert (answer >= fewest - 1e-6).all() and (answer - fewest).max() > 1e-3
    assert (answer >= best - 1e-6).all(), "the other player's best answer must cost something"
    assert (best >= solved["turns", "best"].me.first[2:, 2:] - 1e-6).all()


def test_who_plays_which_part_makes_no_difference(players, solved):
    swapped = solve_match(*players[::-1], START)
    np.testing.assert_allclose(swapped.them.first, solved[BEST].me.first, atol=1e-6)
    np.testing.assert_allclose(swapped.me.second, solved[BEST].them.second, atol=1e-6)


def test_of_equal_players_who_begins_wins_as_often_as_the_other_loses():
    start, player = 21, match_player(12.0, 21)
    alone, twins = (
        solve_match(player, player, start),
        solve_match(12.0, Spread.isotropic(12.0), start),
    )
    np.testing.assert_array_equal(alone.me.first, alone.them.first)
    np.testing.assert_allclose(
        alone.me.first[2:, 2:] + alone.them.second[2:, 2:].T, 1.0, atol=1e-12
    )
    np.testing.assert_allclose(twins.me.first, alone.me.first, atol=1e-6)
    assert alone.me.first[start, start] > 0.5 > alone.me.second[start, start]


def test_every_chance_is_one_and_beginning_helps(solved):
    for side in (solved[BEST].me, solved[BEST].them):
        first, second = side.first[2:, 2:], side.second[2:, 2:]
        assert (second >= 0.0).all() and (first <= 1.0).all() and (first > second).all()
        assert (
            side.first[0, 10] == 1.0 and side.second[10, 0] == 0.0 and np.isnan(side.first[1, 10])
        )


@pytest.mark.slow
def test_more_spread_wins_less():
    chances = [solve_match(sigma, 20.0, 20).me.first[20, 20] for sigma in (7.0, 60.0)]
    assert (np.diff(chances) < 0.0).all(), chances


@pytest.mark.slow
def test_against_an_opponent_who_finishes_next_turn_it_is_now_or_never():
    policy, checkout = solve_match(20.0, 0.5, 70), checkout_table(20.0, 70)
    assert policy.me.first[2:, 40] == pytest.approx(checkout.probability[2:71, 2], abs=1e-3)
    assert policy.me.first[2:, 40] == pytest.approx(checkout.probability[2:71, 2], rel=0.03)


@pytest.mark.slow
def test_the_aim_depends_on_what_the_opponent_has_left():
    """With 50 left and the last dart of a turn: the bull if they may finish now, single 18 to
    leave double 16 if they need another turn.
    """
    policy = solve_match(12.0, 15.0, 110)
    assert [policy.me.target(50, against, 1, 110) for against in (2, 32, 40, 100)] == [
        "DB",
        "DB",
        "DB",
        "S18",
    ]
    apart = aims_apart(policy.me, 40, 100)
    assert (
        apart.against == (40, 100) and apart.beds[0] != apart.beds[1] and min(apart.losses) > 0.003
    )
    np.testing.assert_array_equal(
        apart.aims, [policy.me.best_aim(apart.remaining, against) for against in apart.against]
    )


def test_with_the_fewest_turns_no_aim_depends_on_the_opponent(solved):
    side = solved[FEWEST].me
    assert [side.target(30, against) for against in (2, START)] == [side.player.leg.target(30)] * 2
    with pytest.raises(ValueError, match="only the play 'best' looks at the other player"):
        aims_apart(side)
    assert aims_apart(solved[BEST].me, 30, 30) is None


@pytest.mark.slow
def test_a_professional_against_a_good_amateur():
    policy = solve_match(professional("Van Gerwen"), 15.0, 40)
    assert policy.me.first[40, 40] > 0.75 and policy.me.target(40, 40) == "D20"


@pytest.mark.parametrize(
    ("first", "second", "legs"),
    [(0.7, 0.6, 1), (0.7, 0.6, 3), (0.55, 0.45, 11), (1.0, 0.0, 5), (0.8, 0.1, 21)],
)
@pytest.mark.parametrize("begins", ["me", "them"])
def test_a_match_leg_by_leg(first, second, legs, begins):
    def chance(won, lost):
        if max(won, lost) == legs // 2 + 1:
            return float(won > lost)
        mine = ((won + lost) % 2 == 0) == (begins == "me")
        leg = first if mine else second
        return leg * chance(won + 1, lost) + (1.0 - leg) * chance(won, lost + 1)

    assert match_chance(first, second, legs, begins) == pytest.approx(chance(0, 0), abs=1e-12)


def test_a_long_match_goes_to_the_better_player():
    assert match_chance(0.62, 0.42, 1) == 0.62 and match_chance(0.62, 0.42, 1, "them") == 0.42
    assert 0.999999 < match_chance(0.72, 0.52, 999) <= 1.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((12.0, 15.0, 1), "start"),
        ((12.0, 15.0, 1002), "start must be at most 1001"),
        ((-1.0, 15.0, 40), "sigma"),
        ((12.0, np.nan, 2), "against: sigma"),
        ((12.0, 15.0, 40, ("best", "worst")), "plays must be two of best, turns"),
        ((12.0, 15.0, 40, ("best",)), "plays must be two of best, turns"),
    ],
)
def test_a_game_that_is_none_is_refused(arguments, words):
    with pytest.raises(ValueError, match=words):
        solve_match(*arguments)


def test_a_player_of_other_legs_is_refused(players):
    with pytest.raises(
        ValueError, match="made for legs from 31, not from 30: make another with match_player"
    ):
        solve_match(players[0], 15.0, 30)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((32, 30), "remaining must be between 2 and 31"),
        ((30, 1), "against must be an integer of at least 2"),
        ((30, 32), "against must be between 2 and 31"),
        ((30, 30, 4), "darts_left must be 1, 2 or 3"),
        ((30, 30, 3, 31), "cannot stand at 30 with 3 darts left"),
    ],
)
def test_a_state_that_cannot_be_is_refused(solved, arguments, words):
    with pytest.raises(ValueError, match=words):
        solved[BEST].me.best_aim(*arguments)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((0.7, 1.2, 3), "second must be a chance from 0 to 1, got 1.2"),
        ((-0.1, 0.5, 3), "first must be at least 0"),
        ((0.7, 0.6, 4), "legs must be an odd number up to 999, such as 5, got 4"),
        ((0.7, 0.6, 0), "legs must be an integer"),
        ((0.7, 0.6, 1001), "legs must be an odd number up to 999"),
        ((0.7, 0.6, 3, "you"), "begins must be one of me, them"),
    ],
)
def test_a_match_that_is_none_is_refused(arguments, words):
    with pytest.raises(ValueError, match=words):
        match_chance(*arguments)


def test_the_work_on_a_match_is_told_from_begin_to_end():
    told = []
    solve_match(12.0, 15.0, 11, tell=told.append)
    assert len(told) > 20 and told == sorted(told)
    assert told[0] > 0.0 and told[-1] == pytest.approx(1.0)


def test_a_player_who_counts_turns_alone_is_made_of_the_same_aims(players):
    me, them = players
    quick = match_player(12.0, START, "turns")
    assert len(quick.aims) < len(me.aims)
    slow, fast = (solve_match(one, them, START, FEWEST).me.first for one in (me, quick))
    np.testing.assert_allclose(fast, slow, atol=1e-12)
    with pytest.raises(ValueError, match="play must be one of best, turns, got 'both'"):
        match_player(12.0, START, "both")
