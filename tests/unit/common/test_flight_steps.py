"""Loops over flights: one flight against a batch of them, fits against SciPy's least squares, and
as plain Python.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from dart_skill.common import flight_steps
from tests.interpreted import interpreted

DRAG, GRAVITY = 0.02, 9.81


@pytest.fixture
def throws():
    """Starts and velocities (5, 3) of throws."""
    rng = np.random.default_rng(0)
    return [0.3, -0.1, 2.0] + 0.2 * rng.standard_normal((5, 3)), [
        2.9,
        0.8,
        1.4,
    ] + 0.5 * rng.standard_normal((5, 3))


def integrated(start, velocity, times):
    """Positions (n, 3) by another method."""

    def rate(_, state):
        return [*state[3:], *(-DRAG * np.linalg.norm(state[3:]) * state[3:] - [0.0, 0.0, GRAVITY])]

    done = solve_ivp(
        rate, (0.0, times[-1]), [*start, *velocity], t_eval=times, rtol=1e-11, atol=1e-12
    )
    return done.y[:3].T


def seen(throws, n=30):
    """Times (5, n) and samples (5, n, 3) of flights, a millimetre off."""
    times = np.sort(np.random.default_rng(1).uniform(0.0, 0.5, (5, n)), axis=1)
    return times, flight_steps.fly(*throws, times, DRAG, GRAVITY)[
        0
    ] + 1e-3 * np.random.default_rng(2).standard_normal((5, n, 3))


def test_flights_are_those_of_another_integration(throws):
    times = np.array([0.2, 0.5, 0.9])
    points, _ = flight_steps.fly(*throws, np.tile(times, (5, 1)), DRAG, GRAVITY)
    for start, velocity, flown in zip(*throws, points, strict=True):
        np.testing.assert_allclose(flown, integrated(start, velocity, times), atol=2e-6)


def test_nothing_is_flown_by_no_balls_and_at_no_times(throws):
    assert flight_steps.fly(*throws, np.empty((5, 0)), DRAG, GRAVITY)[0].shape == (5, 0, 3)
    assert flight_steps.fly(np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 2)), DRAG, GRAVITY)[
        1
    ].shape == (0, 2, 3)


def test_the_fit_of_one_flight_is_that_of_a_general_least_squares(throws):
    times, samples = seen(throws)
    for k in range(5):
        first = flight_steps.lines(times[k : k + 1], samples[k : k + 1], GRAVITY)[0]
        state, distances = flight_steps.fit(times[k], samples[k], first, DRAG, GRAVITY, 1e-12)

        def misfit(unknown, time=times[k], sample=samples[k]):
            return (integrated(unknown[:3], unknown[3:], time) - sample).ravel()

        best = least_squares(misfit, first.ravel(), xtol=1e-14, ftol=1e-14, gtol=1e-14)
        np.testing.assert_allclose(state.ravel(), best.x, atol=1e-6)
        np.testing.assert_allclose(
            distances, np.linalg.norm(best.fun.reshape(-1, 3), axis=1), atol=1e-6
        )


def test_lines_are_those_of_polyfit_without_gravity(throws):
    times, samples = seen(throws)
    for time, sample, (value, slope) in zip(
        times, samples, flight_steps.lines(times, samples, 0.0), strict=True
    ):
        np.testing.assert_allclose([slope, value], np.polyfit(time, sample, 1), atol=1e-10)


@pytest.mark.parametrize("scale", [0.1, 1.0, 3.0])
def test_samples_that_fly_within_a_tolerance_may_fly(throws, scale):
    rng, (starts, speeds) = np.random.default_rng(3), throws
    times = np.sort(rng.uniform(0.0, 0.2, (5, 12)), axis=1)
    times -= times[:, :1]
    flown = flight_steps.fly(starts, scale * speeds, times, DRAG, GRAVITY)[0]
    off = rng.standard_normal((5, 12, 3))
    samples = flown + 1e-3 * off / np.linalg.norm(off, axis=2, keepdims=True)
    assert flight_steps.may_fly(
        times, samples, flight_steps.lines(times, samples, GRAVITY), DRAG, GRAVITY, 1.0001e-3
    ).all()


def test_what_rests_or_moves_evenly_for_long_cannot_fly(throws):
    times = np.tile(np.linspace(0.0, 0.1, 11), (5, 1))
    samples = throws[0][:, None] + times[..., None] * np.linspace(0.0, 2.0, 5)[:, None, None]
    assert not flight_steps.may_fly(
        times, samples, flight_steps.lines(times, samples, GRAVITY), DRAG, GRAVITY, 1e-3
    ).any()


def test_a_ball_that_never_crosses_a_plane_has_no_crossing(throws):
    begin = np.array([0.5, np.nan, -1.0, 0.5, 0.5])
    points, speeds, times = flight_steps.cross(
        *throws, begin, np.array([0.0, 0.0, 1.0]), np.array([1, 1, 1, 9, 1.0]), DRAG, GRAVITY
    )
    crossed = np.array([True, False, False, False, True])
    for part in (points, speeds, times):
        np.testing.assert_array_equal(np.isfinite(part.reshape(5, -1)).all(axis=1), crossed)
        assert np.isnan(part[~crossed]).all()
    np.testing.assert_allclose(points[crossed, 2], 1.0, atol=1e-9)


def test_compiled_and_interpreted_have_the_same_bits(throws):
    times, samples = seen(throws, n=12)
    first = flight_steps.lines(times, samples, GRAVITY)

    def all_of(module):
        yield from module.fly(*throws, times, DRAG, GRAVITY)
        yield from module.cross(
            *throws, np.full(5, 0.4), np.array([-0.8, -0.6, 0.0]), np.full(5, -2.0), DRAG, GRAVITY
        )
        yield module.lines(times, samples, GRAVITY)
        yield module.may_fly(times, samples, first, DRAG, GRAVITY, 1e-3)
        yield from module.fit(times[0], samples[0], first[0], DRAG, GRAVITY, 1e-8)
        yield from module.fit_together(times, samples, first, DRAG, GRAVITY, 1e-8)

    for ours, plain in zip(
        all_of(flight_steps), all_of(interpreted("dart_skill.common.flight_steps")), strict=True
    ):
        np.testing.assert_array_equal(ours, plain)
