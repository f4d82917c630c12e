"""The torques that PyBullet applies against linear algebra by NumPy."""

import numpy as np
import pytest

from dart_skill.arm import Actuation, wam_description
from dart_skill.simulation import _joint_dynamics
from dart_skill.simulation._joint_dynamics import JointDynamics, read_joints
from dart_skill.simulation._transmission import Transmission
from tests.interpreted import interpreted

WAM = wam_description()
REFLECTED = WAM.motors.reflected_inertia
STEP = 0.002
STIFFNESS = np.array([9000.0, 9000.0, 5000.0, 3000.0, 800.0, 800.0, 200.0])


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def inertia(rng):
    root = rng.normal(size=(7, 7))
    return 0.1 * root @ root.T + np.diag([2.0, 2.5, 0.6, 0.5, 0.03, 0.04, 0.01])


def test_joints_are_read_as_lists_and_as_arrays(rng):
    states = rng.normal(size=(7, 2))
    joints = tuple((angle, speed, (0.0,) * 6, 0.0) for angle, speed in states.tolist())
    angles, speeds, position, velocity = read_joints(joints)
    assert angles == states[:, 0].tolist() and speeds == states[:, 1].tolist()
    np.testing.assert_array_equal(np.stack([position, velocity], axis=1), states)


def test_motors_are_asked_for_what_the_command_says_and_for_their_share_of_gravity(rng):
    torque, pull, gravity = rng.normal(size=(3, 7))
    joints = JointDynamics(Actuation(WAM), REFLECTED, 0.95, STEP)
    np.testing.assert_allclose(
        joints.asked(torque, None, gravity), torque + 0.95 * gravity, atol=1e-15
    )
    np.testing.assert_allclose(
        joints.asked(torque, pull, gravity), torque + pull + 0.95 * gravity, atol=1e-15
    )


def moved(inertia, bias, torque):
    """Acceleration (7,) that PyBullet's arm without rotors and friction has under a torque."""
    return np.linalg.solve(inertia, np.array(torque) - bias)


@pytest.mark.parametrize("pushed", [False, True])
def test_the_arm_without_rotors_is_moved_as_one_with_rotors(rng, inertia, pushed):
    bias, effort, push, q, v = rng.normal(size=(5, 7))
    joints = JointDynamics(Actuation(WAM, friction_scale=0.0), REFLECTED, 1.0, STEP)
    torque = joints.torque(inertia, bias, effort, push if pushed else None, q, v)
    expected = np.linalg.solve(inertia + REFLECTED, effort + (push if pushed else 0.0) - bias)
    np.testing.assert_allclose(moved(inertia, bias, torque), expected, rtol=1e-9)


def test_friction_and_cables_are_those_of_the_arm(rng, inertia):
    bias, effort, push, q, v = rng.normal(size=(5, 7))
    actuation = Actuation(WAM)
    cables, same_cables = (Transmission(STIFFNESS, REFLECTED, actuation) for _ in range(2))
    for one in (cables, same_cables):
        one.rest(q, bias)
    rigid = actuation.acceleration(inertia + REFLECTED, effort + push - bias, v, STEP)
    elastic = same_cables.advance(q, v, inertia, effort, push - bias, STEP)
    for transmission, expected in ((None, rigid), (cables, elastic)):
        joints = JointDynamics(actuation, REFLECTED, 1.0, STEP, transmission)
        torque = joints.torque(inertia, bias, effort, push, q, v)
        np.testing.assert_allclose(moved(inertia, bias, torque), expected, rtol=1e-9)
    np.testing.assert_array_equal(cables.position, same_cables.position)


def test_compiled_and_interpreted_have_the_same_bits(rng, inertia):
    plain = interpreted("dart_skill.simulation._joint_dynamics")
    bias, effort, push, pull, q, v = rng.normal(size=(6, 7))
    actuation = Actuation(WAM)
    for elastic in (False, True):
        pair = [
            module.JointDynamics(
                actuation,
                REFLECTED,
                0.95,
                STEP,
                Transmission(STIFFNESS, REFLECTED, actuation) if elastic else None,
            )
            for module in (_joint_dynamics, plain)
        ]
        ours, theirs = (one.torque(inertia, bias, effort, push, q, v) for one in pair)
        assert ours == theirs
        ours, theirs = (one.asked(effort, pull, bias) for one in pair)
        np.testing.assert_array_equal(ours, theirs)
