"""Task frames: there and back, the named frames of thesis chapter 8, and features relative to an
azimuth.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dart_skill.movement import (
    TaskFrame,
    azimuth_frame,
    azimuth_of,
    azimuth_target_frame,
    base_frame,
    features,
    pointing_angles,
    pointing_at,
    quaternions_from_angles,
    start_frame,
    target_frame,
    turn_about_z,
)

TARGET = np.array([1.2, 1.6, 0.5])


@given(seed=st.integers(0, 10_000), n_dims=st.integers(1, 7))
@settings(max_examples=30, deadline=None)
def test_to_and_from_a_frame_are_inverse(seed, n_dims):
    rng = np.random.default_rng(seed)
    frame = TaskFrame(
        rng.normal(size=(n_dims, n_dims)) + 3 * np.eye(n_dims), rng.normal(size=n_dims)
    )
    points = rng.normal(size=(5, n_dims))
    np.testing.assert_allclose(frame.to_frame(frame.from_frame(points)), points, atol=1e-9)
    np.testing.assert_allclose(frame.from_frame(np.zeros((1, n_dims)))[0], frame.b)


def test_base_frame_is_the_identity():
    frame = base_frame()
    np.testing.assert_array_equal(frame.A, np.eye(6))
    np.testing.assert_array_equal(frame.b, np.zeros(6))


def test_start_frame_moves_positions_only():
    frame = start_frame([0.1, 0.2, 0.3])
    np.testing.assert_array_equal(frame.A, np.eye(6))
    np.testing.assert_array_equal(frame.b, [0, 0.1, 0.2, 0.3, 0, 0])


def test_target_frame_has_its_first_axis_towards_the_target_and_its_second_horizontal():
    frame = target_frame(TARGET, pointing=(0.4, 0.1))
    axes = frame.A[1:4, 1:4]
    np.testing.assert_allclose(axes[:, 0], TARGET / np.linalg.norm(TARGET), atol=1e-15)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes[2, 1] == 0.0
    np.testing.assert_array_equal(frame.b, [0, *TARGET, 0.4, 0.1])
    np.testing.assert_array_equal(frame.A[[0, 4, 5]], np.eye(6)[[0, 4, 5]])


def test_target_frame_turns_continuously_with_the_target():
    azimuths = np.radians(np.arange(-180, 180))
    frames = [target_frame([2 * np.cos(a), 2 * np.sin(a), 0.3]).A for a in azimuths]
    steps = np.abs(np.diff(frames, axis=0)).max(axis=(1, 2))
    assert steps.max() < 1.1 * np.radians(1), np.degrees(steps.max())


def test_frames_without_angles_are_those_of_the_dart_board():
    assert base_frame(n_angles=0).n_dims == target_frame(TARGET, pointing=()).n_dims == 4


def test_azimuth_frame_sees_the_target_on_its_x_axis():
    frame = azimuth_frame(azimuth_of(TARGET))
    seen = frame.to_frame([[0.3, *TARGET, 0.7, 0.1]])[0]
    np.testing.assert_allclose(seen, [0.3, 2.0, 0.0, 0.5, 0.7, 0.1], atol=1e-12)


def test_azimuth_target_frame_has_the_axes_of_the_azimuth_frame_at_the_target():
    one, other = azimuth_target_frame(TARGET), azimuth_frame(azimuth_of(TARGET))
    np.testing.assert_array_equal(one.A, other.A)
    np.testing.assert_array_equal(one.b, [0, *TARGET, 0, 0])


def test_a_frame_elsewhere_has_the_same_axes_there():
    frame, origin = azimuth_frame(0.4), np.arange(6.0)
    there = frame.at(origin)
    np.testing.assert_array_equal(there.A, frame.A)
    np.testing.assert_array_equal(there.from_frame(np.zeros((1, 6)))[0], origin)
    with pytest.raises(ValueError, match="origin must have length 6"):
        frame.at(np.zeros(5))


def test_a_turned_throw_is_the_same_throw_in_its_azimuth_frame():
    rng = np.random.default_rng(0)
    time = np.linspace(0, 1, 30)
    positions = rng.normal(size=(30, 3))
    angles = np.column_stack([np.linspace(3.5, 0.5, 30), 0.3 * np.sin(time), 0.2 * time])
    quaternions = quaternions_from_angles(angles)
    plain = azimuth_frame(0.0).to_frame(features(time, positions, quaternions))
    for azimuth in np.radians([-120, 10, 75]):
        turned = features(
            time,
            Rotation.from_euler("z", azimuth).apply(positions),
            turn_about_z(quaternions, azimuth),
            azimuth=azimuth,
        )
        np.testing.assert_allclose(azimuth_frame(azimuth).to_frame(turned), plain, atol=1e-12)
    np.testing.assert_allclose(plain[:, 4:], angles[:, :2], atol=1e-12)


def test_pointing_at_gives_the_direction_from_hand_to_target():
    position = np.array([0.2, -0.1, 1.5])
    np.testing.assert_allclose(
        pointing_at(TARGET, position), pointing_angles([TARGET - position])[0], atol=1e-12
    )
    in_plane = pointing_at(TARGET, [0, 0, 0], azimuth=azimuth_of(TARGET))
    np.testing.assert_allclose(in_plane, [np.arctan2(0.5, 2.0), 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: TaskFrame(np.ones((2, 3)), [0, 0]), "square"),
        (lambda: TaskFrame(np.ones((2, 2)), [0, 0]), "not invertible"),
        (lambda: TaskFrame(np.zeros((2, 2)), [0, 0]), "not invertible"),
        (lambda: TaskFrame(np.eye(2), [0, 0, 0]), "length 2"),
        (lambda: TaskFrame(np.eye(2), [0, np.nan]), "nan"),
        (lambda: base_frame().to_frame(np.zeros((3, 4))), "6 columns"),
        (lambda: target_frame([0.0, 0.0, 1.0]), "no azimuth"),
        (lambda: azimuth_frame(np.inf), "inf"),
        (lambda: base_frame(n_angles=-1), "at least 0"),
        (
            lambda: features([0, 1.0], np.zeros((2, 3)), np.ones((3, 4))),
            "one quaternion per position",
        ),
    ],
)
def test_unusable_frames_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_frame_in_mixed_units_is_invertible():
    frame = TaskFrame(np.diag([1.0, 1e-9, 1e6]), np.zeros(3))
    np.testing.assert_allclose(frame.to_frame([[1.0, 1.0, 1.0]]), [[1.0, 1e9, 1e-6]])
