"""Joints near the ends of their ranges: what they still do, and what the others take over."""

import numpy as np
import pytest

from dart_skill.arm import ArmModel, held_in_range, the_arm

STEP = 0.002
REPLACED = (0,)
"""Joints whose part the others can do alone near their ends, from the posture below."""
SWING = np.array([0.1, 0.2, -0.1, 0.9, 0.3, 0.5, 0.2])


@pytest.fixture(scope="module")
def model():
    return ArmModel()


@pytest.fixture(scope="module")
def ends():
    return the_arm().ends


def test_in_the_middle_of_the_ranges_nothing_is_changed(model, ends):
    qdd = np.random.default_rng(0).normal(0.0, 100.0, 7)
    q, qd = 0.5 * (ends[0] + ends[1]), np.full(7, 2.0)
    assert held_in_range(model, q, qd, qdd, STEP) is qdd


@pytest.mark.parametrize("joint", range(7))
def test_the_hand_goes_on_as_before_where_one_joint_is_held(model, ends, joint):
    """Seven joints, six directions of the hand: the arm's free motion gives way."""
    q, qd, qdd = SWING.copy(), np.zeros(7), np.zeros(7)
    q[joint], qdd[joint] = ends[1][joint] - 0.01, 50.0
    jacobian = model.jacobian(q)
    kept = held_in_range(model, q, qd, qdd, STEP)
    assert kept[joint] <= 0.0
    alone = np.where(np.arange(7) == joint, kept, qdd)
    if joint in REPLACED:
        np.testing.assert_allclose(jacobian @ kept, jacobian @ qdd, atol=1e-6)
    else:
        before, after = (np.linalg.norm(jacobian @ (one - qdd)) for one in (alone, kept))
        assert after < before, "the others do a part"


def test_no_joint_runs_into_its_end_however_it_is_driven(model, ends):
    """Of the two that touch the end first, as of all others."""
    rng = np.random.default_rng(1)
    for _ in range(5):
        q, qd = SWING.copy(), np.zeros(7)
        for k in range(400):
            if k % 50 == 0:
                drive = rng.normal(0.0, 60.0, 7)
            qdd = held_in_range(model, q, qd, drive, STEP)
            q, qd = q + STEP * qd + 0.5 * STEP**2 * qdd, qd + STEP * qdd
            assert np.all(q > ends[0]) and np.all(q < ends[1]), f"after {k} steps: {q}"
