"""The arm's joint states out of all that is published on their topic: each message is read by its
own names.
"""

import numpy as np
import pytest

from dart_skill.common.world import joint_names
from dart_skill.recording import deserialize, serialize, stamp_ns, typestore
from dart_skill.recording.imports import SignalSource
from dart_skill.recording.imports.joint_streams import joint_stream, read_states
from dart_skill.recording.mcap import BagMessage

TYPES, KIND, TOPIC = typestore(), "sensor_msgs/msg/JointState", "/joint_states"
NAMES = joint_names()
N, STEP = 400, 2_000_000
STAMPS = 10_000_000_000 + STEP * np.arange(N)
ANGLES = 0.3 + 0.5 * np.sin(0.01 * np.arange(N)[:, None] * (1.0 + np.arange(7)))
SPEEDS = np.gradient(ANGLES, 1e-9 * STEP, axis=0)
FINGERS = (["finger_left", "finger_right"], [0.01, 0.01], [])
ORDER = [4, 2, 0, 6, 1, 3, 5]


def said(k, names=NAMES, position=None, velocity=None, frame="world", late=0):
    """A message of the k-th instant: that of the arm, but for what is given."""
    content = {
        "header": {
            "stamp": {"sec": int(STAMPS[k]) // 10**9, "nanosec": int(STAMPS[k]) % 10**9},
            "frame_id": frame,
        },
        "name": list(names),
        "position": np.array(ANGLES[k] if position is None else position, dtype=float),
        "velocity": np.array(SPEEDS[k] if velocity is None else velocity, dtype=float),
    }
    return BagMessage(TOPIC, KIND, int(STAMPS[k]) + late, serialize(TYPES, KIND, content))


def read(messages, **where):
    """Positions and velocities (n, 7), and what was told."""
    source = SignalSource(TOPIC, **where)
    stamp_of = lambda one: stamp_ns(one.header.stamp)  # noqa: E731
    states = read_states(
        messages, TYPES, lambda one: deserialize(TYPES, one.type_name, one.data), source, stamp_of
    )
    stream, faults = joint_stream(states, states.stamp_ns, source)
    return stream, " | ".join(fault.message for fault in (*states.faults, *faults))


def plain():
    return [said(k) for k in range(N)]


def alternating():
    return [
        (
            said(k, [NAMES[i] for i in ORDER], ANGLES[k][ORDER], SPEEDS[k][ORDER])
            if k % 2
            else said(k)
        )
        for k in range(N)
    ]


def with_another(names, position, velocity, frame="world", every=1):
    """The arm's messages, and between them those of another publisher."""
    for k in range(N):
        if k % every == 0:
            yield said(k, names, position, velocity, frame)
        yield said(k)


SAME_ROWS = {
    "plain": (plain(), ""),
    "the order alternates": (alternating(), ""),
    "many orders": (
        [
            said(k, [NAMES[i] for i in o], ANGLES[k][o], SPEEDS[k][o])
            for k in range(N)
            for o in [np.roll(ORDER, k)]
        ],
        "",
    ),
    "a gripper": (
        list(with_another(*FINGERS, every=10)),
        "besides the arm's there are finger_left, finger_right",
    ),
    "a gripper in each message": (
        [said(k, [*NAMES, "mimic"], [*ANGLES[k], 9.0], [*SPEEDS[k], 0.0]) for k in range(N)],
        "besides the arm's there are mimic",
    ),
    "a prefixed twin": (
        list(with_another([f"sim_{name}" for name in NAMES], np.ones(7), np.ones(7))),
        "there are sim_wam_j1, sim_wam_j2",
    ),
    "zeros in another order": (
        list(with_another([NAMES[i] for i in ORDER], np.zeros(7), [], every=10)),
        "say zeros while the others move",
    ),
    "zeros in our order": (
        list(with_another(NAMES, np.zeros(7), np.zeros(7), every=5)),
        "say zeros while the others move",
    ),
    "a twin that stands": (list(with_another(NAMES, np.full(7, 0.7), [])), "say always [0.7, 0.7"),
    "a part of the arm": (
        list(with_another(NAMES[:3], np.ones(3), [])),
        "400 messages left out: joint wam_j4 is missing",
    ),
    "a position too many": (
        list(with_another(NAMES, np.zeros(8), [], every=4)),
        "100 messages left out: has 7 names and 8 positions",
    ),
    "efforts only": (
        list(with_another(NAMES, [], [], every=4)),
        "100 messages left out: has 7 names and 0 positions",
    ),
    "a name twice": (
        list(with_another([*NAMES[:6], NAMES[0]], np.zeros(7), [])),
        "joint wam_j1 is named twice",
    ),
    "nobody's names": (
        list(with_another([], np.zeros(3), [])),
        "400 messages left out: has no names",
    ),
}


@pytest.mark.parametrize("kind", SAME_ROWS)
def test_the_arms_rows_are_those_of_its_own_messages(kind):
    messages, told = SAME_ROWS[kind]
    stream, text = read(messages)
    np.testing.assert_array_equal(stream.stamp_ns, STAMPS)
    np.testing.assert_array_equal(stream.position, ANGLES)
    np.testing.assert_array_equal(stream.velocity, SPEEDS)
    assert told in text and (told or not text), text


def test_joints_with_something_before_or_behind_their_names_are_known_by_them():
    stream, text = read(
        [
            said(k, [f"left/{NAMES[i]}_joint" for i in ORDER], ANGLES[k][ORDER], SPEEDS[k][ORDER])
            for k in range(N)
        ]
    )
    np.testing.assert_array_equal(stream.position, ANGLES)
    assert "the joints of the arm are taken to be left/wam_j1_joint, " in text


def test_names_that_change_in_the_course_of_a_recording_are_followed():
    half = N // 2
    stream, text = read(
        [said(k) if k < half else said(k, [f"robot/{name}" for name in NAMES]) for k in range(N)]
    )
    np.testing.assert_array_equal(stream.position, ANGLES)
    assert "from here on they are called robot/wam_j1" in text and "besides" not in text


def test_two_arms_are_told_by_the_mapping_that_the_message_asks_for():
    sides = [[f"{side}_{name}" for name in NAMES] for side in ("left", "right")]
    messages = [said(k, sides[0] + sides[1], [*ANGLES[k], *np.ones(7)], []) for k in range(N)]
    with pytest.raises(
        ValueError,
        match=(
            r"which of them is the arm\? .*names: \[left_wam_j1, .* or joints: .*names:"
            r" \[right_wam_j1"
        ),
    ):
        read(messages)
    np.testing.assert_array_equal(read(messages, names=tuple(sides[0]))[0].position, ANGLES)
    assert (read(messages, names=tuple(sides[1]))[0].position == 1.0).all()


def test_seven_names_that_are_not_ours_are_taken_in_their_order_and_told():
    stream, text = read([said(k, [f"axis_{j}" for j in range(7)]) for k in range(N)])
    np.testing.assert_array_equal(stream.position, ANGLES)
    assert "taken to be axis_0, axis_1" in text
    with pytest.raises(
        ValueError,
        match="400 messages that list axis_0, .*axis_7, .*: name the arm's joints in a mapping",
    ):
        read([said(k, [f"axis_{j}" for j in range(8)], np.zeros(8), []) for k in range(N)])


def test_joints_without_names_are_taken_in_the_arms_order_and_told():
    stream, text = read([said(k, []) for k in range(N)])
    np.testing.assert_array_equal(stream.position, ANGLES)
    assert "no names were recorded" in text


def test_joints_that_come_in_two_messages_are_put_together():
    messages = []
    for k in range(N):
        messages += [
            said(k, NAMES[:4], ANGLES[k][:4], SPEEDS[k][:4]),
            said(k, NAMES[4:], ANGLES[k][4:], SPEEDS[k][4:]),
        ]
    stream, text = read(messages)
    np.testing.assert_allclose(stream.position, ANGLES, atol=1e-15)
    np.testing.assert_allclose(stream.velocity, SPEEDS, atol=1e-12)
    assert "come in messages of their own" in text


def test_joints_that_come_now_and_then_are_between_their_messages_and_unknown_over_a_pause():
    seldom = [k for k in range(0, N, 4) if not 80 < k < 240]
    stream, text = read(
        [said(k, NAMES[:4], ANGLES[k][:4], SPEEDS[k][:4]) for k in range(N)]
        + [said(k, NAMES[4:], ANGLES[k][4:], SPEEDS[k][4:]) for k in seldom]
    )
    known = [k for k in range(seldom[-1] + 1) if not 80 < k < 240]
    np.testing.assert_array_equal(stream.stamp_ns, STAMPS[known])
    between = np.interp(STAMPS[known], STAMPS[seldom], ANGLES[seldom, 6])
    np.testing.assert_allclose(stream.position[:, 6], between, atol=1e-12)
    assert f"{N - len(known)} states lack the position of a joint" in text


@pytest.mark.parametrize("change", [{"names": NAMES[::-1]}, {"frame": "sim"}])
def test_two_that_contradict_each_other_are_refused_with_the_line_that_chooses(change):
    messages = [
        said(k, **change, position=ANGLES[k] + 1.0) if k % 2 else said(k) for k in range(N)
    ]
    with pytest.raises(ValueError, match="two publishers contradict each other") as error:
        read(messages)
    key = "listed" if "names" in change else "frame"
    assert f"{key}: " in str(error.value)
    stream, _ = read(messages, **({"listed": NAMES} if key == "listed" else {"frame": "world"}))
    np.testing.assert_array_equal(stream.position, ANGLES[::2])


def test_two_that_nothing_tells_apart_are_refused():
    with pytest.raises(
        ValueError,
        match="in messages that nothing tells apart: record them on topics of their own",
    ):
        read([said(k, position=ANGLES[k] + (k % 2)) for k in range(N)])


def test_an_arm_that_shakes_is_one_arm():
    shaking = ANGLES + np.random.default_rng(0).normal(scale=2e-3, size=ANGLES.shape)
    stream, text = read([said(k, position=shaking[k]) for k in range(N)])
    np.testing.assert_array_equal(stream.position, shaking)
    assert not text


@pytest.mark.parametrize("lacks", ["all", "some", "one joint", "zeros", "not a number"])
def test_velocities_that_were_not_recorded_follow_from_the_positions(lacks):
    speeds = [None] * N
    if lacks in ("all", "some"):
        speeds = [[] if lacks == "all" or k % 3 else None for k in range(N)]
    elif lacks == "zeros":
        speeds = [np.zeros(7)] * N
    else:
        speeds = [
            np.where(np.arange(7) == 2, 0.0 if lacks == "one joint" else np.nan, row)
            for row in SPEEDS
        ]
    stream, text = read([said(k, velocity=speeds[k]) for k in range(N)])
    np.testing.assert_allclose(stream.velocity, SPEEDS, atol=1e-9)
    assert "from the positions instead" in text


def test_an_angle_that_is_counted_within_a_turn_has_no_leap_of_speed():
    turning = np.linspace(2.0, 5.0, N)[:, None] + np.zeros(7)
    stream, _ = read(
        [
            said(k, position=(turning[k] + np.pi) % (2 * np.pi) - np.pi, velocity=[])
            for k in range(N)
        ]
    )
    np.testing.assert_allclose(
        stream.velocity, np.gradient(turning[:, 0], 1e-9 * STEP)[:, None] + np.zeros(7), rtol=1e-6
    )


def test_states_without_a_position_are_left_out_and_a_joint_without_any_is_an_error():
    gone = [np.where(np.arange(7) == 3, np.nan, row) for row in ANGLES]
    stream, text = read([said(k, position=gone[k] if k % 4 == 0 else None) for k in range(N)])
    assert len(stream.stamp_ns) == 300 and "100 states lack the position of a joint" in text
    with pytest.raises(ValueError, match="joint wam_j4 never has a position that is a number"):
        read([said(k, position=gone[k]) for k in range(N)])


def test_nobody_speaks_of_the_arm():
    with pytest.raises(
        ValueError,
        match=(
            "400 messages that list finger_left, finger_right.*: name the arm's joints in a"
            " mapping"
        ),
    ):
        read([said(k, *FINGERS) for k in range(N)])
    with pytest.raises(ValueError, match="no joint 'wam_j7', only"):
        read([said(k, NAMES[:6], ANGLES[k][:6], []) for k in range(N)])
