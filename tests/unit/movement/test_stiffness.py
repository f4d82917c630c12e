"""Stiffness from covariance: bounds, axes, invariance to units, and stability against independent
integration.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from dart_skill.movement import (
    critical_damping_matrix,
    stable_gains,
    stiffness_from_covariance,
)


def covariances(rng, n=30):
    turns = Rotation.random(n, random_state=int(rng.integers(1000))).as_matrix()
    return turns * 10.0 ** rng.uniform(-6, -2, (n, 1, 3)) @ np.swapaxes(turns, 1, 2)


@pytest.mark.parametrize("seed", range(5))
def test_stiffness_keeps_its_bounds_and_the_axes_of_the_covariance(seed):
    sigma = covariances(np.random.default_rng(seed))
    stiffness = stiffness_from_covariance(sigma, 50.0, 2000.0)
    gains = np.linalg.eigvalsh(stiffness)
    assert gains.min() >= 50.0 * (1 - 1e-9) and gains.max() == pytest.approx(2000.0)
    np.testing.assert_allclose(stiffness @ sigma, sigma @ stiffness, atol=1e-9 * 2000)


def test_stiffness_is_inverse_to_the_variance_between_the_bounds():
    sigma = np.array([np.diag([1e-4, 2e-4]), np.diag([4e-4, 1.0])])
    np.testing.assert_allclose(
        stiffness_from_covariance(sigma, 10.0, 800.0), [np.diag([800, 400]), np.diag([200, 10])]
    )


def test_units_and_turns_do_not_matter():
    sigma, turn = (
        covariances(np.random.default_rng(1)),
        Rotation.from_rotvec([0.3, -0.2, 1.0]).as_matrix(),
    )
    stiffness = stiffness_from_covariance(sigma, 50.0, 2000.0)
    np.testing.assert_allclose(
        stiffness_from_covariance(1e6 * sigma, 50.0, 2000.0), stiffness, rtol=1e-9, atol=1e-6
    )
    np.testing.assert_allclose(
        stiffness_from_covariance(turn @ sigma @ turn.T, 50.0, 2000.0),
        turn @ stiffness @ turn.T,
        atol=1e-6,
    )


def test_damping_is_critical_along_every_axis():
    stiffness = stiffness_from_covariance(covariances(np.random.default_rng(2)), 50.0, 2000.0)
    damping = critical_damping_matrix(stiffness)
    np.testing.assert_allclose(damping @ damping, 4.0 * stiffness, rtol=1e-9, atol=1e-6)


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="least stiffness"):
        stiffness_from_covariance(np.eye(2)[None], 100.0, 10.0)
    with pytest.raises(ValueError):
        stiffness_from_covariance(np.zeros((1, 2, 2)), 1.0, 10.0)


def growing(factor, n=200, step=0.005):
    """Stiffness (n, 2, 2) that swings between 50 and factor times as much, along axes that turn."""
    time = step * np.arange(n)
    size = 50.0 * factor ** (0.5 - 0.5 * np.cos(2.0 * np.pi * time / 0.2))
    turn = np.array(
        [[np.cos(3 * time), -np.sin(3 * time)], [np.sin(3 * time), np.cos(3 * time)]]
    ).transpose(2, 0, 1)
    return time, turn @ (
        np.stack([size, np.full(n, 50.0)], axis=1)[:, :, None] * np.eye(2)
    ) @ turn.swapaxes(1, 2)


def least_margin(time, stiffness, damping):
    """Smallest eigenvalue of 2 a K - K' - a D' between the stamps, with a of the theorem, by
    differences.
    """
    rate = np.sqrt(np.linalg.eigvalsh(stiffness).min())
    growth = (np.diff(stiffness, axis=0) + rate * np.diff(damping, axis=0)) / np.diff(time)[
        :, None, None
    ]
    return min(
        np.linalg.eigvalsh(2.0 * rate * ends - growth).min()
        for ends in (stiffness[:-1], stiffness[1:])
    )


def test_stiffness_that_changes_slowly_is_left_as_it_is():
    time, wanted = growing(1.2)
    stiffness, damping = stable_gains(time, wanted)
    np.testing.assert_allclose(stiffness, wanted, atol=1e-12)
    np.testing.assert_allclose(damping, critical_damping_matrix(wanted), atol=1e-12)


@pytest.mark.parametrize("factor", [5.0, 40.0])
def test_stiffness_that_grows_too_fast_is_approached_as_fast_as_is_stable(factor):
    time, wanted = growing(factor)
    stiffness, damping = stable_gains(time, wanted)
    assert least_margin(time, wanted, critical_damping_matrix(wanted)) < -100.0, (
        "or the test shows nothing"
    )
    assert least_margin(time, stiffness, damping) > -1e-3 * np.abs(stiffness).max()
    assert np.linalg.eigvalsh(stiffness).max() > 2.0 * 50.0, "it grows"
    assert np.linalg.eigvalsh(stiffness).min() > 50.0 * (1 - 1e-9)


def test_a_spring_that_feeds_energy_is_tamed():
    """Integrated by another method, the Lyapunov function of Kronander and Billard falls at every
    step.
    """
    time, wanted = growing(40.0)
    stiffness, damping = stable_gains(time, wanted)

    def rate_of(t, state):
        k = min(int(t / 0.005), len(time) - 2)
        share = t / 0.005 - k
        gains = [one[k] + share * (one[k + 1] - one[k]) for one in (stiffness, damping)]
        return np.concatenate([state[2:], -gains[0] @ state[:2] - gains[1] @ state[2:]])

    run = solve_ivp(rate_of, (0.0, 0.99), [0.1, -0.05, 1.0, 0.5], max_step=0.005, rtol=1e-8)
    rate = np.sqrt(50.0)
    lyapunov = []
    for t, state in zip(run.t, run.y.T, strict=True):
        k = min(int(t / 0.005), len(time) - 2)
        share = t / 0.005 - k
        stiff, damp = (one[k] + share * (one[k + 1] - one[k]) for one in (stiffness, damping))
        x, v = state[:2], state[2:]
        lyapunov.append(
            (v + rate * x) @ (v + rate * x) + x @ (stiff + rate * damp - rate**2 * np.eye(2)) @ x
        )
    assert (np.diff(lyapunov) <= 1e-6 * lyapunov[0]).all(), "the energy of the theorem never grows"


def test_a_spring_without_stiffness_is_refused():
    with pytest.raises(ValueError, match="eigenvalue 0"):
        stable_gains([0.0, 0.1], np.zeros((2, 2, 2)))
