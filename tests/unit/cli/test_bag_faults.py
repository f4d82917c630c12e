"""What `bag check` says of files, metadata and log times is said by whatever learns from a bag, in
the same words.
"""

import json
import re
import shutil
import sqlite3
from collections import Counter
from contextlib import closing

import pytest
import yaml

from dart_skill.cli import main
from dart_skill.recording import BagReader, serialize
from dart_skill.recording.bags import check_bag
from dart_skill.recording.imports import OWN, convert, mapping_text
from tests.unit.recording.bag_files import POSE, STRING, TYPES, mcap_file

HAND, DAY_NS = "/vrpn_mocap/hand/pose", 86_400 * 10**9


@pytest.fixture
def source(recorded_session):
    return recorded_session[0]


def rewritten(
    source,
    folder,
    change=lambda one: (one.topic, one.stamp_ns, one.data),
    told=None,
    more=(),
    **options,
):
    """A bag as another writer makes it. told: what differs of channels, by topic; more: channels
    and messages besides.
    """
    folder.mkdir()
    with BagReader(source) as bag:
        channels = [
            (name, topic.type_name, (told or {}).get(name, {}))
            for name, topic in bag.topics.items()
        ]
        numbers = {name: number for number, (name, *_) in enumerate(channels)}
        changed = [
            (numbers[topic], stamp_ns, data)
            for topic, stamp_ns, data in map(change, bag.messages(decode=False))
        ]
        changed += [(len(channels), bag.end_ns, data) for _, data in more]
    mcap_file(
        folder / "bag_0.mcap", [*channels, *(channel for channel, _ in more)], changed, **options
    )
    return folder


def with_metadata(source, folder, **changed):
    shutil.copytree(source, folder)
    told = yaml.safe_load((folder / "metadata.yaml").read_text())
    told["rosbag2_bagfile_information"].update(changed)
    (folder / "metadata.yaml").write_text(yaml.safe_dump(told))
    return folder


def with_file(source, folder, name):
    shutil.copytree(source, folder)
    (folder / name).write_bytes(next(folder.glob("*.mcap")).read_bytes())
    return folder


def without_a_part(source, folder):
    """The second of three parts is missing, in which nothing was thrown."""
    rewritten(source, folder)
    (folder / "metadata.yaml").unlink(missing_ok=True)
    mcap_file(
        folder / "bag_2.mcap", [("/late", STRING)], [(0, 10**12, serialize(TYPES, STRING, {}))]
    )
    return folder


def rows_without_bytes(source, folder):
    convert(source, folder, storage="sqlite3")
    with closing(sqlite3.connect(next(folder.glob("*.db3")))) as database:
        database.execute("UPDATE messages SET data = 'text' WHERE id % 100 = 0")
        database.execute("UPDATE messages SET topic_id = 99 WHERE id % 100 = 1")
        database.commit()
    return folder


def later(ns):
    """Log times of the second half are later, or earlier, by so much."""
    return lambda one: (one.topic, one.stamp_ns + (ns if one.stamp_ns > 10**10 else 0), one.data)


TOLD = {
    "messages that metadata.yaml counts": (
        lambda *a: with_metadata(*a, message_count=99_999),
        "it says 99999 for messages in all",
    ),
    "what the recorder lost": (
        lambda *a: with_metadata(*a, custom_data={"lost": json.dumps({HAND: 3})}),
        f"never received messages that were sent: 3 on {HAND}",
    ),
    "an end that nobody wrote": (rewritten, "there is no metadata.yaml"),
    "a file of another bag": (
        lambda *a: with_file(*a, "other_0.mcap"),
        "metadata.yaml does not name it: readers leave it out",
    ),
    "a part that is missing": (without_a_part, "by the numbers of its files bag_1 is missing"),
    "rows that are none": (
        rows_without_bytes,
        r"messages cannot be read: they have no time, or no bytes",
    ),
    "rows of no topic": (
        rows_without_bytes,
        r"messages are of channels \[99\], which the file does not define",
    ),
    "several types": (
        lambda *a: rewritten(
            *a, more=[((HAND, STRING), serialize(TYPES, STRING, {"data": "words"}))]
        ),
        f"its messages have several types: {POSE}, {STRING}",
    ),
    "a clock that was set forward": (
        lambda *a: rewritten(*a, change=later(3 * DAY_NS)),
        "log time jumps forward by 3.0 days",
    ),
}


def learned(bag, model, *options):
    return main(["learn", str(bag), "--output", str(model), *map(str, options)])


@pytest.mark.parametrize(("make", "text"), TOLD.values(), ids=TOLD)
def test_what_is_told_by_learn_is_what_the_check_says(tmp_path, source, capsys, make, text):
    bag = make(source, tmp_path / "bag")
    checked = {str(one).partition(": ")[2] for one in check_bag(bag)}
    assert learned(bag, tmp_path / "model.npz") == 0
    said = capsys.readouterr().out.splitlines()
    assert any(re.search(text, line) and line in checked for line in said), (said, checked)


def test_every_command_that_reads_a_bag_tells_it(tmp_path, source, capsys):
    bag, text = (
        with_metadata(source, tmp_path / "bag", message_count=99_999),
        "it says 99999 for messages in all",
    )
    (tmp_path / "mapping.yaml").write_text(mapping_text(OWN))
    assert (
        learned(bag, tmp_path / "model.npz", "--mapping", tmp_path / "mapping.yaml", "--json") == 0
    )
    assert [
        one["message"][: len(text)]
        for one in json.loads(capsys.readouterr().out)["faults"]
        if one["kind"] == "bag"
    ] == [text]
    for form in ("bag", "sqlite", "csv", "lerobot"):
        assert (
            main(
                [
                    "bag",
                    "convert",
                    str(bag),
                    "--to",
                    form,
                    "--output",
                    str(tmp_path / f"to_{form}"),
                ]
            )
            == 0
        )
        assert text in "".join(capsys.readouterr()), form
    assert learned(bag, tmp_path / "same.npz", "--demonstrations-topic", "--json") == 0
    told = capsys.readouterr()
    assert text in told.err and json.loads(told.out)["learned_from"]
    pytest.importorskip("matplotlib")
    assert main(["report", str(bag), "--output", str(tmp_path / "page.html")]) == 0
    assert text in capsys.readouterr().out and text in (tmp_path / "page.html").read_text()


def test_messages_that_sequence_numbers_miss_are_told(tmp_path, source, capsys):
    """By the first and the last of a topic: only their chunks are unpacked."""
    with BagReader(source) as bag:
        channels = [(name, topic.type_name) for name, topic in bag.topics.items()]
        numbers, seen, messages = (
            {name: number for number, (name, _) in enumerate(channels)},
            Counter(),
            [],
        )
        for one in bag.messages(decode=False):
            seen[one.topic] += 1
            if one.topic != HAND or seen[HAND] not in (60, 61, 75):
                messages.append((numbers[one.topic], one.stamp_ns, one.data, seen[one.topic]))
    (tmp_path / "bag").mkdir()
    mcap_file(tmp_path / "bag" / "bag_0.mcap", channels, messages)
    assert any(
        f"topic {HAND}: 3 messages are missing in 2 gaps of the sequence numbers" in str(one)
        for one in check_bag(tmp_path / "bag")
    )
    assert learned(tmp_path / "bag", tmp_path / "model.npz") == 0
    said = capsys.readouterr().out
    assert (
        f"topic {HAND}: 3 messages are missing by the sequence numbers" in said
        and said.count("sequence numbers") == 1
    )


def test_log_time_that_jumps_back_is_told_beside_what_comes_of_it(tmp_path, source, capsys):
    assert (
        learned(
            rewritten(source, tmp_path / "bag", change=later(-5 * 10**9)), tmp_path / "model.npz"
        )
        == 1
    )
    assert re.search(
        "two publishers give different positions.*log time jumps back 1 times",
        capsys.readouterr().err,
    )


REFUSED = {
    "a pose": (HAND, f"topic {HAND}: 40 bytes are no {POSE}"),
    "a joint state": (
        "/joint_states",
        "topic /joint_states: 40 bytes are no sensor_msgs/msg/JointState",
    ),
    "a command": ("/wam/teacher_wrench", "topic /wam/teacher_wrench: 40 bytes are no WamCommand"),
}


@pytest.mark.parametrize(("topic", "text"), REFUSED.values(), ids=REFUSED)
def test_messages_that_cannot_be_decoded_are_refused_with_their_topic(
    tmp_path, source, capsys, topic, text
):
    seen = []

    def cut(one):
        seen.append(one.topic)
        return (
            one.topic,
            one.stamp_ns,
            one.data[:40] if one.topic == topic and seen.count(topic) == 50 else one.data,
        )

    assert learned(rewritten(source, tmp_path / "bag", cut), tmp_path / "model.npz") == 1
    assert text in capsys.readouterr().err


def test_a_topic_without_a_type_is_refused(tmp_path, source, capsys):
    assert (
        learned(
            rewritten(source, tmp_path / "bag", told={HAND: {"schema": "", "text": ""}}),
            tmp_path / "model.npz",
        )
        == 1
    )
    assert (
        f"{HAND} has type none; for 'hand' it must be one of PoseStamped"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize("topic", [HAND, "/joint_states"])
def test_where_a_definition_does_not_fit_the_standard_one_teaches_the_same(
    tmp_path, source, capsys, topic
):
    """As `bag check` says."""
    models = []
    for name, told in (
        ("as_it_is", {}),
        ("other", {topic: {"text": "uint8 level\nstring[] names\nfloat64[300] numbers"}}),
    ):
        assert (
            learned(
                rewritten(source, tmp_path / name, told=told), tmp_path / f"{name}.npz", "--json"
            )
            == 0
        )
        models.append(json.loads(capsys.readouterr().out)["model_id"])
    assert models[0] == models[1]
