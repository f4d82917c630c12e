"""What is due when: the order and the times of a bag that is played, on a clock that the test
holds.
"""

import math

import pytest

from dart_skill.recording import (
    BagReader,
    deserialize,
    serialize,
    types_for,
)
from dart_skill.recording.bags import (
    CLOCK_TYPE,
    Playback,
    PlaybackPace,
    PlaybackSelection,
    clock_message,
)
from tests.unit.recording.bag_files import write_bag

TEXT = "std_msgs/msg/String"
SECOND = 1_000_000_000


@pytest.fixture
def bag(tmp_path):
    """One message a tenth of a second on /a, one a second on /b, for three seconds from 5 s on."""
    messages = []
    for k in range(31):
        for topic in "ab" if k % 10 == 0 else "a":
            stamp = 5 * SECOND + k * SECOND // 10
            messages.append((f"/{topic}", TEXT, stamp, {"data": f"{topic}{k}"}))
    write_bag(tmp_path / "bag", messages)
    with BagReader(tmp_path / "bag") as reader:
        yield reader


def text(due):
    return deserialize(types_for(TEXT), TEXT, due.data).data


def test_every_message_is_due_when_it_was_recorded(bag):
    playback = Playback(bag, PlaybackSelection(clock_rate=0.0))
    dues = list(playback)
    assert not playback.makes_clock
    assert [text(due) for due in dues if due.topic == "/a"] == [f"a{k}" for k in range(31)]
    assert [due.position_ns for due in dues if due.topic == "/b"] == [
        0,
        SECOND,
        2 * SECOND,
        3 * SECOND,
    ]
    assert [due.position_ns for due in dues] == sorted(due.position_ns for due in dues)
    assert all(due.stamp_ns == due.position_ns + 5 * SECOND for due in dues)


def test_part_of_a_bag_under_another_name(bag):
    playback = Playback(
        bag,
        PlaybackSelection(
            topics=["/a"], remap={"/a": "/z"}, start=0.95, duration=1.0, clock_rate=0.0
        ),
    )
    assert list(playback.topics) == ["/z"]
    assert [text(due) for due in playback] == [f"a{k}" for k in range(10, 20)]
    assert next(iter(playback)).position_ns == SECOND // 20


def test_the_clock_ticks_between_messages_and_never_ahead_of_them(bag):
    dues = list(Playback(bag, PlaybackSelection(clock_rate=4.0)))
    ticks = [due for due in dues if due.topic == "/clock"]
    assert [due.stamp_ns for due in ticks] == [5 * SECOND + k * SECOND // 4 for k in range(13)]
    assert [due.position_ns for due in dues] == sorted(due.position_ns for due in dues)
    for due in ticks:
        clock = deserialize(types_for(CLOCK_TYPE), CLOCK_TYPE, due.data).clock
        assert clock.sec * SECOND + clock.nanosec == due.stamp_ns
    assert clock_message(7) == serialize(
        types_for(CLOCK_TYPE), CLOCK_TYPE, {"clock": {"sec": 0, "nanosec": 7}}
    )


def test_a_loop_begins_again_and_its_positions_go_on(bag):
    playback = iter(Playback(bag, PlaybackSelection(topics=["/b"], loop=True, clock_rate=0.0)))
    dues = [next(playback) for _ in range(9)]
    assert [text(due) for due in dues] == ["b0", "b10", "b20", "b30"] * 2 + ["b0"]
    positions = [due.position_ns for due in dues]
    assert positions == sorted(set(positions)), "never two rounds at one time"


@pytest.mark.parametrize(
    ("selection", "complaint"),
    [
        ({"topics": ["/nobody"]}, "nothing to play"),
        ({"exclude": [".*"]}, "nothing to play"),
        ({"start": 99.0}, "the bag is 3.000 s long"),
        ({"start": -1.0}, "start = -1.0"),
        ({"duration": 0.0}, "duration = 0.0"),
        ({"clock_rate": math.nan}, "clock_rate = nan"),
        ({"remap": {"/c": "/d"}}, "no topic .*'/c'.* to remap"),
        ({"remap": {"/a": "/b"}}, "two topics would be published under one name"),
        ({"topics": ["("]}, "no regular expression"),
    ],
)
def test_what_cannot_be_played_is_refused_with_a_reason(bag, selection, complaint):
    with pytest.raises(ValueError, match=complaint):
        Playback(bag, PlaybackSelection(**selection))


def test_positions_follow_the_clock_at_the_rate():
    pace = PlaybackPace(2.0, now=100.0)
    assert pace.position_ns(101.5) == 3 * SECOND
    assert pace.wait(4 * SECOND, 101.5) == pytest.approx(0.5)
    assert pace.wait(2 * SECOND, 101.5) == 0.0
    pace.set_rate(0.5, 101.5)
    assert pace.position_ns(103.5) == 4 * SECOND
    assert pace.wait(5 * SECOND, 103.5) == pytest.approx(2.0)


def test_a_pause_takes_no_time_of_the_bag():
    pace = PlaybackPace(1.0, now=0.0)
    pace.pause(True, 2.0)
    assert pace.position_ns(50.0) == 2 * SECOND
    assert pace.wait(3 * SECOND, 50.0) == math.inf
    pace.pause(False, 60.0)
    assert pace.wait(3 * SECOND, 60.25) == pytest.approx(0.75)


def test_steps_while_paused_move_where_playing_goes_on():
    pace = PlaybackPace(1.0, now=0.0, paused=True)
    assert pace.wait(0, 3.0) == math.inf
    pace.reach(7 * SECOND, 3.0)
    pace.pause(False, 10.0)
    assert pace.position_ns(11.0) == 8 * SECOND


def test_as_fast_as_can_be_waits_for_nothing_and_can_slow_down():
    pace = PlaybackPace(0.0, now=0.0)
    assert pace.wait(10**15, 0.0) == 0.0
    pace.reach(9 * SECOND, 1.0)
    pace.set_rate(1.0, 5.0)
    assert pace.wait(10 * SECOND, 5.5) == pytest.approx(0.5)


def test_playing_hurries_flat_out_or_when_it_is_behind():
    assert PlaybackPace(0.0, now=0.0).hurries(10, now=0.0)
    pace = PlaybackPace(4.0, now=0.0)
    assert not pace.hurries(2 * SECOND, now=0.5)
    assert not pace.hurries(2 * SECOND, now=0.99) and pace.hurries(2 * SECOND, now=1.01), (
        "half a second late"
    )
    pace.pause(True, now=1.0)
    pace.pause(False, now=9.0)
    assert not pace.hurries(4 * SECOND, now=9.0)


@pytest.mark.parametrize("rate", [-1.0, math.nan, math.inf])
def test_rates_that_are_none_are_refused(rate):
    with pytest.raises(ValueError, match="rate = "):
        PlaybackPace(rate, 0.0)
