"""The description of the arm against published numbers, and its URDF against the DH table that it
was not made from.
"""

import copy
from xml.etree import ElementTree

import numpy as np
import pybullet
import pytest
from pybullet_utils.bullet_client import BulletClient

from dart_skill.arm import parse_description, the_arm, write_urdf
from dart_skill.common.configuration import load_yaml

WAM = the_arm()


def turn_x(angle):
    return np.array(
        [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    )


def load(urdf, folder):
    path = folder / "wam.urdf"
    path.write_text(urdf, encoding="utf-8")
    client = BulletClient(pybullet.DIRECT)
    return client, client.loadURDF(
        str(path), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE
    )


def test_link_inertials_in_dh_and_in_urdf_frames_are_the_same_bodies():
    """p = (a, 0, d) + Rx c and I' = Rx I Rx' (from the DH frame to the link frame of the URDF)."""
    for link, ((alpha, a, d), dh, urdf) in enumerate(
        zip(WAM.dh, WAM.links_dh, WAM.links_urdf, strict=True), start=1
    ):
        assert dh.mass == urdf.mass
        np.testing.assert_allclose(
            np.array([a, 0, d]) + turn_x(alpha) @ dh.centre,
            urdf.centre,
            atol=1e-9,
            err_msg=f"link {link}",
        )
        turned = turn_x(alpha) @ dh.inertia @ turn_x(alpha).T
        np.testing.assert_allclose(turned, urdf.inertia, atol=1e-12, err_msg=f"link {link}")


def test_moving_links_weigh_what_barrett_says():
    assert sum(link.mass for link in WAM.links_urdf) == pytest.approx(19.459, abs=5e-4)
    assert WAM.hand.inertial.mass == pytest.approx(1.202, abs=5e-4)


@pytest.mark.parametrize("frames", ["links_urdf", "links_dh"])
def test_every_inertia_is_one_that_a_body_can_have(frames):
    for inertial in (*getattr(WAM, frames), WAM.hand.inertial):
        moments = np.linalg.eigvalsh(inertial.inertia)
        assert moments.min() > 0 and moments.sum() > 2 * moments.max(), moments


def test_rotor_inertia_at_the_joints_is_the_published_one():
    reflected = WAM.motors.reflected_inertia
    np.testing.assert_allclose(
        np.diag(reflected), [0.205, 0.189, 0.0669, 0.0346, 0.00323, 0.00323, 0.00032], rtol=0.015
    )
    np.testing.assert_allclose(reflected, reflected.T, atol=1e-15)
    assert np.abs(reflected[1, 2]) < 1e-9, "the two motors of j2 and j3 are alike: no coupling"


def test_no_load_speed_of_a_joint_moving_alone_is_that_of_its_motors():
    motors = WAM.motors
    for joint in range(7):
        column = np.abs(motors.joint_to_motor[:, joint])
        alone = (motors.no_load_speed[column > 0] / column[column > 0]).min()
        assert WAM.joints[joint].no_load_speed == pytest.approx(alone, rel=1e-3), f"j{joint + 1}"


def test_the_motors_can_give_the_peak_torques():
    for joint in range(7):
        column = np.abs(WAM.motors.joint_to_motor[:, joint])
        assert column @ WAM.motors.stall_torque > WAM.joints[joint].peak_torque, f"j{joint + 1}"


def test_joint_limits_are_those_of_the_manual():
    np.testing.assert_array_equal(
        WAM.of_joints("lower"), [-2.6, -2.0, -2.8, -0.9, -4.76, -1.6, -3.0]
    )
    np.testing.assert_array_equal(WAM.of_joints("upper"), [2.6, 2.0, 2.8, 3.14, 1.24, 1.6, 3.0])
    assert ((WAM.of_joints("lower") <= WAM.home) & (WAM.home <= WAM.of_joints("upper"))).all(), (
        "home is reachable"
    )


def test_the_ball_is_a_tennis_ball():
    assert 0.0560 <= WAM.ball.mass <= 0.0594 and 0.06541 <= WAM.ball.diameter <= 0.06858
    assert WAM.ball.radius == WAM.ball.diameter / 2
    shell, solid = (
        2 / 3 * WAM.ball.mass * WAM.ball.radius**2,
        2 / 5 * WAM.ball.mass * WAM.ball.radius**2,
    )
    assert solid < WAM.ball.inertia <= 1.01 * shell


def test_every_shape_belongs_to_a_link():
    links = {joint.child for joint in WAM.joints} | {"wam_base", "bhand_base"}
    assert {capsule.link for capsule in WAM.capsules} <= links
    assert all(
        capsule.radius > 0 and np.linalg.norm(capsule.end - capsule.start) > 0
        for capsule in WAM.capsules
    )


@pytest.mark.parametrize("missing", ["mount_height", "dh", "hand", "motors", "capsules"])
def test_a_description_without_a_part_names_it(missing):
    content = copy.deepcopy(load_yaml("wam.yaml"))
    del content[missing]
    with pytest.raises(KeyError, match=missing):
        parse_description(content)


def test_every_link_of_the_urdf_has_an_inertial():
    """PyBullet gives a link without one a mass of 1 kg."""
    for ball in (False, True):
        for link in ElementTree.fromstring(write_urdf(WAM, ball)).findall("link"):
            assert (
                link.find("inertial/mass") is not None
                and link.find("inertial/inertia") is not None
            ), link.get("name")


def test_pybullet_reads_from_the_urdf_what_stands_in_the_description(tmp_path):
    client, body = load(write_urdf(WAM), tmp_path)
    joints = [client.getJointInfo(body, j) for j in range(7)]
    assert [joint[1].decode() for joint in joints] == [joint.name for joint in WAM.joints]
    columns = {
        "viscous_friction": 6,
        "coulomb_friction": 7,
        "lower": 8,
        "upper": 9,
        "peak_torque": 10,
        "no_load_speed": 11,
    }
    for field, column in columns.items():
        np.testing.assert_allclose(
            [joint[column] for joint in joints], WAM.of_joints(field), atol=1e-6, err_msg=field
        )
    masses = [client.getDynamicsInfo(body, link)[0] for link in range(client.getNumJoints(body))]
    np.testing.assert_allclose(
        masses, [*(link.mass for link in WAM.links_urdf), WAM.hand.inertial.mass], atol=1e-9
    )
    client.disconnect()


def test_the_ball_in_the_hand_adds_its_mass_at_the_grip(tmp_path):
    client, body = load(write_urdf(WAM, ball_in_hand=True), tmp_path)
    ball = client.getNumJoints(body) - 1
    assert client.getJointInfo(body, ball)[12].decode() == "held_ball"
    assert client.getDynamicsInfo(body, ball)[0] == pytest.approx(WAM.ball.mass)
    hand = client.getLinkState(body, 7, computeForwardKinematics=1)
    held = client.getLinkState(body, ball, computeForwardKinematics=1)
    rotation = np.array(client.getMatrixFromQuaternion(hand[5])).reshape(3, 3)
    np.testing.assert_allclose(
        np.array(held[4]), np.array(hand[4]) + rotation @ WAM.hand.ball_centre, atol=1e-6
    )
    client.disconnect()


def test_a_urdf_without_shapes_has_the_same_masses_and_nothing_to_see():
    bare, full = (
        ElementTree.fromstring(write_urdf(WAM, shapes=shapes)) for shapes in (False, True)
    )
    assert not bare.findall("link/visual") and not bare.findall("link/collision")
    assert len(full.findall("link/collision")) == 3 * len(WAM.capsules), (
        "a cylinder and two spheres each"
    )
    assert [e.get("value") for e in bare.iter("mass")] == [
        e.get("value") for e in full.iter("mass")
    ]


def test_collision_shapes_reach_as_far_as_the_capsules_of_the_occlusion_model():
    """The cylinder's ends are its capsule's points, whichever way it is tilted."""
    for link in ElementTree.fromstring(write_urdf(WAM)).findall("link"):
        cylinders = [
            c for c in link.findall("collision") if c.find("geometry/cylinder") is not None
        ]
        capsules = [c for c in WAM.capsules if c.link == link.get("name")]
        for shape, capsule in zip(cylinders, capsules, strict=True):
            origin = shape.find("origin")
            centre, (_, pitch, yaw) = (
                np.array(origin.get(key).split(), dtype=float) for key in ("xyz", "rpy")
            )
            axis = np.array(
                [np.cos(yaw) * np.sin(pitch), np.sin(yaw) * np.sin(pitch), np.cos(pitch)]
            )
            half = 0.5 * float(shape.find("geometry/cylinder").get("length"))
            np.testing.assert_allclose(centre + half * axis, capsule.end, atol=1e-12)
            np.testing.assert_allclose(centre - half * axis, capsule.start, atol=1e-12)
