"""Each line of the table says go of an arm that is right, and no go, with the value and the
remedy, of its own fault.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import Registration
from dart_skill.arm.check import (
    Endpoint,
    Grade,
    Heard,
    HeardJoints,
    HeardPoses,
    PostureCounter,
    as_text,
)
from tests.unit.arm.check.heard import (
    BEGIN_NS,
    NAMES,
    QUIET,
    heard,
    kept,
    table,
    with_joints,
    with_pose,
)

GOOD = heard()
LOOSE = Registration(
    tuple(Rotation.from_rotvec([0.01, -0.005, 0.015]).as_quat()),
    (0.004, -0.003, 0.006),  # fmt: skip
    tuple(Rotation.from_rotvec([0.0, 0.015, -0.01]).as_quat()),
    (0.002, 0.0, -0.003),
)


def test_an_arm_that_is_right_is_go_in_every_line():
    lines, report = table(GOOD)
    assert {one.verdict for one in report.lines} == {Grade.GO}, [
        one for one in report.lines if one.verdict is not Grade.GO
    ]
    assert report.is_go and not any(one.remedy for one in report.lines)
    assert "6.0 ms" in lines["/vrpn_mocap/hand/pose: stamps"].measured
    assert report.registration.position_error < 3e-4


def test_what_cameras_and_arm_differ_in_is_found():
    fit = table(heard(LOOSE))[1].registration.registration
    for name in ("turn", "hand_turn"):
        turned = Rotation.from_quat(getattr(fit, name)).inv() * Rotation.from_quat(
            getattr(LOOSE, name)
        )
        assert turned.magnitude() < 1e-3
    assert np.linalg.norm(np.subtract(fit.shift, LOOSE.shift)) < 1e-3
    assert np.linalg.norm(np.subtract(fit.hand_shift, LOOSE.hand_shift)) < 1e-3


def joints(**change):
    return with_joints(GOOD, **change)


def pose(role="hand", **change):
    return with_pose(GOOD, role, **change)


def seen_with(**change):
    return heard(replace(Registration(), **change))


def about(vector):
    return tuple(Rotation.from_rotvec(vector).as_quat())


J, H = GOOD.joints, GOOD.poses["hand"]
SWAPPED = ("finger", "wam_j2", "wam_j1", *NAMES[2:])
HALF = np.arange(len(H)) % 2 == 0
UNSEEN = H.position[:, 2] < np.quantile(H.position[:, 2], 0.7)
ONE_AXIS = np.column_stack([J.position[:, 0], *np.tile(J.position[0, 1:], (len(J), 1)).T])
NO_BALL, NO_HAND = HeardPoses("/vrpn_mocap/ball/pose"), HeardPoses("/vrpn_mocap/hand/pose")
BIASED = J.position + np.array([0.0, 0.0, 0.0, 0.15, 0.0, 0.0, 0.0])

FAULTS = {
    "nobody publishes": (
        "/joint_states",
        replace(GOOD, joints=HeardJoints("/joint_states")),
        "nobody publishes it",
        "start the arm's driver",
    ),
    "a driver that has ended": ("/joint_states: publisher", joints(publishers=()), "none", "look at its driver"),
    "two publish": (
        "/joint_states: publisher",
        joints(publishers=(Endpoint("wam_driver"), Endpoint("wam_simulator"))),
        "wam_driver, wam_simulator",
        "end all but one",
    ),
    "slow joints": ("/joint_states: rate", joints(stamp_ns=BEGIN_NS + 8_000_000 * np.arange(len(J))), "125.0 Hz", "rate"),
    "a gap": (
        "/joint_states: rate",
        joints(stamp_ns=J.stamp_ns + np.where(np.arange(len(J)) > 3000, 200_000_000, 0)),
        "longest gap 202 ms",
        "load",
    ),
    "no joint states": (
        "/joint_states",
        replace(GOOD, joints=HeardJoints("/joint_states", (Endpoint("wam_driver"),))),
        "no message, though wam_driver publishes it",
        "look at the arm's driver",
    ),
    "zero stamps": ("/joint_states: stamps", joints(stamp_ns=np.zeros(len(J), dtype=np.int64)), "are zero", "must stamp"),
    "stamps that go back": (
        "/joint_states: stamps",
        joints(stamp_ns=np.where(np.arange(len(J)) % 100 == 99, J.stamp_ns - 50_000_000, J.stamp_ns)),
        "do not increase",
        "once",
    ),
    "late joint stamps": ("/joint_states: stamps", joints(received_ns=J.stamp_ns + 300_000_000), "300.0 ms old", "chrony"),
    "stamps of the future": ("/joint_states: stamps", joints(received_ns=J.stamp_ns - 40_000_000), "-40.0 ms old", "clock"),
    "another epoch": ("/joint_states: stamps", joints(received_ns=J.stamp_ns + 10**18), "1000000000.0 s old", "clock"),
    "wrong names": ("joint names", joints(orders=(tuple(f"joint{k}" for k in range(7)),)), "wam_j1 is missing", "name the arm's joints"),
    "a name twice": ("joint names", joints(orders=((*NAMES[:6], "wam_j1"),)), "wam_j1 is named twice", "config/wam.yaml"),
    "hand joints, too": ("joint names", joints(n_odd=12), "12 messages", "topic of their own"),
    "degrees": ("joint positions", joints(position=np.rad2deg(J.position)), "wam_j2 at", "look like degrees"),
    "beyond its end": ("joint positions", joints(position=J.position - [0, 1.2, 0, 0, 0, 0, 0]), "wam_j2 at -2.6", "the arm's zero"),
    "nan positions": ("joint positions", joints(position=np.where(J.position > 1.0, np.nan, J.position)), "not finite", "driver"),
    "no speeds": ("joint velocities", joints(velocity=np.empty((len(J), 0))), "none", "let the driver give them"),
    "speeds of the other sign": ("joint velocities", joints(velocity=J.velocity * [1, 1, 1, -1, 1, 1, 1]), "wam_j4 -1.00", "sign"),
    "speeds in degrees": ("joint velocities", joints(velocity=np.rad2deg(J.velocity)), "wam_j1 57.3", "degrees per second"),
    "speeds of nothing": ("joint velocities", joints(velocity=0.4 * J.velocity), "0.40 times", "units, order and filter"),
    "late poses": ("/vrpn_mocap/hand/pose: stamps", pose(received_ns=H.stamp_ns + 150_000_000), "150.0 ms", "chrony"),
    "slow cameras": ("/vrpn_mocap/hand/pose: rate", with_pose(GOOD, **vars(kept(H, HALF))), "50.0 Hz", "rate"),
    "another frame": ("/vrpn_mocap/hand/pose: frame", pose(frames=("map",)), "'map'", "frame_id"),
    "two frames": ("/vrpn_mocap/hand/pose: frame", pose(frames=("map", "world")), "'map', 'world'", "frame_id"),
    "millimetres": ("/vrpn_mocap/hand/pose: frame", pose(position=1e3 * H.position), "m from the origin", "metres"),
    "quaternions of no length": ("/vrpn_mocap/hand/pose: frame", pose(quaternion=1.1 * H.quaternion), "off by 0.100", "x, y, z, w"),
    "nan poses": ("/vrpn_mocap/hand/pose: frame", pose(position=np.full_like(H.position, np.nan)), "not finite", "metres"),
    "silent camera": (
        "/vrpn_mocap/ball/pose",
        pose("ball", **{**vars(NO_BALL), "publishers": H.publishers}),
        "no message, though vrpn_mocap publishes it",
        "markers",
    ),
    "a body that is never seen": ("/vrpn_mocap/ball/pose", pose("ball", **vars(NO_BALL)), "nobody publishes it", "--remap"),
    "two time bases": ("time base", pose(received_ns=H.stamp_ns + 400_000_000), "399.0 ms", "chrony"),
    "two commanders": ("/wam/command", replace(GOOD, commanders=(Endpoint("a"), Endpoint("b"))), "from a, b", "end all but one of a, b"),
    "zeros of joints": ("hand against kinematics", joints(position=BIASED), "postures", "zero of a joint"),
    "nothing to compare": ("hand against kinematics", pose(**vars(NO_HAND)), "0 different postures", "8 postures"),
    "joints that are wrong": ("hand against kinematics", joints(position=np.rad2deg(J.position)), "not compared", "joints right first"),
    "a base elsewhere": ("base", seen_with(shift=(0.3, 0.0, 0.0)), "at (299.9", "origin below J1"),
    "a base that is turned": ("base", seen_with(turn=about((0.0, 0.0, 0.3))), "turned by 17.19 deg", "x where J1 is zero"),
    "another mount height": ("mount height", seen_with(shift=(0.0, 0.0, 0.2)), "seen at 1.04", "set mount_height"),
    "a body that is turned": ("body on the hand", seen_with(hand_turn=about((0.0, 1.5, 0.0))), "turned by 85.9", "z out of the palm"),
    "a body elsewhere": ("body on the hand", seen_with(hand_shift=(0.0, 0.0, 0.09)), "90", "mounting face"),
    "stamps of the cameras late": ("delay of the stamps", pose(stamp_ns=H.stamp_ns + 60_000_000), "59.9 ms", "use_vrpn_timestamps"),
    "a corner without cameras": ("hand: seen", with_pose(GOOD, **vars(kept(H, UNSEEN))), "in 7", "with the hand about"),
    "noise": ("hand: noise", heard(noise=8e-3), "mm", "calibrate"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_no_go_in_its_line(fault):
    check, whole, measured, remedy = FAULTS[fault]
    lines, report = table(whole)
    assert lines[check].verdict is Grade.NO_GO, lines[check]
    assert measured in lines[check].measured and remedy in lines[check].remedy, lines[check]
    assert not report.is_go


@pytest.mark.parametrize(
    ("limit", "value", "check"),
    [
        ("strongest_force", 400.0, "strongest force"),
        ("fastest_hand", 9.0, "fastest hand"),
        ("farthest_error", 0.5, "farthest error"),
        ("joint_margin", 2.5, "joint limits"),
    ],
)
def test_limits_that_are_no_limits_are_no_go(limit, value, check):
    lines, _ = table(GOOD, {**QUIET, limit: value})
    assert lines[check].verdict is Grade.NO_GO and f"{value:g}" in lines[check].measured


def test_what_can_be_borne_is_a_warning_and_go():
    """Stamps of the receipt, limits of the usual throws, a joint that nobody moved, a base that
    throws alone would not tell.
    """
    lines, report = table(
        with_pose(GOOD, received_ns=H.stamp_ns + 100_000),
        {**QUIET, "strongest_force": 250.0, "fastest_hand": 5.5},
    )
    assert report.is_go
    told = {check: one for check, one in lines.items() if one.verdict is Grade.WARN}
    assert set(told) == {"/vrpn_mocap/hand/pose: stamps", "strongest force", "fastest hand"}
    assert (
        "use_vrpn_timestamps" in told["/vrpn_mocap/hand/pose: stamps"].remedy
        and "VL2" in told["fastest hand"].remedy
    )
    resting, _ = table(
        joints(
            position=J.position * [1, 1, 1, 1, 1, 1, 0],
            velocity=J.velocity * [1, 1, 1, 1, 1, 1, 0],
        )
    )
    assert (
        resting["joint velocities"].verdict is Grade.WARN
        and "wam_j7" in resting["joint velocities"].remedy
    )
    lost, _ = table(joints(publishers=(Endpoint("wam_driver", "best_effort"),)))
    assert (
        lost["/joint_states: QoS"].verdict is Grade.WARN
        and "no command" in lost["/joint_states: QoS"].remedy
    )
    assert table(joints(orders=(SWAPPED,)))[0]["joint names"].verdict is Grade.GO, (
        "nodes read them by their names"
    )
    moved, report = table(seen_with(shift=(0.08, 0.0, 0.0)))
    assert (
        moved["base"].verdict is Grade.WARN
        and "registration_file" in moved["base"].remedy
        and report.registration is not None
    )


def test_what_was_tried_and_worked_is_no_reason_to_move_nothing():
    """The project's own home posture has j2 at its end, where encoders say -2.00 and a little more,
    and 250 states a second were enough: both were NO-GO.
    """
    home, slow = J.position.copy(), BEGIN_NS + 4_000_000 * np.arange(len(J))
    home[:, 1] += -2.003 - home[:, 1].min()
    lines, _ = table(joints(position=home))
    assert lines["joint positions"].verdict is Grade.WARN
    assert lines["joint positions"].measured == "beyond its end: wam_j2, by 0.003 rad"
    farther, _ = table(joints(position=home - [0, 0.06, 0, 0, 0, 0, 0]))
    assert farther["joint positions"].verdict is Grade.NO_GO
    lines, _ = table(joints(stamp_ns=slow))
    rate = lines["/joint_states: rate"]
    assert (rate.verdict, rate.measured[:8]) == (Grade.WARN, "250.0 Hz"), rate


def test_postures_about_one_axis_do_not_suffice_and_it_is_said_of_what():
    one = led_about_j1_only()
    lines, report = table(one)
    assert lines["postures"].verdict is Grade.NO_GO and report.registration is None
    assert "turn of the body z" in lines["postures"].remedy and "J3" in lines["postures"].remedy
    assert "base" not in lines, "a number that the postures do not tell is not told"


def led_about_j1_only():
    from tests.unit.arm.check.heard import MODEL

    time = (J.stamp_ns - BEGIN_NS) * 1e-9
    frames = (H.stamp_ns - BEGIN_NS) * 1e-9
    hands = [MODEL.hand_pose(row) for row in ONE_AXIS[:: len(J) // len(H)][: len(H)]]
    velocity = np.gradient(ONE_AXIS, time, axis=0)
    place, turn = (
        np.array([p for p, _ in hands]),
        Rotation.from_matrix(np.array([r for _, r in hands])).as_quat(),
    )
    assert len(frames) == len(hands)
    return with_pose(joints(position=ONE_AXIS, velocity=velocity), position=place, quaternion=turn)


def test_nothing_at_all_is_no_go_and_no_exception():
    silent = {role: HeardPoses(stream.topic) for role, stream in GOOD.poses.items()}
    lines, report = table(Heard(False, HeardJoints("/joint_states"), silent))
    assert not report.is_go and report.registration is None
    assert all(math.isfinite(len(one.measured)) and one.measured for one in lines.values())


def test_a_body_that_is_missing_is_said_in_one_line():
    """It was seven lines of NO-GO: publisher, QoS, rate, stamps, frame, seen, noise."""
    _, report = table(pose("ball", **vars(NO_BALL)))
    (missing,) = [one for one in report.lines if one.verdict is not Grade.GO]
    assert missing.check == "/vrpn_mocap/ball/pose" and "config/world.yaml" in missing.remedy
    _, silent = table(replace(GOOD, joints=HeardJoints("/joint_states")))
    assert sum("joint" in one.check for one in silent.lines if one.verdict is Grade.NO_GO) == 1


@pytest.mark.parametrize("held", ["ball", ""])
def test_what_belongs_into_the_hand_is_asked_for_by_its_name(held):
    """It was the ball of every skill."""
    lines, _ = table(replace(pose("ball", **vars(kept(GOOD.poses["ball"], UNSEEN))), in_hand=held))
    assert ("put the ball into the hand" in lines["ball: seen"].remedy) == bool(held)


@pytest.mark.parametrize("width", [80, 100, 300])
def test_the_table_is_no_wider_than_a_terminal(width):
    _, report = table(with_pose(pose(frames=("map", "world")), "ball", **vars(NO_BALL)))
    text = as_text(report, width)
    assert max(map(len, text.splitlines())) <= min(width, 120)
    (frame,) = [one for one in report.lines if one.check.endswith("hand/pose: frame")]
    (row,) = [one for one in text.splitlines() if frame.check in one]
    assert row.startswith("NO-GO  /vrpn_mocap/hand/pose: frame") and frame.measured in row
    words = text.split()
    for one in report.lines:
        told = [*one.measured.split(), *f"(asked: {one.asked})".split(), *one.remedy.split()]
        assert any(words[k : k + len(told)] == told for k in range(len(words))), one
    assert text.endswith("33 GO, 2 NO-GO")


def test_in_a_simulation_ages_are_of_its_own_clock():
    zero = with_joints(
        GOOD, stamp_ns=J.stamp_ns - BEGIN_NS + 10**9, received_ns=J.received_ns - BEGIN_NS + 10**9
    )
    for role, stream in zero.poses.items():
        shifted = {
            name: getattr(stream, name) - BEGIN_NS + 10**9 for name in ("stamp_ns", "received_ns")
        }
        zero = with_pose(zero, role, **shifted)
    lines, report = table(
        replace(zero, simulated=True), {**QUIET, "strongest_force": 250.0, "fastest_hand": 5.5}
    )
    assert {one.verdict for one in report.lines} == {Grade.GO}, [
        one for one in report.lines if one.verdict is not Grade.GO
    ]
    assert "/clock" in lines["/joint_states: stamps"].asked


def test_postures_are_counted_when_the_arm_rests_in_a_new_one():
    counter, time, places = (
        PostureCounter(),
        0.0,
        [np.zeros(7), np.full(7, 0.5), np.zeros(7), np.full(7, -0.5)],
    )
    counts, last = [], places[0]
    for place in places:
        for share in np.linspace(0.0, 1.0, 50):
            time += 0.01
            counter.add(time, last + share * (place - last))
        for _ in range(50):
            time += 0.01
            counter.add(time, place)
        last = place
        counts.append(len(counter))
    assert counts == [1, 2, 2, 3]
