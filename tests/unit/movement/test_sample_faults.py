"""Repeats, jumps and quantisation are found in samples that have them, and in no others."""

import warnings

import numpy as np
import pytest

from dart_skill.movement import (
    DSGMR,
    estimate_noise,
    find_faults,
    retimed,
    smooth_derivatives,
    without_repeats,
)

TIME = 0.001 * np.arange(2000)


def path(time):
    """A reach of 0.4 m in 2 s [m]."""
    s = time / 2.0
    return np.outer(s**3 * (10.0 - 15.0 * s + 6.0 * s**2), [0.4, 0.2, -0.1])


def noisy(time=TIME, seed=0):
    return path(time) + np.random.default_rng(seed).normal(0.0, 2e-4, (len(time), 3))


def held(every):
    """As a logger writes it that is `every` times as fast as the sensor."""
    return np.repeat(noisy()[::every], every, axis=0)[: len(TIME)]


def test_good_samples_have_no_faults():
    for samples in (noisy(), path(TIME)):
        faults = find_faults(TIME, samples)
        assert faults.reasons == [] and faults.held == 1 and faults.repeats == 0.0, faults


def test_a_rest_before_and_after_is_no_fault():
    rested = np.vstack(
        [
            np.repeat(path(TIME)[:1], 500, axis=0),
            path(TIME),
            np.repeat(path(TIME)[-1:], 500, axis=0),
        ]
    )
    assert find_faults(0.001 * np.arange(3000), rested).reasons == []


def test_held_samples_are_found_and_thinned_to_those_that_were_measured():
    samples = held(4)
    faults = find_faults(TIME, samples)
    assert faults.repeats == pytest.approx(0.75, abs=0.01) and faults.held == 4
    assert "75 % of the samples repeat the one before" in faults.reasons[0] and not faults.jumps
    time, thinned = without_repeats(TIME, samples)
    np.testing.assert_array_equal(time, TIME[::4])
    np.testing.assert_array_equal(thinned, noisy()[::4])


def test_thinned_samples_have_noise_and_accelerations_as_those_measured():
    samples = held(20)
    time, thinned = without_repeats(TIME, samples)
    assert estimate_noise(TIME, samples) < 1e-12, "what this is about"
    assert estimate_noise(time, thinned) == pytest.approx(2e-4, rel=0.3)
    worst = np.abs(smooth_derivatives(TIME, samples).acceleration).max()
    mended = np.abs(smooth_derivatives(time, thinned).acceleration).max()
    assert worst > 50.0 and mended < 2.0, (worst, mended)


def test_a_rest_keeps_samples_at_the_rate_of_the_sensor():
    samples = np.vstack([held(4), np.repeat(held(4)[-1:], 400, axis=0)])
    time, _ = without_repeats(0.001 * np.arange(2400), samples)
    assert np.diff(time).max() == pytest.approx(0.004)


def test_a_jump_is_found_where_it_is():
    for samples in (noisy(), held(4)):
        samples = samples.copy()
        samples[1200:] += [0.0, 0.19, 0.0]
        faults = find_faults(TIME, samples)
        assert faults.jumps == (1200,) and faults.largest_jump == pytest.approx(0.19, abs=0.002)
        assert any("jumps of up to 0.19" in reason for reason in faults.reasons)


def test_quantised_columns_are_found_with_their_step():
    samples = noisy()
    samples[:, 1] = 1e-3 * np.round(samples[:, 1] / 1e-3)
    faults = find_faults(TIME, samples)
    assert faults.quantum[0] == faults.quantum[2] == 0.0 and faults.quantum[1] == pytest.approx(
        1e-3
    )
    assert "quantised in steps of 0.001" in faults.reasons[0] and "0.00029" in faults.reasons[0], (
        "q / sqrt(12)"
    )


def test_encode_refuses_or_thins_where_it_is_asked_to():
    model, samples = DSGMR(4), held(4)
    with pytest.raises(ValueError, match="75 % of the samples repeat"):
        model.encode(TIME, samples, faults="refuse")
    thinned = model.encode(TIME, samples, faults="thin")
    assert thinned.shape == (500, 4)
    np.testing.assert_array_equal(thinned, model.encode(*without_repeats(TIME, samples)))
    jumped = samples.copy()
    jumped[1200:] += 0.19
    with pytest.raises(ValueError, match="jump"):
        model.encode(TIME, jumped, faults="thin")
    np.testing.assert_array_equal(
        model.encode(TIME, noisy()), model.encode(TIME, noisy(), faults="refuse")
    )
    with pytest.raises(ValueError, match="faults must be one of"):
        model.encode(TIME, samples, faults="mend")


def test_encode_says_what_is_wrong_before_it_differentiates():
    """The attractor of held samples was hundreds of metres away, and nobody was told."""
    model, samples = DSGMR(4), held(4)
    with pytest.warns(UserWarning, match="75 % of the samples repeat"):
        said = model.encode(TIME, samples)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(said, model.encode(TIME, samples, faults="keep"))
        model.encode(TIME, noisy())


def aligned(path, seed=0, waits=40):
    """As published after an alignment with another recording: the movement waits for uneven times,
    and goes ahead between.
    """
    rng = np.random.default_rng(seed)
    index = np.sort(
        np.concatenate(
            [
                rng.integers(0, len(path), 300),
                np.repeat(rng.integers(0, len(path), waits), rng.integers(5, 90, waits)),
            ]
        )
    )
    return path[index]


def test_repeats_of_uneven_length_are_not_said_to_be_mended_by_thinning():
    samples = aligned(noisy())
    time = 0.001 * np.arange(len(samples))
    faults = find_faults(time, samples)
    assert faults.uneven and faults.repeats > 0.7, faults
    assert (
        "for uneven times" in faults.reasons[0]
        and "retimed" in faults.reasons[0]
        and "thin" not in faults.reasons[0]
    )
    assert not find_faults(TIME, held(4)).uneven
    with pytest.raises(ValueError, match="retimed"):
        DSGMR(4).encode(time, samples, faults="thin")


def test_a_straight_path_is_retimed_to_the_movement_of_least_jerk():
    """Closed form: 10 u^3 - 15 u^4 + 6 u^5, whatever the stamps were."""
    samples = aligned(path(TIME))
    time, positions = retimed(samples, 2.0, 101)
    np.testing.assert_allclose(time, np.linspace(0.0, 2.0, 101))
    np.testing.assert_allclose(
        positions,
        samples[0] + (path(time) / path(TIME[-1:] + 0.001)) * (samples[-1] - samples[0]),
        atol=1e-9,
    )
    assert np.abs(smooth_derivatives(time, positions).velocity[[0, -1]]).max() < 1e-3, (
        "from rest to rest"
    )


def test_what_does_not_move_has_no_path():
    with pytest.raises(ValueError, match="samples must move to have a path, got 5 at one place"):
        retimed(np.ones((5, 2)), 1.0, 10)
