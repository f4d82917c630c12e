"""Velocity-threshold segmentation (thesis 8.4.3) on recordings with noise, jitter, gaps and bad
samples.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dart_skill.movement import VelocityThreshold, segment_containing, speed

NOISE = 1e-4


def minimum_jerk(u):
    u = np.clip(u, 0, 1)
    return u**3 * (10 - 15 * u + 6 * u * u)


def recording(moves, end=4.0, seed=0, jitter=0.002, noise=NOISE):
    """Stamps and positions of minimum-jerk moves (start, duration, distance along x)."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, end, 0.01) + rng.uniform(-jitter, jitter, round(end / 0.01))
    x = sum(length * minimum_jerk((time - begin) / duration) for begin, duration, length in moves)
    position = np.column_stack([0.8 * x, 0.6 * x, np.full_like(time, 1.2)])
    return time, position + rng.normal(0, noise, position.shape)


def crossings(begin, duration, length, start, stop):
    """Stamps at which the speed of a minimum-jerk move passes the thresholds."""
    u = np.linspace(0, 1, 200_001)
    speeds = abs(length) / duration * 30 * u**2 * (1 - u) ** 2
    rising = u[np.argmax(speeds > start)]
    falling = u[len(u) - np.argmax(speeds[::-1] > stop) - 1]
    return begin + duration * rising, begin + duration * falling


@given(seed=st.integers(0, 1000), begin=st.floats(0.5, 1.5), duration=st.floats(0.4, 1.0))
@settings(max_examples=25, deadline=None)
def test_start_and_stop_are_found_within_half_a_sample(seed, begin, duration):
    (segment,) = VelocityThreshold().segment(*recording([(begin, duration, 1.0)], seed=seed))
    start, stop = crossings(begin, duration, 1.0, 0.3, 0.1)
    assert segment.motion_start == pytest.approx(start, abs=0.008)
    assert segment.motion_stop == pytest.approx(stop, abs=0.012)
    assert segment.peak_speed == pytest.approx(1.875 / duration, rel=0.05)


def test_the_thresholds_have_hysteresis():
    """Speed that dips between the thresholds goes on; without the gap between them it is two
    motions.
    """
    time = np.arange(0, 3, 0.01)
    pace = np.interp(
        time, [0, 0.5, 0.6, 1.0, 1.1, 1.5, 1.6, 2.0, 2.1], [0, 0, 1, 1, 0.2, 0.2, 1, 1, 0]
    )
    x = np.concatenate([[0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * 0.01)])[:, None]
    assert len(VelocityThreshold(0.3, 0.1).segment(time, x)) == 1
    assert len(VelocityThreshold(0.3, 0.3).segment(time, x)) == 2


def test_the_turn_between_winding_up_and_throwing_does_not_end_the_motion():
    moves = [(0.5, 0.6, -0.5), (1.1, 0.5, 1.2)]
    (joined,) = VelocityThreshold(max_pause=0.2).segment(*recording(moves))
    apart = VelocityThreshold(max_pause=0.0).segment(*recording(moves))
    assert len(apart) == 2
    assert joined.motion_start == apart[0].motion_start
    assert joined.motion_stop == apart[1].motion_stop
    assert joined.peak_speed == pytest.approx(1.875 * 1.2 / 0.5, rel=0.05)


def test_several_motions_are_returned_in_order_and_one_is_picked_by_an_instant():
    segments = VelocityThreshold().segment(*recording([(0.5, 0.5, 1.0), (2.0, 0.6, -0.8)]))
    assert [round(one.motion_start, 1) for one in segments] == [0.5, 2.1]
    assert segment_containing(segments, 2.3) is segments[1]
    assert segment_containing(segments, segments[0].start) is segments[0]
    with pytest.raises(ValueError, match="no segment contains 1.500 s; segments: 0"):
        segment_containing(segments, 1.5)


def test_where_margins_overlap_the_motion_itself_wins():
    segments = VelocityThreshold(settle=0.6, run_up=0.6).segment(
        *recording([(0.8, 0.5, 1.0), (1.6, 0.5, 1.0)])
    )
    assert segments[0].stop > segments[1].motion_start + 0.01
    assert segment_containing(segments, segments[1].motion_start + 0.005) is segments[1]


def test_margins_are_kept_and_cut_at_the_ends_of_the_recording():
    time, positions = recording([(0.5, 0.5, 1.0)], end=1.2)
    (segment,) = VelocityThreshold(run_up=0.2, settle=5.0).segment(time, positions)
    assert segment.start == pytest.approx(segment.motion_start - 0.2)
    assert segment.stop == time[-1]
    inside = time[segment.samples]
    assert inside[0] >= segment.start > time[segment.first - 1]
    assert segment.last == len(time) - 1


def test_a_lone_bad_sample_is_not_a_motion():
    time, positions = recording([(1.0, 0.6, 1.0)])
    positions[[30, 250]] += 0.5
    positions[130] -= 2.0
    (segment,) = VelocityThreshold().segment(time, positions)
    start, _ = crossings(1.0, 0.6, 1.0, 0.3, 0.1)
    assert segment.motion_start == pytest.approx(start, abs=0.008)
    assert segment.peak_speed == pytest.approx(1.875 / 0.6, rel=0.1)


def test_a_gap_in_the_tracking_is_bridged_and_reported():
    time, positions = recording([(1.0, 0.6, 1.0)], jitter=0.0)
    keep = np.delete(np.arange(len(time)), np.arange(125, 133))
    (segment,) = VelocityThreshold().segment(time[keep], positions[keep])
    start, stop = crossings(1.0, 0.6, 1.0, 0.3, 0.1)
    assert segment.largest_gap == pytest.approx(0.09, abs=1e-9)
    assert (segment.motion_start, segment.motion_stop) == pytest.approx((start, stop), abs=0.012)


def test_short_twitches_are_ignored():
    segments = VelocityThreshold(min_duration=0.2).segment(
        *recording([(0.5, 0.1, 0.05), (1.5, 0.6, 1.0)])
    )
    assert len(segments) == 1
    assert segments[0].motion_start > 1.5


def test_a_motion_that_is_under_way_at_the_start_is_left_out():
    time, positions = recording([(-0.3, 0.6, 1.0), (1.5, 0.6, 1.0)])
    (segment,) = VelocityThreshold().segment(time, positions)
    assert segment.motion_start > 1.5
    with pytest.raises(ValueError, match="start recording earlier"):
        VelocityThreshold().segment(time[:100], positions[:100])


def test_speed_is_exact_on_uniform_motion_and_invariant_to_the_units_of_time():
    rng = np.random.default_rng(1)
    time = np.sort(rng.uniform(0, 2, 150))
    positions = time[:, None] * [1.0, -2.0, 2.0]
    np.testing.assert_allclose(speed(time, positions), 3.0, rtol=1e-9)
    np.testing.assert_allclose(speed(1e3 * time, positions, window=70.0), 3e-3, rtol=1e-9)


def test_speed_noise_is_that_of_a_fitted_slope():
    """Theil-Sen on 7 equal steps scatters like least squares, sigma / (dt sqrt(28)), within a
    tenth.
    """
    rng = np.random.default_rng(2)
    scatter = speed(
        0.01 * np.arange(4000),
        rng.normal(0, NOISE, (4000, 1)) + 5 * 0.01 * np.arange(4000)[:, None],
    ).std()
    assert scatter == pytest.approx(NOISE / (0.01 * np.sqrt(28)), rel=0.1)


def test_nothing_moved_reports_the_peak_speed():
    with pytest.raises(
        ValueError, match=r"nothing moved .* peak speed 0\.0\d+ m/s .* threshold 0.3 m/s"
    ):
        VelocityThreshold().segment(*recording([(1.0, 1.0, 0.01)]))


def test_never_stopped_reports_the_peak_speed():
    time, positions = recording([(1.0, 0.6, 1.0)])
    before = time < 1.35
    with pytest.raises(ValueError, match=r"never falls below 0.1 m/s .*peak speed 3\.\d+ m/s"):
        VelocityThreshold().segment(time[before], positions[before])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": 0.1, "stop": 0.2}, "above the start threshold"),
        ({"start": 0.0}, "start must be above 0"),
        ({"window": np.nan}, "nan"),
        ({"run_up": -0.1}, "run_up must be at least 0"),
    ],
)
def test_impossible_thresholds_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        VelocityThreshold(**options)


@pytest.mark.parametrize(
    ("time", "positions", "message"),
    [
        ([0.0, 1.0], np.zeros((2, 3)), "at least 3"),
        ([0.0, 1.0, 1.0], np.zeros((3, 3)), "must increase"),
        ([0.0, 1.0, 2.0], np.full((3, 3), np.nan), "nan"),
        ([0.0, 1.0, 2.0], np.zeros((4, 3)), "length 4"),
        ([], np.zeros((0, 3)), "empty"),
    ],
)
def test_unusable_recordings_are_refused(time, positions, message):
    with pytest.raises(ValueError, match=message):
        VelocityThreshold().segment(time, positions)


def test_a_hand_that_only_creeps_after_a_fast_movement_is_at_rest():
    """Soft joints creep at 0.13 m/s after a peak of 3 m/s; at a tenth of it they would not rest."""
    time, positions = recording([(1.0, 0.6, 1.0)])
    creeping = positions + np.outer(np.maximum(time - 1.3, 0.0), [0.13, 0.0, 0.0])
    (segment,) = VelocityThreshold().segment(time, creeping)
    assert 1.5 < segment.motion_stop < 1.65
    faster = positions + np.outer(np.maximum(time - 1.3, 0.0), [0.35, 0.0, 0.0])
    with pytest.raises(ValueError, match="never falls below"):
        VelocityThreshold().segment(time, faster)


@pytest.mark.parametrize("noise", [3e-4, 1e-3, 2e-3, 5e-3])
@pytest.mark.parametrize("seed", range(3))
def test_noise_that_the_samples_show_neither_begins_nor_prolongs_a_motion(noise, seed):
    (segment,) = VelocityThreshold().segment(*recording([(1.0, 0.8, 1.0)], seed=seed, noise=noise))
    start, stop = crossings(1.0, 0.8, 1.0, 0.3, 0.1)
    assert segment.motion_start == pytest.approx(start, abs=0.05 + 10 * noise)
    assert segment.motion_stop == pytest.approx(stop, abs=0.05 + 10 * noise)


def test_only_the_motion_that_is_wanted_must_be_over():
    """The arm is moved again before the recording ends: the throw before it is whole."""
    time, positions = recording([(0.8, 0.6, 1.0), (2.6, 1.0, -1.0)], end=3.0)
    with pytest.raises(ValueError, match="never falls below"):
        VelocityThreshold().segment(time, positions)
    (segment,) = VelocityThreshold().segment(time, positions, instant=1.1)
    assert segment.contains(1.1)
    with pytest.raises(ValueError, match="never falls below"):
        VelocityThreshold().segment(time, positions, instant=2.8)
