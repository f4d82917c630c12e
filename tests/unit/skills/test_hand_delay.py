"""The delay of the hand is the mean of what was seen, until two openings in a row say that it is
another hand.
"""

import numpy as np
import pytest

from dart_skill.skills.practice import USUAL_DELAY_SPREAD, HandDelay, likely_late


def test_expects_the_mean_of_what_it_saw():
    delay = HandDelay([0.028, np.nan, 0.030])
    delay.add(0.035)
    delay.add(np.nan)
    assert delay.mean == pytest.approx(np.mean([0.028, 0.030, 0.035])) and len(delay) == 3


def test_learns_the_spread_of_a_hand_from_many_openings():
    delay = HandDelay(np.random.default_rng(0).normal(0.03, 0.002, 100))
    assert delay.spread == pytest.approx(0.002, rel=0.15)
    assert HandDelay().spread == pytest.approx(USUAL_DELAY_SPREAD)


def test_one_late_opening_is_an_accident():
    delay = HandDelay(np.random.default_rng(1).normal(0.03, 0.004, 20))
    before = delay.mean
    delay.add(0.060)
    assert delay.mean == before
    delay.add(0.031)
    assert len(delay) == 21


def test_two_late_openings_are_another_hand():
    delay = HandDelay(np.random.default_rng(2).normal(0.03, 0.004, 20))
    delay.add(0.047)
    delay.add(0.045)
    assert delay.mean == pytest.approx(0.046) and len(delay) == 2


def test_surprises_that_no_landing_confirms_tell_nothing():
    delay = HandDelay(np.random.default_rng(2).normal(0.03, 0.004, 20))
    before = delay.mean
    for _ in range(3):
        delay.add(0.047, confirmed=False)
    assert delay.mean == before
    delay.add(0.031, confirmed=False)
    assert len(delay) == 21, "what surprises nobody needs no landing"


def test_an_early_and_a_late_one_are_not():
    delay = HandDelay(np.random.default_rng(3).normal(0.03, 0.004, 20))
    before = delay.mean
    delay.add(0.047)
    delay.add(0.010)
    assert delay.mean == before


def test_a_steady_hand_is_hardly_ever_taken_for_another_one():
    """Normal delays, 50 hands of 100 openings: two in a row beyond 2.5 deviations on one side come
    once in 50,000.
    """
    forgotten = 0
    for seed in range(50):
        delay, rng = HandDelay(), np.random.default_rng([4, seed])
        for n in range(100):
            delay.add(rng.normal(0.03, 0.004))
            forgotten += n > 10 and len(delay) == 2
    assert forgotten <= 1


def test_without_any_opening_there_is_no_delay_to_expect():
    assert HandDelay().mean == 0.0


def test_an_opening_that_was_not_seen_clearly_tells_nothing():
    hand = HandDelay([0.030] * 5)
    for _ in range(4):
        hand.add(0.045, 0.004)
    assert hand.mean == pytest.approx(0.030) and len(hand) == 5
    for _ in range(2):
        hand.add(0.045, 0.0005)
    assert hand.mean == pytest.approx(0.045)


def test_how_late_a_hand_was_is_believed_as_far_as_it_was_seen():
    """The mean of a Gaussian about a usual hand, once it was seen with Gaussian noise."""
    time = np.linspace(-0.1, 0.1, 20001)
    for seen, uncertainty in ((0.010, 0.004), (-0.006, 0.001), (0.002, 0.012)):
        density = np.exp(
            -0.5 * (time / USUAL_DELAY_SPREAD) ** 2 - 0.5 * ((seen - time) / uncertainty) ** 2
        )
        assert likely_late(seen, uncertainty) == pytest.approx(
            density @ time / density.sum(), abs=1e-9
        )
    assert likely_late(0.01, 0.0) == 0.01 and np.isnan(likely_late(np.nan, 0.001))
