"""The arm from the joints of its URDF against the controller's model, from the DH table by
Pinocchio.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import DART, ArmModel, wam_description, write_urdf
from dart_skill.simulation import ArmGeometry
from dart_skill.simulation._arm_geometry import ArmDynamics
from dart_skill.simulation._bullet import connect, pybullet
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
    lower, upper = (wam_description().of_joints(end) for end in ("lower", "upper"))
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


@pytest.mark.parametrize("ball_in_hand", [False, True])
def test_dynamics_are_those_of_the_controllers_model_from_other_frames(ball_in_hand):
    arm, model = ArmDynamics(ball_in_hand=ball_in_hand), ArmModel(ball_in_hand=ball_in_hand)
    for q, qd in motions(20):
        gravity = arm.gravity_torque(q).copy()
        inertia, bias = arm.terms(q, qd)
        np.testing.assert_allclose(inertia, model.mass_matrix(q, rotors=False), atol=1e-12)
        np.testing.assert_allclose(gravity, model.gravity_torque(q), atol=1e-11)
        np.testing.assert_allclose(bias, gravity + model.coriolis_torque(q, qd), atol=1e-11)


@pytest.mark.parametrize("ball", [None, wam_description().ball, DART])
def test_dynamics_are_those_of_pybullet(ball, tmp_path):
    """PyBullet turns inertias to principal axes, which costs it some digits."""
    description = replace(wam_description(), ball=ball or DART)
    (tmp_path / "arm.urdf").write_text(
        write_urdf(description, ball is not None, shapes=False), encoding="utf-8"
    )
    client, arm = connect(), ArmDynamics(description, ball is not None)
    client.setGravity(0, 0, -description.gravity)
    body = client.loadURDF(
        str(tmp_path / "arm.urdf"), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE
    )
    for q, qd in motions(20):
        inertia, bias = arm.terms(q, qd)
        np.testing.assert_allclose(
            inertia, client.calculateMassMatrix(body, q.tolist()), atol=1e-8
        )
        np.testing.assert_allclose(
            bias,
            client.calculateInverseDynamics(body, q.tolist(), qd.tolist(), [0.0] * 7),
            atol=1e-7,
        )
    client.disconnect()


def test_compiled_and_interpreted_have_the_same_bits():
    plain = interpreted("dart_skill.simulation._arm_geometry")
    for q in postures(20):
        ours, theirs = ArmGeometry(), plain.ArmGeometry()
        np.testing.assert_array_equal(ours.capsules(q, 0.2)[0], theirs.capsules(q, 0.2)[0])
        np.testing.assert_array_equal(ours.in_joints(q, q[1:]), theirs.in_joints(q, q[1:]))
    ours, theirs = ArmDynamics(ball_in_hand=True), plain.ArmDynamics(ball_in_hand=True)
    for q, qd in motions(5):
        np.testing.assert_array_equal(ours.gravity_torque(q), theirs.gravity_torque(q))
        for part, same_part in zip(ours.terms(q, qd), theirs.terms(q, qd), strict=True):
            np.testing.assert_array_equal(part, same_part)
