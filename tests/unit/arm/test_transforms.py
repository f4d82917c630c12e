"""The transforms of the arm, chained, put every link where the analytic model has it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmModel, fixed_transforms, joint_transforms, the_arm


def test_the_chain_from_the_world_to_the_hand_is_forward_kinematics():
    arm, model, rng = the_arm(), ArmModel(), np.random.default_rng(0)
    base, mount = fixed_transforms(arm)
    for q in rng.uniform(-2.0, 2.0, size=(20, 7)):
        place, turn, frame = np.zeros(3), Rotation.identity(), "world"
        for step in (base, *joint_transforms(arm, q), mount):
            assert step.parent == frame
            place, turn, frame = (
                place + turn.apply(step.translation),
                turn * Rotation.from_quat(step.quaternion),
                step.child,
            )
        assert frame == "bhand_base"
        position, rotation = model.hand_pose(q)
        np.testing.assert_allclose(place, position, atol=1e-12)
        np.testing.assert_allclose(turn.as_matrix(), rotation, atol=1e-12)


@pytest.mark.parametrize("position", [np.zeros(6), np.full(7, np.nan), np.zeros((2, 7))])
def test_angles_of_another_arm_are_refused(position):
    with pytest.raises(ValueError, match="give 7 finite joint angles"):
        joint_transforms(the_arm(), position)
