"""What a recorder writes as it should has no fault, and jumps and gaps of time are told where they
are some.
"""

import numpy as np
import pytest

from dart_skill.recording import BagReader, serialize, typestore
from dart_skill.recording.bags import check_bag, check_file, describe
from tests.unit.recording.bag_files import (
    POSE,
    POSE_CDR,
    START_NS,
    STRING,
    TYPES,
    mcap_file,
    metadata_of,
    sqlite_file,
    stamps,
    write_metadata,
)

SECOND = 10**9
EVENT, LOG, JOY = (
    "rcl_interfaces/msg/ParameterEvent",
    "rcl_interfaces/msg/Log",
    "sensor_msgs/msg/Joy",
)
ADD = "int64 a\nint64 b\n---\nint64 sum\n"
HEAD = "=" * 80 + "\n"
INFO = (
    "uint8 event_type\nbuiltin_interfaces/Time stamp\nchar[16] client_gid\nint64 sequence_number\n"
)


def said(findings, *severities):
    return [
        str(one)
        for one in findings
        if one.severity in (severities or ("error", "warning", "note"))
    ]


def decoded(path, topic):
    with BagReader(path) as bag:
        return [one.data for one in bag.messages([topic])]


# types


def types_of(folder, files):
    """A store with the interfaces of a package that is written for it."""
    (folder / "msg").mkdir(parents=True)
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    return typestore(folder)


EVENT_OF_ADD = {
    "info": {"event_type": 1, "stamp": {"sec": 3}, "sequence_number": 7},
    "request": [{"a": 2, "b": 3}],
    "response": [],
}


@pytest.mark.parametrize(
    "text",
    [
        ADD,
        f"{HEAD}SRV: lab_msgs/srv/Add_Event\n{ADD}",
        f"{HEAD}MSG: lab_msgs/srv/Add_Event\n{ADD}",
        (
            f"{ADD}\n{HEAD}MSG: service_msgs/ServiceEventInfo\n{INFO}{HEAD}MSG:"
            " builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
        ),
    ],
)
def test_events_of_services_are_decoded_by_the_definition_of_the_service(tmp_path, text):
    types = types_of(tmp_path / "lab_msgs", {"srv/Add.srv": ADD})
    names = {
        "event": "lab_msgs/srv/Add_Event",
        "request": "lab_msgs/srv/Add_Request",
        "response": "lab_msgs/srv/Add_Response",
    }
    contents = {"event": EVENT_OF_ADD, "request": {"a": 2}, "response": {"sum": 5}}
    data = {name: serialize(types, names[name], content) for name, content in contents.items()}
    file = mcap_file(
        tmp_path / "a.mcap",
        [(f"/{name}", type_name, {"text": text}) for name, type_name in names.items()],
        [(k, START_NS, one) for k, one in enumerate(data.values())],
    )
    assert said(check_file(file)) == []
    (event,) = decoded(file, "/event")
    assert (event.info.sequence_number, event.request[0].b, list(event.response)) == (7, 3, [])
    assert decoded(file, "/request")[0].a == 2 and decoded(file, "/response")[0].sum == 5
    table = sqlite_file(
        tmp_path / "a.db3",
        [("/event", names["event"], "", "cdr")],
        [(0, START_NS, data["event"])],
        definitions=[("lab_msgs/srv/Add", "ros2msg", text)],
    )
    assert (
        said(check_file(table), "error", "warning") == []
        and decoded(table, "/event")[0].request[0].a == 2
    )


FIBONACCI = "int32 order\n---\nint32[] sequence\n---\nint32[] partial\n"


@pytest.mark.parametrize(
    "text", [FIBONACCI, f"{HEAD}ACTION: lab_msgs/action/Fibonacci\n{FIBONACCI}", ""]
)
def test_topics_and_services_of_actions_are_decoded(tmp_path, text):
    types = types_of(tmp_path / "lab_msgs", {"action/Fibonacci.action": FIBONACCI})
    goal = {"goal_id": {"uuid": [1] * 16}}
    contents = {
        "FeedbackMessage": {**goal, "feedback": {"partial": [1, 2]}},
        "SendGoal_Request": {**goal, "goal": {"order": 9}},
        "SendGoal_Event": {
            "request": [{**goal, "goal": {"order": 9}}],
            "response": [{"accepted": True}],
        },
        "GetResult_Response": {"status": 4, "result": {"sequence": [1, 1, 2]}},
        "GetResult_Event": {"response": [{"status": 4, "result": {"sequence": [1, 1, 2]}}]},
    }
    schema = {"text": text, "schema": "ros2msg" if text else "unknown"}
    channels = [(f"/{name}", f"lab_msgs/action/Fibonacci_{name}", schema) for name in contents]
    messages = [
        (k, START_NS, serialize(types, channels[k][1], content))
        for k, content in enumerate(contents.values())
    ]
    file = mcap_file(tmp_path / "a.mcap", channels, messages)
    assert said(check_file(file, types)) == []
    if text:
        assert said(check_file(file)) == []
        assert decoded(file, "/FeedbackMessage")[0].feedback.partial.tolist() == [1, 2]
        assert decoded(file, "/SendGoal_Event")[0].request[0].goal.order == 9
        assert decoded(file, "/GetResult_Response")[0].result.sequence.tolist() == [1, 1, 2]
    else:
        assert (
            len(said(check_file(file), "warning")) == 5 and said(check_file(file), "error") == []
        )


@pytest.mark.parametrize("text", ["", "# nothing\n", "\n\n", "uint8 A=1\n"])
@pytest.mark.parametrize("name", ["std_msgs/msg/Empty", "lab_msgs/msg/Nothing"])
@pytest.mark.parametrize("data", [b"\0\1\0\0\0", b"\0\1\0\0\0\0\0\0", b"\0\1\0\0"])
def test_types_without_fields_are_types(tmp_path, text, name, data):
    file = mcap_file(tmp_path / "a.mcap", [("/e", name, {"text": text})], [(0, START_NS, data)])
    assert said(check_file(file)) == [] and len(decoded(file, "/e")) == 1


def test_topics_without_messages_are_no_fault_whatever_is_said_of_them(tmp_path):
    channels = [
        ("/p", POSE),
        (
            "/events/write_split",
            "rosbag2_interfaces/msg/WriteSplitEvent",
            {"schema": "ros2msg", "text": "string closed_file\n"},
        ),
        ("/unknown", "lab_msgs/msg/X", {"text": ""}),
        ("/damaged", "lab_msgs/msg/Y", {"text": "float64[ x"}),
        ("/bare", "", {"schema": "", "text": ""}),
        ("/json", "J", {"encoding": "json", "text": ""}),
    ]
    assert (
        said(
            check_file(
                mcap_file(
                    tmp_path / "a.mcap", channels, [(0, stamp, POSE_CDR) for stamp in stamps()]
                )
            )
        )
        == []
    )
    topics = [("/p", POSE, "", "cdr"), ("/unknown", "lab_msgs/msg/X", "", "cdr")]
    file = sqlite_file(tmp_path / "a.db3", topics, [(0, stamp, POSE_CDR) for stamp in stamps()])
    assert said(check_file(file), "error", "warning") == []
    assert {one["name"]: one["count"] for one in describe(file)["topics"]} == {
        "/p": 20,
        "/unknown": 0,
    }


def test_messages_of_a_type_that_is_nowhere_defined_are_whole_and_told(tmp_path):
    """As every bag of Humble has them: the fault is not the bag's."""
    messages = [(0, stamp, b"\0\1\0\0" + bytes(12)) for stamp in stamps()]
    for file in (
        sqlite_file(tmp_path / "a.db3", [("/x", "lab_msgs/msg/X", "", "cdr")], messages),
        mcap_file(tmp_path / "a.mcap", [("/x", "lab_msgs/msg/X", {"text": ""})], messages),
    ):
        (found,) = said(check_file(file), "error", "warning")
        assert (
            found.startswith("warning")
            and "lab_msgs/msg/X, which the bag does not define" in found
            and "--definitions" in found
        )


def test_a_definition_that_does_not_fit_is_told_and_the_standard_one_is_taken(tmp_path):
    words = [(0, stamp, serialize(TYPES, STRING, {"data": "a"})) for stamp in stamps()]
    file = sqlite_file(
        tmp_path / "a.db3",
        [("/w", STRING, "", "cdr")],
        words,
        definitions=[(STRING, "ros2msg", "uint8 level")],
    )
    assert [one.data for one in decoded(file, "/w")] == ["a"] * 20
    (found,) = said(check_file(file), "error", "warning")
    assert (
        found.startswith("warning")
        and f"20 messages are no {STRING} as the bag defines it" in found
    )


# time


def recorded(path, topics, types=None):
    """topics: times by name."""
    kinds = {"/words": STRING, "/joy": JOY, "/rosout": LOG, **(types or {})}
    data = {
        name: serialize(TYPES, kinds[name], {}) if name in kinds else POSE_CDR for name in topics
    }
    messages = sorted(
        (int(stamp), k) for k, times in enumerate(topics.values()) for stamp in times
    )
    names = list(topics)
    return mcap_file(
        path,
        [(name, kinds.get(name, POSE)) for name in names],
        [(k, stamp, data[names[k]]) for stamp, k in messages],
    )


def times(seconds, rate=100.0, jitter=0.0, without=(), start_ns=START_NS):
    """Times [ns] of so many seconds, without stretches (begin, end) [s]."""
    rng = np.random.default_rng(0)
    at = np.arange(0.0, seconds, 1.0 / rate)
    at = np.sort(at + jitter / rate * rng.standard_normal(len(at)))
    kept = (
        np.all([(at < begin) | (at >= end) for begin, end in without], axis=0)
        if without
        else np.ones(len(at), dtype=bool)
    )
    return (start_ns + np.maximum(at[kept], 0.0) * SECOND).astype(np.int64)


@pytest.mark.parametrize("leap", [55 * 365.25 * 86_400, 86_400 * 2, 3600, 100])
def test_log_time_that_leaps_forward_is_told(tmp_path, leap):
    first = times(10.0)
    both = np.concatenate([first, first[-1] + int(leap * SECOND) + first - first[0]])
    for topics in ({"/p": both}, {"/p": both, "/q": both[::4]}):
        (found,) = check_file(recorded(tmp_path / "a.mcap", topics))
        assert (
            found.severity == "warning"
            and "log time jumps forward by" in found.message
            and f"after {first[-1]} ns" in found.message
        )
    rare = recorded(
        tmp_path / "a.mcap",
        {"/words": [START_NS, START_NS + SECOND, START_NS + int(leap * SECOND)]},
    )
    assert bool(check_file(rare)) == (leap >= 86_400), "words come when there is something to say"


def test_log_time_that_jumps_back_is_told_and_a_small_disorder_is_not(tmp_path):
    first = times(3.0)
    for back in (20 * SECOND, 50_000_000):
        both = [(0, int(stamp), POSE_CDR) for stamp in [*first, *(first + 3 * SECOND - back)]]
        for file in (
            mcap_file(tmp_path / "a.mcap", [("/p", POSE)], both),
            sqlite_file(tmp_path / "a.db3", [("/p", POSE, "", "cdr")], both),
        ):
            (found,) = said(check_file(file), "warning")
            assert (
                "log time jumps back 1 times" in found
                and f"first at {first[-1]} ns, on /p" in found
            )
    late = [(k % 2, int(stamp) - (k % 2) * 15_000_000, POSE_CDR) for k, stamp in enumerate(first)]
    assert (
        said(check_file(mcap_file(tmp_path / "a.mcap", [("/p", POSE), ("/q", POSE)], late))) == []
    ), "of two publishers, each in order"
    batched = [(0, int(stamp), POSE_CDR) for stamp in first] + [
        (1, int(stamp), POSE_CDR) for stamp in first
    ]
    (found,) = check_file(mcap_file(tmp_path / "a.mcap", [("/p", POSE), ("/q", POSE)], batched))
    assert (
        found.severity == "note"
        and "do not stand in order of log time, by up to 2.990 s" in found.message
    )


def test_publishers_with_delays_of_their_own_have_set_no_clock(tmp_path):
    """An arm whose driver lags: it was said 1825 times that a clock was set, or that a
    simulation began anew. One step of a second among them is told as what it is.
    """
    first = times(30.0)
    pairs = [(stamp, int(stamp) - late) for stamp in first for late in (0, 300_000_000)]
    late = [(0, stamp, POSE_CDR) for _, stamp in pairs]
    (found,) = check_file(mcap_file(tmp_path / "a.mcap", [("/p", POSE)], late))
    assert found.severity == "note" and found.place == "topic /p"
    assert (
        f"{len(first)} of {len(late)} messages stand after later ones, by up to 0.300000 s, first"
        f" at {first[0]} ns: readers sort them" in found.message
    )
    assert "several publishers" in found.remedy and "no clock was set" in found.remedy
    anew = [*late, *((0, stamp + 28 * SECOND, POSE_CDR) for _, stamp in pairs)]
    (found,) = said(check_file(mcap_file(tmp_path / "a.mcap", [("/p", POSE)], anew)), "warning")
    assert "log time jumps back" in found and "a clock was set" in found


def test_a_jump_from_one_file_to_the_next_is_told_once(tmp_path):
    path, first = tmp_path / "bag", times(3.0)
    path.mkdir()
    for k, start in enumerate((0, 10**8 * SECOND)):
        mcap_file(
            path / f"bag_{k}.mcap",
            [("/p", POSE)],
            [(0, int(stamp) + start, POSE_CDR) for stamp in first],
        )
    told = metadata_of(
        9,
        ["bag_0.mcap", "bag_1.mcap"],
        [("/p", POSE, 600)],
        600,
        length_ns=int(first[-1] - first[0]) + 10**8 * SECOND,
    )
    write_metadata(path, told)
    (found,) = check_bag(path)
    assert "log time jumps forward by 3.2 years" in found.message and found.place == "bag"


@pytest.mark.parametrize(
    ("rate", "jitter"), [(10.0, 0.2), (100.0, 0.0), (100.0, 0.2), (250.0, 0.2)]
)
def test_a_gap_of_a_topic_against_its_rate_is_told_with_its_place(tmp_path, rate, jitter):
    topics = {"/joints": times(40.0, rate), "/hand": times(40.0, rate, jitter, [(12.0, 15.0)])}
    (found,) = check_file(recorded(tmp_path / "a.mcap", topics))
    before = max(stamp for stamp in topics["/hand"] if stamp < START_NS + 13 * SECOND)
    assert found.severity == "warning" and found.place == "topic /hand"
    assert (
        f"after {before} ns" in found.message
        and "a gap of 3." in found.message
        and "comes after" in found.message
    )


def test_gaps_of_several_bodies_at_once_are_told_while_the_joints_go_on(tmp_path):
    lost = times(60.0, 100.0, 0.1, [(20.0, 22.0), (30.0, 31.0)])
    found = check_file(
        recorded(
            tmp_path / "a.mcap", {"/joints": times(60.0, 200.0), "/hand": lost, "/ball": lost}
        )
    )
    assert {one.place for one in found} == {"topic /hand", "topic /ball"}
    assert all(
        "2 gaps, the longest of 2.0" in one.message and one.severity == "warning" for one in found
    )


def test_a_topic_that_was_lost_for_half_of_the_time_is_a_note(tmp_path):
    topics = {"/joints": times(20.0, 500.0), "/hand": times(20.0, 100.0, 0.0, [(5.0, 15.0)])}
    (found,) = check_file(recorded(tmp_path / "a.mcap", topics))
    assert found.severity == "note" and "a gap of 10.0" in found.message


def bursts(n, length, pause, rate):
    return np.concatenate(
        [
            times(length, rate, start_ns=START_NS + int(k * (length + pause) * SECOND))
            for k in range(n)
        ]
    )


HEALTHY = {
    "a world that is paused for all alike": {
        "/p": times(40.0, 100.0, 0.1, [(9.0, 13.0)]),
        "/q": times(40.0, 200.0, 0.1, [(9.0, 13.0)]),
    },
    "with words meanwhile": {
        "/p": times(40.0, 100.0, 0.0, [(9.0, 13.0)]),
        "/q": times(40.0, 50.0, 0.0, [(9.0, 13.0)]),
        "/words": [START_NS + 10 * SECOND, START_NS + 11 * SECOND],
    },
    "words now and then": {
        "/p": times(60.0),
        "/words": START_NS + np.cumsum(np.random.default_rng(1).exponential(0.5, 100) * SECOND),
    },
    "a latched topic": {"/p": times(60.0), "/words": [START_NS]},
    "buttons that are held": {"/p": times(60.0), "/joy": bursts(4, 10.0, 4.0, 20.0)},
    "a teleoperator": {"/p": times(100.0), "/cmd": bursts(10, 5.0, 5.0, 20.0)},
    "the log of a node": {"/p": times(60.0), "/rosout": times(60.0, 10.0, 0.0, [(20.0, 30.0)])},
    "a world that is paused twice, and one topic says something in between": {
        "/p": times(40.0, 100.0, 0.1, [(9.0, 11.0)]),
        "/q": times(40.0, 200.0, 0.1, [(9.0, 10.0), (10.01, 11.0)]),
        "/r": times(40.0, 200.0, 0.1, [(9.0, 10.0), (10.01, 11.0)]),
    },
    "a world that is paused when a topic has ended": {
        "/p": times(60.0, 100.0, 0.1, [(30.0, 32.0)]),
        "/q": times(60.0, 200.0, 0.1, [(30.0, 32.0)]),
        "/guided": times(60.0, without=[(29.0, 60.0)]),
    },
    "jitter": {"/p": times(60.0, 100.0, 0.8), "/q": times(60.0, 1.0, 0.2)},
    "a topic that begins late and ends early": {
        "/p": times(60.0),
        "/q": times(60.0, without=[(0.0, 20.0), (40.0, 60.0)]),
    },
    "receipt in bursts": {
        "/p": np.sort(np.concatenate([times(30.0, 20.0) + k * 100_000 for k in range(5)])),
        "/q": times(30.0),
    },
    "a slow topic": {"/p": times(300.0, 10.0), "/q": times(300.0, 0.1)},
}


@pytest.mark.parametrize("topics", HEALTHY.values(), ids=HEALTHY)
def test_no_alarm_for_what_is_as_it_should_be(tmp_path, topics):
    assert said(check_file(recorded(tmp_path / "a.mcap", topics))) == []


def test_topics_that_are_latched_or_of_events_have_no_gaps(tmp_path):
    times_ns = times(60.0, 10.0, 0.0, [(20.0, 23.0)])
    latched = {"metadata": {"offered_qos_profiles": "- {durability: transient_local}"}}
    for told, type_name in ((latched, POSE), ({}, EVENT)):
        data = POSE_CDR if type_name == POSE else serialize(TYPES, EVENT, {})
        messages = sorted(
            [(0, int(s), POSE_CDR) for s in times(60.0)] + [(1, int(s), data) for s in times_ns],
            key=lambda one: one[1],
        )
        assert (
            said(
                check_file(
                    mcap_file(
                        tmp_path / "a.mcap", [("/p", POSE), ("/e", type_name, told)], messages
                    )
                )
            )
            == []
        )


def test_a_long_pause_of_all_topics_is_a_note(tmp_path):
    lost = {"without": [(100.0, 120.0)]}
    (found,) = check_file(
        recorded(
            tmp_path / "a.mcap",
            {"/p": times(300.0, 20.0, **lost), "/q": times(300.0, 50.0, **lost)},
        )
    )
    assert (
        found.severity == "note"
        and "no topic of a regular rate has messages for 20.0" in found.message
    )
