"""The manifold R^n x S3 against scipy's rotations, closed forms, and the laws of a Riemannian
manifold.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.common.quaternions import product
from dart_skill.movement.pose import (
    angles_between,
    exponential,
    logarithm,
    mean_point,
    parallel_transport,
)
from tests.unit.movement.pose.random_poses import apart, flipped, near, orientations, turned


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.fixture
def points(rng):
    return np.column_stack([rng.normal(size=(300, 3)), orientations(300, rng)])


def test_exponential_and_logarithm_are_those_of_scipy(points, rng):
    base, tangent = (
        points[0],
        np.column_stack([rng.normal(size=(300, 3)), rng.normal(0.0, 2.0, (300, 3))]),
    )
    ends = exponential(base, tangent)
    wanted = Rotation.from_rotvec(tangent[:, 3:]) * Rotation.from_quat(base[3:])
    assert apart(ends, wanted.as_quat()) < 1e-14
    np.testing.assert_allclose(ends[:, :3], base[:3] + tangent[:, :3])
    ways = logarithm(base, points)
    np.testing.assert_allclose(
        ways[:, 3:],
        (Rotation.from_quat(points[:, 3:]) * Rotation.from_quat(base[3:]).inv()).as_rotvec(),
        atol=1e-13,
    )
    np.testing.assert_allclose(ways[:, :3], points[:, :3] - base[:3])


def test_both_signs_of_a_quaternion_are_one_orientation(points, rng):
    others = points[rng.permutation(300)]
    np.testing.assert_allclose(
        logarithm(flipped(points, rng), flipped(others, rng)),
        logarithm(points, others),
        atol=1e-14,
    )
    assert apart(mean_point(flipped(points[:20], rng)), mean_point(points[:20])) < 1e-13


def test_half_a_turn_has_one_logarithm_for_both_signs(points):
    """There both ways are equally short; rounding must not choose between them."""
    ends = exponential(points, np.tile([0.0, 0.0, 0.0, np.pi * 0.6, -np.pi * 0.8, 0.0], (300, 1)))
    ways = logarithm(points, ends)
    np.testing.assert_allclose(
        np.abs(ways[:, 3:]), np.tile([np.pi * 0.6, np.pi * 0.8, 0.0], (300, 1)), atol=1e-13
    )
    ends[:, 3:] *= -1.0
    np.testing.assert_allclose(logarithm(points, ends), ways, atol=1e-13)


def test_a_turn_of_the_world_turns_tangent_vectors(points, rng):
    rotation = Rotation.random(random_state=3)
    ways = logarithm(points[:150], points[150:])
    np.testing.assert_allclose(
        logarithm(turned(points[:150], rotation), turned(points[150:], rotation))[:, 3:],
        rotation.apply(ways[:, 3:]),
        atol=1e-13,
    )


def test_transport_is_that_of_the_sphere_in_four_dimensions(points, rng):
    """On S3 in R^4: v - (u.v / |u|^2) (u + u'), with u and u' the logarithms at both ends (Absil,
    Mahony and Sepulchre 2008).
    """
    start, end = points[:100, 3:], points[100:200, 3:]
    end = np.where((start * end).sum(1, keepdims=True) < 0, -end, end)
    vectors = rng.normal(size=(100, 3))
    flat = 0.5 * product(np.column_stack([vectors, np.zeros(100)]), start)

    def log(base, point):
        away = point - (base * point).sum(1, keepdims=True) * base
        return (
            away
            / np.linalg.norm(away, axis=1, keepdims=True)
            * np.arccos((base * point).sum(1, keepdims=True))
        )

    u, back = log(start, end), log(end, start)
    carried = flat - (u * flat).sum(1, keepdims=True) / np.square(u).sum(1, keepdims=True) * (
        u + back
    )
    found = 0.5 * product(
        np.column_stack([parallel_transport(start, end, vectors), np.zeros(100)]), end
    )
    np.testing.assert_allclose(found, carried, atol=1e-13)


def test_tangent_vectors_to_all_points_sum_to_zero_at_their_mean(rng):
    cloud = np.column_stack(
        [rng.normal(size=(60, 2)), near(orientations(1, rng)[0], 0.6, 60, rng)]
    )
    weights = rng.uniform(0.0, 1.0, 60)
    np.testing.assert_allclose(
        weights @ logarithm(mean_point(cloud, weights), cloud), np.zeros(5), atol=1e-12
    )


def test_mean_of_two_is_in_the_middle_of_the_shorter_way():
    two = Rotation.from_rotvec([[0.0, 0.0, 1.4], [0.0, 0.0, -1.6]]).as_quat()
    assert apart(mean_point(two), Rotation.from_rotvec([0.0, 0.0, -0.1]).as_quat()) < 1e-14
    assert (
        apart(mean_point(two, [3.0, 1.0]), Rotation.from_rotvec([0.0, 0.0, 0.65]).as_quat())
        < 1e-14
    )
    across = Rotation.from_rotvec([[0.0, 0.0, 3.0], [0.0, 0.0, -3.0]]).as_quat()
    assert apart(mean_point(across), Rotation.from_rotvec([0.0, 0.0, np.pi]).as_quat()) < 1e-14


def test_angles_between_orientations(points):
    wanted = (
        Rotation.from_quat(points[:150, 3:]) * Rotation.from_quat(points[150:, 3:]).inv()
    ).magnitude()
    np.testing.assert_allclose(angles_between(points[:150], points[150:]), wanted, atol=1e-13)


POINT = [0.0, 0.0, 0.0, 1.0]
WRONG = {
    "holds nan at index": lambda: logarithm([np.nan, 0.0, 0.0, 1.0], POINT),
    "base: the quaternion has length 0;": lambda: logarithm(np.zeros(4), POINT),
    r"points: the quaternion at index \(1,\) has length 2;": lambda: logarithm(
        POINT, [POINT, [0.0, 0.0, 0.0, 2.0]]
    ),
    "must have at least four columns": lambda: exponential([0.0, 0.0, 1.0], [0.0, 0.0]),
    "tangent must have 3 columns": lambda: exponential(POINT, np.zeros(4)),
    "others must have 4 columns": lambda: angles_between(POINT, [0.0, *POINT]),
    "points must have 2 dimension": lambda: mean_point(POINT),
    r"got shape \(0, 4\)": lambda: mean_point(np.empty((0, 4))),
    "weights are all zero": lambda: mean_point([POINT], [0.0]),
    "no mean is unique": lambda: mean_point(
        Rotation.from_euler("z", [[0.0], [180.0]], degrees=True).as_quat()
    ),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_wrong_is_named(message):
    with pytest.raises(ValueError, match=message):
        WRONG[message]()
