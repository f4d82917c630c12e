"""Hand orientation as alpha, beta, roll, and quaternion algebra, against scipy and closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dart_skill.movement import (
    angles_from_quaternions,
    angular_velocity,
    multiply,
    pointing_angles,
    quaternions_from_angles,
    rotate,
    turn_about_z,
)


def pointing_directions(angles):
    """Unit vectors (n, 3) along alpha and beta."""
    alpha, beta = np.transpose(angles)[:2]
    return np.stack(
        [np.cos(beta) * np.cos(alpha), np.sin(beta), np.cos(beta) * np.sin(alpha)], axis=1
    )


def random_quaternions(seed, n=20):
    quaternions = np.random.default_rng(seed).normal(size=(n, 4))
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def same_rotation(one, other):
    return np.abs(np.abs(np.einsum("ni,ni->n", one, other)) - 1.0).max()


@given(alpha=st.floats(-1.5, 4.7), beta=st.floats(-1.5, 1.5), roll=st.floats(-3.1, 3.1))
@settings(max_examples=100, deadline=None)
def test_angles_survive_the_way_through_quaternions(alpha, beta, roll):
    angles = np.array([[alpha, beta, roll]])
    np.testing.assert_allclose(
        angles_from_quaternions(quaternions_from_angles(angles)), angles, atol=1e-9
    )


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_orientations_survive_the_way_through_angles(seed):
    quaternions = random_quaternions(seed, 1)
    assert (
        same_rotation(quaternions_from_angles(angles_from_quaternions(quaternions)), quaternions)
        < 1e-12
    )


def test_the_hand_points_along_the_direction_of_the_angles():
    angles = np.random.default_rng(0).uniform([-1, -1.4, -3], [4, 1.4, 3], (50, 3))
    hand_z = rotate(quaternions_from_angles(angles), [[0.0, 0.0, 1.0]])
    np.testing.assert_allclose(hand_z, pointing_directions(angles), atol=1e-12)


def test_roll_turns_the_hand_about_the_pointing_direction():
    base, rolled = (
        quaternions_from_angles([[0.4, 0.3, 0.1]]),
        quaternions_from_angles([[0.4, 0.3, 0.8]]),
    )
    turn = Rotation.from_quat(rolled[0]) * Rotation.from_quat(base[0]).inv()
    np.testing.assert_allclose(
        turn.as_rotvec(), 0.7 * pointing_directions([[0.4, 0.3]])[0], atol=1e-12
    )


def test_a_throw_from_behind_the_shoulder_has_no_jump_whatever_the_signs_of_the_quaternions():
    time = np.linspace(0, 1, 200)
    angles = np.column_stack(
        [np.radians(250 - 280 * time), 0.4 * np.sin(9 * time), 3.0 + 2.0 * time - 3.0 * time**2]
    )
    signs = np.random.default_rng(1).choice([-1.0, 1.0], (200, 1))
    found = angles_from_quaternions(signs * quaternions_from_angles(angles))
    np.testing.assert_allclose(found, angles, atol=1e-9)


def test_the_first_angle_is_taken_from_the_branch_asked_for():
    quaternions = quaternions_from_angles([[0.2, 0.0, 3.0]])
    angles = angles_from_quaternions(quaternions, alpha_near=2 * np.pi, roll_near=-np.pi)
    np.testing.assert_allclose(angles, [[0.2 + 2 * np.pi, 0.0, 3.0 - 2 * np.pi]], atol=1e-9)


def test_quaternions_of_a_sequence_are_unit_and_in_one_hemisphere():
    angles = np.column_stack([np.linspace(0, 20, 300), np.full(300, 0.2), np.linspace(0, -9, 300)])
    quaternions = quaternions_from_angles(angles)
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=1e-14)
    assert np.einsum("ni,ni->n", quaternions[1:], quaternions[:-1]).min() > 0.99


def test_turning_the_task_about_z_leaves_the_angles_of_a_turned_hand():
    angles = np.random.default_rng(2).uniform([0, -1, -1], [2.5, 1, 1], (20, 3))
    in_task = quaternions_from_angles(angles)
    in_world = turn_about_z(in_task, 0.7)
    expected = Rotation.from_euler("z", 0.7).apply(pointing_directions(angles))
    np.testing.assert_allclose(rotate(in_world, [[0, 0, 1.0]]), expected, atol=1e-12)
    assert same_rotation(turn_about_z(in_world, -0.7), in_task) < 1e-12


def test_pointing_angles_invert_pointing_directions():
    angles = np.random.default_rng(3).uniform([-3.1, -1.5], [3.1, 1.5], (40, 2))
    np.testing.assert_allclose(
        pointing_angles(7.0 * pointing_directions(angles)), angles, atol=1e-12
    )


def test_products_agree_with_scipy():
    left, right = random_quaternions(4), random_quaternions(5)
    expected = (Rotation.from_quat(left) * Rotation.from_quat(right)).as_quat()
    assert same_rotation(multiply(left, right), expected) < 1e-12


def test_angular_velocity_of_a_constant_turn_is_exact_at_irregular_stamps():
    rate = np.array([0.5, -2.0, 3.0])
    time = np.sort(np.random.default_rng(6).uniform(0, 2, 40))
    turn = Rotation.from_rotvec(time[:, None] * rate) * Rotation.from_euler(
        "xyz", [0.3, 1.0, -2.0]
    )
    signs = np.random.default_rng(7).choice([-1.0, 1.0], (40, 1))
    np.testing.assert_allclose(
        angular_velocity(time, signs * turn.as_quat()), np.tile(rate, (40, 1)), atol=1e-8
    )
    np.testing.assert_allclose(
        angular_velocity(time[:2], turn.as_quat()[:2]), [rate, rate], atol=1e-8
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: angles_from_quaternions([[0, 0, 0, 0.0]]), "length 0"),
        (lambda: angles_from_quaternions([[0, 0, np.nan, 1.0]]), "nan"),
        (lambda: angles_from_quaternions(np.zeros((3, 3))), "4 columns"),
        (lambda: quaternions_from_angles(np.zeros((3, 2))), "3 columns"),
        (lambda: multiply(np.ones((2, 4)), np.ones((3, 4))), "2 quaternions by 3"),
        (lambda: pointing_angles([[0, 0, 0.0]]), "points nowhere"),
        (lambda: angular_velocity([0, 0.0], np.ones((2, 4))), "must increase"),
        (lambda: angular_velocity([0.0], np.ones((1, 4))), "at least 2"),
    ],
)
def test_unusable_orientations_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_quaternions_of_angles_are_the_product_of_the_four_turns():
    angles = np.random.default_rng(8).uniform(-3.0, 3.0, (50, 3))
    alpha, beta, roll = angles.T[:, :, None]
    quarter = Rotation.from_euler("y", np.pi / 2)
    expected = (
        Rotation.from_euler("y", -alpha)
        * Rotation.from_euler("z", beta)
        * Rotation.from_euler("x", roll)
        * quarter
    )
    assert (
        Rotation.from_quat(quaternions_from_angles(angles)) * expected.inv()
    ).magnitude().max() < 1e-14
