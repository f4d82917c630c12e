"""Rhythmic primitives: cycles learned, their period found, no seam, and what changes on the way
(thesis (7.6)-(7.13)).
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dart_skill.movement import RhythmicPrimitive
from tests.unit.movement.primitives import execute, rms, track

PERIOD = 1.7
STAMPS = np.linspace(0.0, 3 * PERIOD, 601)
CENTRE = np.array([0.4, -0.1])


def circle(time, period=PERIOD):
    angle = 2 * np.pi * time / period
    return CENTRE + 0.2 * np.stack([np.cos(angle), np.sin(angle)], 1)


def figure_eight(time, period=PERIOD):
    angle = 2 * np.pi * time / period + 0.3
    return CENTRE + np.stack([0.3 * np.sin(angle), 0.1 * np.sin(2 * angle)], 1)


SHAPES = [circle, figure_eight]


def learned(shape=figure_eight, n_basis=25, **settings):
    return RhythmicPrimitive(n_basis, **settings).fit(STAMPS, shape(STAMPS), period=PERIOD)


@pytest.mark.parametrize("shape", SHAPES)
def test_cycle_is_reproduced_for_as_long_as_one_likes(shape):
    primitive = RhythmicPrimitive(50).fit(STAMPS, shape(STAMPS))
    long = np.linspace(0.0, 40 * PERIOD, 8001)
    movement = primitive.open_loop(long)
    assert primitive.period_ == pytest.approx(PERIOD, rel=1e-6)
    np.testing.assert_allclose(primitive.baseline_, CENTRE, atol=1e-5)
    assert rms(movement.position - shape(long)) < 5e-5, rms(movement.position - shape(long))


def literal_rate(primitive, period):
    """(7.6), (7.8), (7.9) in seconds for (angle, x1, x2), with periodic kernels."""
    n = primitive.n_basis
    centres, tau = 2 * np.pi * np.arange(n) / n, 1.0 / period
    alpha, beta = 2 * np.sqrt(primitive.stiffness), np.sqrt(primitive.stiffness) / 2
    # Half of its height at the next kernel's centre.
    concentration = np.log(2.0) / (1.0 - np.cos(2 * np.pi / n))

    def rate(_, state):
        angle, x1, x2 = state[0], state[1:3], state[3:]
        psi = np.exp(concentration * (np.cos(angle - centres) - 1.0))
        f = psi @ primitive.weights_ / psi.sum()
        return np.concatenate(
            [
                [2 * np.pi * tau],
                tau * x2,
                tau * (alpha * (beta * (primitive.baseline_ - x1) - x2) + f),
            ]
        )

    return rate


def test_it_moves_by_the_equations_of_the_thesis():
    primitive = learned()
    times = np.linspace(0.0, 3.0, 1201)
    state = primitive.begin([0.9, 0.2], velocity=[0.0, -1.0], period=1.2, phase=0.4)
    start = np.concatenate([[0.8 * np.pi], state.position, state.velocity * 1.2])
    exact = solve_ivp(
        literal_rate(primitive, 1.2),
        (0.0, 3.0),
        start,
        t_eval=times[::20],
        method="DOP853",
        rtol=1e-9,
        atol=1e-10,
    )
    movement = primitive.open_loop(times, state)
    np.testing.assert_allclose(movement.position[::20], exact.y[1:3].T, atol=2e-8)
    np.testing.assert_allclose(movement.velocity[::20], exact.y[3:].T / 1.2, atol=2e-7)


@pytest.mark.parametrize("phase", [0.0, 0.31, -2.75])
def test_limit_cycle_is_what_one_period_maps_to_itself(phase):
    primitive = learned()
    position, velocity = primitive.limit_cycle(phase, period=0.9, amplitude=2.0)
    after = primitive.open_loop(
        np.linspace(0.0, 0.9, 301), primitive.begin(period=0.9, amplitude=2.0, phase=phase)
    )
    np.testing.assert_allclose(after.position[-1], position, atol=1e-6)
    np.testing.assert_allclose(after.velocity[-1], velocity, atol=1e-5)
    np.testing.assert_allclose(after.position[0], position)


def test_there_is_no_seam_where_the_phase_starts_again():
    primitive = learned()
    np.testing.assert_allclose(
        primitive.activations([0.0]), primitive.activations([1.0]), atol=1e-12
    )
    s = np.linspace(0.98, 1.02, 401)
    slopes = np.diff(primitive.activations(s) @ primitive.weights_, axis=0) / np.diff(s)[:, None]
    assert np.abs(np.diff(slopes, axis=0)).max() < 0.02 * np.abs(slopes).max()
    states = execute(primitive, primitive.begin(), 2 * PERIOD)
    assert np.abs(np.diff(track(states, "acceleration"), axis=0)).max() < 0.5
    assert all(0.0 <= state.progress < 1.0 for state in states)


def test_from_anywhere_it_comes_to_the_cycle():
    primitive = learned()
    long = np.linspace(0.0, 4 * PERIOD, 1201)
    rng = np.random.default_rng(0)
    usual = primitive.open_loop(long).position
    for start, velocity in rng.normal(0, 2.0, (4, 2, 2)):
        gap = np.abs(
            primitive.open_loop(long, primitive.begin(start, velocity=velocity)).position - usual
        )
        assert gap[-1].max() < 1e-8 < 0.1 < gap[0].max()


def test_amplitude_scales_the_cycle_about_the_baseline_which_can_be_moved():
    primitive = learned()
    times = np.linspace(0.0, PERIOD, 301)
    usual = primitive.open_loop(times).position - CENTRE
    other = primitive.open_loop(
        times, primitive.begin(baseline=[5.0, 6.0], amplitude=[3.0, 0.5])
    ).position
    np.testing.assert_allclose(other - [5.0, 6.0], usual * [3.0, 0.5], atol=1e-5)


def test_period_changes_the_pace_and_not_the_path():
    primitive = learned()
    usual, fast = (
        primitive.open_loop(PERIOD / 100),
        primitive.open_loop(0.25 / 100, primitive.begin(period=0.25)),
    )
    np.testing.assert_allclose(fast.position, usual.position, atol=1e-9)
    np.testing.assert_allclose(fast.velocity, usual.velocity * PERIOD / 0.25, rtol=1e-6, atol=1e-8)


def test_period_amplitude_and_baseline_that_change_on_the_way_are_followed_without_a_jump():
    primitive = learned()
    before = execute(primitive, primitive.begin(), 1.0)[-1]
    changes = {"baseline": [1.0, 1.0], "amplitude": 2.0}
    assert (
        np.abs(primitive.step(before, 1e-7, **changes).acceleration - before.acceleration).max()
        < 1e-4
    )
    assert np.abs(primitive.step(before, 1e-7, period=0.8).velocity - before.velocity).max() < 1e-5
    last = execute(primitive, before, 8.0, period=0.8, **changes)[-1]
    position, velocity = primitive.limit_cycle(last.progress, period=0.8, **changes)
    np.testing.assert_allclose(last.position, position, atol=1e-5)
    np.testing.assert_allclose(last.velocity, velocity, atol=1e-4)


@pytest.mark.parametrize("n_periods", [1.6, 2.0, 3.7, 11.0])
def test_period_is_found_from_noisy_samples(n_periods):
    rng = np.random.default_rng(4)
    time = np.arange(0.0, n_periods * PERIOD, 0.01)
    noisy = figure_eight(time) + rng.normal(0, 0.003, (len(time), 2))
    primitive = RhythmicPrimitive(15).fit(time, noisy)
    assert primitive.period_ == pytest.approx(PERIOD, rel=0.01 / n_periods)
    assert rms(primitive.open_loop(time).position - figure_eight(time)) < 0.003


def test_two_strokes_that_differ_a_little_are_one_period():
    time = np.arange(0.0, 8.0, 0.01)
    strokes = np.sin(2 * np.pi * time) + 0.25 * np.sin(np.pi * time)
    assert RhythmicPrimitive().fit(time, strokes[:, None]).period_ == pytest.approx(2.0, rel=1e-3)


def test_one_period_is_enough_when_it_is_given_with_or_without_its_last_sample():
    for time in (np.linspace(0.0, PERIOD, 171), np.linspace(0.0, PERIOD, 170, endpoint=False)):
        primitive = RhythmicPrimitive(40).fit(time, figure_eight(time), period=PERIOD)
        np.testing.assert_allclose(primitive.baseline_, CENTRE, atol=1e-12)
        assert rms(primitive.open_loop(STAMPS).position - figure_eight(STAMPS)) < 2e-4


def test_what_does_not_repeat_is_refused():
    time = np.linspace(0.0, 1.0, 101)
    reach = (time**3 * (10 - 15 * time + 6 * time**2))[:, None]
    with pytest.raises(
        ValueError,
        match=r"position does not repeat within its 1 s; give period= or record two periods",
    ):
        RhythmicPrimitive().fit(time, reach)
    with pytest.raises(
        ValueError, match=r"does not repeat after the period of 1 s: it comes back off by 1"
    ):
        RhythmicPrimitive().fit(time, reach, period=1.0)
    with pytest.raises(ValueError, match=r"does not repeat after the period of 1.3 s"):
        RhythmicPrimitive().fit(STAMPS, figure_eight(STAMPS), period=1.3)
    with pytest.raises(
        ValueError,
        match=r"position spans 1 s, less than the period of 1.5 s; record a whole period",
    ):
        RhythmicPrimitive().fit(time, reach, period=1.5)
    with pytest.raises(ValueError, match="does not repeat"):
        RhythmicPrimitive().fit(STAMPS, np.ones((len(STAMPS), 2)))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"period": 0.0}, "period must be above 0, got 0"),
        ({"phase": np.nan}, "phase holds nan"),
        ({"baseline": [0.0]}, "baseline must have length 2, got 1"),
        ({"amplitude": [[1.0]]}, "amplitude must be one number or one per dimension"),
        ({"start": [0.0, np.nan]}, "start holds nan"),
    ],
)
def test_bad_settings_are_named(settings, message):
    with pytest.raises(ValueError, match=message):
        learned().begin(**settings)
    with pytest.raises(ValueError, match="n_basis must be an integer of at least 3, got 2"):
        RhythmicPrimitive(2)
