"""A leg as it is played, against the rules, and against the simulation that the policies are
checked with.
"""

import numpy as np
import pytest

from dart_skill.darts import LegInPlay, as_target, solve_leg
from tests.unit.darts.simulated import impacts, simulate_legs


def played(start, *beds):
    leg = LegInPlay(start)
    return leg, [leg.hit(as_target(bed)) for bed in beds]


@pytest.mark.parametrize(
    ("start", "beds", "left"),
    [
        (501, ["T20"], [441]),
        (32, ["D16"], [0]),
        (40, ["S20", "D10"], [20, 0]),
        (50, ["DB"], [0]),
        (32, ["S16", "S16"], [16, 32]),  # 0 without a double is a bust
        (32, ["S16", "S15"], [16, 32]),  # and so is 1
        (32, ["T20"], [32]),  # and less
        (60, ["S20", "S20", "S18", "D1"], [40, 20, 2, 0]),
        # a bust costs the whole turn
        (
            60,
            ["S20", "S20", "T20", "S20", "S20", "D10"],
            [40, 20, 60, 40, 20, 0],
        ),
    ],
)
def test_what_is_left_is_what_the_rules_say(start, beds, left):
    leg, darts = played(start, *beds)
    assert [dart.after for dart in darts] == left
    assert leg.is_over == (left[-1] == 0) and leg.remaining == left[-1]


def test_a_turn_has_three_darts_and_a_bust_ends_it():
    leg, _ = played(100, "S20", "S20")
    assert (leg.darts_left, leg.turn_start, leg.remaining) == (1, 100, 60)
    leg.hit(as_target("S20"))
    assert (leg.darts_left, leg.turn_start) == (3, 40)
    leg.hit(as_target("T20"))
    assert (leg.darts_left, leg.turn_start, leg.remaining) == (3, 40, 40) and leg.darts[-1].bust


def test_a_dart_that_was_not_seen_scores_nothing():
    leg = LegInPlay(40)
    assert leg.lost("it was not seen").points == 0
    assert (leg.remaining, leg.darts_left) == (40, 2)


def test_nothing_is_thrown_after_the_end():
    leg, _ = played(2, "D1")
    with pytest.raises(ValueError, match="finished with dart 1"):
        leg.hit(np.zeros(2))


def test_a_leg_takes_as_many_darts_as_the_simulation_of_its_policy_says():
    policy, rng = solve_leg(8.0, start=101, objective="darts"), np.random.default_rng(3)
    counts = []
    for _ in range(300):
        leg = LegInPlay(101)
        while not leg.is_over:
            choice = policy.choices[3 - leg.darts_left][
                leg.turn_start, leg.turn_start - leg.remaining
            ]
            leg.hit(impacts(policy.aims[[choice]], policy.which[[choice]], policy.spreads, rng)[0])
        counts.append(len(leg.darts))
    simulated = simulate_legs(policy, 3000, rng)[1]
    standard_error = np.std(counts) / np.sqrt(len(counts)) + np.std(simulated) / np.sqrt(
        len(simulated)
    )
    assert abs(np.mean(counts) - simulated.mean()) < 4.0 * standard_error
