"""From streams of samples to one demonstration: what is rejected, what is missing, what is kept."""

import numpy as np
import pytest

from dart_skill.movement import VelocityThreshold
from dart_skill.skills.observation import Stream, ThrowLog, seen_down, watched_until
from tests.throw_demonstrations import assert_same

MS = 1_000_000
START_NS = 5_000 * MS
OPENED_NS = START_NS + 1_450 * MS
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
BASKET = np.array([2.0, 0.3, 0.4])


def hand_at(time):
    """Turned about slowly, at rest, then swung 1 m in 0.8 s between 1.0 s and 1.8 s."""
    s = np.clip((time - 1.0) / 0.8, 0.0, 1.0)
    return np.array([-0.5 + 10 * s**3 - 15 * s**4 + 6 * s**5, 0.0, 1.9])


def filled(leave_out=(), opened=OPENED_NS, duration=3.0):
    """A log of a whole throw at 100 Hz; `leave_out` names streams that stay empty."""
    log = ThrowLog()
    for k in range(round(duration * 100)):
        stamp, time = START_NS + k * 10 * MS, k * 0.01
        if "hand" not in leave_out:
            log.take("hand", stamp, hand_at(time), UPRIGHT)
        if "ball" not in leave_out:
            log.take("ball", stamp, hand_at(time) + [0.0, 0.0, 0.1135], UPRIGHT)
        if "basket" not in leave_out:
            log.take("basket", stamp, BASKET, UPRIGHT)
        if "joints" not in leave_out:
            log.add_joints(stamp, np.full(7, time), np.full(7, 0.1 * time))
    if opened is not None:
        log.add_opening(opened)
    return log


END_NS = START_NS + 2_900 * MS


def test_a_cut_contains_the_motion_with_its_margins_and_the_release():
    d = filled().cut("one", END_NS)
    assert d.id == "one"
    begin = (d.stamp_ns - START_NS) * 1e-9
    assert (
        begin + d.hand_time[0] <= begin + d.motion_start < begin + d.opened < begin + d.motion_stop
    )
    assert 1.0 < begin + d.motion_start < 1.2 and 1.6 < begin + d.motion_stop < 1.85
    assert d.motion_start == pytest.approx(0.15, abs=0.011), "the run-up"
    assert d.hand_time[-1] == pytest.approx(d.motion_stop + 0.1, abs=0.011), "the settling"
    assert d.stamp_ns + round(d.opened * 1e9) == OPENED_NS


def test_samples_of_a_cut_are_those_that_came():
    d = filled().cut("one", END_NS)
    begin = (d.stamp_ns - START_NS) * 1e-9
    np.testing.assert_allclose(
        d.hand_position, [hand_at(t) for t in begin + d.hand_time], atol=1e-9
    )
    np.testing.assert_allclose(d.joint_position[:, 0], begin + d.joint_time, atol=1e-9)
    np.testing.assert_allclose(d.joint_velocity[:, 0], 0.1 * (begin + d.joint_time), atol=1e-9)
    np.testing.assert_array_equal(d.target, BASKET)
    np.testing.assert_array_equal(d.hand_quaternion, np.tile(UPRIGHT, (len(d.hand_time), 1)))


def test_the_ball_is_kept_until_the_end_and_the_hand_only_for_its_motion():
    d = filled().cut("one", END_NS)
    assert (d.stamp_ns + d.moved.time[-1] * 1e9 - START_NS) * 1e-9 == pytest.approx(2.9)
    assert d.hand_time[-1] < d.moved.time[-1] - 0.8


def test_nothing_after_the_given_instant_is_used():
    log = filled()
    until = START_NS + 2_500 * MS
    first = log.cut("one", until)
    for k in range(300, 320):
        log.take("hand", START_NS + k * 10 * MS, np.full(3, 9.0), UPRIGHT)
        log.take("ball", START_NS + k * 10 * MS, np.full(3, 9.0), UPRIGHT)
    second = log.cut("one", until)
    np.testing.assert_array_equal(first.moved.position, second.moved.position)
    np.testing.assert_array_equal(first.hand_position, second.hand_position)
    assert first.moved.time[-1] <= (until - first.stamp_ns) * 1e-9


@pytest.mark.parametrize(
    ("missing", "message"),
    [
        ("hand", "the hand"),
        ("ball", "the ball"),
        ("basket", "the basket"),
        ("joints", "the arm's joints"),
    ],
)
def test_what_is_missing_is_named(missing, message):
    with pytest.raises(ValueError, match=f"only 0 samples of {message}"):
        filled(leave_out=(missing,)).cut("one", END_NS)


def test_a_sensor_that_spoke_is_not_asked_whether_it_is_there():
    """Nobody filled in its stamps, or its clock is another one: what has come is counted."""
    log = filled(leave_out=("hand",))
    for _ in range(300):
        log.take("hand", 0, np.zeros(3), UPRIGHT)
    with pytest.raises(
        ValueError,
        match=(
            "only 1 samples of the hand, and 299 that do not count: not numbers, or stamped no"
            " later"
        ),
    ):
        log.cut("one", END_NS)
    log = filled(leave_out=("ball",))
    for k in range(100):
        log.take("ball", 10 * END_NS + k * MS, np.zeros(3), UPRIGHT)
    with pytest.raises(
        ValueError,
        match=(
            r"only 0 samples of the ball at that time, and 100 from .* s: have all sensors one"
            r" clock\?"
        ),
    ):
        part = log.part(START_NS, END_NS)
        part.add_opening(OPENED_NS)
        part.cut("one", END_NS)


def test_joints_that_were_silent_during_the_throw_make_it_none():
    """A clock that was set left one state of the joints in a demonstration, from which its
    registration was learned.
    """
    log = filled(leave_out=("joints",))
    for k in range(98):
        log.add_joints(START_NS + k * 10 * MS, np.zeros(7), np.zeros(7))
    with pytest.raises(
        ValueError,
        match=r"only \d states of the joints during the throw, .* and 98 around it: have all",
    ):
        log.cut("one", END_NS)


def test_a_throw_without_the_button_is_none():
    with pytest.raises(ValueError, match="never told to open"):
        filled(opened=None).cut("one", END_NS)


def test_a_button_pressed_outside_the_motion_is_none():
    with pytest.raises(ValueError, match=r"no segment contains 0\.300 s"):
        filled(opened=START_NS + 300 * MS).cut("one", END_NS)


def test_a_hand_that_did_not_move_is_none():
    with pytest.raises(ValueError, match="nothing moved|never falls|no motion"):
        filled().cut("one", START_NS + 900 * MS)


def test_thresholds_can_be_chosen():
    wide = filled().cut("one", END_NS, VelocityThreshold(run_up=0.4, settle=0.3))
    assert wide.motion_start == pytest.approx(0.4, abs=0.011)


def test_only_the_first_press_of_the_button_counts():
    log = filled()
    log.add_opening(OPENED_NS + 300 * MS)
    assert log.opened_ns == OPENED_NS


BAD = [
    ("hand", lambda log, stamp, v: log.take("hand", stamp, np.full(3, v), UPRIGHT)),
    ("hand", lambda log, stamp, v: log.take("hand", stamp, np.zeros(3), np.full(4, v))),
    ("ball", lambda log, stamp, v: log.take("ball", stamp, np.full(3, v), UPRIGHT)),
    ("basket", lambda log, stamp, v: log.take("basket", stamp, np.full(3, v), UPRIGHT)),
    ("joints", lambda log, stamp, v: log.add_joints(stamp, np.full(7, v), np.zeros(7))),
    ("joints", lambda log, stamp, v: log.add_joints(stamp, np.zeros(7), np.full(7, v))),
]


@pytest.mark.parametrize(("stream", "add"), BAD)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_samples_that_are_not_finite_are_rejected_and_counted(stream, add, value):
    log = ThrowLog()
    add(log, START_NS, value)
    assert log.rejected == 1 and not getattr(log, stream).stamps
    add(log, START_NS, 1.0)
    assert log.rejected == 1 and getattr(log, stream).stamps == [START_NS]


@pytest.mark.parametrize(("stream", "add"), BAD[:1] + BAD[2:4])
@pytest.mark.parametrize("age", [0, 10 * MS])
def test_stale_samples_are_rejected_and_counted(stream, add, age):
    """A driver that lost a body repeats its last pose, and a network may deliver late."""
    log = ThrowLog()
    add(log, START_NS, 1.0)
    add(log, START_NS - age, 2.0)
    add(log, START_NS + 10 * MS, 3.0)
    assert log.rejected == 1 and getattr(log, stream).stamps == [START_NS, START_NS + 10 * MS]
    assert getattr(log, stream).rows[-1][0] == 3.0


def test_rejected_samples_leave_no_trace_in_the_cut():
    clean, dirty = filled(), ThrowLog()
    for k in range(300):
        stamp, time = START_NS + k * 10 * MS, k * 0.01
        for shift in (0, -7 * MS):
            dirty.take("hand", stamp + shift, hand_at(time), UPRIGHT)
            dirty.take("ball", stamp + shift, hand_at(time) + [0.0, 0.0, 0.1135], UPRIGHT)
        dirty.take("hand", stamp + 3 * MS, np.full(3, np.nan), UPRIGHT)
        dirty.take("basket", stamp, BASKET, UPRIGHT)
        dirty.add_joints(stamp, np.full(7, time), np.full(7, 0.1 * time))
    dirty.add_opening(OPENED_NS)
    first, second = clean.cut("one", END_NS), dirty.cut("one", END_NS)
    assert_same(first, second)
    assert dirty.rejected == 300 * 3


def test_joint_states_are_thinned_to_the_rate_of_the_poses():
    log = ThrowLog()
    for k in range(500):
        stamp = START_NS + k * 2 * MS
        assert log.wants_joints(stamp) == (k % 5 == 0)
        log.add_joints(stamp, np.zeros(7), np.zeros(7))
    assert len(log.joints.stamps) == 100 and log.rejected == 0
    everything = ThrowLog(joint_period_ns=0)
    for k in range(10):
        everything.add_joints(START_NS + k * MS, np.zeros(7), np.zeros(7))
    assert len(everything.joints.stamps) == 10


def test_clear_forgets_everything():
    log = filled()
    log.take("ball", START_NS, np.zeros(3), UPRIGHT)
    assert log.rejected
    log.clear()
    assert log.opened_ns is None and log.rejected == 0
    assert not any(stream.stamps for stream in (log.hand, log.ball, log.joints, log.basket))
    log.take("hand", START_NS, np.zeros(3), UPRIGHT)
    assert log.hand.stamps == [START_NS], "time may start anew"


def test_a_basket_that_is_hidden_during_the_throw_is_where_it_was_before():
    log = filled(leave_out=("basket",))
    for k in range(50):
        log.take("basket", START_NS + k * 10 * MS, BASKET + [0.0, 0.0, 0.001 * (k % 2)], UPRIGHT)
    d = log.cut("one", END_NS)
    np.testing.assert_allclose(d.target, BASKET, atol=1e-3)


def test_ball_between_gives_what_was_seen_between_two_instants():
    time, position = filled().ball_between(OPENED_NS, OPENED_NS + 200 * MS)
    assert len(time) == 21 and time[0] == pytest.approx(0.0) and time[-1] == pytest.approx(0.2)
    np.testing.assert_allclose(position[:, 0], [hand_at(1.45 + t)[0] for t in time])
    time, position = ThrowLog().ball_between(0, OPENED_NS)
    assert time.shape == (0,) and position.shape == (0, 3)


def test_ten_samples_are_the_least():
    log = filled(leave_out=("basket",))
    for k in range(9):
        log.take("basket", START_NS + k * 10 * MS, BASKET, UPRIGHT)
    with pytest.raises(ValueError, match="only 9 samples of the basket"):
        log.cut("one", END_NS)


def test_what_was_seen_before_the_world_was_set_anew_changes_no_cut():
    """A simulator that puts the ball back sets its clock on; when the log was begun before that
    must not matter.
    """
    clean, early = filled(), ThrowLog()
    for k in range(200):
        stamp = START_NS - 3_000 * MS + k * 10 * MS
        early.take("hand", stamp, hand_at(1.8 - 0.005 * k), UPRIGHT)
        early.take("ball", stamp, np.full(3, 0.01 * k), UPRIGHT)
        early.add_joints(stamp, np.full(7, 9.0), np.zeros(7))
    for name in ("hand", "ball", "basket", "joints"):
        late, stream = getattr(clean, name), getattr(early, name)
        for stamp, row in zip(late.stamps, late.rows, strict=True):
            stream.add(stamp, row)
    early.add_opening(OPENED_NS)
    first, second = clean.cut("one", END_NS), early.cut("one", END_NS)
    assert first.stamp_ns == second.stamp_ns
    assert_same(first, second)


def test_a_ball_that_was_seen_to_leave_the_hand_stands_in_for_the_button():
    log, told = filled(opened=None), filled()
    log.add_release(OPENED_NS)
    log.add_release(OPENED_NS + 500 * MS)
    first, second = log.cut("one", END_NS), told.cut("one", END_NS)
    assert np.isnan(first.opened) and second.opened > 0.0
    assert first.stamp_ns == second.stamp_ns
    np.testing.assert_array_equal(first.hand_position, second.hand_position)


@pytest.mark.parametrize(
    ("seen_for", "down"), [(0.45, False), (0.55, False), (0.75, True), (1.2, True)]
)
def test_a_ball_is_seen_down_when_its_last_pose_is_below_the_rim(seen_for, down):
    """Without drag from 2 m at 3.5 m/s level it comes through a rim at 0.4 m after 0.571 s; what
    is seen later is no matter.
    """
    log, ms = ThrowLog(), np.arange(0, round(1000 * seen_for), 10)
    for at in ms:
        time = 1e-3 * at
        log.take(
            "ball",
            int(OPENED_NS + at * MS),
            np.array([3.5 * time, 0.0, 2.0 - 0.5 * 9.81 * time**2]),
            UPRIGHT,
        )
    rim = np.array([3.5 * 0.571, 0.0, 0.4])
    assert seen_down(log, rim, OPENED_NS, OPENED_NS + 1_500 * MS) == down


def test_a_throw_is_watched_as_long_as_its_samples_are_sure_to_have_come():
    assert watched_until(OPENED_NS) == OPENED_NS + 1_150 * MS


def test_joint_states_are_thinned_from_the_first_of_a_world_on_whatever_is_lost():
    """The arm's clock begins anywhere: what is kept depends on the time since a reset alone."""
    for begun in (START_NS, START_NS + 4 * MS + 35):
        log = ThrowLog()
        for world in (begun, begun + 2000 * MS):
            for k in (*range(7), *range(9, 60)):  # two of them never came
                log.add_joints(world + 2 * k * MS, np.zeros(7), np.zeros(7))
        kept = (np.array(log.joints.stamps) - begun) / MS
        np.testing.assert_allclose(kept[:12], [0, 10, 20, *range(30, 120, 10)])
        np.testing.assert_allclose(kept[12:] - 2000, kept[:12])


def test_many_samples_are_kept_as_they_are_one_by_one():
    rng = np.random.default_rng(0)
    stamps = np.cumsum(rng.integers(-1, 4, size=200))
    rows = rng.normal(size=(200, 3))
    rows[rng.random(200) < 0.1, 1] = np.nan
    one_by_one, at_once = Stream(), Stream()
    kept = sum(one_by_one.add(int(stamp), row) for stamp, row in zip(stamps, rows, strict=True))
    assert (
        sum(
            at_once.extend(stamps[part], rows[part])
            for part in (slice(0, 50), slice(50, 50), slice(50, 200))
        )
        == kept
        < 150
    )
    assert at_once.stamps == one_by_one.stamps
    np.testing.assert_array_equal(at_once.rows, one_by_one.rows)
