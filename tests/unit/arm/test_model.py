"""The controller's model (Pinocchio, from the DH table) against DH products and finite differences;
against PyBullet (from the URDF): tests/unit/simulation/test_arm_geometry.py.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmModel, the_arm
from dart_skill.simulation import ArmGeometry

WAM = the_arm()
SHOULDER = WAM.mount_height + WAM.shoulder_height
LOWER, UPPER = WAM.of_joints("lower"), WAM.of_joints("upper")
N_POSTURES = 40


def postures(seed=0, n=N_POSTURES):
    rng = np.random.default_rng(seed)
    return rng.uniform(LOWER, UPPER, (n, 7)), rng.normal(0.0, 2.0, (n, 7))


def dh_frames(q):
    """World poses of DH frames 1 to 7 by plain products: Rot_z Trans_z Trans_x Rot_x."""
    pose, frames = np.eye(4), []
    pose[2, 3] = SHOULDER
    for angle, (alpha, a, d) in zip(q, WAM.dh, strict=True):
        turn_z, turn_x = np.eye(4), np.eye(4)
        turn_z[:3, :3] = Rotation.from_euler("z", angle).as_matrix()
        turn_x[:3, :3] = Rotation.from_euler("x", alpha).as_matrix()
        turn_z[2, 3], turn_x[0, 3] = d, a
        pose = pose @ turn_z @ turn_x
        frames.append(pose)
    return frames


def along(function, q, qd, h=1e-6):
    """Central difference of function(q) along qd."""
    return (function(q + h * qd) - function(q - h * qd)) / (2 * h)


def test_rotors_add_their_reflected_inertia_to_the_mass_matrix():
    model, q = ArmModel(), postures()[0][0]
    to_motor, rotors = WAM.motors.joint_to_motor, WAM.motors.rotor_inertia
    expected = sum(rotors[m] * np.outer(to_motor[m], to_motor[m]) for m in range(7))
    np.testing.assert_allclose(
        model.mass_matrix(q) - model.mass_matrix(q, rotors=False), expected, atol=1e-12
    )


def test_the_hand_is_where_the_dh_table_puts_it():
    model = ArmModel()
    for q in postures(1)[0]:
        position, rotation = model.hand_pose(q)
        expected = dh_frames(q)[-1]
        np.testing.assert_allclose(position, expected[:3, 3], atol=1e-12)
        np.testing.assert_allclose(rotation, expected[:3, :3], atol=1e-12)


@pytest.mark.parametrize(
    ("posture", "tool_plate"),
    [
        ([0, 0, 0, 0, 0, 0, 0], [0, 0, 0.911]),
        ([0, -2.0, 0, 3.13, 0, 0, 0], [-0.212, 0, 0.007]),
        ([0, -1.57, 0, 1.57, 0, 0, 0], [-0.595, 0, 0.406]),
        ([0, 0.5876, 0, 1.36, 0, -0.321, -1.57], [0.699, 0, 0.361]),
        ([0, 0, 0, 1.57, 0, 0, 0], [0.406, 0, 0.595]),
    ],
)
def test_published_poses_of_the_tool_plate(posture, tool_plate):
    position, _ = ArmModel().hand_pose(np.array(posture, dtype=float))
    np.testing.assert_allclose(position - [0, 0, SHOULDER], tool_plate, atol=6e-4)


def test_largest_static_torques_with_hand_and_ball_are_the_published_ones():
    """J2 40.2, J3 12.3, J4 10.5, J5 1.73, J6 1.74 Nm (libbarrett, wam7w.conf), as maxima over all
    postures.
    """
    model = ArmModel(ball_in_hand=True)
    torques = np.abs(
        [
            model.gravity_torque(q)
            for q in np.random.default_rng(2).uniform(LOWER, UPPER, (6000, 7))
        ]
    ).max(axis=0)
    published = np.array([40.2, 12.3, 10.5, 1.73, 1.74])
    assert (torques[1:6] < 1.01 * published).all() and (torques[1:6] > 0.9 * published).all(), (
        torques
    )
    assert torques[0] < 1e-9, "the base axis is vertical"


def test_the_hand_at_several_instants_is_the_hand_at_each():
    model, rng = ArmModel(), np.random.default_rng(4)
    joints, speeds = rng.uniform(LOWER, UPPER, (5, 7)), rng.normal(size=(5, 7))
    states = [model.hand_state(q, qd) for q, qd in zip(joints, speeds, strict=True)]
    for name, found in zip(
        ("position", "rotation", "velocity"), model.hand_states(joints, speeds), strict=True
    ):
        np.testing.assert_array_equal(found, [getattr(state, name) for state in states])
    assert [part.shape for part in model.hand_states(joints[:0], speeds[:0])] == [
        (0, 3),
        (0, 3, 3),
        (0, 6),
    ]


def test_jacobian_is_the_derivative_of_the_hand_pose():
    model = ArmModel()
    for q, qd in zip(*postures(3, 15), strict=True):
        velocity = model.jacobian(q) @ qd
        np.testing.assert_allclose(
            velocity[:3], along(lambda q: model.hand_pose(q)[0], q, qd), atol=1e-7
        )
        spin = along(lambda q: model.hand_pose(q)[1], q, qd) @ model.hand_pose(q)[1].T
        np.testing.assert_allclose(velocity[3:], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-7)
        state = model.hand_state(q, qd)
        np.testing.assert_allclose(
            np.concatenate([state.linear, state.angular]), velocity, atol=1e-12
        )


def test_jacobian_drift_is_the_derivative_of_the_jacobian():
    model = ArmModel()
    for q, qd in zip(*postures(4, 15), strict=True):
        np.testing.assert_allclose(
            model.jacobian_drift(q, qd), along(model.jacobian, q, qd) @ qd, atol=1e-6
        )


def test_the_elbow_and_its_jacobian():
    model = ArmModel()
    for q, qd in zip(*postures(5, 15), strict=True):
        position, jacobian = model.elbow(q)
        np.testing.assert_allclose(position, dh_frames(q)[2][:3, 3], atol=1e-12)
        np.testing.assert_allclose(
            jacobian @ qd, along(lambda q: model.elbow(q)[0], q, qd), atol=1e-7
        )


def test_gravity_torque_is_the_slope_of_the_potential_energy():
    model = ArmModel(ball_in_hand=True)

    def potential(q):
        frames = dh_frames(q)
        height = sum(
            link.mass * (f[:3, :3] @ link.centre + f[:3, 3])[2]
            for link, f in zip(WAM.links_dh, frames, strict=True)
        )
        hand = frames[-1]
        for body, centre in (
            (WAM.hand.inertial.mass, WAM.hand.inertial.centre),
            (WAM.ball.mass, WAM.hand.ball_centre),
        ):
            height += body * (hand[:3, :3] @ centre + hand[:3, 3])[2]
        return WAM.gravity * height

    for q, qd in zip(*postures(6, 10), strict=True):
        assert model.gravity_torque(q) @ qd == pytest.approx(along(potential, q, qd), abs=1e-6)


def test_coriolis_torque_does_half_the_work_of_the_changing_inertia():
    """qd' C(q, qd) qd = 1/2 qd' dM/dt qd: kinetic energy is conserved without torques."""
    model = ArmModel(ball_in_hand=True)
    for q, qd in zip(*postures(7, 10), strict=True):
        work = 0.5 * qd @ along(model.mass_matrix, q, qd) @ qd
        assert model.coriolis_torque(q, qd) @ qd == pytest.approx(work, abs=1e-5)


def test_capsules_lie_along_the_arm():
    model, q = ArmModel(), postures(9)[0][0]
    ends, radii = ArmGeometry().capsules(q)
    assert ends.shape == (len(WAM.capsules), 2, 3) and radii.shape == (len(WAM.capsules),)
    by_link = {capsule.link: pair for capsule, pair in zip(WAM.capsules, ends, strict=True)}
    np.testing.assert_allclose(by_link["wam_base"][0], [0, 0, WAM.mount_height + 0.06], atol=1e-12)
    hand, rotation = model.hand_pose(q)
    np.testing.assert_allclose(by_link["bhand_base"][0], hand + 0.045 * rotation[:, 2], atol=1e-12)
    upper_arm = next(
        pair
        for capsule, pair in zip(WAM.capsules, ends, strict=True)
        if capsule.link == "wam_link3"
    )
    direction = (upper_arm[1] - upper_arm[0]) / np.linalg.norm(upper_arm[1] - upper_arm[0])
    np.testing.assert_allclose(np.linalg.norm(upper_arm[0] - [0, 0, SHOULDER]), 0.05, atol=1e-12)
    elbow = dh_frames(q)[2]
    np.testing.assert_allclose(
        [0, 0, SHOULDER] + 0.55 * direction, elbow[:3, 3] - 0.045 * elbow[:3, 0], atol=1e-12
    )
