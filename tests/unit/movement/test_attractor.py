"""The spring-damper and its inverse against integration and closed forms (thesis (7.19), (7.20))."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dart_skill.movement import attractor_from_motion, critical_damping, follow_attractor


def random_attractor(seed, n=60, d=3):
    return np.random.default_rng(seed).normal(size=(n, d)).cumsum(axis=0) * 0.1


@pytest.mark.parametrize("damping", [0.0, 5.0, 2 * np.sqrt(200.0), 200.0])
def test_response_is_that_of_a_fine_numerical_integration(damping):
    attractor, step, kp = random_attractor(0), 0.02, 200.0
    time = step * np.arange(60)
    position0, velocity0 = np.array([0.1, -0.2, 0.3]), np.array([1.0, 0.0, -2.0])

    def rate(t, state):
        k = min(int(t / step), 58)
        share = t / step - k
        pull = (1 - share) * attractor[k] + share * attractor[k + 1]
        return np.concatenate([state[3:], kp * (pull - state[:3]) - damping * state[3:]])

    reference = np.empty((60, 6))
    reference[0] = np.concatenate([position0, velocity0])
    for k in range(59):
        piece = solve_ivp(
            rate, time[k : k + 2], reference[k], rtol=1e-11, atol=1e-12, first_step=step / 50
        )
        reference[k + 1] = piece.y[:, -1]
    motion = follow_attractor(attractor, step, position0, velocity0, kp, damping)
    np.testing.assert_allclose(motion.position, reference[:, :3], atol=2e-8)
    np.testing.assert_allclose(motion.velocity, reference[:, 3:], atol=3e-7)


def test_step_response_at_critical_damping_is_the_closed_form():
    w, time = np.sqrt(200.0), 0.002 * np.arange(500)
    motion = follow_attractor(np.ones((500, 1)), 0.002, [0.0], [0.0], 200.0)
    np.testing.assert_allclose(
        motion.position[:, 0], 1 - (1 + w * time) * np.exp(-w * time), atol=1e-12
    )
    np.testing.assert_allclose(motion.velocity[:, 0], w * w * time * np.exp(-w * time), atol=1e-11)


def test_rates_agree_on_an_attractor_that_is_straight_between_samples():
    coarse = random_attractor(1, 30, 1)
    fine = np.interp(np.arange(0, 29.0001, 0.1), np.arange(30), coarse[:, 0])[:, None]
    one = follow_attractor(coarse, 0.05, [0.2], [0.3], 150.0)
    other = follow_attractor(fine, 0.005, [0.2], [0.3], 150.0)
    np.testing.assert_allclose(one.position, other.position[::10], atol=1e-12)


def test_attractor_of_a_motion_reproduces_the_motion():
    time = np.linspace(0, 1.5, 1501)
    position = np.stack([np.sin(4 * time), time**3], 1)
    velocity = np.stack([4 * np.cos(4 * time), 3 * time**2], 1)
    acceleration = np.stack([-16 * np.sin(4 * time), 6 * time], 1)
    attractor = attractor_from_motion(position, velocity, acceleration, [200.0, 90.0], [20.0, 9.0])
    motion = follow_attractor(
        attractor, 0.001, position[0], velocity[0], [200.0, 90.0], [20.0, 9.0]
    )
    np.testing.assert_allclose(motion.position, position, atol=5e-6)
    np.testing.assert_allclose(motion.velocity, velocity, atol=5e-5)
    np.testing.assert_allclose(motion.acceleration, acceleration, atol=1e-3)


def test_one_sample_is_the_start():
    motion = follow_attractor([[1.0]], 0.01, [0.0], [2.0], 50.0, 3.0)
    assert [part.item() for part in motion] == pytest.approx([0.0, 2.0, 50.0 * 1.0 - 3.0 * 2.0])


def test_critical_damping_is_the_least_without_overshoot():
    step = np.ones((4000, 1))
    peak = [
        follow_attractor(
            step, 0.001, [0.0], [0.0], 80.0, share * critical_damping(80.0)
        ).position.max()
        for share in (0.9, 1.0)
    ]
    assert peak[0] > 1.0 + 1e-4
    assert peak[1] <= 1.0 + 1e-12


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"attractor": np.zeros((0, 2))}, "empty"),
        ({"attractor": [[0.0, np.inf]]}, "inf"),
        ({"step": 0.0}, "above 0"),
        ({"position0": [0.0]}, "length 2"),
        ({"velocity0": [0.0, np.nan]}, "nan"),
        ({"stiffness": 0.0}, "positive"),
        ({"stiffness": [1.0, 1.0, 1.0]}, "one per dimension"),
        ({"damping": -1.0}, "at least 0"),
    ],
)
def test_unusable_arguments_are_refused(changes, message):
    arguments = {
        "attractor": np.zeros((5, 2)),
        "step": 0.01,
        "position0": [0.0, 0.0],
        "velocity0": [0.0, 0.0],
        "stiffness": 100.0,
        "damping": 20.0,
    }
    with pytest.raises(ValueError, match=message):
        follow_attractor(**(arguments | changes))


def test_parts_of_a_motion_must_agree_in_shape():
    with pytest.raises(ValueError, match="one shape"):
        attractor_from_motion(np.zeros((5, 2)), np.zeros((4, 2)), np.zeros((5, 2)), 100.0)
