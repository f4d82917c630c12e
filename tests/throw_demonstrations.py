"""Demonstrations of throws by the names that a throw has for their parts."""

from dataclasses import replace

import numpy as np

from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import Demonstration, Event, Track

HAND, BALL = ("hand_time", "hand_position", "hand_quaternion"), ("ball_time", "ball_position")
OWN = {*HAND, *BALL, "target", "hand_opened"}


def throw_demonstration(bodies=("ball", "basket"), **parts):
    """One from hand_time, hand_position, hand_quaternion, ball_time, ball_position, target,
    hand_opened and the fields of a demonstration. bodies: what is thrown, and at what.
    """
    ball = parts.get("ball_time", np.empty(0)), parts.get("ball_position", np.empty((0, 3)))
    opened = parts.get("hand_opened", np.nan)
    return Demonstration(
        tracks={
            "hand": Track(*(parts[name] for name in HAND)),
            bodies[0]: Track.unturned(*ball),
        },
        situation=Situation({bodies[1]: Pose(parts["target"])}),
        events=() if np.isnan(opened) else (Event("open", opened),),
        **{name: value for name, value in parts.items() if name not in OWN},
    )


def parts_of(one):
    """All that `throw_demonstration` makes a demonstration from."""
    others = ("id", "stamp_ns", "skill", "motion_start", "motion_stop", "frame_id", "joint_names")
    joints = ("joint_time", "joint_position", "joint_velocity")
    return {
        **{name: getattr(one, name) for name in (*HAND, *others, *joints, "target")},
        "hand_opened": one.opened,
        "ball_time": one.moved.time,
        "ball_position": one.moved.position,
    }


def changed_throw(one, **changes):
    """The same with other parts."""
    if not OWN & set(changes):
        return replace(one, **changes)
    bodies = (*(role for role in one.tracks if role != "hand"), *one.situation.poses)
    return throw_demonstration(bodies, **{**parts_of(one), **changes})


def assert_same(one, two, tolerance=0.0, time=0.0):
    """Both have the same numbers, within tolerances."""
    for name in ("id", "skill", "frame_id", "joint_names"):
        assert getattr(one, name) == getattr(two, name)
    assert one.stamp_ns == two.stamp_ns and list(one.tracks) == list(two.tracks)
    pairs = [(one.tracks[role], two.tracks[role]) for role in one.tracks]
    pairs += [
        (one.situation.poses[role], two.situation.poses[role]) for role in one.situation.poses
    ]
    for a, b in [*pairs, (one, two)]:
        for name, value in vars(a).items():
            if isinstance(value, np.ndarray):
                near = time if name.endswith("time") else tolerance
                np.testing.assert_allclose(
                    getattr(b, name), value, rtol=0, atol=near, err_msg=name
                )
    assert list(one.situation.poses) == list(two.situation.poses)
    assert one.situation.numbers == two.situation.numbers
    assert [event.name for event in one.events] == [event.name for event in two.events]
    instants = [
        [*(event.time for event in each.events), each.motion_start, each.motion_stop]
        for each in (one, two)
    ]
    np.testing.assert_allclose(*instants, rtol=0.0, atol=time)
