"""Practice goes where a throw teaches most of where throws are bad."""

import numpy as np
import pytest

from dart_skill.common.regions import REGION
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


def test_a_place_that_stays_bad_does_not_take_all_throws():
    """At the end of its reach an arm may be bad whatever it learns: others learn meanwhile."""
    curriculum, rng, thrown = Curriculum(), np.random.default_rng(0), []
    for _ in range(40):
        baskets = REGION.spread(48, rng)
        chosen = baskets[curriculum.order(baskets)[0]]
        in_corner = np.hypot(chosen[0], chosen[1]) > 2.25 and chosen[1] < -0.5 * chosen[0]
        curriculum.tell(chosen, 0.10 if in_corner else 0.02)
        thrown.append(in_corner)
    share = 0.25 * (0.785 - 0.46) / (2 * 0.785)
    assert 2 * share * 40 < sum(thrown) < 20, f"{sum(thrown)} of 40 in the corner"


def test_only_the_latest_throws_are_remembered():
    """Hours of practice must not make each choice slower."""
    long, short = Curriculum(), Curriculum()
    targets = REGION.spread(500, np.random.default_rng(2))
    for k, target in enumerate(targets):
        for one in (long, *([short] if k >= 300 else [])):
            one.tell(target, 0.01 + 1e-4 * k)
    np.testing.assert_array_equal(long.gains(targets[:20]), short.gains(targets[:20]))


def test_the_gain_is_that_of_a_gaussian_process_beside_its_definition():
    """Expected squared error times correlation, before a throw and after it."""
    curriculum = Curriculum()
    for target, error in ((NEAR, 0.01), (FAR, 0.20), (LEFT, 0.01)):
        curriculum.tell(target, error)
    targets = REGION.spread(9, np.random.default_rng(1))
    polar = [(np.hypot(x, y), np.arctan2(y, x)) for x, y, _ in [NEAR, FAR, LEFT, *targets]]
    scaled = np.array(polar) / (0.25, 0.35)
    kernel = np.exp(-0.5 * np.sum((scaled[:, None] - scaled) ** 2, axis=2))

    def variance(thrown):
        of, at = np.ix_(range(3, 12), thrown), np.ix_(thrown, thrown)
        told = np.linalg.solve(kernel[at] + np.eye(len(thrown)), kernel[of].T)
        return np.diag(kernel)[3:] - np.einsum("ij,ji->i", kernel[of], told)

    gains = [(variance([0, 1, 2]) - variance([0, 1, 2, k])) for k in range(3, 12)]
    expected = np.array(gains) @ curriculum.expected_error(targets) ** 2
    np.testing.assert_allclose(curriculum.gains(targets), expected, rtol=1e-9)


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
