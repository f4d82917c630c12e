"""The arm as capsules, from the joints of the URDF, against the controller's model, from the DH table by Pinocchio."""

import numpy as np
import pytest

from dart_skill.robot import ArmModel, wam_description
from dart_skill.simulation import ArmShape
from tests.interpreted import interpreted


def postures(n):
    return np.random.default_rng(0).uniform(-3.0, 3.0, size=(n, 7))


@pytest.mark.parametrize("base_turn", [0.0, 0.4])
def test_capsules_are_where_the_model_of_the_arm_has_them(base_turn):
    shape, model = ArmShape(), ArmModel()
    for q in postures(20):
        (ends, radii), (expected, thick) = shape.capsules(q, base_turn), model.link_capsules(q, base_turn)
        np.testing.assert_allclose(ends, expected, atol=1e-13)
        np.testing.assert_array_equal(radii, thick)
    assert len(radii) == len(wam_description().capsules)


def test_another_posture_does_not_change_what_was_said_before():
    shape = ArmShape()
    first, second = postures(2)
    ends, kept = shape.capsules(first)[0], shape.capsules(first)[0].copy()
    shape.capsules(second, 0.3)
    np.testing.assert_array_equal(ends, kept)


def test_angles_of_another_number_are_refused():
    with pytest.raises(ValueError, match="give 7 joint angles"):
        ArmShape().capsules(np.zeros(6))


def test_compiled_and_interpreted_have_the_same_bits():
    plain = interpreted("dart_skill.simulation._arm_shape")
    for q in postures(20):
        np.testing.assert_array_equal(ArmShape().capsules(q, 0.2)[0], plain.ArmShape().capsules(q, 0.2)[0])
