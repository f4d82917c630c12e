"""Finishing a leg: the table against simulated legs, hand calculation, the rules, and what a
perfect thrower can do.
"""

import numpy as np
import pytest

from dart_skill.darts import (
    BED_NAMES,
    LegPolicy,
    Spread,
    as_target,
    bed_probabilities,
    checkout_table,
    professional,
    solve_leg,
)
from tests.unit.darts import reference
from tests.unit.darts.simulated import simulate_legs

UNFINISHABLE = [159, 162, 163, 165, 166, 168, 169]
"""Scores up to 170 that no three darts finish."""


@pytest.fixture(scope="module")
def policy():
    return solve_leg(Spread([[500.0, 80.0], [80.0, 300.0]], [5.0, -6.0]), start=125)


@pytest.fixture(scope="module")
def perfect():
    return solve_leg(2.5, start=171), checkout_table(2.5, 172)


def test_simulated_legs_take_the_turns_that_the_table_expects(policy):
    turns, darts = simulate_legs(policy, 6000, np.random.default_rng(3))
    error = turns.std() / np.sqrt(len(turns))
    assert turns.mean() == pytest.approx(policy.expected[-1], abs=4 * error), (
        turns.mean(),
        policy.expected[-1],
        error,
    )
    assert (darts >= turns).all() and (darts <= 3 * turns).all()


@pytest.mark.parametrize("objective", ["turns", "darts"])
@pytest.mark.parametrize(
    "sigma",
    [
        0.5,
        2.0,
        7.0,
        8.0,
        100.0,
        *(pytest.param(one, marks=pytest.mark.slow) for one in (1.0, 4.0, 40.0)),
    ],
)
def test_legs_take_what_is_expected_of_every_thrower(sigma, objective):
    """A guess of V that is too low makes busting seem free, and from it there was no way to the
    solution for some sigmas.
    """
    policy = solve_leg(sigma, objective=objective)
    played = dict(
        zip(("turns", "darts"), simulate_legs(policy, 800, np.random.default_rng(3)), strict=True)
    )[objective]
    error = max(played.std() / np.sqrt(len(played)), 0.02)
    assert played.mean() == pytest.approx(policy.expected[-1], abs=4 * error), (
        played.mean(),
        policy.expected[-1],
        error,
    )
    assert policy.expected[-1] >= {"turns": 3.0, "darts": 9.0}[objective] - 1e-9, (
        "faster than a perfect leg"
    )
    assert (policy.expected[2:] > 0.0).all() and policy.expected[-1] == policy.expected[501]


@pytest.mark.parametrize("objective", ["turns", "darts"])
@pytest.mark.parametrize(("sigma", "spacing"), [(2.0, 2.0), (7.0, 3.0), (27.0, 8.0), (80.0, 25.0)])
def test_no_aim_of_a_fine_grid_finishes_earlier(sigma, spacing, objective):
    highest = 12
    policy = solve_leg(sigma, highest, objective)
    costs = (0.0, 1.0) if objective == "turns" else (1.0, 0.0)
    expected = reference.leg(sigma, highest, spacing, *costs)
    np.testing.assert_array_less(policy.expected[2:], expected[2:] * 1.004)
    np.testing.assert_allclose(policy.expected[2:], expected[2:], rtol=0.02)


def test_darts_are_counted_when_darts_are_to_be_few():
    policy = solve_leg(25.0, start=40, objective="darts")
    _, darts = simulate_legs(policy, 6000, np.random.default_rng(5))
    assert darts.mean() == pytest.approx(
        policy.expected[-1], abs=4 * darts.std() / np.sqrt(len(darts))
    )


def test_a_professional_whose_spread_depends_on_the_target():
    policy = solve_leg(professional("Van Gerwen"), start=60)
    turns, _ = simulate_legs(policy, 6000, np.random.default_rng(8))
    assert turns.mean() == pytest.approx(
        policy.expected[-1], abs=4 * turns.std() / np.sqrt(len(turns))
    )
    assert policy.target(40) == "D20" and policy.target(32) == "D16"


def test_two_remaining_by_hand(policy):
    """Only double one finishes and only a miss does not bust: from the last dart back, the best of
    p + m times what comes then.
    """
    steps = np.arange(-40.0, 61.0, 2.0)
    beds = bed_probabilities(
        as_target("D1") + np.stack(np.meshgrid(steps, steps), axis=-1), policy.spreads[0]
    )
    finish, miss, chance = beds[..., BED_NAMES.index("D1")], beds[..., -1], 0.0
    for _ in range(3):
        chance = (finish + miss * chance).max()
    assert policy.expected[2] == pytest.approx(1.0 / chance, rel=0.002)


def test_the_policy_beats_the_rule_of_thumb(policy):
    """From 40: the double of what is left if it is even, single one if it is odd."""
    aims = (
        np.array([as_target(f"D{number}") for number in range(1, 21)] + [as_target("S1")])
        - policy.spreads[0].bias
    )
    start = np.arange(41)[:, None]
    remaining = [np.maximum(start - np.arange(1 + 60 * used), 2) for used in range(3)]
    thumb = tuple(np.where(left % 2 == 0, left // 2 - 1, 20) for left in remaining)
    simple = LegPolicy(
        aims, policy.expected[:41], thumb, policy.spreads, np.zeros(21, dtype=int), "turns"
    )
    turns, _ = simulate_legs(simple, 8000, np.random.default_rng(1))
    error = turns.std() / np.sqrt(len(turns))
    assert policy.expected[40] < turns.mean() + 3 * error, (
        policy.expected[40],
        turns.mean(),
        error,
    )
    assert turns.mean() < 2 * policy.expected[40]


def test_a_precise_thrower_finishes_in_one_turn_what_can_be_finished(perfect):
    policy, checkout = perfect
    possible = np.setdiff1d(np.arange(2, 171), UNFINISHABLE)
    assert checkout.probability[possible, 2].min() > 0.7
    assert np.abs(checkout.probability[UNFINISHABLE, 2]).max() == 0.0
    assert checkout.probability[171:].max() < 1e-6
    assert policy.expected[possible].max() < 1.4
    assert policy.expected[UNFINISHABLE].min() >= 2.0


def test_a_precise_thrower_aims_at_what_every_player_knows(perfect):
    policy, _ = perfect
    states = [(170, 3), (110, 2, 170), (50, 1, 170), (40, 1), (2, 1)]
    assert [policy.target(*state) for state in states] == ["T20", "T20", "DB", "D20", "D1"]
    assert policy.target(171) in ("T19", "T20")


def test_chances_to_finish_grow_with_the_darts_and_shrink_with_the_spread():
    wide, narrow = checkout_table(30.0), checkout_table(15.0)
    for table in (wide, narrow):
        assert (np.diff(table.probability[2:], axis=1) >= -1e-12).all()
        assert (table.probability >= 0.0).all() and (table.probability <= 1.0).all()
    assert (narrow.probability[2:] >= wide.probability[2:] - 1e-3).all()


def test_one_dart_finishes_with_the_chance_of_its_double():
    table = checkout_table(20.0)
    for remaining in (2, 16, 40, 50):
        name = "DB" if remaining == 50 else f"D{remaining // 2}"
        chance = bed_probabilities(table.aims[remaining, 0], 20.0)[BED_NAMES.index(name)]
        assert table.probability[remaining, 0] == pytest.approx(chance, abs=1e-12)
    assert table.probability[[3, 41, 42, 60], 0].max() == 0.0


def test_higher_scores_take_longer_on_average(policy):
    assert np.isnan(policy.expected[1])
    assert policy.expected[0] == 0.0
    assert (policy.expected[61:106:20] < policy.expected[81::20]).all()


def test_every_state_that_can_be_reached_has_an_aim(policy):
    for used, table in enumerate(policy.choices):
        for start in (2, 40, 90, 125):
            reachable = np.arange(min(60 * used, start - 2) + 1)
            assert (table[start, reachable] >= 0).all()


@pytest.mark.parametrize(
    "arguments, words",
    [
        ((1,), "remaining"),
        ((126,), "between 2 and 125"),
        ((40, 0), "darts_left must be 1, 2 or 3"),
        ((40, 3, 100), "cannot stand at 40 with 3 darts left"),
        ((40, 2, 101), "cannot stand at 40 with 2 darts left"),
        ((40, 1, 20), "cannot stand"),
        ((40.5,), "integer"),
    ],
)
def test_a_state_that_cannot_be_is_refused(policy, arguments, words):
    with pytest.raises(ValueError, match=words):
        policy.best_aim(*arguments)


@pytest.mark.parametrize(
    "arguments, words",
    [
        ((16.0, 1), "start"),
        ((16.0, 10_000), "start"),
        ((16.0, 501, "points"), "objective"),
        ((-16.0,), "sigma"),
        ((np.nan,), "sigma"),
    ],
)
def test_a_leg_that_is_none_is_refused(arguments, words):
    with pytest.raises(ValueError, match=words):
        solve_leg(*arguments)
