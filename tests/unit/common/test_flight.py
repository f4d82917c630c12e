"""Ball flight against numerical integration, closed forms and its own inverse."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dart_skill.common.flight import TENNIS_BALL, fit_flight, fit_flights, flight, landing

VACUUM = replace(TENNIS_BALL, drag_coefficient=0.0)
START = np.array([0.3, -0.1, 2.05])
VELOCITY = np.array([2.9, 0.8, 1.4])


def reference(position, velocity, ball, time):
    """Independent integration of the equation of motion, written out per component."""

    def rate(_, state):
        x_dot, y_dot, z_dot = state[3:]
        k = (
            0.5
            * ball.air_density
            * ball.drag_coefficient
            * np.pi
            * (ball.diameter / 2) ** 2
            / ball.mass
        )
        speed = np.sqrt(x_dot**2 + y_dot**2 + z_dot**2)
        return [
            x_dot,
            y_dot,
            z_dot,
            -k * speed * x_dot,
            -k * speed * y_dot,
            -k * speed * z_dot - ball.gravity,
        ]

    solution = solve_ivp(
        rate, (0.0, time), np.concatenate([position, velocity]), rtol=1e-11, atol=1e-12
    )
    return solution.y[:3, -1], solution.y[3:, -1]


@pytest.mark.parametrize("time", [1.0, 0.37, 0.004, -0.4])
@pytest.mark.parametrize(
    "ball", [TENNIS_BALL, VACUUM, replace(TENNIS_BALL, mass=0.01, drag_coefficient=0.7)]
)
def test_flight_equals_an_independent_integration(ball, time):
    position, velocity = flight(START, VELOCITY, np.array([0.1, time]), ball)
    expected_position, expected_velocity = reference(START, VELOCITY, ball, time)
    np.testing.assert_allclose(position[1], expected_position, atol=2e-6)
    np.testing.assert_allclose(velocity[1], expected_velocity, atol=1e-5)


def test_flight_in_vacuum_is_a_parabola():
    times = np.linspace(-0.5, 1.0, 31)
    position, velocity = flight(START, VELOCITY, times, VACUUM)
    fall = np.outer(times**2, [0.0, 0.0, -0.5 * VACUUM.gravity])
    np.testing.assert_allclose(position, START + np.outer(times, VELOCITY) + fall, atol=1e-12)
    np.testing.assert_allclose(velocity[:, 2], VELOCITY[2] - VACUUM.gravity * times, atol=1e-12)


def test_a_batch_of_throws_equals_single_throws():
    rng = np.random.default_rng(3)
    position, velocity = rng.normal(size=(2, 5, 3)) + START, rng.normal(size=(2, 5, 3))
    times = np.array([0.0, 0.2, 0.9])
    together, _ = flight(position, velocity, times)
    assert together.shape == (3, 2, 5, 3)
    for index in np.ndindex(2, 5):
        np.testing.assert_allclose(
            together[(slice(None), *index)],
            flight(position[index], velocity[index], times)[0],
            atol=1e-9,
        )


def test_drag_shortfall_is_the_published_one():
    """Drag coefficient 0.55 (docs/sources.md): 45 degrees, 0.6 m drop: 2 of 133 cm at 3 m/s, 5.5
    of 210 at 4 m/s, 12 of 305 at 5 m/s.
    """
    for speed, shortfall in ((3.0, 0.02), (4.0, 0.055), (5.0, 0.12)):
        velocity = speed * np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
        reach = [
            landing(np.zeros(3), velocity, -0.6, ball).position[0]
            for ball in (VACUUM, TENNIS_BALL)
        ]
        assert reach[0] - reach[1] == pytest.approx(shortfall, abs=0.006), reach


def test_landing_lies_on_the_flight_and_on_the_plane_going_down():
    rng = np.random.default_rng(0)
    position = START + 0.1 * rng.normal(size=(50, 3))
    velocity = VELOCITY + rng.normal(size=(50, 3))
    found = landing(position, velocity, 0.6)
    assert np.all(found.time > 0.0) and np.all(found.velocity[:, 2] < 0.0)
    np.testing.assert_allclose(found.position[:, 2], 0.6, atol=1e-9)
    for i in range(50):
        expected, _ = reference(position[i], velocity[i], TENNIS_BALL, found.time[i])
        np.testing.assert_allclose(found.position[i], expected, atol=1e-6)


def test_landing_in_vacuum_has_a_closed_form():
    found = landing(START, VELOCITY, 0.5, VACUUM)
    time = (VELOCITY[2] + np.sqrt(VELOCITY[2] ** 2 + 2 * 9.81 * (START[2] - 0.5))) / 9.81
    assert found.time == pytest.approx(time, abs=1e-12)
    np.testing.assert_allclose(found.position[:2], START[:2] + time * VELOCITY[:2], atol=1e-12)


def test_landing_is_nan_where_the_plane_is_never_crossed_going_down():
    apex = VELOCITY[2] ** 2 / (2 * 9.81)
    planes = START[2] + apex * np.array([0.9, 0.9999, 1.1])
    found = landing(np.tile(START, (3, 1)), np.tile(VELOCITY, (3, 1)), planes)
    assert np.isfinite(found.time[0])
    assert np.isnan(found.time[1:]).all() and np.isnan(found.position[1:]).all()
    falling_below = landing(np.zeros(3), np.array([0.0, 0.0, -3.0]), 0.2)
    assert np.isnan(falling_below.time), "the crossing was in the past"


def test_fit_recovers_an_exact_flight_at_any_instant():
    times = 12.5 + np.array([0.0, 0.01, 0.05, 0.3, 0.31, 0.7])
    position, velocity = flight(START, VELOCITY, times - 12.5)
    for at, index in ((None, 0), (times[3], 3), (times[5], 5)):
        fit = fit_flight(times, position, at=at)
        np.testing.assert_allclose(fit.position, position[index], atol=1e-6)
        np.testing.assert_allclose(fit.velocity, velocity[index], atol=2e-6)
        assert fit.residual < 1e-6
    np.testing.assert_allclose(fit.at(times)[0], position, atol=1e-6)


def test_a_flight_to_begin_with_changes_only_the_work():
    times = 3.0 + 0.01 * np.arange(60)
    samples = flight(START, VELOCITY, times - 3.0)[0] + np.random.default_rng(5).normal(
        0.0, 1e-3, (60, 3)
    )
    shorter = fit_flight(times[10:30], samples[10:30])
    alone, helped = fit_flight(times, samples), fit_flight(times, samples, near=shorter)
    np.testing.assert_allclose(helped.position, alone.position, atol=1e-6)
    np.testing.assert_allclose(helped.velocity, alone.velocity, atol=1e-5)


@pytest.mark.parametrize("time", [0.0, 1e-3, 0.31, 0.9, -0.2])
def test_one_ball_alone_flies_as_among_others(time):
    """To the last bit, though it is followed in plain numbers."""
    alone, among = (
        flight(START, VELOCITY, np.array([time])),
        flight(START, VELOCITY, np.array([time, time])),
    )
    for one, others in zip(alone, among, strict=True):
        np.testing.assert_array_equal(one[0], others[1])
    landed, together = (
        landing(START, VELOCITY, 0.4),
        landing(np.tile(START, (2, 1)), np.tile(VELOCITY, (2, 1)), 0.4),
    )
    for part in ("position", "velocity", "time"):
        np.testing.assert_array_equal(getattr(landed, part), getattr(together, part)[1])


def windows_of_flights(n=4, samples=10):
    """Noisy samples of flights of different speeds: times (n, samples) from 0, positions (n,
    samples, 3).
    """
    rng = np.random.default_rng(2)
    time = np.sort(rng.uniform(0.0, 0.1, (n, samples)), axis=1)
    exact = [flight(START, VELOCITY * (0.5 + 0.3 * k), row)[0] for k, row in enumerate(time)]
    return time, np.array(exact) + 1e-4 * rng.standard_normal((n, samples, 3))


def test_flights_fitted_together_are_those_fitted_one_by_one():
    """Together by lines and repetition, one alone by its sensitivity: two ways to one
    least-squares flight, but for what drag bends.
    """
    time, position = windows_of_flights()
    start, velocity, misfit = fit_flights(time, position)
    for k in range(len(time)):
        alone = fit_flights(time[k : k + 1], position[k : k + 1])
        np.testing.assert_allclose(start[k], alone[0][0], atol=1e-5)
        np.testing.assert_allclose(velocity[k], alone[1][0], atol=3e-4)
        np.testing.assert_allclose(misfit[k], alone[2][0], atol=2e-5)


def test_in_vacuum_flights_are_lines_fitted_to_what_gravity_leaves():
    """Against numpy's polynomials, axis by axis."""
    time, position = windows_of_flights()
    start, velocity, _ = fit_flights(time, position, VACUUM)
    lifted = position + 0.5 * 9.81 * time[..., None] ** 2 * [0.0, 0.0, 1.0]
    for k in range(len(time)):
        slope, value = np.polyfit(time[k], lifted[k], 1)
        np.testing.assert_allclose(start[k], value, atol=1e-9)
        np.testing.assert_allclose(velocity[k], slope, atol=1e-8)


@pytest.mark.parametrize("accuracy", [1e-4, 1e-6])
def test_a_rough_fit_is_off_by_less_than_it_says(accuracy):
    time, position = windows_of_flights()
    exact, rough = (
        fit_flights(time, position, accuracy=1e-12),
        fit_flights(time, position, accuracy=accuracy),
    )
    for good, fast in zip(exact, rough, strict=True):
        np.testing.assert_allclose(fast, good, atol=accuracy)


def test_fit_errors_match_the_least_squares_theory():
    rng = np.random.default_rng(1)
    times, sigma = 0.01 * np.arange(50), 1e-4
    exact, _ = flight(START, VELOCITY, times)
    errors = np.array(
        [
            fit_flight(times, exact + sigma * rng.normal(size=exact.shape)).velocity - VELOCITY
            for _ in range(200)
        ]
    )
    expected = sigma / np.sqrt(np.sum((times - times.mean()) ** 2))  # of the slope of a line
    assert np.std(errors) == pytest.approx(expected, rel=0.15)
    assert np.abs(errors.mean(axis=0)).max() < 4 * expected / np.sqrt(200)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.arange(2.0), np.zeros((2, 3))), "2 samples, need at least 3"),
        ((np.array([0.0, 1.0, 1.0]), np.zeros((3, 3))), "does not increase after sample 1"),
        ((np.arange(3.0), np.full((3, 3), np.nan)), "sample 0 is not finite"),
        ((np.arange(3.0), np.zeros((3, 2))), r"\(n, 3\)"),
    ],
)
def test_fit_refuses_bad_samples_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        fit_flight(*arguments)


def test_bad_states_and_balls_are_refused():
    with pytest.raises(ValueError, match="velocity of a ball must be finite"):
        flight(START, np.array([np.nan, 0.0, 0.0]), np.zeros(1))
    with pytest.raises(ValueError, match="differ in shape"):
        landing(np.zeros((2, 3)), np.zeros(3), 0.0)
    with pytest.raises(ValueError, match="Ball.mass = 0"):
        replace(TENNIS_BALL, mass=0.0)
