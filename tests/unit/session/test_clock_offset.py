"""The clocks of cameras and arm are brought together by the speed of the hand."""

from functools import lru_cache

import numpy as np
import pytest

from dart_skill.recording.imports import read_recording
from dart_skill.session import clock_offset


@lru_cache(maxsize=1)
def recorded():
    return read_recording("bags/demonstrations")


def found(late=0, drift=0.0, step=0, turn=None, joints=slice(None)):
    """The offset of joints that are late [ns], run faster by a share, or were set anew by so much after 30 s [ns]."""
    hand, arm = recorded().bodies["hand"], recorded().joints
    since = arm.stamp_ns - arm.stamp_ns[0]
    stamps = arm.stamp_ns + late + np.rint(drift * since).astype(np.int64) + np.where(since > 30_000_000_000, step, 0)
    position = hand.position if turn is None else hand.position @ turn
    return clock_offset(hand.stamp_ns, position, stamps[joints], arm.position[joints])


@pytest.mark.parametrize("late", [0, 100_000_000, -2_300_000_000, 3600_000_000_000, 1_764_000_000_000_000_000])
def test_a_constant_offset_is_found_to_a_millisecond_however_large_it_is(late):
    offset = found(late)
    assert abs(offset.shift_ns + late) < 1_000_000, offset
    assert offset.correlation > 0.99 and offset.drift == 0.0 and offset.is_steady


@pytest.mark.parametrize("drift", [1e-3, -2e-4])
def test_a_drift_is_told_from_an_offset(drift):
    offset = found(1_000_000_000, drift)
    assert offset.drift == pytest.approx(-drift, rel=0.05), offset
    assert offset.correlation > 0.99 and offset.is_steady


def test_a_clock_that_was_set_anew_is_no_steady_offset():
    offset = found(step=200_000_000)
    assert not offset.is_steady and offset.correlation < 0.95, offset


def test_neither_axes_nor_unit_nor_rate_matter():
    turned = 1000.0 * np.eye(3)[:, [0, 2, 1]]
    offset = found(50_000_000, turn=turned, joints=slice(0, None, 10))
    assert abs(offset.shift_ns + 50_000_000) < 2_000_000, offset
    assert offset.correlation > 0.98


def test_an_arm_that_never_moves_tells_no_offset():
    hand, arm = recorded().bodies["hand"], recorded().joints
    assert clock_offset(hand.stamp_ns, hand.position, arm.stamp_ns, np.zeros_like(arm.position)) is None
    assert clock_offset(hand.stamp_ns[:3], hand.position[:3], arm.stamp_ns, arm.position) is None
