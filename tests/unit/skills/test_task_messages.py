"""Demonstrations of any skill: what a recorder keeps of them, and their way through messages, bags
and model files.
"""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.arm import Grip
from dart_skill.recording import (
    DEMONSTRATION_TOPIC,
    DEMONSTRATION_TYPE,
    BagError,
    BagWriter,
    Demonstration,
    Event,
    definition,
    demonstration_from_message,
    demonstration_message,
    deserialize,
    message,
    qos_yaml,
    read_demonstrations,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.skills.observation import SensorLog
from dart_skill.skills.practice import Practice, ResidualPractice
from dart_skill.skills.protocol import Skill, SkillSettings, TaskOutcome, load_skill
from dart_skill.skills.throw import Throw
from tests.throw_demonstrations import assert_same
from tests.unit.skills.task_demonstrations import draw_body, show, situation_of

ORIGIN_NS = 1_700_000_123_456_789_012
TOLD = (Event("close", 5.0), Event("open", 6.9))


class Push(Skill):
    """Between the hand and one body."""

    name, bodies, corrects = "push", ("button",), "button"


@pytest.fixture(scope="module")
def types():
    return typestore()


def shown(seed=0, told=TOLD):
    rng = np.random.default_rng(seed)
    one = show(rng, draw_body(rng), told=told, name=f"push_{seed}")
    return replace(one, stamp_ns=ORIGIN_NS + seed, skill="push")


# messages and bags


@pytest.mark.parametrize("told", [TOLD, ()])
def test_through_a_message_and_its_bytes_and_back(types, told):
    one = shown(told=told)
    data = serialize(
        types, DEMONSTRATION_TYPE, demonstration_message(types, Push().described(one))
    )
    read = deserialize(types, DEMONSTRATION_TYPE, data)
    assert_same(Push().described(one), demonstration_from_message(read, "push"), 1e-9, 1e-9)
    start, stop = Push().cut(one)
    begun = read.motion_start.sec * 10**9 + read.motion_start.nanosec
    assert (
        begun == one.stamp_ns + round(1e9 * start)
        and read.motion_stop.sec >= read.motion_start.sec
        and stop > start
    )
    assert list(read.situation.bodies) == ["hand", "button"] and read.skill == "push"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda msg: setattr(msg, "skill", "throw"),
            "push_0 is of the skill 'throw', not of 'push'",
        ),
        (
            lambda msg: setattr(msg.header, "frame_id", "camera"),
            "is in frame 'camera', not 'world'",
        ),
        (lambda msg: setattr(msg.events[0], "name", "squeeze"), "an event is called 'squeeze'"),
        (
            lambda msg: setattr(msg.tracks[0], "body", "foot"),
            "no track of the hand, only of button, foot",
        ),
    ],
)
def test_what_is_none_is_refused_by_name(types, change, said):
    msg = demonstration_message(types, Push().described(shown()))
    change(msg)
    with pytest.raises(ValueError, match=said):
        demonstration_from_message(msg, "push")


def test_a_bag_of_a_skill_is_read_and_one_of_another_skill_is_refused(tmp_path, types):
    both = [shown(0), shown(1)]
    with BagWriter(tmp_path / "bag") as bag:
        kind = DEMONSTRATION_TYPE
        bag.add_topic(
            DEMONSTRATION_TOPIC, kind, definition(types, kind), qos_yaml(), type_hash(types, kind)
        )
        for k, one in enumerate(both):
            bag.write(
                DEMONSTRATION_TOPIC,
                k,
                k,
                serialize(types, kind, demonstration_message(types, Push().described(one))),
            )
    for one, again in zip(both, read_demonstrations(tmp_path / "bag", "push"), strict=True):
        assert_same(Push().described(one), again, 1e-9, 1e-9)
    with pytest.raises(BagError, match="of the skill 'push', not of 'place'"):
        read_demonstrations(tmp_path / "bag", "place")


def test_a_bag_without_demonstrations_is_refused(tmp_path, types):
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic(
            "/other",
            "std_msgs/msg/String",
            definition(types, "std_msgs/msg/String"),
            qos_yaml(),
            "",
        )
        bag.write(
            "/other",
            1,
            1,
            serialize(types, "std_msgs/msg/String", message(types, "std_msgs/msg/String")),
        )
    with pytest.raises(BagError, match="no topic /demonstrations"):
        read_demonstrations(tmp_path / "bag", "push")


# what a recorder keeps


def heard(one: Demonstration, offset_ns=0):
    """A log that has seen all of a demonstration."""
    log = Push().sensor_log()
    for role, track in one.tracks.items():
        for time, position, quaternion in zip(
            track.time, track.position, track.quaternion, strict=True
        ):
            log.take(role, offset_ns + round(1e9 * time), position, quaternion)
    for time, position, velocity in zip(
        one.joint_time, one.joint_position, one.joint_velocity, strict=True
    ):
        log.add_joints(offset_ns + round(1e9 * time), position, velocity)
    for told in one.events:
        log.add_told(offset_ns + round(1e9 * told.time), told.grip)
    return log


def test_what_was_heard_is_cut_out_again():
    one = shown()
    cut = heard(one, ORIGIN_NS).seen("push_0", ORIGIN_NS, ORIGIN_NS + 10**11, "push")
    assert_same(replace(one, stamp_ns=ORIGIN_NS), cut, 2e-9, 2e-9)


def test_the_same_word_again_and_again_counts_once_and_later_again():
    log, ms = SensorLog(["hand"]), 1_000_000
    for k in range(50):
        log.add_told(k * 2 * ms, Grip.OPEN)
        log.add_told(k * 2 * ms, Grip.UNSPECIFIED)
    log.add_told(400 * ms, Grip.OPEN)
    log.add_told(402 * ms, Grip.CLOSE)
    assert log.told == [(0, Grip.OPEN), (400 * ms, Grip.OPEN), (402 * ms, Grip.CLOSE)]
    log.forget_before(401 * ms)
    assert log.told == [(402 * ms, Grip.CLOSE)]
    log.clear()
    assert log.told == []


def test_a_body_that_was_not_seen_is_named():
    log = heard(shown())
    log.bodies["button"].stamps.clear()
    with pytest.raises(ValueError, match="the button was not seen"):
        log.seen("x", 0, 10**12, "push")
    with pytest.raises(ValueError, match="no samples of the hand"):
        Push().sensor_log().world_begins_ns()


def test_bodies_are_where_they_were_seen_of_late():
    one = shown()
    log = heard(one)
    stamp = round(1e9 * one.tracks["button"].time[100])
    seen = log.situation_at(stamp)
    assert list(seen.poses) == ["button"]
    assert seen.pose("button").position == pytest.approx(
        one.tracks["button"].pose_at(stamp * 1e-9).position, abs=1e-4
    )
    with pytest.raises(ValueError, match="was not seen"):
        log.situation_at(stamp + 10**11)


def test_a_demonstration_begins_with_its_own_world():
    """Before it the simulator was reset: what was seen in the world before does not belong to it."""
    before, one = shown(1, told=()), shown(0)
    log, later = heard(before), 10**11
    for role, track in one.tracks.items():
        for time, position, quaternion in zip(
            track.time, track.position, track.quaternion, strict=True
        ):
            log.take(role, later + round(1e9 * time), position, quaternion)
    for time, position in zip(one.joint_time, one.joint_position, strict=True):
        log.add_joints(later + round(1e9 * time), position, np.zeros(7))
    log.add_told(later + 5 * 10**9, Grip.CLOSE)
    assert log.world_begins_ns() == later + round(1e9 * one.hand_time[0])


# model files


@pytest.fixture(scope="module")
def practised():
    skill = Push(SkillSettings(components=6, stiffness=300.0))
    one = ResidualPractice(skill, [shown(seed) for seed in range(4)])
    one.model.tell(TaskOutcome(True, 0.01, miss=np.array([0.004, 0.0, 0.002])))
    return one


def test_a_model_file_learns_the_same_again(practised, tmp_path):
    practised.save(tmp_path / "push.npz")
    learned = practised.model
    again = ResidualPractice.load(tmp_path / "push.npz", Push()).model
    assert again.model_id == learned.model_id
    assert again.skill.settings == learned.skill.settings and len(again.misses) == 1
    rng = np.random.default_rng(9)
    situation = situation_of(draw_body(rng))
    np.testing.assert_array_equal(
        again.plan(situation).attractor_position, learned.plan(situation).attractor_position
    )
    with pytest.raises(FileExistsError):
        practised.save(tmp_path / "push.npz")
    with pytest.raises(FileNotFoundError, match="no folder"):
        practised.save(tmp_path / "nowhere" / "push.npz")


def test_a_file_that_is_no_model_of_this_skill_is_refused(practised, tmp_path):
    practised.save(tmp_path / "push.npz")
    with pytest.raises(ValueError, match="a model of the skill 'push', not of 'place'"):
        Practice.load(tmp_path / "push.npz", load_skill("place"))
    whole = (tmp_path / "push.npz").read_bytes()
    for name, data in {"text": b"nothing", "half": whole[: len(whole) // 2], "empty": b""}.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(ValueError, match="is not a model file of dart_skill"):
            Practice.load(tmp_path / name, Push())
    np.savez(tmp_path / "other.npz", format=np.array("other"))
    with pytest.raises(ValueError, match="its format is 'other'"):
        Practice.load(tmp_path / "other.npz", Push())


# throwing, in the words of all skills


@pytest.mark.parametrize(("past", "success"), [(0.02, True), (0.40, False)])
def test_a_throw_is_judged_by_where_the_ball_came_down(past, success):
    rim, opened, height = np.array([2.0, 0.0, 0.4]), 5.5, 1.8
    fall = np.sqrt(2.0 * (height - rim[2]) / 9.81)
    after = np.arange(0.0, fall + 0.02, 0.01)  # then it is hidden by the basket
    position = np.column_stack(
        [(rim[0] + past) * after / fall, 0.0 * after, height - 0.5 * 9.81 * after**2]
    )
    ball = replace(
        shown().tracks["button"],
        time=opened + after,
        position=position,
        quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (len(after), 1)),
    )
    one = shown(told=(Event("open", opened),))
    seen = replace(
        one, tracks={"hand": one.tracks["hand"], "ball": ball, "basket": one.tracks["button"]}
    )
    outcome = Throw().judge(
        seen, situation_of(replace(one.tracks["button"].pose_at(5.0), position=rim), role="basket")
    )
    assert outcome.success == success and outcome.error == pytest.approx(past, abs=5e-3)
    assert outcome.miss == pytest.approx([past, 0.0, 0.0], abs=5e-3)
    assert bool(outcome.reason) != success
    silent = Throw().judge(
        replace(seen, events=()), situation_of(draw_body(np.random.default_rng(0)), role="basket")
    )
    assert not silent.success and "never told to open" in silent.reason


@pytest.mark.parametrize(
    ("ball", "said"),
    [([2.0, 0.0, 0.1], "the ball was not in the hand"), ([0.5, 0.1, 1.2], "was not seen")],
)
def test_why_nobody_saw_a_ball_land_is_said(ball, said):
    """An empty hand was executed without a word."""
    throw, ns = Throw(), 10_000_000
    log = throw.sensor_log()
    for k in range(100):
        log.take("hand", k * ns, np.array([0.5, 0.0, 1.3]), np.array([0.0, 0.0, 0.0, 1.0]))
        log.take("ball", k * ns, np.array(ball), np.array([0.0, 0.0, 0.0, 1.0]))
    asked = throw.at(np.array([2.0, 0.0, 0.4]))
    outcome, _ = throw.outcome(log, asked, 50 * ns, 99 * ns, 200 * ns)
    assert not outcome.success and said in outcome.reason


def test_baskets_are_drawn_from_the_region():
    rng = np.random.default_rng(3)
    for _ in range(20):
        basket = Throw().draw(rng).pose("basket").position
        assert 1.5 <= np.hypot(*basket[:2]) <= 2.5 and basket[2] == pytest.approx(0.4)
    assert Throw().situated == ("basket",)


def test_a_skill_that_nobody_can_show_or_try_in_simulation_says_what_to_write():
    with pytest.raises(ValueError, match="write Push.goal"):
        Push().goal(situation_of(draw_body(np.random.default_rng(0))))
    with pytest.raises(ValueError, match="write Push.draw"):
        Push().draw(np.random.default_rng(0))
