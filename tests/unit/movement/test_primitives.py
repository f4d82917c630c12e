"""Discrete primitives left to themselves: what they learn, how they are integrated and what
carries over to a new start, goal, duration and amplitude (thesis (7.6)-(7.13)).
"""

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp

from dart_skill.movement import DiscretePrimitive
from tests.unit.movement.primitives import rms

DURATION = 1.6
STAMPS = np.linspace(0.0, DURATION, 201)
LITERAL = {"goal_path": "fixed", "regression": "local"}
FORMS = [
    {},
    {"phase_scaled": True},
    {"goal_path": "fixed"},
    {"goal_path": "fixed", "phase_scaled": True},
    {**LITERAL},
]
MINIMUM_JERK = Polynomial([0, 0, 0, 10, -15, 6])
# Four derivatives vanish at both ends: the path that the goal takes.
BLEND = Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])


def reach_with_swing(stamps=STAMPS, offset=0.0):
    """Minimum-jerk reach plus a sine of it, from rest to rest, in two dimensions, with its
    derivatives (n, 2).
    """
    s = stamps / stamps[-1]
    u, du, ddu = MINIMUM_JERK(s), MINIMUM_JERK.deriv()(s), MINIMUM_JERK.deriv(2)(s)
    wave, slope, curve = (
        np.sin(2 * np.pi * u),
        2 * np.pi * np.cos(2 * np.pi * u),
        -((2 * np.pi) ** 2) * np.sin(2 * np.pi * u),
    )
    position = np.stack([0.3 + 0.8 * u, -0.2 * u + 0.15 * wave], 1) + offset
    velocity = np.stack([0.8 * du, (-0.2 + 0.15 * slope) * du], 1) / stamps[-1]
    acceleration = (
        np.stack([0.8 * ddu, (-0.2 + 0.15 * slope) * ddu + 0.15 * curve * du**2], 1)
        / stamps[-1] ** 2
    )
    return position, velocity, acceleration


def learned(n_basis=30, **form):
    return DiscretePrimitive(n_basis, **form).fit(STAMPS, *reach_with_swing())


def kernels(z, n_basis, decay):
    """(7.11) at one z: centres equally spaced in time, half of its height at the next kernel's
    centre.
    """
    centres = np.exp(-decay * np.arange(n_basis) / (n_basis - 1))
    gaps = centres[:-1] - centres[1:]
    psi = np.exp(-np.log(2.0) * ((z - centres) / np.append(gaps, gaps[-1])) ** 2)
    return psi / psi.sum()


def goal_share(s, primitive):
    if primitive.goal_path == "fixed":
        return 1.0
    alpha = 2 * np.sqrt(primitive.stiffness)
    attractor = (
        BLEND + BLEND.deriv() * alpha / primitive.stiffness + BLEND.deriv(2) / primitive.stiffness
    )
    return attractor(min(s, 1.0))


def literal_rate(primitive, start, goal, duration, amplitude=1.0):
    """(7.6), (7.8), (7.9) in seconds for the state (z, x1, x2)."""
    tau, alpha, beta = (
        1.0 / duration,
        2 * np.sqrt(primitive.stiffness),
        np.sqrt(primitive.stiffness) / 2,
    )

    def rate(time, state):
        z, (x1, x2) = state[0], np.reshape(state[1:], (2, -1))
        f = kernels(z, primitive.n_basis, primitive.canonical_decay) @ primitive.weights_
        f = (
            f * z
            if primitive.phase_scaled
            else f * (1.0 - BLEND(np.clip((time / duration - 1.0) / 0.25, 0.0, 1.0)))
        )
        g = start + goal_share(time / duration, primitive) * (goal - start)
        dx2 = tau * alpha * (beta * (g - x1) - x2) + tau * amplitude * f
        return np.concatenate([[-tau * primitive.canonical_decay * z], tau * x2, dx2])

    return rate


def integrate_literally(
    primitive, times, start, velocity, goal, duration, amplitude=1.0, rtol=1e-9
):
    rate = literal_rate(primitive, start, goal, duration, amplitude)
    state = np.concatenate([[1.0], start, velocity * duration])
    options = {"method": "DOP853", "rtol": rtol, "atol": rtol / 10, "max_step": duration / 50}
    solution = solve_ivp(rate, (times[0], times[-1]), state, t_eval=times, **options)
    n = len(start)
    return solution.y[1 : n + 1].T, solution.y[n + 1 :].T / duration


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_it_moves_by_the_equations_of_the_thesis(form):
    primitive = learned(12, **form)
    times = np.linspace(0.0, 1.5, 601)
    start, velocity, goal, amplitude = (
        np.array([0.1, 0.5]),
        np.array([0.4, -0.3]),
        np.array([0.9, 0.6]),
        np.array([1.0, 0.7]),
    )
    state = primitive.begin(start, goal=goal, duration=1.1, amplitude=amplitude, velocity=velocity)
    movement = primitive.open_loop(times, state)
    position, speed = integrate_literally(
        primitive, times[::10], start, velocity, goal, 1.1, amplitude
    )
    np.testing.assert_allclose(movement.position[::10], position, atol=2e-8)
    np.testing.assert_allclose(movement.velocity[::10], speed, atol=2e-7)


def measured_order(errors):
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def test_integration_between_irregular_stamps_is_of_fourth_order():
    primitive = learned(6)
    state = primitive.begin(duration=1.0)
    nodes = np.sort(np.random.default_rng(3).uniform(0.0, 1.0, 31))
    nodes = 1.2 * (nodes - nodes[0]) / (nodes[-1] - nodes[0])
    exact, _ = integrate_literally(
        primitive, nodes, state.position, state.velocity, state.wanted.goal, 1.0, rtol=1e-12
    )
    errors = []
    for split in (4, 8, 16, 32):
        times = np.interp(np.arange(30 * split + 1) / split, np.arange(31), nodes)
        errors.append(np.abs(primitive.open_loop(times, state).position[::split] - exact).max())
    assert np.abs(measured_order(errors)[1:] - 4.0).max() < 0.25, (errors, measured_order(errors))


@pytest.mark.parametrize("form", FORMS[:-1], ids=str)
def test_demonstration_is_reproduced(form):
    position, velocity, _ = reach_with_swing()
    movement = DiscretePrimitive(50, **form).fit(STAMPS, position).open_loop(STAMPS)
    assert rms(movement.position - position) < 2e-5, rms(movement.position - position)
    assert rms(movement.velocity - velocity) < 1e-3, rms(movement.velocity - velocity)


@pytest.mark.parametrize("phase_scaled", [False, True])
def test_local_regression_is_7_13_kernel_by_kernel(phase_scaled):
    primitive = learned(9, goal_path="fixed", regression="local", phase_scaled=phase_scaled)
    position, velocity, acceleration = reach_with_swing()
    alpha, beta, tau = (
        2 * np.sqrt(primitive.stiffness),
        np.sqrt(primitive.stiffness) / 2,
        1 / DURATION,
    )
    f_ref = acceleration / tau**2 - alpha * (beta * (position[-1] - position) - velocity / tau)
    z = np.exp(-primitive.canonical_decay * STAMPS / DURATION)
    psi = np.array([kernels(each, 9, primitive.canonical_decay) for each in z])
    regressor = (z if phase_scaled else np.ones_like(z))[:, None]
    for n in range(9):
        local = np.diag(psi[:, n])
        theta = np.linalg.inv(regressor.T @ local @ regressor) @ (regressor.T @ local @ f_ref)
        np.testing.assert_allclose(
            primitive.weights_[n], theta[0], rtol=1e-8, atol=1e-8 * np.abs(f_ref).max()
        )


@pytest.mark.parametrize("phase_scaled", [False, True])
def test_joint_regression_is_least_squares_on_the_forcing_term(phase_scaled):
    primitive = learned(9, goal_path="fixed", phase_scaled=phase_scaled)
    position, velocity, acceleration = reach_with_swing()
    pull = primitive.stiffness * (position[-1] - position)
    f_ref = (
        acceleration * DURATION**2 - pull + 2 * np.sqrt(primitive.stiffness) * velocity * DURATION
    )
    features = np.array(
        [
            kernels(np.exp(-4.6 * s), 9, 4.6) * (np.exp(-4.6 * s) if phase_scaled else 1)
            for s in STAMPS / DURATION
        ]
    )
    expected = np.linalg.lstsq(features, f_ref, rcond=None)[0]
    np.testing.assert_allclose(primitive.weights_, expected, atol=2e-4 * np.abs(expected).max())


@pytest.mark.parametrize("phase_scaled", [False, True])
def test_forcing_term_is_activations_times_weights(phase_scaled):
    primitive = learned(8, phase_scaled=phase_scaled)
    for s in (0.0, 0.37, 1.0):
        gate = np.exp(-4.6 * s) if phase_scaled else 1.0
        np.testing.assert_allclose(
            primitive.activations([s])[0], gate * kernels(np.exp(-4.6 * s), 8, 4.6), atol=1e-9
        )
    assert primitive.activations(np.linspace(0, 1, 50)).shape == (50, 8)
    past = primitive.activations(np.array([1.25, 2.0, 100.0]))
    assert np.isfinite(past).all() and np.abs(past).max() < (4e-3 if phase_scaled else 1e-12)


def test_parameters_are_one_vector_and_changing_them_leaves_the_original_alone():
    primitive = learned(8)
    before = primitive.parameters
    assert before.shape == (16,) and np.array_equal(before.reshape(8, 2), primitive.weights_)
    same, other = primitive.with_parameters(before), primitive.with_parameters(before + 1.0)
    assert np.array_equal(same.open_loop(0.01).position, primitive.open_loop(0.01).position)
    assert not np.allclose(other.open_loop(0.01).position, primitive.open_loop(0.01).position)
    other.parameters[:] = np.nan
    assert np.array_equal(primitive.parameters, before)


def test_movement_is_linear_in_the_parameters_as_policy_search_needs():
    primitive = learned(8)
    rng = np.random.default_rng(5)
    first, second = primitive.parameters, rng.normal(size=16)
    at = [
        primitive.with_parameters(theta).open_loop(0.02).position
        for theta in (first, second, 0.3 * first + 0.7 * second)
    ]
    np.testing.assert_allclose(at[2], 0.3 * at[0] + 0.7 * at[1], atol=1e-10)


def closed_loop_track(stamps=STAMPS):
    """Leaves from rest, makes a detour and comes back to where it was."""
    s = stamps / stamps[-1]
    return np.stack([0.4 + 0.2 * np.sin(np.pi * MINIMUM_JERK(s)) ** 2, np.full_like(s, -0.7)], 1)


@pytest.mark.parametrize("form", FORMS[:-1], ids=str)
def test_shape_is_kept_when_the_movement_returns_to_its_start(form):
    track = closed_loop_track()
    primitive = DiscretePrimitive(40, **form).fit(STAMPS, track)
    assert rms(primitive.open_loop(STAMPS).position - track) < 5e-5
    elsewhere = primitive.open_loop(STAMPS, primitive.begin([5.0, 2.0], goal=[5.0, 2.0])).position
    np.testing.assert_allclose(elsewhere - [5.0, 2.0], track - track[0], atol=3e-4)


def test_a_new_goal_near_or_across_the_start_neither_collapses_nor_explodes_the_shape():
    position, *_ = reach_with_swing()
    primitive = DiscretePrimitive(40).fit(STAMPS, position)
    for goal in (
        primitive.start_,
        primitive.start_ + 1e-3,
        primitive.start_ - (primitive.goal_ - primitive.start_),
    ):
        added = primitive.open_loop(STAMPS, primitive.begin(goal=goal)).position - position
        share = BLEND(STAMPS / DURATION)[:, None]
        np.testing.assert_allclose(added, share * (goal - primitive.goal_), atol=3e-4)


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_new_starts_and_goals_are_met(form):
    primitive = learned(**form)
    rng = np.random.default_rng(1)
    for start, goal in rng.normal(size=(5, 2, 2)):
        movement = primitive.open_loop(
            np.linspace(0.0, 4.0, 401), primitive.begin(start, goal=goal)
        )
        np.testing.assert_array_equal(movement.position[0], start)
        np.testing.assert_allclose(
            movement.position[-1], goal, atol=2e-3 if "phase_scaled" in form else 1e-6
        )
    if form.get("goal_path", "smooth") == "smooth" and form.get("regression", "joint") == "joint":
        at_end = primitive.open_loop([0.0, DURATION], primitive.begin(start, goal=goal)).position[
            -1
        ]
        np.testing.assert_allclose(at_end, goal, atol=3e-3)


def test_it_starts_smoothly_towards_a_new_goal_where_a_fixed_goal_jumps():
    far = [6.0, 6.0]
    smooth, fixed = (learned(goal_path=name) for name in ("smooth", "fixed"))
    jump = fixed.stiffness * (np.array(far) - fixed.goal_) / DURATION**2
    np.testing.assert_allclose(
        fixed.begin(goal=far).acceleration - fixed.begin().acceleration, jump
    )
    np.testing.assert_allclose(
        smooth.begin(goal=far).acceleration, smooth.begin().acceleration, atol=1e-9
    )


@pytest.mark.parametrize("duration", [0.1, 1.6, 33.0])
def test_duration_changes_the_pace_and_not_the_path(duration):
    primitive = learned()
    normal, other = (
        primitive.open_loop(DURATION / 200),
        primitive.open_loop(duration / 200, primitive.begin(duration=duration)),
    )
    ratio = DURATION / duration
    np.testing.assert_allclose(other.position, normal.position, atol=1e-9)
    np.testing.assert_allclose(other.velocity, normal.velocity * ratio, atol=1e-8 * ratio)
    np.testing.assert_allclose(
        other.acceleration, normal.acceleration * ratio**2, atol=1e-7 * ratio**2
    )


def test_amplitude_scales_what_is_not_the_way_to_the_goal():
    primitive = learned()
    way = (
        BLEND(STAMPS / DURATION)[:, None] * (primitive.goal_ - primitive.start_) + primitive.start_
    )
    normal = primitive.open_loop(STAMPS).position - way
    doubled = primitive.open_loop(STAMPS, primitive.begin(amplitude=[2.0, 0.5])).position - way
    np.testing.assert_allclose(doubled, normal * [2.0, 0.5], atol=1e-5)


def test_a_movement_that_starts_and_ends_in_motion_is_reproduced_and_then_comes_to_the_goal():
    stamps = np.linspace(0.0, 1.0, 301)
    throw = np.stack([np.sin(3.0 * stamps + 0.5), stamps**2 + stamps], 1)
    primitive = DiscretePrimitive(40).fit(stamps, throw)
    np.testing.assert_allclose(primitive.start_velocity_, [3.0 * np.cos(0.5), 1.0], atol=1e-6)
    assert rms(primitive.open_loop(stamps).position - throw) < 2e-5
    np.testing.assert_allclose(
        primitive.open_loop(stamps * 3).velocity[100], [3.0 * np.cos(3.5), 3.0], atol=0.05
    )
    np.testing.assert_allclose(primitive.open_loop(stamps * 4).position[-1], throw[-1], atol=1e-6)


def test_stamps_may_start_anywhere():
    primitive = learned()
    late = DiscretePrimitive(30).fit(STAMPS + 1e4, *reach_with_swing())
    np.testing.assert_allclose(
        late.open_loop(STAMPS - 77.0).position, primitive.open_loop(STAMPS).position, atol=1e-8
    )
