"""How the hand is pulled, by the law on the arm or on a model of it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import (
    ArmModel,
    ArmState,
    CommanderSettings,
    Guidance,
    HandPull,
    Impedance,
    JointServo,
    PoseGains,
    Reference,
    the_arm,
)
from dart_skill.common.constants import Grip

POSTURE = np.array([0.3, 0.5, 0.1, 1.9, -0.2, 0.5, 0.1])
GAINS = PoseGains.of((100.0, 20.0), (150.0, 25.0))
FORCE = np.array([0.3, -0.2, 0.5])
"""On the hand [N], small, so that what it moves is linear in it."""


def pull_by(tracking: str) -> HandPull:
    settings = CommanderSettings.configured(tracking=tracking)
    servo = JointServo(Impedance(ArmModel(), settings.friction_compensation))
    return HandPull(settings, the_arm(), servo)


def test_soft_joints_give_to_a_force_on_the_hand_what_the_compliance_says():
    """Joints that balance the torque of the force: by the forward kinematics."""
    model = ArmModel()
    torque = model.jacobian(POSTURE)[:3].T @ FORCE
    balanced = POSTURE + torque / the_arm().servo.following_stiffness
    moved = model.hand_pose(balanced)[0] - model.hand_pose(POSTURE)[0]
    compliance = pull_by("joints").yielding(POSTURE, GAINS, False).compliance
    np.testing.assert_allclose(compliance @ FORCE, moved, rtol=0.02, atol=2e-6)


@pytest.mark.parametrize(
    ("tracking", "touches"), [("hand", False), ("none", False), ("hand", True)]
)
def test_the_law_on_the_hand_balances_a_force_where_the_compliance_says(tracking, touches):
    """A hand that is held by the force at its own orientation, off its attractor by what the force
    moves it, is pulled with the opposite force.
    """
    pull, model, still = pull_by(tracking), ArmModel(ball_in_hand=touches), np.zeros(7)
    off = pull.yielding(POSTURE, GAINS, touches, touches).compliance @ FORCE
    jacobian = model.jacobian(POSTURE)
    mobility = jacobian @ np.linalg.solve(model.mass_matrix(POSTURE), jacobian.T)
    settings = CommanderSettings.configured()
    second = settings.tracking_stiffness_rotation if tracking == "hand" and not touches else 0.0
    stiffness = 150.0 + second
    turned = mobility[3:, :3] @ FORCE / stiffness
    place, rotation = model.hand_pose(POSTURE)
    attractor = place - off, Rotation.from_rotvec(-turned).as_matrix() @ rotation
    reference = Reference(*attractor, *attractor, np.zeros(6), np.zeros(6))
    now = Guidance(0.0, reference, GAINS, Grip.UNSPECIFIED, touches, 0.0, False, touches=touches)
    pull.begin(POSTURE)
    wrench, _ = pull.at(ArmState(0, POSTURE, still), now, 0.0, False)
    np.testing.assert_allclose(wrench[:3], -FORCE, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(wrench[3:], 0.0, atol=1e-3)


@pytest.mark.parametrize("tracking", ["hand", "none"])
def test_a_slower_hand_is_pulled_like_one_that_is_behind_by_the_lead(tracking):
    pull, place = pull_by(tracking), ArmModel().hand_pose(POSTURE)
    velocity = np.array([0.02, -0.05, 0.08])
    expected = place[0] - pull.yielding(POSTURE, GAINS, False).lead * velocity
    attractor = expected + velocity * GAINS.damping[0] / GAINS.stiffness[0]
    moving = Reference(
        attractor, place[1], expected, place[1], np.append(velocity, np.zeros(3)), np.zeros(6)
    )
    now = Guidance(0.0, moving, GAINS, Grip.UNSPECIFIED, False, 0.0, False)
    pull.begin(POSTURE)
    wrench, _ = pull.at(ArmState(0, POSTURE, np.zeros(7)), now, 0.0, False)
    assert wrench == pytest.approx(np.zeros(6), abs=1e-9)
