"""Springs that take turns (7.18): against known springs, (7.19), and what was shown."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dart_skill.mixture import GaussianMixture
from dart_skill.movement import (
    Motion,
    SpringMixture,
    attractor_from_motion,
    follow_attractor,
)

TIME = np.arange(0.0, 1.2, 0.01)
CENTRES = np.array([[0.0, 0.3], [0.5, 0.2], [0.8, -0.4]])
STIFFNESS = np.array(
    [
        [[300.0, 40.0], [40.0, 120.0]],
        [[150.0, 0.0], [0.0, 400.0]],
        [[220.0, -60.0], [-60.0, 180.0]],
    ]
)
DAMPING = 22.0


@pytest.fixture(scope="module")
def timing():
    return GaussianMixture.from_parameters(
        np.full(3, 1 / 3), [[0.1], [0.5], [1.0]], np.full((3, 1, 1), 0.02)
    )


@pytest.fixture(scope="module")
def springs(timing):
    return SpringMixture(timing, CENTRES, STIFFNESS, DAMPING)


@pytest.fixture(scope="module")
def shown(springs):
    rng = np.random.default_rng(0)
    return [
        springs.follow(TIME, rng.normal(0.0, 0.3, 2), rng.normal(0.0, 0.5, 2)) for _ in range(4)
    ]


def test_the_motion_is_that_of_an_independent_integration(springs, timing):
    def slope(t, state):
        density = np.exp(-0.5 * (t - np.array([0.1, 0.5, 1.0])) ** 2 / 0.02)
        share = density / density.sum()
        pull = sum(
            h * K @ (mu - state[:2]) for h, K, mu in zip(share, STIFFNESS, CENTRES, strict=True)
        )
        return np.concatenate([state[2:], pull - DAMPING * state[2:]])

    made = springs.follow(TIME, [0.1, -0.2], [0.3, 0.0])
    alone = solve_ivp(
        slope, (0.0, TIME[-1]), [0.1, -0.2, 0.3, 0.0], "Radau", t_eval=TIME, rtol=1e-9, atol=1e-11
    ).y.T
    np.testing.assert_allclose(np.hstack([made.position, made.velocity]), alone, atol=1e-6)
    np.testing.assert_allclose(
        made.acceleration, [slope(t, s)[2:] for t, s in zip(TIME, alone, strict=True)], atol=1e-4
    )


def test_springs_are_found_again_where_it_is_known_which_one_pulls(springs, timing, shown):
    found = SpringMixture.fit([TIME] * len(shown), shown, 3, damping=DAMPING, timing=timing)
    np.testing.assert_allclose(found.stiffness, STIFFNESS, rtol=1e-3, atol=0.1)
    np.testing.assert_allclose(found.centres, CENTRES, atol=1e-3)


def test_which_spring_pulls_is_what_the_mixture_says(springs, timing):
    np.testing.assert_allclose(
        springs.activations(TIME), timing.responsibilities(TIME[:, None]), atol=1e-12
    )


def test_the_same_pull_as_a_moving_attractor(springs, shown):
    """(7.18) and (7.19) are the same acceleration."""
    one = shown[0]
    y = springs.attractor(TIME, one.position, 200.0)
    np.testing.assert_allclose(
        200.0 * (y - one.position) - DAMPING * one.velocity, one.acceleration, atol=1e-8
    )
    np.testing.assert_allclose(y, attractor_from_motion(*one, 200.0, DAMPING), atol=1e-9)


def test_springs_of_one_stiffness_follow_the_blend_of_their_centres(timing):
    """Then y = sum_i h_i mu_i does not depend on where the mass is."""
    alike = SpringMixture(timing, CENTRES, np.tile(200.0 * np.eye(2), (3, 1, 1)), DAMPING)
    blend = alike.activations(TIME) @ CENTRES
    fine = np.arange(0.0, TIME[-1] + 1e-9, 1e-4)
    exact = follow_attractor(
        alike.activations(fine) @ CENTRES, 1e-4, [0.0, 0.0], [0.0, 0.0], 200.0, DAMPING
    )
    made = alike.follow(TIME, [0.0, 0.0], [0.0, 0.0])
    np.testing.assert_allclose(made.position, exact.position[::100], atol=1e-6)
    np.testing.assert_allclose(alike.attractor(TIME, made.position, 200.0), blend, atol=1e-12)


def test_where_nothing_tells_the_stiffness_it_is_the_usual_one():
    """A mass that rests at one point says where the springs balance, and nothing of how stiff they
    are.
    """
    still = Motion(
        np.tile([0.2, 0.1], (len(TIME), 1)), np.zeros((len(TIME), 2)), np.zeros((len(TIME), 2))
    )
    timing = GaussianMixture.from_parameters([0.5, 0.5], [[0.3], [0.9]], np.full((2, 1, 1), 0.05))
    found = SpringMixture.fit([TIME], [still], 2, 150.0, timing=timing)
    np.testing.assert_allclose(
        found.stiffness, np.tile(150.0 * np.eye(2), (2, 1, 1)), rtol=1e-9, atol=1e-6
    )
    np.testing.assert_allclose(found.centres, np.tile([0.2, 0.1], (2, 1)), atol=1e-9)


def test_what_makes_no_sense_is_said(timing, shown):
    with pytest.raises(ValueError, match="3 components over time alone"):
        SpringMixture(
            GaussianMixture.from_parameters([1.0], [[0.0]], [[[1.0]]]), CENTRES, STIFFNESS, DAMPING
        )
    with pytest.raises(ValueError, match="stiffness has the eigenvalue -1"):
        SpringMixture(timing, CENTRES, np.tile(np.diag([200.0, -1.0]), (3, 1, 1)), DAMPING)
    with pytest.raises(ValueError, match="2 arrays of stamps for 4 motions"):
        SpringMixture.fit([TIME] * 2, shown, 3)
    with pytest.raises(ValueError, match="bounds are"):
        SpringMixture.fit([TIME] * 4, shown, 3, bounds=(100.0, 50.0))
