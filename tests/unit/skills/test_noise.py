"""What a throw was is told whatever the cameras: their noise and rate come from the samples
themselves.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.skills.observation import (
    column_noise,
    find_flight,
    fit_release,
    grow,
    judge_flight,
    position_noise,
    repeats,
    rows_at,
    usual_speeds,
)
from tests.interpreted import interpreted
from tests.unit.skills.test_outcome import GRIP, ORIGIN, Throw, basket_at

NOISES = [2e-5, 1e-4, 3e-4, 1e-3, 2e-3, 5e-3]


def seen(throw, noise, rate=100.0, end=2.0, jitter=0.0):
    """Samples of the ball and the hand of a throw, from cameras with a noise [m], a rate [1/s] and
    stamps that jitter [s].
    """
    time = np.arange(0.0, end, 1.0 / rate)
    stamps = ORIGIN + time + np.abs(jitter * throw.rng.standard_normal(len(time)))
    position, pose = throw.hand(time)
    pose = Rotation.from_rotvec(10 * noise * throw.rng.standard_normal((len(time), 3))) * pose
    blur = noise * throw.rng.standard_normal((2, len(time), 3))
    return (stamps, throw.ball(time) + blur[0]), (stamps, position + blur[1], pose.as_quat())


@pytest.mark.parametrize("noise", NOISES)
def test_the_noise_is_told_from_the_samples(noise):
    ball, hand = seen(Throw(3), noise)
    assert position_noise(*ball) == pytest.approx(noise, rel=0.25)
    angles = Rotation.from_quat(hand[2]).as_rotvec()[:, 2:]
    assert column_noise(hand[0], angles)[0] < 30 * noise


def test_poses_that_a_driver_repeats_and_leaps_do_not_hide_the_noise():
    time, position = seen(Throw(4), 1e-3)[0]
    held = np.repeat(position[::2], 2, axis=0)
    held[[30, 77]] += 0.4
    assert position_noise(time, held) == pytest.approx(1e-3, rel=0.4)


def test_stamps_that_jitter_are_noise_of_what_moves():
    rest = position_noise(*seen(Throw(5), 1e-4)[0])
    assert position_noise(*seen(Throw(5), 1e-4, jitter=1e-3)[0]) > 5 * rest


def test_too_few_samples_tell_no_noise():
    assert position_noise(np.arange(5.0), np.zeros((5, 3))) < 1e-4
    assert position_noise(np.empty(0), np.empty((0, 3))) < 1e-4


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("seed", range(5))
def test_a_landing_is_as_exact_as_the_cameras_allow(noise, seed):
    throw = Throw(seed)
    rim, crossing = basket_at(throw, shift=0.04)
    ball, _ = seen(throw, noise, end=crossing + 0.03)
    outcome = judge_flight(*ball, rim, 0.15)
    assert outcome.landing_seen and outcome.in_basket
    np.testing.assert_allclose(
        outcome.landing, throw.landing(rim[2]).position, atol=1e-3 + 4 * noise
    )


@pytest.mark.parametrize("rate", [30.0, 60.0, 240.0, 360.0])
def test_a_flight_is_found_at_any_rate_of_the_cameras(rate):
    throw = Throw(6)
    rim, crossing = basket_at(throw)
    ball, hand = seen(throw, 3e-4, rate, crossing)
    assert judge_flight(*ball, rim, 0.15).landing_seen
    free = find_flight(*ball)
    assert ball[0][free.samples[0]] - ORIGIN == pytest.approx(throw.release, abs=1.5 / rate + 0.02)
    assert fit_release(*ball, *hand, GRIP).time - ORIGIN == pytest.approx(throw.release, abs=3e-3)


@pytest.mark.parametrize("noise", [1e-3, 2e-3, 5e-3])
def test_a_ball_in_a_hand_or_at_rest_does_not_fly_however_noisy_it_is(noise):
    """No window of a swing is taken for a flight, nor is a ball that lies on the floor."""
    for seed in range(5):
        throw = Throw(seed)
        (time, ball), _ = seen(throw, noise)
        kept = time - ORIGIN < throw.release - 0.1
        assert find_flight(time[kept], ball[kept]) is None
        rest = noise * np.random.default_rng(seed).standard_normal((200, 3))
        assert find_flight(0.01 * np.arange(200), rest) is None


@pytest.mark.parametrize("noise", NOISES)
def test_the_release_is_told_to_what_its_uncertainty_says(noise):
    off, said = [], []
    for seed in range(12):
        throw = Throw(seed)
        _, crossing = basket_at(throw)
        ball, hand = seen(throw, noise, end=crossing)
        release = fit_release(*ball, *hand, GRIP)
        off.append(release.time - ORIGIN - throw.release)
        said.append(release.time_uncertainty)
        assert np.linalg.norm(release.velocity - throw.velocity) < 0.01 + 30 * noise + 12 * abs(
            off[-1]
        )
    assert np.median(np.abs(off)) < 4e-4 + 3.0 * noise, off
    assert np.median(np.abs(np.array(off) / said)) < 2.0, (off, said)


def test_the_seat_of_the_ball_is_seen_in_the_hand():
    """The ball sits 6 mm beside where it should; the release is told as well as ever, and the seat
    to a fraction of a millimetre.
    """
    throw = Throw(7)
    _, crossing = basket_at(throw)
    ball, hand = seen(throw, 1e-4, end=crossing)
    believed = GRIP + [0.004, -0.003, 0.0033]
    release = fit_release(*ball, *hand, believed)
    np.testing.assert_allclose(release.grip, GRIP, atol=3e-4)
    assert release.time - ORIGIN == pytest.approx(throw.release, abs=1e-3)
    assert release.grip_distance < 2e-3


def test_a_ball_that_was_hidden_in_the_hand_is_where_it_should_be():
    throw = Throw(8)
    _, crossing = basket_at(throw)
    (time, ball), hand = seen(throw, 1e-4, end=crossing)
    flown = time - ORIGIN > throw.release
    release = fit_release(time[flown], ball[flown], *hand, GRIP)
    np.testing.assert_array_equal(release.grip, GRIP)
    assert release.time - ORIGIN == pytest.approx(throw.release, abs=1e-3)


def test_a_flight_that_grows_over_outliers_never_shrinks_to_a_few_samples():
    """Gaps of three outliers on all sides of a sample in the middle: what was found stays."""
    samples = np.arange(5, 25)
    near = np.zeros(40, dtype=bool)
    near[[14, 15]] = True
    near[[0, 1, 2, 3, 4, 5, 6, 26, 27, 28, 29, 30, 31, 32]] = True
    np.testing.assert_array_equal(grow(near, samples), samples)


def test_a_usual_speed_is_the_median_of_five():
    time, position = seen(Throw(6), 1e-3)[0]
    speeds = np.linalg.norm(np.diff(position, axis=0), axis=1) / np.diff(time)
    longer = np.pad(speeds, 2, mode="edge")
    np.testing.assert_allclose(
        usual_speeds(time, position),
        [np.median(longer[k : k + 5]) for k in range(len(speeds))],
        rtol=1e-12,
    )


def test_compiled_and_interpreted_have_the_same_bits():
    plain = interpreted("dart_skill.skills.observation._noise")
    time, position = seen(Throw(6), 1e-3)[0]
    np.testing.assert_array_equal(usual_speeds(time, position), plain.usual_speeds(time, position))
    for samples, repeated in (
        (position, False),
        (np.repeat(position, 2, axis=0), True),
        (position[:1], False),
    ):
        assert repeats(samples) == plain.repeats(samples) == repeated


def test_rows_between_samples_are_those_of_numpy():
    rng = np.random.default_rng(8)
    stamps, rows = np.cumsum(rng.uniform(0.01, 0.1, 20)), rng.standard_normal((20, 3))
    when = np.concatenate([stamps, rng.uniform(stamps[0], stamps[-1], 50)])
    np.testing.assert_allclose(
        rows_at(when, stamps, rows),
        np.stack([np.interp(when, stamps, column) for column in rows.T], axis=1),
        atol=1e-14,
    )
