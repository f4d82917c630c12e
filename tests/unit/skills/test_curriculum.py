"""Practice goes where throws are worst, or where nobody has thrown."""

import numpy as np
import pytest

from dart_skill.skills.practice import UNKNOWN_ERROR, UNSEEN_ERROR, Curriculum

NEAR, FAR, LEFT = [1.5, 0.0, 0.4], [2.5, 0.0, 0.4], [1.4, 1.4, 0.4]


def test_without_any_throw_one_place_is_as_good_as_another():
    np.testing.assert_allclose(Curriculum().expected_error([NEAR, FAR, LEFT]), UNKNOWN_ERROR)


def test_goes_where_nobody_has_thrown_when_throws_are_good():
    curriculum = Curriculum()
    curriculum.tell(NEAR, 0.01)
    curriculum.tell(LEFT, 0.01)
    assert curriculum.order([NEAR, FAR, LEFT])[0] == 1


def test_goes_back_to_where_a_throw_was_bad_until_it_is_good():
    curriculum = Curriculum()
    for target, error in ((NEAR, 0.01), (FAR, 0.20), (LEFT, 0.01)):
        curriculum.tell(target, error)
    assert curriculum.order([NEAR, FAR, LEFT])[0] == 1
    for _ in range(30):
        curriculum.tell(FAR, 0.005)
    assert curriculum.order([NEAR, FAR, LEFT])[-1] == 1


def test_after_an_odd_throw_goes_elsewhere_once():
    """Has the arm changed, or is it the place? A throw at another place tells."""
    curriculum = Curriculum()
    for target in (NEAR, FAR, LEFT, NEAR, FAR, LEFT):
        curriculum.tell(target, 0.01)
    curriculum.tell(FAR, 0.30)
    assert curriculum.order([NEAR, FAR, LEFT])[-1] == 1
    curriculum.tell(NEAR, 0.01)
    assert curriculum.order([NEAR, FAR, LEFT])[0] == 1


def test_a_lone_throw_is_weighed_against_ignorance():
    """One throw that missed by e: the mean of two squares."""
    curriculum = Curriculum()
    curriculum.tell(NEAR, 0.1)
    assert curriculum.expected_error([NEAR])[0] == pytest.approx(
        np.sqrt((UNKNOWN_ERROR**2 + 0.1**2) / 2)
    )


def test_a_landing_that_nobody_saw_counts_as_a_bad_throw():
    curriculum = Curriculum()
    curriculum.tell(NEAR, np.nan)
    assert curriculum.expected_error([NEAR])[0] == pytest.approx(
        np.sqrt((UNKNOWN_ERROR**2 + UNSEEN_ERROR**2) / 2)
    )


def test_stays_away_from_where_no_throw_came_about():
    curriculum = Curriculum()
    for target in (NEAR, LEFT):
        curriculum.tell(target, 0.02)
    curriculum.give_up(FAR)
    assert curriculum.order([NEAR, FAR, LEFT])[-1] == 1
    for _ in range(100):
        curriculum.tell(NEAR, 0.02)
    assert curriculum.order([NEAR, FAR, LEFT])[-1] != 1, "but not for ever"


def test_a_target_that_is_none_is_refused():
    with pytest.raises(ValueError, match="not finite"):
        Curriculum().tell([np.nan, 0.0, 0.4], 0.1)
