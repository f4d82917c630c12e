"""The arm from the joints of its URDF against the controller's model, from the DH table by
Pinocchio.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmModel, the_arm
from dart_skill.simulation import ArmDynamics, ArmGeometry, connect
from tests.interpreted import interpreted


def postures(n):
    return np.random.default_rng(0).uniform(-3.0, 3.0, size=(n, 7))


def test_capsules_turn_with_the_base():
    arm, turn = ArmGeometry(), Rotation.from_rotvec([0.0, 0.0, 0.4])
    for q in postures(5):
        ends = arm.capsules(q)[0].copy()
        np.testing.assert_allclose(arm.capsules(q, 0.4)[0], ends @ turn.as_matrix().T, atol=1e-13)


def test_another_posture_does_not_change_what_was_said_before():
    arm = ArmGeometry()
    first, second = postures(2)
    ends, kept = arm.capsules(first)[0], arm.capsules(first)[0].copy()
    arm.capsules(second, 0.3)
    np.testing.assert_array_equal(ends, kept)


def test_a_wrench_in_the_joints_is_that_of_the_transposed_jacobian():
    arm, model, rng = ArmGeometry(), ArmModel(), np.random.default_rng(1)
    for q in postures(20):
        wrench = rng.normal(size=6)
        np.testing.assert_allclose(
            arm.in_joints(q, wrench), model.jacobian(q).T @ wrench, atol=1e-13
        )
    force_alone = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(arm.in_joints(q, force_alone), model.jacobian(q)[2], atol=1e-13)
    assert arm.in_joints(q, np.zeros(6)) is None


def test_the_arm_cannot_reach_the_floor():
    """The plant lets PyBullet not look for contacts between them."""
    lower, upper = (the_arm().of_joints(end) for end in ("lower", "upper"))
    arm, lowest = ArmGeometry(), np.inf
    for q in np.random.default_rng(2).uniform(lower, upper, size=(5000, 7)):
        ends, radii = arm.capsules(q)
        lowest = min(lowest, (ends[:, :, 2] - radii[:, None]).min())
    assert lowest > 0.3


def test_angles_of_another_number_are_refused():
    with pytest.raises(ValueError, match="give 7 joint angles"):
        ArmGeometry().capsules(np.zeros(6))


def motions(n):
    """Angles and speeds."""
    rng = np.random.default_rng(3)
    return zip(postures(n), rng.uniform(-3.0, 3.0, size=(n, 7)), strict=True)


@pytest.fixture
def server():
    client = connect()
    client.setGravity(0, 0, -the_arm().gravity)
    yield client
    client.disconnect()


@pytest.mark.parametrize("ball_in_hand", [False, True])
def test_dynamics_are_those_of_the_controllers_model_from_other_frames(server, ball_in_hand):
    """PyBullet turns inertias to principal axes, which costs it some digits."""
    arm = ArmDynamics(server, the_arm(), ball_in_hand)
    model = ArmModel(ball_in_hand=ball_in_hand)
    for q, qd in motions(20):
        gravity = arm.gravity_torque(q)
        inertia, bias = arm.terms(q, qd)
        np.testing.assert_allclose(inertia, model.mass_matrix(q, rotors=False), atol=1e-8)
        np.testing.assert_allclose(gravity, model.gravity_torque(q), atol=1e-7)
        np.testing.assert_allclose(bias, gravity + model.coriolis_torque(q, qd), atol=1e-7)


def test_compiled_and_interpreted_have_the_same_bits():
    ours, theirs = ArmGeometry(), interpreted("dart_skill.simulation._arm_geometry").ArmGeometry()
    for q in postures(20):
        np.testing.assert_array_equal(ours.capsules(q, 0.2)[0], theirs.capsules(q, 0.2)[0])
        np.testing.assert_array_equal(ours.in_joints(q, q[1:]), theirs.in_joints(q, q[1:]))
