"""Arms that are described from their URDF: beside PyBullet, which reads the same file itself; what
the file of an arm may say, and what is refused.
"""

import numpy as np
import pybullet
import pybullet_data
import pytest
from pybullet_utils.bullet_client import BulletClient

from dart_skill.arm import (
    GUIDED_SPEED,
    ArmModel,
    Command,
    Impedance,
    JointServo,
    Speed,
    guided_bound,
    joint_transforms,
    load_arm,
    posture_at,
    ready_posture,
    swing_plane,
    the_arm,
    the_swing,
    throwing_bound,
)
from dart_skill.common.arm_choice import joint_count, joint_names
from dart_skill.common.configuration import ARM_VARIABLE, node_parameters
from dart_skill.common.quaternions import matrices
from dart_skill.common.world import the_world
from dart_skill.simulation import Phase, Plant, PlantSettings, Teacher

IIWA = "kuka_iiwa/model.urdf"
TURNED = """
<robot name="turned">
  <link name="base"/>
  <link name="one"><inertial><origin xyz="0.1 0.02 0.2" rpy="0.3 0 0"/><mass value="2"/>
    <inertia ixx="0.02" iyy="0.025" izz="0.015" ixy="0.001" ixz="0" iyz="0.002"/></inertial></link>
  <link name="two"><inertial><origin xyz="0 0.1 0"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="three"><inertial><mass value="0.5"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="four"><inertial><origin xyz="0 0 0.05"/><mass value="0.4"/>
    <inertia ixx="0.002" iyy="0.003" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="hand"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="one"/><origin xyz="0 0 0.3"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="2" effort="50"/></joint>
  <joint name="b" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0 0.1 0.1"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="40"/></joint>
  <joint name="c" type="revolute"><parent link="two"/><child link="three"/>
    <origin xyz="0 -0.1 0.4"/><axis xyz="0 -1 0"/>
    <limit lower="-2" upper="2" velocity="2" effort="30"/></joint>
  <joint name="d" type="revolute"><parent link="three"/><child link="four"/>
    <origin xyz="0 0 0.3" rpy="0 0 0.4"/><axis xyz="0.38941834230865 0.92106099400289 0"/>
    <limit lower="-2" upper="2" velocity="3" effort="10"/></joint>
  <joint name="mount" type="fixed"><parent link="four"/><child link="hand"/>
    <origin xyz="0 0 0.1" rpy="0.2 0 0.7"/></joint>
</robot>
"""
"""Four joints that turn about other axes than z; the last one's is the y axis of the joint before."""


@pytest.fixture
def iiwa(monkeypatch):
    monkeypatch.setenv(ARM_VARIABLE, "iiwa7")
    return the_arm()


def arm_file(folder, **entries):
    """A file of an arm with the URDF above, in which entries count instead."""
    (folder / "turned.urdf").write_text(TURNED, encoding="utf-8")
    lines = {
        "urdf": "turned.urdf",
        "base": "base",
        "tool": "hand",
        "joints": "[a, b, c, d]",
        "mount_height": "0.5",
        "postures": "{home: [0.1, 0.2, 0.3, 0.4]}",
        **entries,
    }
    path = folder / "turned.yaml"
    path.write_text("\n".join(f"{key}: {value}" for key, value in lines.items()) + "\n")
    return path


def loaded(urdf, height):
    """PyBullet with the URDF as it reads it."""
    client = BulletClient(pybullet.DIRECT)
    client.setGravity(0, 0, -9.81)
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE
    return client, client.loadURDF(str(urdf), [0, 0, height], useFixedBase=True, flags=flags)


def agrees(arm, client, body, hand, n_tries=5):
    """Inertia, gravity and the pose of the hand's link of the model, as PyBullet has them."""
    model, n, rng = ArmModel(arm), arm.n_joints, np.random.default_rng(0)
    for q in rng.uniform(arm.of_joints("lower"), arm.of_joints("upper"), (n_tries, n)):
        angles = q.tolist()
        theirs = np.array(client.calculateMassMatrix(body, angles))
        np.testing.assert_allclose(model.mass_matrix(q, rotors=False), theirs, atol=1e-6)
        weight = client.calculateInverseDynamics(body, angles, [0.0] * n, [0.0] * n)
        np.testing.assert_allclose(model.gravity_torque(q), weight, atol=1e-5)
        for joint, angle in enumerate(angles):
            client.resetJointState(body, joint, angle)
        at, turned = client.getLinkState(body, hand, computeForwardKinematics=True)[4:6]
        position, rotation = model.hand_pose(q)
        np.testing.assert_allclose(position, at, atol=1e-6)
        np.testing.assert_allclose(rotation, matrices(np.array(turned)), atol=1e-6)


def test_the_arm_of_a_package_is_as_pybullet_reads_it(iiwa):
    agrees(iiwa, *loaded(f"{pybullet_data.getDataPath()}/{IIWA}", iiwa.mount_height), hand=6)


def test_axes_that_are_not_z_and_a_turned_hand(tmp_path, monkeypatch):
    monkeypatch.setenv(ARM_VARIABLE, str(arm_file(tmp_path)))
    arm = the_arm()
    assert arm.n_joints == joint_count() == 4 and joint_names() == ("a", "b", "c", "d")
    # of PyBullet the links with an inertial alone: a base and a hand without one would weigh 1 kg
    bare = TURNED.replace('<link name="base"/>', weightless("base"))
    (tmp_path / "bare.urdf").write_text(bare.replace('<link name="hand"/>', weightless("hand")))
    agrees(arm, *loaded(tmp_path / "bare.urdf", 0.5), hand=4)


def weightless(name):
    return (
        f'<link name="{name}"><inertial><mass value="1e-9"/><inertia ixx="1e-12" iyy="1e-12"'
        ' izz="1e-12" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def test_transforms_lead_to_the_hand(iiwa):
    q = np.array([0.3, -0.4, 0.5, -0.6, 0.7, -0.8, 0.9])
    rotation, position = np.eye(3), np.array([0.0, 0.0, iiwa.mount_height])
    for step in joint_transforms(iiwa, q):
        position = position + rotation @ step.translation
        rotation = rotation @ matrices(step.quaternion)
    np.testing.assert_allclose(position + rotation @ iiwa.tool_plate, ArmModel().hand_pose(q)[0])


def test_the_servo_swings_as_it_is_told_to_and_a_file_may_give_it(iiwa, tmp_path, monkeypatch):
    servo = JointServo(Impedance(ArmModel())).gains
    inertia = np.diag(ArmModel().mass_matrix(iiwa.home))
    np.testing.assert_allclose(servo.following_stiffness, 15.0**2 * inertia, rtol=1e-5)
    ratio = servo.damping / (2.0 * np.sqrt(servo.stiffness * inertia))
    np.testing.assert_allclose(ratio, 0.7, rtol=1e-5)
    given = arm_file(tmp_path, servo="{stiffness: [1.0, 2.0, 3.0, 4.0]}")
    monkeypatch.setenv(ARM_VARIABLE, str(given))
    assert the_arm().servo.stiffness.tolist() == [1.0, 2.0, 3.0, 4.0]


def test_friction_that_nobody_measured_is_simulated_and_not_compensated(tmp_path, monkeypatch):
    monkeypatch.setenv(ARM_VARIABLE, str(arm_file(tmp_path)))
    arm = the_arm()
    assert not arm.knows_friction
    assert arm.of_joints("coulomb_friction") == pytest.approx([1.5, 1.2, 0.9, 0.3])
    assert not Impedance(ArmModel(arm)).friction_torque(np.ones(4)).any()
    known = TURNED.replace(
        'effort="50"/>', 'effort="50"/><dynamics friction="0.7" damping="0.2"/>'
    )
    (tmp_path / "turned.urdf").write_text(known)
    (tmp_path / "known.yaml").write_text((tmp_path / "turned.yaml").read_text())
    monkeypatch.setenv(ARM_VARIABLE, str(tmp_path / "known.yaml"))
    assert the_arm().of_joints("coulomb_friction").tolist() == [0.7, 0.0, 0.0, 0.0]
    torque = Impedance(ArmModel(), friction_compensation=1.0).friction_torque(np.ones(4))
    assert torque == pytest.approx([0.9, 0.0, 0.0, 0.0])


def test_a_hand_is_brought_to_a_pose_within_the_ranges(iiwa):
    position, rotation = np.array([0.5, 0.2, 1.3]), np.diag([1.0, -1.0, -1.0])
    q = posture_at(iiwa, position, rotation)
    at, turned = ArmModel(iiwa).hand_pose(q)
    assert np.abs(at - position).max() < 1e-4 and np.abs(turned - rotation).max() < 2e-4
    assert (iiwa.of_joints("lower") < q).all() and (q < iiwa.of_joints("upper")).all()
    with pytest.raises(ValueError, match=r"iiwa7: no posture .* at \[3.0, 0.2, 1.3\] m"):
        posture_at(iiwa, np.array([3.0, 0.2, 1.3]), rotation)


def test_a_posture_with_a_name_is_that_of_the_file(monkeypatch):
    assert ready_posture("bench", (9.0, 9.0, 9.0), (0.0, 0.0, 0.0))[1] == 0.6  # of the WAM
    monkeypatch.setenv(ARM_VARIABLE, "iiwa7")
    q = ready_posture("bench", (0.43, -0.36, 1.34), (1.0773, 2.9511, 0.0))
    assert ArmModel().hand_pose(np.array(q))[0] == pytest.approx([0.43, -0.36, 1.34], abs=1e-3)


def test_home_points_down_before_the_base(iiwa):
    position, rotation = ArmModel().hand_pose(iiwa.home)
    assert position[0] > 0.3 and rotation[:, 2] == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)


@pytest.mark.parametrize("name", ["wam", "iiwa7", "panda"])
def test_a_stop_and_a_held_posture_are_stable_wherever_the_arm_is(name, monkeypatch):
    """Joints in line have hardly any inertia against each other: J1 and J3 of a KUKA, upright."""
    monkeypatch.setenv(ARM_VARIABLE, name)
    arm, model, step, n = the_arm(), ArmModel(), 0.002, joint_count()
    servo, rng = JointServo(Impedance(model)), np.random.default_rng(0)
    lower, upper = arm.of_joints("lower"), arm.of_joints("upper")
    small, still, fastest = 1e-6, np.zeros(n), 0.0
    for q in [np.zeros(n).clip(lower, upper), *rng.uniform(lower, upper, (200, n))]:
        light = step * np.linalg.inv(model.mass_matrix(q)) / small
        stop = light @ np.transpose([servo.damp(q, v) for v in small * np.eye(n)])
        pull = light @ np.transpose([servo.hold(q, still, q - d) for d in small * np.eye(n)])
        slow = light @ np.transpose([servo.hold(q, v, q) for v in small * np.eye(n)])
        # a torque acts on the state that follows the one it answers
        nothing, one = np.zeros((n, n)), np.eye(n)
        stopped = np.block([[one, stop], [one, nothing]])
        held = np.block(
            [
                [one, step * one, nothing, nothing],
                [nothing, one, pull, slow],
                [one, nothing, nothing, nothing],
                [nothing, one, nothing, nothing],
            ]
        )
        for law in (stopped, held):
            fastest = max(fastest, np.abs(np.linalg.eigvals(law)).max())
    assert fastest < 1.0


def test_a_swing_keeps_clear_and_ends_as_fast_as_its_joints(iiwa):
    swing, arm = the_swing(), load_arm("iiwa7")
    speeds = np.abs(swing.rates) / arm.speeds[swing.joints]
    assert speeds.max() == pytest.approx(GUIDED_SPEED, abs=1e-3)
    assert swing.release - swing.cocked == pytest.approx(0.5 * swing.duration * swing.rates)
    angles = np.linspace(swing.cocked, swing.release, 20)
    hand = swing_plane(arm).places(angles)[:, -1]
    assert (np.abs(hand[:, 0]) > 0.2).all() and (hand[:, 1] > arm.mount_height - 2e-3).all()


@pytest.mark.parametrize("name", ["iiwa7", "panda"])
def test_an_arm_stands_where_its_swing_begins_and_baskets_where_it_throws(name, monkeypatch):
    monkeypatch.setenv(ARM_VARIABLE, name)
    swing, start = the_swing(), node_parameters("wam_simulator.yaml", "wam_simulator")
    np.testing.assert_allclose(
        np.array(start["start_posture"])[swing.joints], swing.cocked, atol=0.02
    )
    guided = guided_bound(load_arm(name), the_world().rim, the_world().side)
    assert the_world().near < the_world().far < guided.distance
    assert throwing_bound(load_arm(name), the_world().rim).distance > 1.3 * guided.distance


def test_a_person_guides_such_an_arm_through_a_throw(iiwa):
    settings = node_parameters("wam_simulator.yaml", "wam_simulator")
    plant, teacher = Plant(PlantSettings.from_parameters(settings), 0), Teacher(0)
    target = np.array([1.2, 0.0, 0.4])
    plant.reset(target)
    teacher.begin(target, plant.arm_state)
    while teacher.phase is not Phase.WATCHING:
        push = teacher.step(plant.arm_state)
        plant.step(Command(plant.state_stamp_ns, speed=Speed.THROW), push)
    while plant.state.ball_position[2] > 0.4:
        plant.step(Command(plant.state_stamp_ns, speed=Speed.THROW))
    assert not plant.fault
    assert np.hypot(*(plant.state.ball_position - target)[:2]) < 0.25, "a first try is so good"


@pytest.mark.parametrize(
    ("entry", "value", "says"),
    [
        (
            "joints",
            "[a, b, d, c]",
            r"joints is \['a', 'b', 'd', 'c'\]; from base to hand they are",
        ),
        (
            "servo",
            "{stifness: [1.0, 1.0, 1.0, 1.0]}",
            "servo: unknown stifness; stiffness, damping,",
        ),
        ("servo", "{limit: [1.0]}", "servo: limit is .*give 4 finite numbers"),
        (
            "postures",
            "{home: [1.0, .nan, 0.0, 0.0]}",
            r"postures.home\[1\] is nan; it must be a number",
        ),
        (
            "rotor_inertia",
            "{e: 1.0}",
            "arm turned: rotor_inertia names e; its joints are a, b, c, d",
        ),
        ("colour", "red", "unknown entry 'colour'"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_by_name(tmp_path, monkeypatch, entry, value, says):
    path = arm_file(tmp_path, **{entry: value})
    monkeypatch.setenv(ARM_VARIABLE, str(path))
    with pytest.raises(ValueError, match=f"turned.yaml(: | has an ){says}"):
        the_arm()


def test_a_file_without_joints_says_what_to_write(tmp_path, monkeypatch):
    monkeypatch.setenv(ARM_VARIABLE, str(arm_file(tmp_path, joints="7")))
    with pytest.raises(ValueError, match="joints is 7; name the joints from the base to the hand"):
        joint_names()


def test_an_arm_may_set_parameters_of_nodes(tmp_path, monkeypatch):
    posture = "{wam_simulator: {start_posture: [0.1, 0.2, 0.3, 0.4]}, world: {far: 1.7}}"
    monkeypatch.setenv(ARM_VARIABLE, str(arm_file(tmp_path, parameters=posture)))
    parameters = node_parameters("wam_simulator.yaml", "wam_simulator")
    assert parameters["far"] == 1.7
    settings = PlantSettings.from_parameters(parameters)
    assert settings.start_posture == (0.1, 0.2, 0.3, 0.4) and settings.mass_scale == (1.0,) * 4
    plant = Plant(settings)
    assert plant.joint_position == [0.1, 0.2, 0.3, 0.4]
    np.testing.assert_allclose(
        plant.hand_position,
        ArmModel().hand_pose(the_arm().home * 0 + [0.1, 0.2, 0.3, 0.4])[0],
        atol=1e-6,
    )
    monkeypatch.setenv(ARM_VARIABLE, str(arm_file(tmp_path, parameters="[1]")))
    with pytest.raises(
        ValueError, match=r"parameters is \[1\]; it must be names and values by file"
    ):
        node_parameters("wam_simulator.yaml", "wam_simulator")
