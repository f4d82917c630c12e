"""Rotations of a whole recording, beside SciPy's and NumPy's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.common import rotations
from tests.interpreted import interpreted


@pytest.fixture
def quaternions():
    given = np.random.default_rng(0).standard_normal((40, 4))
    return given / np.linalg.norm(given, axis=1, keepdims=True)


def test_vectors_are_turned_as_by_scipy(quaternions):
    vectors = np.random.default_rng(1).standard_normal((40, 3))
    turns = Rotation.from_quat(quaternions)
    np.testing.assert_allclose(
        rotations.turned(quaternions, vectors), turns.apply(vectors), atol=1e-14
    )
    np.testing.assert_allclose(
        rotations.turned(quaternions, vectors[:1]), turns.apply(vectors[0]), atol=1e-14
    )
    np.testing.assert_allclose(
        rotations.turned(quaternions[:1], vectors), turns[0].apply(vectors), atol=1e-14
    )


def test_quaternions_are_scaled_and_the_shortest_is_told(quaternions):
    lengths, unit = np.random.default_rng(2).uniform(0.5, 2.0, 40), np.empty((40, 4))
    assert rotations.least_length(quaternions * lengths[:, None], unit) == pytest.approx(
        lengths.min()
    )
    np.testing.assert_allclose(unit, quaternions, atol=1e-14)
    assert rotations.least_length(np.zeros((1, 4)), unit) == 0.0


def test_angles_are_those_of_the_rotation_they_make_up(quaternions):
    """R = R_y(-alpha) R_z(beta) R_x(roll) R_y(90 degrees), 8.4.1."""
    angles = rotations.hand_angles(quaternions)
    made = Rotation.from_euler("YZX", angles * [-1.0, 1.0, 1.0]) * Rotation.from_euler(
        "Y", np.pi / 2
    )
    np.testing.assert_allclose(
        made.as_matrix(), Rotation.from_quat(quaternions).as_matrix(), atol=1e-12
    )
    assert np.abs(angles).max() <= np.pi


def test_quaternions_of_angles_are_those_whose_angles_these_are():
    angles = np.cumsum(np.random.default_rng(4).uniform(-0.4, 0.4, (60, 3)), axis=0) * [
        1.0,
        0.2,
        1.0,
    ]
    found = rotations.of_hand_angles(angles)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-14)
    assert (np.einsum("ni,ni->n", found[1:], found[:-1]) > 0.0).all()
    np.testing.assert_allclose(
        np.exp(1j * rotations.hand_angles(found)), np.exp(1j * angles), atol=1e-12
    )


@pytest.mark.parametrize("turns", [-3, 0, 2])
def test_jumps_are_taken_out_as_by_numpy(turns):
    smooth = np.cumsum(np.random.default_rng(3).uniform(-2.5, 2.5, 200))
    wrapped = np.angle(np.exp(1j * smooth))
    rotations.unwrap(wrapped, smooth[0] + 2.0 * np.pi * turns)
    np.testing.assert_allclose(wrapped, smooth + 2.0 * np.pi * turns, atol=1e-9)
    np.testing.assert_allclose(
        np.diff(wrapped), np.diff(np.unwrap(np.angle(np.exp(1j * smooth)))), atol=1e-9
    )


def test_quaternions_of_matrices_have_the_same_rotation(quaternions):
    half_turns = np.concatenate(
        [np.eye(4), np.sqrt(0.5) * np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 1.0]])]
    )
    for given in (quaternions, half_turns):
        found = rotations.of_matrices(Rotation.from_quat(given).as_matrix())
        np.testing.assert_allclose(np.abs(np.einsum("ni,ni->n", found, given)), 1.0, atol=1e-14)
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-15)


def test_one_rotation_is_written_as_a_vector_a_quaternion_or_a_matrix(quaternions):
    vector, quaternion, matrix = np.empty(3), np.empty(4), np.empty((3, 3))
    for k, turn in enumerate(Rotation.from_quat(quaternions)):
        rotations.vector_into(quaternions[k], vector)
        np.testing.assert_allclose(vector, turn.as_rotvec(), atol=1e-14)
        rotations.quaternion_into(vector, quaternion)
        np.testing.assert_allclose(np.abs(quaternion @ quaternions[k]), 1.0, atol=1e-14)
        rotations.matrix_into(quaternions[k], matrix)
        np.testing.assert_allclose(matrix, turn.as_matrix(), atol=1e-14)
        rotations.product_into(quaternions[k], quaternions[0], quaternion)
        np.testing.assert_allclose(
            quaternion, (turn * Rotation.from_quat(quaternions[0])).as_quat(), atol=1e-14
        )
    rotations.quaternion_into(np.zeros(3), quaternion)
    np.testing.assert_array_equal(quaternion, [0.0, 0.0, 0.0, 1.0])
    rotations.vector_into(quaternion, vector)
    np.testing.assert_array_equal(vector, 0.0)


def test_compiled_and_interpreted_have_the_same_bits(quaternions):
    def all_of(module):
        yield module.turned(quaternions, quaternions[:, :3])
        yield module.of_hand_angles(quaternions[:, :3])
        yield module.of_matrices(Rotation.from_quat(quaternions).as_matrix())
        angles = module.hand_angles(quaternions)
        yield angles.copy()
        module.unwrap(angles[:, 2], 7.0)
        yield angles
        vector, quaternion, matrix = np.empty(3), np.empty(4), np.empty((3, 3))
        module.vector_into(quaternions[3], vector)
        module.quaternion_into(vector, quaternion)
        module.matrix_into(quaternions[5], matrix)
        yield from (vector, quaternion.copy(), matrix)
        module.product_into(quaternions[1], quaternions[2], quaternion)
        yield quaternion
        unit = np.empty((40, 4))
        yield module.least_length(3.0 * quaternions, unit)
        yield unit

    for ours, plain in zip(
        all_of(rotations), all_of(interpreted("dart_skill.common.rotations")), strict=True
    ):
        np.testing.assert_array_equal(ours, plain)
