"""Discrete primitives executed step by step: goal, duration and amplitude that change on the way,
a push, being held, and measured positions.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from dart_skill.movement import DiscretePrimitive
from tests.unit.movement import primitives
from tests.unit.movement.primitives import track

DURATION, STEP = 2.0, 0.005
BLEND = Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])
STAMPS = np.linspace(0.0, DURATION, 401)


def demonstration():
    """Minimum-jerk reach with a swing to the side, in two dimensions."""
    s = STAMPS / DURATION
    u = s**3 * (10 - 15 * s + 6 * s * s)
    return np.stack([0.2 + 0.6 * u, 0.1 - 0.3 * u + 0.2 * np.sin(np.pi * u)], 1)


@pytest.fixture(scope="module")
def primitive():
    return DiscretePrimitive(20).fit(STAMPS, demonstration())


def execute(primitive, state, seconds, dt=STEP, **settings):
    return primitives.execute(primitive, state, seconds, dt, **settings)


def on_path(primitive, progress):
    """Where the movement that nothing disturbs is at the same progress."""
    fine = primitive.open_loop(np.linspace(0.0, 3 * DURATION, 6001))
    return CubicHermiteSpline(fine.time, fine.position, fine.velocity)(DURATION * progress)


def test_step_by_step_it_is_the_open_loop_movement(primitive):
    states = execute(primitive, primitive.begin(goal=[1.0, 0.0], duration=1.5), 2.0)
    laid_out = primitive.open_loop(STEP * np.arange(401), states[0])
    np.testing.assert_allclose(track(states), laid_out.position, atol=1e-12)
    np.testing.assert_allclose(track(states, "velocity"), laid_out.velocity, atol=1e-11)
    np.testing.assert_allclose(track(states, "acceleration"), laid_out.acceleration, atol=1e-9)
    assert states[-1].progress == pytest.approx(2.0 / 1.5)


def test_open_loop_goes_on_from_any_state(primitive):
    state = execute(primitive, primitive.begin(), 0.6)[-1]
    state = primitive.step(
        state, STEP, goal=[1.0, 1.0], duration=1.0, amplitude=0.5, coupling=[1.0, 2.0]
    )
    states = execute(primitive, state, 1.0)
    laid_out = primitive.open_loop(7.0 + STEP * np.arange(201), state)
    np.testing.assert_allclose(track(states), laid_out.position, atol=1e-10)
    # Not at the first one, which still felt the push.
    np.testing.assert_allclose(
        track(states, "acceleration")[1:], laid_out.acceleration[1:], atol=1e-7
    )


CHANGES = {
    "goal": [1.1, -0.4],
    "duration": 1.1,
    "amplitude": [0.5, 1.8],
    "coupling": [2.0, -1.0],
    "tracking_error": [0.02, 0.01],
}


def changing_rate(primitive):
    """Everything that follows what is wanted, as differential equations in seconds, for (s, pace,
    x, dx/ds, g, A).
    """
    frequency = np.sqrt(primitive.stiffness)
    goal, amplitude, push = (np.array(CHANGES[name]) for name in ("goal", "amplitude", "coupling"))
    share = 1.0 / (1.0 + (0.02**2 + 0.01**2) / 0.03**2)
    pull_of_the_blend = BLEND + 2 / frequency * BLEND.deriv() + BLEND.deriv(2) / frequency**2

    def rate(_, state):
        s, pace, x, slope, g, a = state[0], state[1], *state[2:].reshape(4, 2)
        way = pull_of_the_blend(min(s, 1.0))
        f = primitive.activations([s])[0] @ primitive.weights_
        pull = (
            primitive.stiffness * (primitive.start_ + way * (g - primitive.start_) - x)
            - 2 * frequency * slope
        )
        curvature = pull + a * f + CHANGES["duration"] ** 2 * push
        rates = [slope, curvature, frequency * (goal - g), frequency * (amplitude - a)]
        return np.concatenate(
            [
                [pace, frequency / CHANGES["duration"] * (share / CHANGES["duration"] - pace)],
                pace * np.concatenate(rates),
            ]
        )

    return rate


def test_online_steps_are_of_fourth_order_while_everything_changes():
    primitive = DiscretePrimitive(6).fit(STAMPS, demonstration())
    # From one and the same state, which was reached by itself.
    begin = execute(primitive, primitive.begin(), 0.5, 0.01)[-1]
    start = np.concatenate(
        [
            [begin.progress, begin.pace],
            begin.position,
            begin.velocity / begin.pace,
            begin.goal,
            begin.amplitude,
        ]
    )
    exact = solve_ivp(
        changing_rate(primitive), (0.0, 0.8), start, method="DOP853", rtol=1e-12, atol=1e-13
    ).y[:, -1]
    errors = []
    for dt in (0.04, 0.02, 0.01, 0.005):
        last = execute(primitive, begin, 0.8, dt, **CHANGES)[-1]
        errors.append(np.abs(last.position - exact[2:4]).max())
        np.testing.assert_allclose(
            [last.progress, last.pace, *last.goal, *last.amplitude],
            [*exact[:2], *exact[6:]],
            rtol=1e-9,
        )
    order = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.abs(order - 4.0).max() < 0.3, (errors, order)
    np.testing.assert_allclose(last.velocity, exact[1] * exact[4:6], atol=1e-6)


@pytest.mark.parametrize("when", [0.0, 0.5, 1.2, 1.9, 2.6])
def test_a_goal_that_changes_on_the_way_does_not_jump_the_acceleration_and_is_reached(
    primitive, when
):
    before = execute(primitive, primitive.begin(), when)[-1]
    goal, jump = np.array([1.5, -1.0]), primitive.stiffness / DURATION**2
    after = primitive.step(before, 1e-7, goal=goal)
    assert np.abs(after.acceleration - before.acceleration).max() < 1e-4 * jump
    np.testing.assert_allclose(
        execute(primitive, after, 4.0, 0.02, goal=goal)[-1].position, goal, atol=1e-5
    )


def test_a_goal_that_moves_closer_before_the_hand_is_there_is_not_overshot(primitive):
    closer = primitive.start_ + 0.5 * (primitive.goal_ - primitive.start_)
    early = execute(primitive, primitive.begin(), 0.5)[-1]
    assert early.position[0] < closer[0]
    path = track(execute(primitive, early, 3.0, goal=closer))[:, 0]
    assert path.max() < closer[0] + 0.02 * (primitive.goal_ - primitive.start_)[0], path.max()


@pytest.mark.parametrize("duration", [0.5, 1.0, 6.0])
def test_a_duration_that_changes_on_the_way_keeps_to_the_path_and_does_not_jump_the_velocity(
    primitive, duration
):
    before = execute(primitive, primitive.begin(), 0.8)[-1]
    states = execute(primitive, before, duration, duration=duration)
    np.testing.assert_allclose(
        track(states), on_path(primitive, track(states, "progress")), atol=1e-6
    )
    assert (
        np.abs(primitive.step(before, 1e-8, duration=duration).velocity - before.velocity).max()
        < 1e-5
    )
    later = states[len(states) // 2 :]
    assert np.diff(track(later, "progress")) == pytest.approx(STEP / duration, rel=0.02), (
        "it has the new pace"
    )


def test_after_a_push_it_returns_to_its_path_like_a_critically_damped_spring(primitive):
    begin = execute(primitive, primitive.begin(), 0.4)[-1]
    pushed = execute(primitive, begin, 0.1, coupling=[8.0, -3.0])[-1]
    left_alone = execute(primitive, begin, 0.1)[-1]
    off, speed = pushed.position - left_alone.position, pushed.velocity - left_alone.velocity
    assert np.abs(off).max() > 0.02
    gap = track(execute(primitive, pushed, 1.5)) - track(execute(primitive, left_alone, 1.5))
    frequency, time = np.sqrt(primitive.stiffness) / DURATION, STEP * np.arange(len(gap))[:, None]
    np.testing.assert_allclose(
        gap, np.exp(-frequency * time) * (off + (speed + frequency * off) * time), atol=1e-7
    )
    np.testing.assert_allclose(
        execute(primitive, pushed, 4.0, 0.02)[-1].position, primitive.goal_, atol=1e-6
    )


def hold(primitive, state, seconds, **settings):
    """Steps while the robot stays where it is."""
    held, states = state.position, [state]
    for _ in range(round(seconds / STEP)):
        error = held - states[-1].position
        states.append(primitive.step(states[-1], STEP, tracking_error=error, **settings))
    return states


def test_while_it_is_held_the_movement_waits_on_its_path(primitive):
    begin = execute(primitive, primitive.begin(), 0.9)[-1]
    states = hold(primitive, begin, 3.0, tolerance=0.01)
    progress = track(states, "progress")
    assert progress[-1] - progress[0] < 0.2 < 3.0 / DURATION, progress[-1]
    assert states[-1].pace < 0.05 / DURATION
    np.testing.assert_allclose(track(states), on_path(primitive, progress), atol=1e-7)


def test_released_it_goes_on_along_the_path_without_a_jump(primitive):
    waiting = hold(primitive, execute(primitive, primitive.begin(), 0.9)[-1], 3.0)[-1]
    states = execute(primitive, waiting, 3.0)
    assert np.abs(np.diff(track(states, "velocity"), axis=0)).max() < STEP * 5.0
    np.testing.assert_allclose(
        track(states), on_path(primitive, track(states, "progress")), atol=1e-6
    )
    np.testing.assert_allclose(states[-1].position, primitive.goal_, atol=1e-6)


def test_a_tracking_error_of_the_tolerance_halves_the_pace_and_none_leaves_it(primitive):
    begin = primitive.begin()
    slow = execute(primitive, begin, 2.0, tracking_error=[0.03, 0.04], tolerance=0.05)[-1]
    assert slow.pace == pytest.approx(0.5 / DURATION, rel=1e-4)
    free = execute(primitive, begin, 2.0, tracking_error=[0.0, 0.0])[-1]
    assert free.progress == pytest.approx(1.0) and free.pace == pytest.approx(1.0 / DURATION)


def test_steps_do_not_change_the_state_they_start_from(primitive):
    begin = primitive.begin()
    first = primitive.step(begin, 0.1, goal=[3.0, 3.0], coupling=[1.0, 1.0])
    again = primitive.step(begin, 0.1, goal=[3.0, 3.0], coupling=[1.0, 1.0])
    np.testing.assert_array_equal(first.position, again.position)
    np.testing.assert_array_equal(begin.position, primitive.begin().position)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"dt": 0.0}, "dt must be above 0, got 0"),
        ({"dt": np.nan}, "dt holds nan"),
        ({"goal": [1.0]}, "goal must have length 2, got 1"),
        ({"goal": [np.inf, 0.0]}, "goal holds inf"),
        ({"duration": -1.0}, "duration must be above 0, got -1"),
        ({"amplitude": [1.0, 2.0, 3.0]}, "amplitude must be one number or one per dimension"),
        ({"coupling": 1.0}, "coupling must have 1 dimension"),
        ({"tracking_error": [0.0]}, "tracking_error must have length 2"),
        ({"tracking_error": [0.0, 0.0], "tolerance": 0.0}, "tolerance must be above 0, got 0"),
    ],
)
def test_bad_settings_of_a_step_are_named(primitive, settings, message):
    with pytest.raises(ValueError, match=message):
        primitive.step(primitive.begin(), **{"dt": 0.01, **settings})


def test_a_measured_state_that_is_no_state_is_refused(primitive):
    begin = primitive.begin()
    for broken in (
        replace(begin, position=np.zeros(3)),
        replace(begin, velocity=np.array([np.nan, 0.0])),
    ):
        with pytest.raises(ValueError, match="state must hold 2 finite positions and velocities"):
            primitive.step(broken, 0.01)


def test_a_tracking_error_beyond_all_bounds_stops_the_movement_for_as_long_as_it_lasts_and_no_longer(
    primitive,
):
    states = execute(primitive, primitive.begin(), 400.0, 1.0, tracking_error=[1e200, 0.0])
    assert 0.0 < states[-1].progress < 0.1
    np.testing.assert_allclose(
        execute(primitive, states[-1], 6.0, 0.02)[-1].position, primitive.goal_, atol=1e-6
    )
