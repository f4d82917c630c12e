"""Quaternions against SciPy's rotations and closed forms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.common.quaternions import (
    CONJUGATE,
    from_vectors,
    matrices,
    of_matrices,
    product,
    rotate,
    to_vectors,
    unit,
)
from tests.unit.movement.pose.random_poses import apart, orientations


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.fixture
def left(rng):
    return orientations(150, rng)


@pytest.fixture
def right(rng):
    return orientations(150, rng)


@pytest.fixture
def vectors(rng):
    return rng.normal(size=(150, 3))


def test_products_are_those_of_scipy(left, right):
    assert (
        apart(
            product(left, right), (Rotation.from_quat(left) * Rotation.from_quat(right)).as_quat()
        )
        < 1e-14
    )
    np.testing.assert_allclose(unit(3.0 * left), left, atol=1e-15)
    np.testing.assert_allclose(
        product(left, left * CONJUGATE), np.tile([0.0, 0.0, 0.0, 1.0], (150, 1)), atol=1e-15
    )


def test_rotated_vectors_and_matrices_are_those_of_scipy(left, vectors):
    wanted = Rotation.from_quat(left)
    np.testing.assert_allclose(rotate(left, vectors), wanted.apply(vectors), atol=1e-14)
    np.testing.assert_allclose(matrices(left), wanted.as_matrix(), atol=1e-14)


def test_quaternions_of_matrices_have_the_same_rotation(left):
    half_turns = np.concatenate([np.eye(4), np.sqrt(0.5) * np.array([[1.0, 1.0, 0.0, 0.0]])])
    for given in (left, half_turns):
        found = of_matrices(matrices(given))
        np.testing.assert_allclose(np.abs(np.einsum("ni,ni->n", found, given)), 1.0, atol=1e-14)
        assert (found.max(axis=1) == np.abs(found).max(axis=1)).all()


def test_leading_shapes_are_broadcast_to_the_same_bits(left, right, vectors):
    many, one = left.reshape(3, 50, 4), right[0]
    assert (product(many, one)[1, 7] == product(left[57], one)).all() and (
        product(one, many)[1, 7] == product(one, left[57])
    ).all()
    assert (rotate(many, vectors[0])[1, 7] == rotate(left[57], vectors[0])).all()
    assert (rotate(one, vectors)[57] == rotate(one, vectors[57])).all()
    assert (matrices(many)[1, 7] == matrices(left[57])).all()
    assert (from_vectors(vectors.reshape(3, 50, 3))[1, 7] == from_vectors(vectors[57])).all()
    assert (to_vectors(many)[1, 7] == to_vectors(left[57])).all()


def test_rotation_vectors_are_those_of_scipy(left, vectors):
    np.testing.assert_allclose(
        from_vectors(vectors), Rotation.from_rotvec(vectors).as_quat(), atol=1e-15
    )
    np.testing.assert_allclose(to_vectors(left), Rotation.from_quat(left).as_rotvec(), atol=1e-13)


@pytest.mark.parametrize(
    "angle", [0.0, 1e-300, 1e-16, 1e-9, 1e-5, 0.1, np.pi / 2, np.pi - 1e-9, np.pi]
)
def test_a_vector_comes_back_from_its_quaternion_up_to_half_a_turn(angle):
    vector = angle * np.array([0.6, 0.0, 0.8])
    np.testing.assert_allclose(to_vectors(from_vectors(vector)), vector, rtol=1e-14, atol=1e-15)


def test_beyond_half_a_turn_the_other_way_is_shorter():
    vector = np.array([0.0, 0.0, np.radians(200.0)])
    np.testing.assert_allclose(
        to_vectors(from_vectors(vector)), [0.0, 0.0, np.radians(-160.0)], atol=1e-14
    )
