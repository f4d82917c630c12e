"""Arms from their URDF: what is read, what is refused, and the model, beside the WAM's own."""

import numpy as np
import pytest

from dart_skill.arm import ArmModel, UrdfArm, load_arm, read_urdf, urdf_ends
from dart_skill.cli import main
from dart_skill.common.configuration import arm_names


def urdf_of(kinds, limits='lower="-2" upper="2" velocity="1" effort="10"', inertial=True):
    """A chain of joints along z, each 0.3 m after the one before, that turn about y."""
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    body = f"{mass}</inertial>" if inertial else ""
    links = "".join(f'<link name="l{k}">{body}</link>' for k in range(len(kinds) + 1))
    joints = "".join(
        f'<joint name="j{k}" type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>{"<limit " + limits + "/>" if limits else ""}'
        "</joint>"
        for k, kind in enumerate(kinds)
    )
    return f'<robot name="chain">{links}{joints}</robot>'


def test_the_wam_from_its_urdf_is_the_wam_of_its_table():
    """The commander's model is made from the DH table, this one from the URDF."""
    arm, model, rng = load_arm("wam"), ArmModel(), np.random.default_rng(0)
    for q in rng.uniform(arm.lower, arm.upper, (5, 7)):
        place, rotation = model.hand_pose(q)
        hand = arm.hand(q)
        np.testing.assert_allclose(hand.rotation, rotation, atol=1e-9)
        np.testing.assert_allclose(hand.translation, place + rotation @ arm.grip, atol=1e-9)
        torque = arm.torque(q[None], np.zeros((1, 7)), np.zeros((1, 7)))[0]
        np.testing.assert_allclose(torque, model.gravity_torque(q), atol=2e-3)


def test_the_axes_are_where_a_small_turn_leaves_the_hand():
    arm, h = load_arm("panda"), 1e-6
    q = np.array([0.3, -0.4, 0.2, -1.5, 0.4, 1.2, -0.3])
    places, axes = arm.axes(q)
    for k in range(7):
        step = h * np.eye(7)[k]
        moved = (arm.hand(q + step).translation - arm.hand(q - step).translation) / (2.0 * h)
        expected = np.cross(axes[k], arm.hand(q).translation - places[k])
        np.testing.assert_allclose(moved, expected, atol=1e-7)


@pytest.mark.parametrize(
    "name", [name for name in arm_names() if name in ("wam", "panda", "iiwa7")]
)
def test_arms_that_the_given_packages_bring_have_limits(name):
    arm = load_arm(name)
    assert len(arm.joints) == 7 and (arm.lower < arm.upper).all()
    assert (arm.speeds > 0.5).all() and (arm.speeds < 25.0).all() and (arm.torques > 1.0).all()


def test_fingers_stand_still_and_a_joint_without_ends_turns_twice():
    arm = UrdfArm("chain", urdf_of(["revolute", "continuous", "fixed"]), "l0", "l3")
    assert [joint.name for joint in arm.joints] == ["j0", "j1"]
    assert arm.upper.tolist() == [2.0, 2.0 * np.pi] and arm.model.nq == 2
    assert arm.hand([0.0, np.pi / 2]).translation == pytest.approx([0.3, 0.0, 0.6])
    panda = load_arm("panda")
    assert panda.model.nq == 7  # of nine: two fingers


def test_limits_that_nobody_measured_are_refused_until_they_are_given():
    placeholders = urdf_of(["revolute"] * 4)
    arm = UrdfArm("chain", placeholders, "l0", "l4")
    for what in ("speeds", "torques"):
        with pytest.raises(ValueError, match="1 rad/s and 10 N m for every joint.*placeholder"):
            getattr(arm, what)
    assert any("placeholder" in doubt for doubt in arm.doubts())
    given = {f"j{k}": 0.5 + k for k in range(4)}
    arm = UrdfArm("chain", placeholders, "l0", "l4", velocity_limits=given, torque_limits=given)
    assert arm.speeds.tolist() == arm.torques.tolist() == [0.5, 1.5, 2.5, 3.5]
    assert not any("placeholder" in doubt for doubt in arm.doubts())
    silent = UrdfArm("chain", urdf_of(["revolute"], 'lower="-1" upper="1"'), "l0", "l1")
    with pytest.raises(ValueError, match="no velocity of j0; write `velocity"):
        _ = silent.speeds


def test_links_without_an_inertial_are_named():
    arm = UrdfArm("chain", urdf_of(["revolute"] * 5, inertial=False), "l0", "l5")
    assert any("l0, l1, l2 and 3 more: PyBullet would give each 1 kg" in d for d in arm.doubts())


@pytest.mark.parametrize(
    ("urdf", "base", "tool", "says"),
    [
        ("<robot", "l0", "l1", "is no XML"),
        ("<sdf></sdf>", "l0", "l1", "xacro or SDF"),
        (urdf_of(["revolute"]), "l0", "hand", "no link 'hand' as tool; it has l0, l1"),
        (urdf_of(["revolute"]), "l1", "l0", "'l0' is the root"),
        (urdf_of(["revolute", "prismatic"]), "l0", "l2", "'j1' between .* is prismatic"),
        (urdf_of(["fixed"]), "l0", "l1", "no joint moves between"),
    ],
)
def test_what_is_no_arm_is_refused(urdf, base, tool, says):
    with pytest.raises(ValueError, match=says):
        UrdfArm("it", urdf, base, tool)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("tool: 3", "tool is 3; it must be a name"),
        ("mount_height: high", "mount_height is 'high'"),
        ("grip: [1.0]", "grip is .*a list of 3"),
        ("velocity: {j9: 1.0}", "velocity names j9; its joints are j0"),
        ("velocity: {j0: -1.0}", "velocity.j0 is -1.0"),
        ("speed: 3", "unknown entry 'speed'"),
        ("urdf: nowhere.urdf", "no URDF nowhere.urdf"),
        ("urdf: package://no_such/arm.urdf", "package is not installed|no_such"),
    ],
)
def test_a_file_that_is_wrong_is_named(tmp_path, line, says):
    (tmp_path / "arm.urdf").write_text(urdf_of(["revolute"]))
    lines = {"urdf": "urdf: arm.urdf", "base": "base: l0", "tool": "tool: l1"}
    lines[line.partition(":")[0]] = line
    path = tmp_path / "it.yaml"
    path.write_text("\n".join(lines.values()))
    with pytest.raises((ValueError, OSError), match=says):
        load_arm(str(path))


def test_an_arm_that_is_not_there_is_refused_with_those_that_are():
    with pytest.raises(ValueError, match="no arm 'fr33'.*there are fr3, iiwa7, panda"):
        load_arm("fr33")


def test_import_writes_a_file_that_loads_again(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(urdf_of(["revolute"] * 5))
    assert main(["arm", "import", "arm.urdf", "--mount-height", "0.5"]) == 0
    said = capsys.readouterr().out
    assert "5 joints from l0 to l5" in said and "doubtful: the URDF says 1 rad/s" in said
    arm = load_arm("arm.yaml")
    assert len(arm.joints) == 5 and arm.mount_height == 0.5
    assert "# velocity: {j0: , j1: " in (tmp_path / "arm.yaml").read_text()
    assert main(["arm", "import", "arm.urdf"]) == 1
    assert "exists already" in capsys.readouterr().err


def test_of_several_hands_the_tool_is_asked_for(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hand = '<link name="finger"/><joint name="f" type="fixed"><parent link="l1"/>'
    urdf = urdf_of(["revolute"] * 2).replace(
        "</robot>", f'{hand}<child link="finger"/></joint></robot>'
    )
    assert urdf_ends(urdf, "it") == ("l0", ["l2", "finger"])
    (tmp_path / "arm.urdf").write_text(urdf)
    assert main(["arm", "import", "arm.urdf"]) == 1
    assert "--tool, one of l2, finger" in capsys.readouterr().err


def test_arms_are_listed_with_what_their_urdfs_lack(capsys):
    assert main(["arm", "list"]) == 0
    said = capsys.readouterr().out
    assert "wam: 7 joints\n" in said and "panda: 7 joints; no friction of any joint" in said


def test_a_urdf_of_a_python_package_is_found():
    assert "<robot" in read_urdf("package://pybullet_data/franka_panda/panda.urdf")
