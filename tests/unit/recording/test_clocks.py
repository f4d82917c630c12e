"""What stamps are worth beside the times at which messages were recorded, and what a mapping makes
of both.
"""

import numpy as np
import pytest
import yaml

from dart_skill.recording.imports import (
    OWN,
    Fault,
    clocks_of,
    fault_lines,
    mapping_text,
    parse_mapping,
    repair,
    with_remedies,
)
from dart_skill.recording.imports.clocks import clocks_apart, rate_of, regular, timed
from dart_skill.recording.imports.mapping import Clock, MappingError
from dart_skill.recording.imports.pose_stream import PoseStream

S, MS = 10**9, 10**6
N = 3000
STAMPS = 1_764_000_000 * S + 10 * MS * np.arange(N)
LOG = STAMPS + 3 * MS
HOURS = 3600 * S
BURSTS = STAMPS - STAMPS % (50 * MS) + (STAMPS % (50 * MS)) // 100


def fault_of(stamps, log=LOG):
    """The only fault of stamps."""
    _, _, (fault,) = timed("hand", np.asarray(stamps, dtype=np.int64), log, Clock())
    return fault


WRONG = {
    "zero": (
        np.zeros(N),
        "unstamped",
        "the stamps of 3000 messages: all are 0; they were recorded over 30.0 s",
        "time: log",
    ),
    "equal": (
        np.full(N, 5 * S),
        "unstamped",
        "all 3000 messages have the same stamp, 5.000 s",
        "time: log",
    ),
    "milliseconds": (
        (STAMPS - STAMPS[0]) * 1000 + S,
        "unit",
        "their seconds are ms in truth",
        "time: ms",
    ),
    "microseconds": (
        (STAMPS - STAMPS[0]) // 1000 * S + S,
        "unit",
        "their seconds are us in truth",
        "time: us",
    ),
    "a thousandth": (
        (STAMPS - STAMPS[0]) // 1000 + S,
        "unit",
        "seconds or nanoseconds are filled in wrongly",
        "time: log",
    ),
    "microseconds as nanoseconds": (
        STAMPS // S * S + STAMPS % S // 1000,
        "unit",
        "the nanoseconds are filled in wrongly",
        "time: log",
    ),
    "seconds only": (
        STAMPS // S * S,
        "unit",
        "the nanoseconds are filled in wrongly",
        "time: log",
    ),
    "nanoseconds only": (STAMPS % S + 1, "set_back", "nanoseconds without seconds", "time: log"),
    "32 bits": (
        STAMPS % 2**32 + 1,
        "set_back",
        "as a counter of 32 bits of nanoseconds does that overflows",
        "time: log",
    ),
    "backwards": (STAMPS[::-1], "set_back", "run backwards all the time", "time: log"),
}


@pytest.mark.parametrize("what", WRONG)
def test_stamps_that_tell_no_time_are_named_with_what_mends_them(what):
    stamps, kind, text, remedy = WRONG[what]
    fault = fault_of(stamps)
    assert (fault.kind, fault.remedy, fault.repaired) == (kind, remedy, False) and fault.is_of_time
    assert text in fault.message
    (line,) = fault_lines([fault])
    assert f"in a mapping: hand: {{{remedy}}} (NOT REPAIRED)" in line


@pytest.mark.parametrize("late", [0, 7 * MS, 4 * HOURS, S - STAMPS[0]])
def test_good_stamps_are_taken_to_the_bit_whatever_their_epoch(late):
    times, kept, faults = timed("hand", STAMPS + late, LOG, Clock())
    np.testing.assert_array_equal(times, STAMPS + late)
    assert not faults and kept.all()


def test_a_few_stamps_that_nobody_filled_in_are_left_out():
    stamps = np.where(np.arange(N) % 50 == 7, 0, STAMPS)
    times, _, (fault,) = timed("hand", stamps, LOG, Clock())
    np.testing.assert_array_equal(times, stamps[stamps != 0])
    assert "60 of 3000 messages" in fault.message and fault.repaired


def test_a_mapping_says_log_unit_shift_and_drift():
    np.testing.assert_array_equal(timed("hand", np.zeros(N, np.int64), LOG, Clock("log"))[0], LOG)
    since = STAMPS - STAMPS[0] + S
    np.testing.assert_array_equal(timed("hand", since * 1000, LOG, Clock(unit="ms"))[0], since)
    moved = timed("hand", STAMPS, LOG, Clock(shift_ns=-5, drift=1e-3))[0]
    np.testing.assert_array_equal(moved, STAMPS - 5 + np.rint(1e-3 * (since - S)).astype(np.int64))
    assert not timed("hand", np.zeros(N, np.int64), LOG, Clock("log"))[2]


def test_only_messages_of_a_bag_have_a_log_time():
    table = {"csv": "a.csv", "columns": {"time": 1, "position": [2, 3, 4]}, "time": "log"}
    with pytest.raises(
        MappingError, match="hand: time is log, but only messages of a bag have a log time"
    ):
        parse_mapping(
            {"hand": table, "ball": {"position": [0, 0, 0]}, "basket": {"position": [0, 0, 0]}}
        )


# regular samples


@pytest.mark.parametrize("log", [LOG, BURSTS + 60 * MS, None])
def test_stamps_in_bursts_become_regular(log):
    """Where the log tells nothing better, the last frame of a burst was on time: a message is late
    and never early.
    """
    found = regular(BURSTS, log)
    assert np.ptp(np.diff(found)) <= 1 and abs(np.diff(found)[0] - 10 * MS) < 1000
    assert abs(found[0] - STAMPS[0]) < 41 * MS


def test_the_log_tells_which_frames_are_missing():
    kept = np.delete(np.arange(N), [100, 101, 500, 2000])
    found = regular(np.zeros(len(kept), np.int64), LOG[kept])
    np.testing.assert_allclose(found - found[0], STAMPS[kept] - STAMPS[0], atol=2000)


def test_a_silence_is_no_frame():
    kept = np.r_[0:1000, 1400:N]
    found = regular(BURSTS[kept], None)
    steps = np.diff(found)
    assert (
        abs(steps[999] - 4010 * MS) < 20 * MS
        and np.abs(np.delete(steps, 999) - 10 * MS).max() < 1000
    )


def test_a_rate_is_told_by_bursts_as_well():
    time = 1e-9 * (BURSTS - BURSTS[0])
    rate = rate_of(time)
    assert rate.is_bunched and rate.count == 5 and rate.period == pytest.approx(0.01, rel=1e-3)
    steady = rate_of(1e-9 * (STAMPS - STAMPS[0]))
    assert not steady.is_bunched and steady.period == pytest.approx(0.01)
    assert rate_of(np.zeros(N)) is None


def test_bursts_are_one_fault_and_no_gaps():
    position = np.column_stack([np.linspace(0.0, 1.0, N), np.zeros((N, 2))])
    kept = np.r_[0:1000, 1400:N]
    stream = PoseStream("hand", BURSTS, position, np.tile([0.0, 0.0, 0.0, 1.0], (N, 1))).take(kept)
    bodies, faults = repair({"hand": stream})
    assert [fault.kind for fault in faults] == ["bursts", "gap"] and bodies["hand"] is stream
    assert (
        faults[0].remedy == "time: regular" and "5 within 0.4 ms every 50 ms" in faults[0].message
    )
    assert abs(faults[1].count - 400) <= 5, "no more frames than there can have been"


# clocks of several topics


def apart(change):
    """The faults of the hand's clock beside two others, where its stamps are changed."""
    faults = clocks_apart(
        {"hand": (change(STAMPS), LOG), "ball": (STAMPS, LOG + MS), "joints": (STAMPS, LOG)}
    )
    assert {fault.body for fault in faults} <= {"hand"}
    return faults


@pytest.mark.parametrize(
    ("late", "text"),
    [
        (HOURS, "a whole number of hours"),
        (-7 * HOURS, "a time zone"),
        (int(-1.7e18), "another epoch"),
        (3 * S, "another clock"),
    ],
)
def test_clocks_of_other_epochs_are_told_by_the_log(late, text):
    (fault,) = apart(lambda stamps: stamps + late)
    assert fault.kind == "clock" and text in fault.message
    shift = yaml.safe_load(f"{{{fault.remedy}}}")["time_shift"]
    assert shift == pytest.approx(-1e-9 * late, abs=0.01)


@pytest.mark.parametrize("late", [0, 20 * MS, -80 * MS])
def test_clocks_that_are_nearly_the_same_are_not_told_apart_by_the_log(late):
    assert not apart(lambda stamps: stamps + late)


def test_a_drift_is_told():
    (fault,) = apart(lambda stamps: stamps + np.rint(2e-3 * (stamps - stamps[0])).astype(np.int64))
    assert fault.kind == "drift" and yaml.safe_load(f"{{{fault.remedy}}}") == {
        "time_drift": pytest.approx(-2e-3, rel=0.01)
    }


@pytest.mark.parametrize("by", [-3600 * S, -2 * S, -S, S, 2 * S, 3600 * S])
def test_a_clock_that_was_set_meanwhile_is_told_and_mended(by):
    late = 700 * S + np.where(np.arange(N) > 1500, by, 0) - np.where(np.arange(N) > 2200, 2 * S, 0)
    (fault,) = apart(lambda stamps: stamps + late)
    assert (
        fault.kind == "set_back"
        and f"the clock was set by {1e-9 * by:.3f} s, 15 s after" in fault.message
    )
    clock = with_remedies(OWN, [fault]).bodies["hand"].clock
    assert np.abs(clock.corrected(STAMPS + late) - STAMPS).max() < 10 * MS


@pytest.mark.parametrize("by", [-5 * S, -0.3 * S, 0.3 * S, 20 * S, 100 * S])
@pytest.mark.parametrize(
    "unseen", [slice(0, 0), slice(1490, 1600), slice(0, 1510), slice(1500, N)]
)
def test_each_stream_of_a_clock_finds_where_it_was_set(by, unseen):
    """By the stamp at which another stream saw it, also where a body was not seen meanwhile, only
    before it, or only afterwards.
    """
    kept = np.delete(np.arange(N), unseen)
    late = np.where(np.arange(N) > 1500, by, 0).astype(np.int64)
    clock = Clock(steps=((1e-9 * (STAMPS[1500] + 2 * MS), -1e-9 * by),))
    np.testing.assert_array_equal(clock.corrected((STAMPS + late)[kept]), STAMPS[kept])


def test_a_log_of_another_clock_than_all_stamps_is_no_fault():
    """As of a simulated world that is recorded with the time of the wall, and stands still at
    times.
    """
    wall = LOG + np.cumsum(np.where(np.arange(N) % 700 == 0, 5 * S, 2 * MS))
    assert not clocks_apart({"hand": (STAMPS, wall), "joints": (STAMPS, wall + MS)})


def test_what_mends_faults_goes_into_a_mapping():
    faults = [
        fault_of(np.zeros(N)),
        Fault("clock", "joints", 0, 1, 2, "", False, "time_shift: -1.5, time_drift: 0.001"),
    ]
    mapping = with_remedies(OWN, faults)
    assert clocks_of(OWN) == {}
    assert clocks_of(mapping) == {
        "hand": {"time": ["log"]},
        "joints": {"time_shift": -1.5, "time_drift": 0.001},
    }
    assert clocks_of(parse_mapping(yaml.safe_load(mapping_text(mapping)))) == clocks_of(mapping)
