"""Every fault is put into clean poses and must be found where it is; what is repaired must be the
clean poses again.
"""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.recording.imports.pose_faults import repair
from dart_skill.recording.imports.pose_stream import PoseStream

MS = 1_000_000
FRAME = 10 * MS
START = 1_700_000_000_000_000_000
N = 800
# frames: the hand begins to move, the ball leaves it, and lies in the basket
SWING, RELEASE, LANDED = (
    200,
    240,
    290,
)


def clean(seed=0, noise=1e-4):
    """A hand that rests, swings for 0.8 s and rests; a ball in it that is thrown, flies, and
    rests; a basket: by body, 100 Hz.
    """
    rng = np.random.default_rng(seed)
    frame = np.arange(N)
    s = np.clip((frame - SWING) / 80.0, 0.0, 1.0)
    way = 10 * s**3 - 15 * s**4 + 6 * s**5
    angle = -0.5 + 1.2 * way
    hand = np.column_stack([-0.6 + 1.5 * way, 0.1 * way, 1.6 + 0.4 * np.sin(3.0 * way)])
    turn = np.column_stack([np.zeros(N), np.sin(angle / 2), np.zeros(N), np.cos(angle / 2)])
    ball = hand + 0.1135 * np.column_stack([np.sin(angle), np.zeros(N), np.cos(angle)])
    velocity = (ball[RELEASE] - ball[RELEASE - 1]) / 0.01 + [0.0, 0.0, 1.5]
    time = (frame - RELEASE)[RELEASE:, None] * 0.01
    ball[RELEASE:] = ball[RELEASE] + velocity * time + [0.0, 0.0, -4.905] * time**2
    ball[LANDED:] = ball[LANDED]
    basket = np.tile([2.0, 0.3, 0.4], (N, 1))
    stamps = START + frame * FRAME
    bodies = {
        "hand": (hand, turn),
        "ball": (ball, turn),
        "basket": (basket, np.tile([0.0, 0.0, 0.0, 1.0], (N, 1))),
    }
    return {
        name: PoseStream(name, stamps, *_noisy(*poses, noise, rng))
        for name, poses in bodies.items()
    }


def _noisy(position, quaternion, noise, rng):
    turned = quaternion + 10 * noise * rng.standard_normal(quaternion.shape) * (np.arange(4) < 3)
    return position + noise * rng.standard_normal(position.shape), turned / np.linalg.norm(
        turned, axis=1, keepdims=True
    )


def with_rows(stream, rows, **values):
    """The stream with other values in some rows."""
    columns = {name: getattr(stream, name).copy() for name in values}
    for name, value in values.items():
        columns[name][rows] = value
    return replace(stream, **columns)


def found(faults, *kinds):
    """kind, body, first and last frame, count, repaired of the faults that are no gaps."""
    wanted = [
        fault
        for fault in faults
        if not fault.is_information and (not kinds or fault.kind in kinds)
    ]
    return [
        (
            f.kind,
            f.body,
            (f.start_ns - START) / FRAME,
            (f.stop_ns - START) / FRAME,
            f.count,
            f.repaired,
        )
        for f in wanted
    ]


def assert_same(stream, expected, rows=slice(None)):
    np.testing.assert_array_equal(stream.stamp_ns, expected.stamp_ns[rows])
    np.testing.assert_array_equal(stream.position, expected.position[rows])
    np.testing.assert_array_equal(stream.quaternion, expected.quaternion[rows])


def without(rows):
    return np.delete(np.arange(N), rows)


@pytest.mark.parametrize("seed", range(5))
def test_clean_poses_have_no_fault_and_stay_as_they_are(seed):
    streams = clean(seed)
    repaired, faults = repair(streams)
    assert not faults, faults[:3]
    assert all(repaired[body] is streams[body] for body in streams)


# what no camera would report


def test_poses_that_are_not_finite_are_left_out():
    streams = clean()
    streams["hand"] = with_rows(streams["hand"], slice(30, 35), position=np.nan)
    streams["ball"] = with_rows(streams["ball"], 50, quaternion=[np.inf, 0, 0, 1])
    repaired, faults = repair(streams)
    assert found(faults) == [
        ("not_finite", "ball", 50, 50, 1, True),
        ("not_finite", "hand", 30, 34, 5, True),
    ]
    assert_same(repaired["hand"], clean()["hand"], without(np.arange(30, 35)))


def test_zeros_for_a_lost_body_are_left_out():
    streams = clean()
    streams["ball"] = with_rows(streams["ball"], slice(300, 350), position=0.0, quaternion=0.0)
    repaired, faults = repair(streams)
    assert found(faults) == [("zero_pose", "ball", 300, 349, 50, True)]
    assert_same(repaired["ball"], clean()["ball"], without(np.arange(300, 350)))


def test_a_body_that_never_has_an_orientation_keeps_its_positions():
    streams = clean()
    streams["ball"] = with_rows(streams["ball"], slice(None), quaternion=0.0)
    repaired, faults = repair(streams)
    assert found(faults) == [("zero_pose", "ball", 0, N - 1, N, True)]
    np.testing.assert_array_equal(repaired["ball"].position, clean()["ball"].position)
    np.testing.assert_array_equal(repaired["ball"].quaternion, np.tile([0, 0, 0, 1], (N, 1)))


def test_quaternions_a_little_off_norm_one_are_normalised_and_others_left_out():
    streams, good = clean(), clean()["hand"]
    streams["hand"] = with_rows(good, slice(10, 13), quaternion=1.03 * good.quaternion[10:13])
    streams["hand"] = with_rows(streams["hand"], 20, quaternion=2.0 * good.quaternion[20])
    repaired, faults = repair(streams)
    assert sorted(found(faults)) == [
        ("not_unit", "hand", 10, 12, 3, True),
        ("not_unit", "hand", 20, 20, 1, True),
    ]
    np.testing.assert_allclose(
        repaired["hand"].quaternion, good.quaternion[without(20)], atol=1e-12
    )


def test_a_quaternion_and_its_negative_are_one_orientation():
    streams = clean()
    signs = np.where(np.arange(N) % 7, 1.0, -1.0)[:, None]
    streams["hand"] = replace(streams["hand"], quaternion=signs * streams["hand"].quaternion)
    assert not repair(streams)[1]


# the order of stamps


def test_copies_of_a_message_are_left_out():
    streams = clean()
    index = np.sort(np.concatenate([np.arange(N), [100, 250, 250]]))
    streams["ball"] = streams["ball"].take(index)
    repaired, faults = repair(streams)
    assert found(faults) == [
        ("repeated_stamp", "ball", 100, 100, 1, True),
        ("repeated_stamp", "ball", 250, 250, 2, True),
    ]
    assert_same(repaired["ball"], clean()["ball"])


def test_two_poses_with_one_stamp_are_not_repaired():
    streams = clean()
    hand = streams["hand"].take(np.sort(np.concatenate([np.arange(N), [100]])))
    streams["hand"] = with_rows(hand, 101, position=hand.position[100] + 0.001)
    repaired, faults = repair(streams)
    assert found(faults) == [("repeated_stamp", "hand", 100, 100, 1, False)]
    assert_same(repaired["hand"], clean()["hand"])


@pytest.mark.parametrize("frame", [60, 230])
def test_late_messages_are_sorted_in(frame):
    streams = clean()
    order = np.arange(N)
    order[frame : frame + 4] = [frame + 1, frame + 2, frame + 3, frame]
    streams["hand"] = streams["hand"].take(order)
    repaired, faults = repair(streams)
    assert found(faults) == [("backwards", "hand", frame, frame, 1, True)]
    assert_same(repaired["hand"], clean()["hand"])


def test_a_clock_that_is_set_back_is_not_repaired():
    streams = clean()
    stamps = streams["hand"].stamp_ns.copy()
    stamps[225:] -= 8 * FRAME + 3 * MS
    streams["hand"] = replace(streams["hand"], stamp_ns=stamps)
    _, faults = repair(streams)
    assert ("backwards", "hand") in {(f.kind, f.body) for f in faults if not f.repaired}, found(
        faults
    )
    (fault,) = (f for f in faults if f.kind == "backwards")
    assert fault.count == 8 and fault.start_ns == START + 225 * FRAME - 83 * MS


# poses that are repeated


STALE = [(50, 1), (60, 10), (215, 1), (225, 6), (240, 1), (262, 3), (300, 12), (500, 60)]


@pytest.mark.parametrize("body", ["hand", "ball", "basket"])
def test_stale_poses_are_left_out(body):
    streams = clean()
    rows = [np.arange(first, first + count) for first, count in STALE]
    for chunk in rows:
        before = streams[body].take([chunk[0] - 1])
        streams[body] = with_rows(
            streams[body], chunk, position=before.position[0], quaternion=before.quaternion[0]
        )
    repaired, faults = repair(streams)
    assert found(faults) == [
        ("stale", body, first, first + count - 1, count, True) for first, count in STALE
    ]
    assert_same(repaired[body], clean()[body], without(np.concatenate(rows)))


def test_a_body_without_noise_may_rest():
    assert not found(repair(clean(noise=0.0))[1])


def test_a_body_without_noise_that_is_lost_in_its_motion_is_stale():
    streams = clean(noise=0.0)
    hand = streams["hand"]
    streams["hand"] = with_rows(
        hand, slice(220, 224), position=hand.position[219], quaternion=hand.quaternion[219]
    )
    assert found(repair(streams)[1]) == [("stale", "hand", 220, 223, 4, True)]


@pytest.mark.parametrize("decimals", [3, 4])
def test_a_body_with_rounded_poses_may_rest(decimals):
    streams = clean(noise=1e-4)
    for body, stream in streams.items():
        quaternion = np.round(stream.quaternion, 2)
        quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
        streams[body] = replace(
            stream, position=np.round(stream.position, decimals), quaternion=quaternion
        )
    assert not found(repair(streams)[1], "stale")


# stamps that jitter


def delayed(delay_ns, frames=None):
    """Clean streams with stamps that are late; frames that are left out."""
    kept = np.arange(N) if frames is None else frames
    return {
        name: replace(s.take(kept), stamp_ns=s.stamp_ns[kept] + delay_ns[kept])
        for name, s in clean().items()
    }


def assert_regular(stream, expected_rows, within):
    error = (stream.stamp_ns - clean()["hand"].stamp_ns[expected_rows]) * 1e-6
    assert np.abs(error - error.mean()).max() < within, (
        f"stray {error.min():.3f} to {error.max():.3f} ms"
    )


@pytest.mark.parametrize("mean", [0.5, 1.5, 2.5])
def test_stamps_of_receipt_are_put_on_the_grid(mean):
    delay = (np.random.default_rng(1).exponential(mean * MS, N)).astype(np.int64)
    repaired, faults = repair(
        delayed(np.maximum.accumulate(np.arange(N) * FRAME + delay) - np.arange(N) * FRAME)
    )
    assert {f.body for f in faults if f.kind == "jitter"} == set(clean()) and not found(
        faults, "gap"
    )
    assert all(fixed and kind in ("jitter", "repeated_stamp") for kind, *_, fixed in found(faults))
    for body in clean():
        assert len(repaired[body]) == N
        assert_regular(repaired[body], slice(None), 0.01 + 0.12 * mean)
        np.testing.assert_array_equal(repaired[body].position, clean()[body].position)


def test_frames_that_come_at_once_after_a_stall_are_sorted_out():
    delay = np.abs(np.random.default_rng(2).normal(0.0, 0.3 * MS, N)).astype(np.int64)
    for first, count in ((100, 12), (231, 30)):
        delay[first : first + count] = (
            np.arange(count, 0, -1) * FRAME - np.arange(count, 0, -1) * MS // 20
        )
    repaired, faults = repair(delayed(delay))
    assert all(fault.repaired for fault in faults if not fault.is_information), faults
    assert_regular(repaired["hand"], slice(None), 0.05)


def test_a_frame_that_is_missing_in_a_stall_makes_it_unclear():
    delay = np.abs(np.random.default_rng(2).normal(0.0, 0.3 * MS, N)).astype(np.int64)
    delay[100:112] = np.arange(12, 0, -1) * FRAME - np.arange(12, 0, -1) * MS // 20
    streams = delayed(delay, without(104))
    repaired, faults = repair(streams)
    assert {(f.kind, f.repaired) for f in faults if f.body == "hand" and not f.is_information} == {
        ("jitter", False)
    }
    assert_same(repaired["hand"], streams["hand"])


def test_stamps_without_a_frame_rate_are_reported():
    time = np.cumsum(np.random.default_rng(3).uniform(2 * MS, 30 * MS, N)).astype(np.int64)
    streams = {name: replace(s, stamp_ns=START + time) for name, s in clean().items()}
    repaired, faults = repair(streams)
    assert [(f.kind, f.repaired) for f in faults if f.body == "hand" and not f.is_information] == [
        ("jitter", False)
    ]
    np.testing.assert_array_equal(repaired["hand"].stamp_ns, START + time)


@pytest.mark.parametrize(("rate", "rounded"), [(120.0, 1), (119.97, 1), (240.0, 1), (120.0, 1000)])
def test_other_frame_rates_are_no_jitter(rate, rounded):
    stamps = START + np.rint(1e9 / rate * np.arange(N) / rounded).astype(np.int64) * rounded
    streams = {name: replace(s, stamp_ns=stamps) for name, s in clean().items()}
    assert not found(repair(streams)[1])


def test_stamps_rounded_to_milliseconds_are_put_on_the_grid():
    exact = START + np.rint(1e9 / 120.0 * np.arange(N)).astype(np.int64)
    streams = {
        name: replace(s, stamp_ns=(exact + MS // 2) // MS * MS) for name, s in clean().items()
    }
    repaired, faults = repair(streams)
    assert {fault.kind for fault in faults} == {"jitter"} and all(
        fault.repaired for fault in faults
    )
    error = (repaired["hand"].stamp_ns - exact) * 1e-6
    assert np.abs(error).max() < 0.05, error


def test_a_world_that_is_set_anew_begins_a_grid_of_its_own():
    streams = {
        name: replace(s, stamp_ns=s.stamp_ns + (np.arange(N) > 400) * 1_003_700_000)
        for name, s in clean().items()
    }
    _, faults = repair(streams)
    assert not found(faults)
    assert {(f.body, f.count) for f in faults} == {(body, 100) for body in clean()}


# bodies that exchange their names


def exchanged(streams, one, other, rows):
    """Two streams of which some rows are exchanged."""
    mask = np.zeros(N, dtype=bool)
    mask[rows] = True
    a, b = streams[one], streams[other]
    pick = {name: (getattr(a, name), getattr(b, name)) for name in ("position", "quaternion")}
    streams[one] = replace(
        a, **{name: np.where(mask[:, None], y, x) for name, (x, y) in pick.items()}
    )
    streams[other] = replace(
        b, **{name: np.where(mask[:, None], x, y) for name, (x, y) in pick.items()}
    )
    return streams


SWAPS = [(50, 51), (60, 100), (210, 216), (245, 270), (400, 500), (0, 30), (0, 230), (700, N)]


@pytest.mark.parametrize(("first", "stop"), SWAPS)
@pytest.mark.parametrize("pair", [("hand", "ball"), ("hand", "basket"), ("ball", "basket")])
def test_swapped_bodies_get_their_names_back(pair, first, stop):
    one, other = pair
    repaired, faults = repair(exchanged(clean(), one, other, slice(first, stop)))
    assert found(faults) == [("swap", f"{one} and {other}", first, stop - 1, stop - first, True)]
    for body in clean():
        assert_same(repaired[body], clean()[body])


def test_the_ball_that_flies_under_the_name_of_the_hand_is_found_without_any_exchange():
    repaired, faults = repair(exchanged(clean(), "hand", "ball", slice(None)))
    assert found(faults) == [("swap", "hand and ball", 0, N - 1, N, True)]
    assert_same(repaired["ball"], clean()["ball"])


def test_two_halves_without_a_flight_are_not_repaired():
    streams = {
        name: stream.take(slice(0, 180)) for name, stream in clean().items() if name != "basket"
    }
    hand, ball = streams["hand"], streams["ball"]
    half = (np.arange(180) < 90)[:, None]
    streams["hand"] = replace(hand, position=np.where(half, ball.position, hand.position))
    streams["ball"] = replace(ball, position=np.where(half, hand.position, ball.position))
    repaired, faults = repair(streams)
    assert [(f.kind, f.repaired) for f in faults] == [("swap", False)]
    assert_same(repaired["hand"], streams["hand"])


def test_a_swap_is_repaired_where_frames_are_missing():
    streams = exchanged(clean(), "hand", "ball", slice(205, 235))
    lost_hand, lost_ball = np.arange(203, 208), np.arange(212, 214)
    streams["hand"] = streams["hand"].take(without(lost_hand))
    streams["ball"] = streams["ball"].take(without(lost_ball))
    repaired, faults = repair(streams)
    assert all(kind == "swap" and fixed for kind, *_, fixed in found(faults)) and found(faults)
    # What is called ball in a swap is the hand. Nobody knows when it began while the hand was not
    # seen: what came then is left out.
    assert_same(repaired["hand"], clean()["hand"], without(np.concatenate([lost_hand, lost_ball])))
    assert_same(repaired["ball"], clean()["ball"], without([203, 204, 205, 206, 207]))


@pytest.mark.parametrize("distance", [0.03, 0.06, 0.1135])
def test_bodies_that_move_fast_together_have_not_changed_places(distance):
    streams = clean()
    hand = streams["hand"]
    away = (
        hand.position
        + [0.0, distance, 0.0]
        + 1e-4 * np.random.default_rng(4).standard_normal((N, 3))
    )
    kept = np.sort(np.random.default_rng(5).choice(N, 500, replace=False))
    pair = {"hand": hand.take(kept), "ball": replace(hand, body="ball", position=away).take(kept)}
    assert not found(repair(pair)[1])


# lone samples, and missing ones


@pytest.mark.parametrize("frame", [40, 222, 260, 600])
@pytest.mark.parametrize("body", ["hand", "ball"])
def test_a_lone_pose_far_away_is_left_out(body, frame):
    streams = clean()
    streams[body] = with_rows(
        streams[body], frame, position=streams[body].position[frame] + [0.4, -0.5, 0.2]
    )
    repaired, faults = repair(streams)
    assert found(faults) == [("outlier", body, frame, frame, 1, True)]
    assert_same(repaired[body], clean()[body], without(frame))


def test_a_lone_orientation_far_away_is_left_out():
    streams = clean()
    streams["hand"] = with_rows(streams["hand"], 100, quaternion=[0.0, 0.0, 1.0, 0.0])
    assert found(repair(streams)[1]) == [("outlier", "hand", 100, 100, 1, True)]


def test_a_bounce_is_no_outlier():
    streams = clean()
    time = np.arange(N) * 0.01
    height = np.abs(2.0 * np.sin(2.2 * time)) + 0.03  # turns about within one frame, at 4.4 m/s
    ball = streams["ball"]
    streams["ball"] = replace(
        ball,
        position=np.column_stack([0.3 * time, 0.0 * time, height])
        + 1e-4 * ball.position[:, [1, 2, 0]],
    )
    assert not found(repair(streams)[1])


def test_gaps_are_information():
    streams = clean()
    streams["hand"] = streams["hand"].take(without(np.concatenate([[20], np.arange(230, 240)])))
    repaired, faults = repair(streams)
    assert [
        (f.kind, f.body, (f.start_ns - START) / FRAME, (f.stop_ns - START) / FRAME, f.count)
        for f in faults
    ] == [
        ("gap", "hand", 19, 21, 1),
        ("gap", "hand", 229, 240, 10),
    ]
    assert all(fault.is_information and not fault.repaired for fault in faults)
    assert repaired["hand"] is streams["hand"]


def test_faults_come_together():
    """A recording with everything at once is clean again where it was not left out."""
    streams = exchanged(clean(), "hand", "ball", slice(60, 90))
    streams["basket"] = with_rows(streams["basket"], slice(300, 310), position=streams["basket"].position[299],
                                  quaternion=streams["basket"].quaternion[299])  # fmt: skip
    streams["hand"] = with_rows(streams["hand"], 500, position=np.nan)
    streams["ball"] = with_rows(streams["ball"], 120, position=[5.0, 5.0, 5.0])
    order = np.arange(N)
    order[400:403] = [401, 402, 400]
    streams["hand"] = streams["hand"].take(order)
    repaired, faults = repair(streams)
    assert sorted(kind for kind, *_ in found(faults)) == [
        "backwards",
        "not_finite",
        "outlier",
        "stale",
        "swap",
    ]
    assert all(fixed for *_, fixed in found(faults))
    assert_same(repaired["hand"], clean()["hand"], without(500))
    assert_same(repaired["ball"], clean()["ball"], without(120))
    assert_same(repaired["basket"], clean()["basket"], without(np.arange(300, 310)))


def test_short_and_empty_streams_pass():
    streams = {
        "hand": clean()["hand"].take(slice(0, 3)),
        "ball": clean()["ball"].take(slice(0, 0)),
    }
    repaired, faults = repair(streams)
    assert not faults and [len(repaired[body]) for body in ("hand", "ball")] == [3, 0]


def test_a_stream_says_which_shape_is_wrong():
    with pytest.raises(ValueError, match=r"poses of hand: .*\(3, 2\)"):
        PoseStream("hand", np.arange(3), np.zeros((3, 2)), np.zeros((3, 4)))


def test_a_swap_from_the_beginning_goes_back_to_frames_in_which_one_body_was_seen():
    streams = exchanged(clean(), "hand", "ball", slice(0, 300))
    streams["hand"] = streams["hand"].take(without([0, 1, 2]))
    repaired, faults = repair(streams)
    assert found(faults) == [("swap", "hand and ball", 3, 299, 297, True)]
    assert_same(repaired["hand"], clean()["hand"])
    assert_same(repaired["ball"], clean()["ball"], without([0, 1, 2]))
