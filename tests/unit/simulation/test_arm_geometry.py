"""The arm from the joints of its URDF against the controller's model, from the DH table by Pinocchio."""

import numpy as np
import pytest

from dart_skill.robot import ArmModel, wam_description
from dart_skill.simulation import ArmGeometry
from tests.interpreted import interpreted


def postures(n):
    return np.random.default_rng(0).uniform(-3.0, 3.0, size=(n, 7))


@pytest.mark.parametrize("base_turn", [0.0, 0.4])
def test_capsules_are_where_the_model_of_the_arm_has_them(base_turn):
    arm, model = ArmGeometry(), ArmModel()
    for q in postures(20):
        (ends, radii), (expected, thick) = arm.capsules(q, base_turn), model.link_capsules(q, base_turn)
        np.testing.assert_allclose(ends, expected, atol=1e-13)
        np.testing.assert_array_equal(radii, thick)
    assert len(radii) == len(wam_description().capsules)


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
        np.testing.assert_allclose(arm.in_joints(q, wrench), model.jacobian(q).T @ wrench, atol=1e-13)
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


def test_compiled_and_interpreted_have_the_same_bits():
    plain = interpreted("dart_skill.simulation._arm_geometry")
    for q in postures(20):
        ours, theirs = ArmGeometry(), plain.ArmGeometry()
        np.testing.assert_array_equal(ours.capsules(q, 0.2)[0], theirs.capsules(q, 0.2)[0])
        np.testing.assert_array_equal(ours.in_joints(q, q[1:]), theirs.in_joints(q, q[1:]))
