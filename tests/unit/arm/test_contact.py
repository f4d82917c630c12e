"""A careful motion that touches something: felt, searched around, backed out of, and given up."""

import numpy as np
import pytest

from dart_skill.arm import ContactSearch, Yielding

STEP, FORCE, FELT = 0.002, 20.0, 0.01
SOFT = Yielding(np.diag([0.5e-3, 0.5e-3, 1.25e-3]), 0.0)
"""Hand of which contact is felt at 10 mm, and a search presses with 6.25 mm."""
STILL = np.zeros(3)
"""How much slower a hand is that is as fast as wanted [m/s]."""
STIFF = Yielding(1e-4 * np.eye(3), 0.08)
"""Hand that 20 N hold back by 2 mm, as much as being slower than wanted by 2.5 cm/s."""
DOWN = np.array([0.0, 0.0, -0.04])
"""Planned velocity [m/s]."""


def lowered(hole, seconds=15.0, carries=True, velocity=DOWN, play=0.003):
    """A hand that follows what is wanted, but for a plate at z = 0 with a hole of this play at a
    place (2,), None for none: rows of hand (3,), wanted (3,), rate; and the search.
    """
    search, planned, hand, rows = ContactSearch(FORCE), np.array([0.0, 0.0, 0.03]), None, []
    for k in range(round(seconds / STEP)):
        wanted = planned + search.aside
        through = hole is not None and np.hypot(*(wanted[:2] - hole)) < play
        inside = hand is not None and hand[2] < 0.0
        hand = wanted.copy()
        if not (through or inside):
            hand[2] = max(hand[2], 0.0)
        rate = search.rate(STEP * k, STEP, hand, wanted, velocity, STILL, carries, lambda: SOFT)
        rows.append((hand, wanted, rate))
        planned = planned + rate * STEP * velocity
        if search.fault:
            break
    return rows, search


def test_a_hand_that_comes_along_is_left_alone():
    rows, search = lowered(np.zeros(2), 2.0)
    assert {rate for *_, rate in rows} == {1.0} and not search.touches and not search.aside.any()


@pytest.mark.parametrize("place", [(0.005, 0.0), (-0.004, 0.005), (0.0, -0.007), (0.006, 0.005)])
def test_it_finds_a_hole_that_is_beside(place):
    rows, search = lowered(np.array(place), 10.0)
    assert not search.fault and rows[-1][0][2] < -0.01
    assert np.hypot(*(search.aside[:2] - place)) < 0.003 and search.aside[2] == 0.0


def test_it_presses_no_harder_than_it_felt_and_moves_slowly():
    rows, _ = lowered(np.array([0.006, 0.005]), 10.0)
    hand, wanted = (np.array([row[k] for row in rows]) for k in (0, 1))
    assert (hand - wanted)[:, 2].max() < FELT + 2 * STEP * 0.04
    searching = np.array([row[2] for row in rows[:-1]]) == 0.0
    speed = np.linalg.norm(np.diff(hand[:, :2], axis=0), axis=1)[searching] / STEP
    assert 0.02 < np.median(speed) < 0.03


@pytest.mark.parametrize("place", [(0.005, 0.0), (0.0, -0.004)])
def test_friction_at_the_rim_does_not_hold_what_a_soft_hand_carries(place):
    """With the force at which contact is felt, 8 N, friction of 3.2 N held a part against a spiral
    of 9 mm: a hand that gives 3 mm to a newton was dragged nowhere.
    """
    friction, soft, search = 0.4, 3e-3, ContactSearch(FORCE)
    planned, hand = np.array([0.0, 0.0, 0.03]), np.array([0.0, 0.0, 0.03])

    def gives():
        return Yielding(soft * np.eye(3), 0.0)

    for k in range(round(10.0 / STEP)):
        wanted = planned + search.aside
        rate = search.rate(STEP * k, STEP, hand, wanted, DOWN, STILL, True, gives)
        aim = wanted - search.too_hard(wanted - hand, STILL, gives)
        holds = friction * max(hand[2] - aim[2], 0.0) if hand[2] <= 0.0 else 0.0
        pull = aim[:2] - hand[:2]
        if (size := np.hypot(*pull)) > holds:
            hand[:2] += (1.0 - holds / size) * pull
        free = np.hypot(*(hand[:2] - place)) < 0.003
        hand[2] = aim[2] if free else max(aim[2], 0.0)
        planned = planned + rate * STEP * DOWN
        if hand[2] < -0.01:
            return
    pytest.fail(f"not found: {search.fault}, hand at {hand}")


def test_without_a_hole_it_backs_out_tries_once_more_and_gives_up_outside():
    rows, search = lowered(None)
    rates = np.array([rate for *_, rate in rows])
    backs = np.flatnonzero(np.diff((rates == -1.0).astype(int)) == 1)
    assert len(backs) == 2 and "did not go in within 9 mm of it in 2 tries" in search.fault
    assert rows[-1][0][2] > 0.015 and not search.touches and not search.aside.any()


def test_the_two_searches_turn_in_opposite_senses():
    rows, _ = lowered(None)
    searching = np.flatnonzero([rate == 0.0 for *_, rate in rows])
    spins = []
    for part in np.split(searching, np.flatnonzero(np.diff(searching) > 1) + 1):
        x, y = np.array([rows[k][0][:2] for k in part]).T
        spins.append(np.sum(x[:-1] * y[1:] - y[:-1] * x[1:]))
    assert len(spins) == 2 and spins[0] * spins[1] < 0.0


@pytest.mark.parametrize("how", [{"carries": False}, {"velocity": np.array([0.0, 0.0, -0.004])}])
def test_an_empty_hand_or_one_that_is_to_rest_does_not_search(how):
    rows, search = lowered(None, 3.0, **how)
    assert {rate for *_, rate in rows} == {1.0} and not search.touches


def test_a_hand_that_is_held_back_is_aimed_no_farther_than_the_force_allows():
    _, search = lowered(None, 2.0)
    assert search.touches
    np.testing.assert_allclose(
        search.too_hard(np.array([0.03, 0.0, -0.03]), STILL, lambda: SOFT),
        [0.02, 0.0, -0.02375],
        atol=1e-12,
    )
    assert not search.too_hard(np.array([0.0, 0.0, -0.006]), STILL, lambda: SOFT).any()
    assert not search.too_hard(np.array([0.0, 0.0, 0.03]), STILL, lambda: SOFT).any()
    np.testing.assert_allclose(
        search.too_hard(np.array([0.008, -0.006, 0.0]), STILL, lambda: STIFF),
        [0.0064, -0.0048, 0.0],
    )
    assert not ContactSearch().too_hard(np.array([0.0, 0.0, -0.03]), STILL, lambda: STIFF).any()


def test_a_search_of_a_stiff_hand_presses_with_spring_and_damper_together():
    search = ContactSearch(FORCE)
    stands = np.zeros(3), np.array([0.0, 0.0, -0.006]), DOWN, DOWN
    assert search.rate(0.0, STEP, *stands, True, lambda: STIFF) == 0.0
    way, slower = np.array([0.0, 0.0, -0.002]), np.array([0.0, 0.0, -0.005])
    aimed = way - search.too_hard(way, slower, lambda: STIFF)
    assert (aimed + STIFF.lead * slower) / 1e-4 == pytest.approx([0.0, 0.0, -0.25 * FORCE])


def test_a_stiff_hand_that_is_late_is_not_held_back():
    """What 8 N ask of it is 0.8 mm: so late it is without any contact."""
    for behind, touches in ((0.0049, False), (0.0051, True)):
        search, aim = ContactSearch(FORCE), np.array([0.0, 0.0, -behind])
        search.rate(0.0, STEP, np.zeros(3), aim, DOWN, STILL, True, lambda: STIFF)
        assert search.touches == touches


def test_a_stiff_hand_that_stands_all_at_once_is_held_back():
    """Its damper pulls with 8 N before the spring does: 5 mm later it had pressed for 0.06 s."""
    for behind, slower, touches in ((0.002, 0.5, False), (0.002, 1.0, True), (0.0, 1.0, False)):
        search, aim = ContactSearch(FORCE), np.array([0.0, 0.0, -behind])
        search.rate(0.0, STEP, np.zeros(3), aim, DOWN, slower * DOWN, True, lambda: STIFF)
        assert search.touches == touches


def test_while_it_searches_only_what_is_across_counts_as_left():
    _, search = lowered(None, 2.0)
    assert search.touches
    assert search.across(np.array([1.0, 2.0, 3.0])) == pytest.approx([1.0, 2.0, 0.0])
    assert ContactSearch(FORCE).across(np.array([1.0, 2.0, 3.0])) == pytest.approx([1.0, 2.0, 3.0])
