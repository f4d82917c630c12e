"""The share of throws that no plan can do better than, with fingers that scatter."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from dart_skill.common.flight import landing
from dart_skill.experiments.studies import scatter_bound, throws
from dart_skill.experiments.studies.scatter_bound import best_share

HAND, RIM = np.array([-0.2, 0.0, 2.16]), np.array([1.9, 0.6, 0.4])


def test_fingers_that_never_scatter_put_every_ball_in():
    assert best_share(HAND, RIM, 0.0, 0.0, 0.01) == 1.0


@pytest.mark.slow
def test_more_scatter_never_helps_and_a_wider_rim_never_hurts():
    shares = [
        best_share(HAND, RIM, scatter, scatter, 0.13) for scatter in (0.01, 0.02, 0.04, 0.08)
    ]
    assert shares == sorted(shares, reverse=True) and shares[-1] < 0.5 < 0.99 < shares[0]
    assert best_share(HAND, RIM, 0.04, 0.04, 0.15) > shares[2]


def test_a_share_is_that_of_the_scatter_to_first_order(monkeypatch):
    """One elevation and no other aim: the covariance of hits from the derivatives of the flight,
    integrated over the disc.
    """
    monkeypatch.setattr(scatter_bound, "ELEVATIONS", [0.3])
    monkeypatch.setattr(scatter_bound, "FASTER", [0.0])
    turn, speed, radius = 0.03, 0.01, 0.06
    (velocity,) = scatter_bound._velocities(HAND, RIM, scatter_bound.TENNIS_BALL)

    def hit(turned, faster):
        return landing(
            HAND, (1.0 + faster) * (velocity + np.cross(turned, velocity)), RIM[2]
        ).position[:2]

    step, middle = 1e-4, hit(np.zeros(3), 0.0)
    np.testing.assert_allclose(middle, RIM[:2], atol=1e-3)
    columns = [turn * (hit(step * axis, 0.0) - middle) / step for axis in np.eye(3)] + [
        speed * (hit(np.zeros(3), step) - middle) / step
    ]
    grid = np.stack(np.meshgrid(*[np.linspace(-radius, radius, 201)] * 2), axis=-1)
    density = multivariate_normal(np.zeros(2), np.transpose(columns).dot(columns)).pdf(grid)
    expected = (
        density[np.hypot(*np.moveaxis(grid, -1, 0)) < radius].sum() * (2 * radius / 200) ** 2
    )
    assert best_share(HAND, RIM, turn, speed, radius) == pytest.approx(expected, abs=0.03)


def test_a_rim_above_the_reach_of_every_throw_is_refused():
    with pytest.raises(ValueError, match="reaches"):
        best_share(HAND, RIM + [0.0, 0.0, 30.0], 0.01, 0.01, 0.1)


@pytest.mark.slow
def test_the_arm_says_how_much_its_fingers_scatter():
    """`ideal` has fingers that do not, and a throw that was not planned does not count."""
    aimed = throws.ThrowResult(0, "ideal", "default", tuple(RIM), 0.0, 0.0, True, "", tuple(HAND))
    scattered, without = (
        throws.ThrowResult(
            0, "scattering_hand", "default", tuple(RIM), np.nan, np.nan, False, "", tuple(where)
        )
        for where in (HAND, [np.nan] * 3)
    )
    assert throws.best_possible([aimed]) == 1.0
    assert 0.75 < throws.best_possible([scattered, without]) < 0.95
    assert throws.best_possible([without]) is None
    loosened = ("wam_simulator.release_turn=0.035", "wam_simulator.release_speed=0.02")
    assert throws.best_possible([aimed], loosened) == throws.best_possible([scattered]), (
        "fingers that --set made loose"
    )
