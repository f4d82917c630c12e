"""The share of throws that no plan can do better than, with fingers that scatter."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from dart_skill.common.flight import landing
from dart_skill.experiments.studies.throws import (
    ThrowResult,
    along_and_across,
    best_possible,
    best_share,
    velocity_to,
)

HAND, RIM = np.array([-0.2, 0.0, 2.16]), np.array([1.9, 0.6, 0.4])


def test_a_miss_is_told_in_the_direction_of_the_throw_and_to_its_left():
    ahead, left = np.array([0.6, 0.8]), np.array([-0.8, 0.6])
    told = along_and_across(2.0 * ahead + 0.3 * ahead - 0.1 * left, 2.0 * ahead)
    assert told == pytest.approx((0.3, -0.1))


def test_fingers_that_never_scatter_put_every_ball_in():
    assert best_share(HAND, RIM, 0.0, 0.0, 0.01, elevations=np.array([10.0, 40.0])) == 1.0


@pytest.mark.slow
def test_more_scatter_never_helps_and_a_wider_rim_never_hurts():
    shares = [
        best_share(HAND, RIM, scatter, scatter, 0.13) for scatter in (0.01, 0.02, 0.04, 0.08)
    ]
    assert shares == sorted(shares, reverse=True) and shares[-1] < 0.5 < 0.99 < shares[0]
    assert best_share(HAND, RIM, 0.04, 0.04, 0.15) > shares[2]


def test_a_share_is_that_of_the_scatter_to_first_order():
    """One elevation and no other aim: the covariance of hits from the derivatives of the flight,
    integrated over the disc.
    """
    turn, speed, radius = 0.03, 0.01, 0.06
    velocity = velocity_to(HAND, RIM, 0.3)

    def hit(turned, faster):
        scattered = (1.0 + faster) * (velocity + np.cross(turned, velocity))
        return landing(HAND, scattered, RIM[2]).position[:2]

    step, middle = 1e-4, hit(np.zeros(3), 0.0)
    np.testing.assert_allclose(middle, RIM[:2], atol=1e-3)
    columns = [turn * (hit(step * axis, 0.0) - middle) / step for axis in np.eye(3)] + [
        speed * (hit(np.zeros(3), step) - middle) / step
    ]
    grid = np.stack(np.meshgrid(*[np.linspace(-radius, radius, 201)] * 2), axis=-1)
    density = multivariate_normal(np.zeros(2), np.transpose(columns).dot(columns)).pdf(grid)
    inside = np.hypot(*np.moveaxis(grid, -1, 0)) < radius
    expected = density[inside].sum() * (2 * radius / 200) ** 2
    only = {"elevations": np.degrees([0.3]), "faster": np.zeros(1)}
    assert best_share(HAND, RIM, turn, speed, radius, **only) == pytest.approx(expected, abs=0.03)


def test_a_rim_above_the_reach_of_every_throw_is_refused():
    with pytest.raises(ValueError, match="reaches"):
        best_share(HAND, RIM + [0.0, 0.0, 30.0], 0.01, 0.01, 0.1)


@pytest.mark.slow
def test_the_arm_says_how_much_its_fingers_scatter():
    """`ideal` has fingers that do not, and a throw that was not planned does not count."""
    aimed, scattered = (
        ThrowResult(0, arm, "default", tuple(RIM), let_go=tuple(HAND))
        for arm in ("ideal", "scattering_hand")
    )
    without = ThrowResult(0, "scattering_hand", "default", tuple(RIM))
    assert best_possible([aimed]) == 1.0 and best_possible([without]) is None
    assert 0.75 < best_possible([scattered, without]) < 0.95
    loosened = ("wam_simulator.release_turn=0.035", "wam_simulator.release_speed=0.02")
    assert best_possible([aimed], loosened) == best_possible([scattered]), (
        "fingers that --set made loose"
    )
