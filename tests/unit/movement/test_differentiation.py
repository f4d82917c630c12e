"""The smoothing spline on polynomials, on noise of known size, through gaps, and against theory."""

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator
from scipy.spatial.transform import Rotation

from dart_skill.movement import estimate_noise, smooth_derivatives
from tests.unit.movement.primitives import rms

NOISE = 1e-4
BEST_PENALTY = "dart_skill.movement._differentiation._best_penalty"


def throw(time):
    """A smooth path of 1.2 m with its derivatives, at 4 m/s and 40 m/s^2."""
    w = 2 * np.pi / 1.2
    position = np.stack(
        [0.7 * np.sin(w * time), 0.2 * np.cos(0.5 * w * time), 0.3 * np.sin(w * time + 1)], 1
    )
    velocity = w * np.stack(
        [0.7 * np.cos(w * time), -0.1 * np.sin(0.5 * w * time), 0.3 * np.cos(w * time + 1)], 1
    )
    acceleration = -w * w * position * [1.0, 0.25, 1.0]
    return position, velocity, acceleration


def noisy_throw(seed, n=150, jitter=0.0, lost=()):
    rng = np.random.default_rng(seed)
    time = 0.01 * np.arange(n) + rng.uniform(-jitter, jitter, n)
    time = np.delete(time, lost)
    return time, throw(time)[0] + rng.normal(0, NOISE, (len(time), 3))


@pytest.mark.parametrize("n", [8, 11, 12, 13, 40, 700])
def test_polynomials_of_degree_five_are_exact_without_noise(n):
    time = 3.0 + np.sort(np.random.default_rng(n).uniform(-0.002, 0.002, n) + 0.01 * np.arange(n))
    u = (time - time[0])[:, None]
    coefficients = np.random.default_rng(1).normal(size=(6, 2))
    powers = np.arange(6)
    expected = [(u**powers) @ coefficients]
    for _ in range(2):
        coefficients = coefficients[1:] * np.arange(1, len(coefficients))[:, None]
        expected.append((u ** np.arange(len(coefficients))) @ coefficients)
    for order, (found, wanted) in enumerate(
        zip(smooth_derivatives(time, expected[0], noise=0.0), expected, strict=True)
    ):
        scale = np.abs(expected[0]).max() * 100.0**order
        np.testing.assert_allclose(found, wanted, atol=1e-10 * scale, err_msg=f"order {order}")


def test_quadratics_are_exact_for_any_noise_level():
    time = 0.01 * np.arange(100)
    samples = np.stack([1 + 2 * time - 9.81 / 2 * time**2], 1)
    motion = smooth_derivatives(time, samples, noise=0.01)
    np.testing.assert_allclose(motion.position, samples, atol=1e-8)
    np.testing.assert_allclose(motion.velocity[:, 0], 2 - 9.81 * time, atol=1e-6)
    np.testing.assert_allclose(motion.acceleration[:, 0], -9.81, atol=1e-4)


@pytest.mark.parametrize("jitter", [0.0, 0.002])
def test_noise_is_estimated_from_the_samples(jitter):
    levels = [float(estimate_noise(*noisy_throw(seed, 400, jitter))) for seed in range(20)]
    assert np.mean(levels) == pytest.approx(NOISE, rel=0.05), levels


def test_position_error_is_near_the_best_of_all_penalties(monkeypatch):
    """The chosen penalty costs at most 15 % over the one that an oracle would choose, on average."""
    chosen, oracle = [], []
    for seed in range(10):
        time, samples = noisy_throw(seed)
        truth = throw(time)[0]
        chosen.append(rms(smooth_derivatives(time, samples, noise=NOISE).position - truth))
        errors = []
        for log_penalty in np.arange(-6, 10, 0.5):
            with monkeypatch.context() as patch:
                patch.setattr(BEST_PENALTY, lambda _, p=10.0**log_penalty: p)
                errors.append(rms(smooth_derivatives(time, samples, noise=NOISE).position - truth))
        oracle.append(min(errors))
    assert np.mean(chosen) < 1.15 * np.mean(oracle), (np.mean(chosen), np.mean(oracle))


def test_derivatives_of_a_noisy_throw_beat_finite_differences_by_far():
    found, plain = [], []
    for seed in range(8):
        time, samples = noisy_throw(seed)
        _, velocity, acceleration = throw(time)
        motion = smooth_derivatives(time, samples)
        inside = slice(10, -10)
        found.append(
            [
                rms((motion.velocity - velocity)[inside]),
                rms((motion.acceleration - acceleration)[inside]),
            ]
        )
        slope = np.gradient(samples, time, axis=0)
        plain.append(
            [
                rms((slope - velocity)[inside]),
                rms((np.gradient(slope, time, axis=0) - acceleration)[inside]),
            ]
        )
    found, plain = np.mean(found, axis=0), np.mean(plain, axis=0)
    assert found[0] < 0.004, found
    assert found[1] < 0.3, found
    assert (found < plain / 2).all(), (found, plain)


def test_a_gap_is_bridged():
    time, samples = noisy_throw(3, jitter=0.002, lost=np.arange(60, 68))
    at = np.linspace(time[0], time[-1], 400)
    motion = smooth_derivatives(time, samples, noise=NOISE, at=at)
    error = motion.position - throw(at)[0]
    assert np.abs(error).max() < 15 * NOISE, np.abs(error).max()


def test_a_long_gap_does_not_break_the_fit():
    time, samples = noisy_throw(4, n=160, lost=np.arange(40, 110))
    assert all(np.isfinite(part).all() for part in smooth_derivatives(time, samples))


def test_turning_the_axes_turns_the_result():
    time, samples = noisy_throw(5)
    turn = Rotation.from_euler("xyz", [0.3, -1.1, 2.0]).as_matrix()
    plain = smooth_derivatives(time, samples, noise=NOISE)
    turned = smooth_derivatives(time, samples @ turn.T, noise=NOISE)
    for one, other in zip(plain, turned, strict=True):
        np.testing.assert_allclose(other, one @ turn.T, atol=1e-8 * np.abs(one).max())


def test_units_of_time_and_length_change_nothing_but_units():
    time, samples = noisy_throw(6)
    plain = smooth_derivatives(time, samples, noise=NOISE)
    scaled = smooth_derivatives(1e3 * time, 1e3 * samples, noise=1e3 * NOISE)
    for order, (one, other) in enumerate(zip(plain, scaled, strict=True)):
        np.testing.assert_allclose(
            other, one * 1e3 * 1e-3**order, rtol=1e-6, atol=1e-6 * np.abs(other).max()
        )


def test_noise_per_column_smooths_each_column_by_itself():
    time, samples = noisy_throw(7)
    mixed = np.column_stack([samples, 500.0 * samples[:, :1]])
    motion = smooth_derivatives(time, mixed, noise=[NOISE, NOISE, NOISE, 500 * NOISE])
    np.testing.assert_allclose(
        motion.acceleration[:, 3], 500 * motion.acceleration[:, 0], rtol=1e-6, atol=1e-6
    )
    alone = smooth_derivatives(time, samples[:, 1:2], noise=NOISE)
    np.testing.assert_allclose(
        motion.acceleration[:, 1], alone.acceleration[:, 0], rtol=1e-9, atol=1e-9
    )


def test_a_recording_of_a_minute_is_smoothed_whole():
    time, samples = noisy_throw(8, n=6000)
    motion = smooth_derivatives(time, samples)
    assert rms(motion.position - throw(time)[0]) < 0.6 * NOISE


@pytest.mark.parametrize(
    ("time", "samples", "options", "message"),
    [
        (np.arange(7), np.zeros((7, 3)), {}, "at least 8"),
        (np.arange(9), np.zeros((8, 3)), {}, "length 8"),
        (np.zeros(9), np.zeros((9, 3)), {}, "must increase"),
        (np.arange(9), np.full((9, 1), np.nan), {}, "nan"),
        (np.arange(9), np.zeros(9), {}, "2 dimension"),
        (np.arange(9), np.zeros((9, 3)), {"noise": -1.0}, "not negative"),
        (np.arange(9), np.zeros((9, 3)), {"noise": [1.0, 1.0]}, "one per column"),
        (np.arange(9), np.zeros((9, 3)), {"at": [9.0]}, "cannot extrapolate"),
        (np.arange(9), np.zeros((9, 3)), {"at": []}, "cannot extrapolate"),
    ],
)
def test_unusable_recordings_are_refused(time, samples, options, message):
    with pytest.raises(ValueError, match=message):
        smooth_derivatives(time, samples, **options)


@pytest.fixture
def stamps():
    return np.cumsum(np.random.default_rng(0).uniform(0.005, 0.015, 40))


def test_a_polynomial_of_degree_5_has_no_noise(stamps):
    samples = np.stack([((stamps - 0.2) * 5.0) ** k for k in range(6)], axis=1)
    assert estimate_noise(stamps, samples) < 1e-12


def test_the_noise_is_the_median_contrast_by_the_barycentric_formula(stamps):
    samples = np.random.default_rng(1).standard_normal((40, 2))
    contrasts = []
    for first in range(34):
        weights = BarycentricInterpolator(stamps[first : first + 7]).wi
        contrasts.append(np.abs(weights @ samples[first : first + 7]) / np.linalg.norm(weights))
    each = np.median(contrasts, axis=0) / 0.67449
    assert estimate_noise(stamps, samples, apart=True) == pytest.approx(each, 1e-5)
    together = np.sqrt(np.mean(np.square(each)))
    assert estimate_noise(stamps, samples) == pytest.approx(together, 1e-5)


def test_noise_is_told_of_all_columns_together_or_of_each(stamps):
    samples = np.random.default_rng(2).standard_normal((40, 3)) * [1.0, 5.0, 0.1]
    each = estimate_noise(stamps, samples, apart=True)
    np.testing.assert_array_equal(
        each, [estimate_noise(stamps, samples[:, k : k + 1]) for k in range(3)]
    )
    assert each[2] < estimate_noise(stamps, samples) < each[1]
