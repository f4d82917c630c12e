"""Orientations of a plan as SciPy works them out."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from dart_skill.robot._plan_turns import matrices, turns_between, unit


@pytest.fixture
def quaternions():
    """Small turns, turns of nearly nothing, and turns of any size, one after the other (n, 4); not of length 1."""
    rng = np.random.default_rng(0)
    steps = np.concatenate([0.01 * rng.normal(size=(200, 3)), 1e-6 * rng.normal(size=(50, 3)), rng.normal(size=(50, 3)), np.zeros((3, 3))])
    path = [Rotation.identity()]
    for step in steps:
        path.append(Rotation.from_rotvec(step) * path[-1])
    return rng.uniform(0.9, 1.1, (len(path), 1)) * np.array([one.as_quat() for one in path]) * rng.choice([-1.0, 1.0], (len(path), 1))


def test_lengths_matrices_and_turns_are_those_of_scipy(quaternions):
    theirs = Rotation.from_quat(quaternions)
    ours = unit(quaternions)
    assert_allclose(ours, theirs.as_quat(), rtol=0.0, atol=1e-15)
    assert_allclose(matrices(ours), theirs.as_matrix(), rtol=0.0, atol=1e-15)
    assert_allclose(turns_between(ours), (theirs[1:] * theirs[:-1].inv()).as_rotvec(), rtol=0.0, atol=1e-14)


def test_there_is_no_turn_between_equal_orientations():
    same = np.tile([0.5, -0.5, 0.5, 0.5], (4, 1))
    assert np.array_equal(turns_between(same), np.zeros((3, 3)))
