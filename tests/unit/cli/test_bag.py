"""`dart-skill bag`: what it says in text and in JSON, its exit status, and what it refuses."""

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from dart_skill.cli import main
from dart_skill.recording import (
    BagReader,
    BagWriter,
    definition,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.recording.bags import check_bag
from dart_skill.recording.imports.mapping import parse_mapping
from tests.paths import DOCS

POSE, TEXT = "geometry_msgs/msg/PoseStamped", "std_msgs/msg/String"
TYPES = typestore()
START_NS, STEP_NS = 1_700_000_000_123_456_789, 10_000_000
BODIES = {"hand": 0.0, "ball": 1.0, "basket": 2.0}


@pytest.fixture(autouse=True)
def unsynced(monkeypatch):
    """No waiting for the disk: what survives a crash is tested elsewhere (test_survives.py)."""
    monkeypatch.setattr(os, "fsync", lambda fd: None)
    monkeypatch.setattr(os, "fdatasync", lambda fd: None)


def pose(stamp_ns, x):
    stamp = dict(zip(("sec", "nanosec"), divmod(stamp_ns, 10**9), strict=True))
    content = {"position": {"x": float(x), "z": 1.0}, "orientation": {"w": 1.0}}
    return serialize(
        TYPES, POSE, {"header": {"stamp": stamp, "frame_id": "world"}, "pose": content}
    )


def record(path, n_steps=300, custom_data=None, topic="/vrpn_mocap/{}/pose", **options):
    """A bag of three bodies that move along x."""
    with BagWriter(
        path,
        custom_data={"seed": "7", "lost": "{}"} if custom_data is None else custom_data,
        **options,
    ) as bag:
        for body in BODIES:
            bag.add_topic(
                topic.format(body),
                POSE,
                definition(TYPES, POSE),
                qos_yaml("best_effort", depth=5),
                type_hash(TYPES, POSE),
            )
        bag.add_attachment("wam.yaml", "joints: 7\n", "application/yaml")
        for step in range(n_steps):
            stamp = START_NS + step * STEP_NS
            for body, x in BODIES.items():
                bag.write(
                    topic.format(body), stamp, stamp, pose(stamp, x + 0.01 * np.sin(0.01 * step))
                )
    return path


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return record(tmp_path_factory.mktemp("recorded") / "bag", chunk_size=8192)


@pytest.fixture
def bag(recorded, tmp_path):
    """A bag of one's own, to damage."""
    return shutil.copytree(recorded, tmp_path / "bag")


def middle_chunk(file):
    """A place in a chunk in the middle of a file."""
    with open(file, "rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    return chunks[len(chunks) // 2].chunk_start_offset + 200


@pytest.fixture
def cut(bag):
    """The same bag, half of its file, no metadata.yaml: what a killed recorder leaves."""
    file = bag / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[: middle_chunk(file)])
    (bag / "metadata.yaml").unlink()
    return bag


@pytest.fixture
def call(capsys):
    """Runs `dart-skill bag ...`: exit status, standard output, standard error."""

    def run(*arguments):
        status = main(["bag", *map(str, arguments)])
        return (status, *capsys.readouterr())

    return run


def foreign(path, plugin=StoragePlugin.SQLITE3, mode=CompressionMode.NONE):
    """A bag of texts by `rosbags`."""
    writer = Writer(path, version=9, storage_plugin=plugin)
    if mode != CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/said", TEXT, typestore=TYPES)
        for k in range(20):
            writer.write(
                connection, START_NS + k * STEP_NS, serialize(TYPES, TEXT, {"data": str(k)})
            )
    return path


# info


def test_info_tells_the_bag_and_each_topic(bag, call):
    status, said, complaint = call("info", bag)
    assert (status, complaint) == (0, "")
    told = dict(line.split(":", 1) for line in said.split("\n\n")[0].splitlines())
    told = {name: text.strip() for name, text in told.items()}
    assert told["path"] == str(bag) and told["storage"] == "mcap, zstd, ROS jazzy"
    assert (told["duration"], told["messages"], told["lost"]) == ("2.990 s", "900", "0")
    assert told["start"] == "2023-11-14 22:13:20.123 UTC (1700000000.123456789 s)"
    assert told["end"] == "2023-11-14 22:13:23.113 UTC (1700000003.113456789 s)"
    assert told["splits"].startswith("bag_0.mcap  ") and told["splits"].endswith(
        " kB, 2.990 s, 900 messages"
    )
    assert (
        told["custom data"] == "seed: 7"
        and told["attachments"] == "wam.yaml (application/yaml, 10 B)"
    )
    head, *rows = said.split("\n\n")[1].splitlines()
    assert head.split() == ["topic", "type", "count", "Hz", "QoS", "type", "hash"]
    assert [row.split()[0] for row in rows] == [
        f"/vrpn_mocap/{body}/pose" for body in sorted(BODIES)
    ]
    assert all(
        POSE in row
        and " 300  100.3  best effort, last 5  " in row
        and row.endswith(type_hash(TYPES, POSE)[:15])
        for row in rows
    )
    assert said.splitlines()[-1] == f"next: dart-skill bag check {bag}"


def test_info_as_json_is_an_object_and_of_several_bags_a_list(bag, tmp_path, call):
    status, said, _ = call("info", "--json", bag)
    told = json.loads(said)
    assert status == 0 and (told["message_count"], told["storage"], told["lost"]) == (
        900,
        "mcap",
        {},
    )
    status, said, complaint = call("info", "--json", bag / "bag_0.mcap", bag, tmp_path / "nothing")
    single, whole, nothing = json.loads(said)
    assert (
        status == 1 and "nothing: no such bag" in complaint and "no such bag" in nothing["error"]
    )
    assert whole == told and {**single, "path": told["path"], "has_metadata_file": True} == told


def test_info_of_several_bags_shows_those_that_can_be_read(bag, tmp_path, call):
    lost = record(
        tmp_path / "lost",
        custom_data={"lost": '{"/vrpn_mocap/ball/pose": 3}'},
        max_bytes=30_000,
        chunk_size=4096,
    )
    status, said, complaint = call("info", tmp_path / "nothing", bag, lost)
    assert status == 1 and complaint == f"dart-skill: {tmp_path / 'nothing'}: no such bag\n"
    assert said.count("path:  ") == 2 and "next:" not in said
    assert "lost:         3 on /vrpn_mocap/ball/pose" in said
    assert "lost_0.mcap" in said and "\n              lost_1.mcap" in said, "a line for each file"


def test_info_of_a_folder_without_metadata_and_of_a_simulation(tmp_path, call):
    bag = record(tmp_path / "bag", custom_data={})
    (bag / "metadata.yaml").unlink()
    status, said, _ = call("info", bag)
    assert (
        status == 0
        and "metadata:     no metadata.yaml" in said
        and "lost:         not known" in said
    )
    with BagWriter(tmp_path / "early") as early:
        early.add_topic("/said", TEXT, definition(TYPES, TEXT))
        early.write("/said", 2_500_000_000, 0, serialize(TYPES, TEXT, None))
    status, said, _ = call("info", tmp_path / "early")
    assert status == 0 and "start:        2.500000000 s\n" in said and "custom data" not in said
    assert f"/said  {TEXT}      1  0.0  -    -" in said


@pytest.mark.parametrize(
    ("plugin", "mode", "storage"),
    [
        (StoragePlugin.SQLITE3, CompressionMode.NONE, "sqlite3"),
        (StoragePlugin.SQLITE3, CompressionMode.FILE, "sqlite3, zstd"),
        (StoragePlugin.MCAP, CompressionMode.FILE, "mcap, zstd"),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE, "mcap, zstd"),
        (StoragePlugin.MCAP, CompressionMode.STORAGE, "mcap, zstd"),
    ],
)
def test_bags_of_other_formats_are_described_and_have_no_fault(
    tmp_path, call, plugin, mode, storage
):
    bag = foreign(tmp_path / "bag", plugin, mode)
    status, said, _ = call("info", bag)
    (file,) = (file for file in bag.iterdir() if file.name != "metadata.yaml")
    assert status == 0 and f"storage:      {storage}, ROS" in said
    assert f"splits:       {file.name}  " in said and "0.190 s, 20 messages" in said
    status, said, _ = call("check", bag)
    assert status == 0 and "error" not in said and "warning" not in said, said


def test_a_lone_sqlite_file_is_described_and_checked(tmp_path, call):
    bag = foreign(tmp_path / "bag")
    (bag / "metadata.yaml").unlink()
    for path in (bag, bag / "bag.db3"):
        status, said, _ = call("info", path)
        assert status == 0 and "storage:      sqlite3" in said and "messages:     20" in said
        status, said, _ = call("check", path)
        assert status == 0 and "it was read as a whole, but changed bytes may go unnoticed" in said


def test_a_sqlite_bag_with_fewer_messages_than_it_says_is_found(tmp_path, call):
    bag = foreign(tmp_path / "bag")
    text = (bag / "metadata.yaml").read_text()
    assert "message_count: 20" in text
    (bag / "metadata.yaml").write_text(text.replace("message_count: 20", "message_count: 21"))
    status, said, _ = call("check", bag)
    assert (
        status == 1
        and "error: metadata.yaml: it says 21 for messages on /said, the files say 20\n" in said
    )


def test_the_files_of_a_split_sqlite_bag_are_told_one_by_one(tmp_path, call):
    first, second = foreign(tmp_path / "bag"), foreign(tmp_path / "other")
    (second / "other.db3").rename(first / "bag_1.db3")
    told = yaml.safe_load((first / "metadata.yaml").read_text())
    info = told["rosbag2_bagfile_information"]
    info["relative_file_paths"].append("bag_1.db3")
    info["files"].append({**info["files"][0], "path": "bag_1.db3"})
    (first / "metadata.yaml").write_text(yaml.safe_dump(told))
    _, said, _ = call("info", "--json", first)
    told = json.loads(said)
    assert [(file["path"], file["message_count"]) for file in told["files"]] == [
        ("bag.db3", 20),
        ("bag_1.db3", 20),
    ]
    assert told["size_bytes"] == sum(file.stat().st_size for file in first.glob("*.db3"))


# check


def test_check_of_a_whole_bag_finds_nothing(bag, call):
    assert call("check", bag) == (0, f"{bag}: nothing is wrong with it\n", "")
    assert call("check", "--json", bag) == (0, "[]\n", "")


def test_check_names_each_fault_its_remedy_and_the_next_command(cut, call):
    status, said, _ = call("check", cut)
    *lines, verdict, following = said.splitlines()
    assert (
        status == 1
        and verdict == f"{cut}: {len(lines) - 1} errors, 1 warning"
        and following == f"next: dart-skill bag recover {cut}"
    )
    assert (
        lines[0]
        == "error: bag_0.mcap: the file has no end (make a new bag of what is in it: dart-skill"
        " bag recover)"
    )
    assert lines[-1].startswith("warning: bag: there is no metadata.yaml")


def test_check_as_json_is_a_list_of_findings(cut, tmp_path, call):
    record(tmp_path / "whole")
    status, said, _ = call("check", "--json", tmp_path / "whole", cut, tmp_path / "nothing")
    findings = json.loads(said)
    assert status == 1 and {one["bag"] for one in findings} == {
        str(cut),
        str(tmp_path / "nothing"),
    }
    assert all(set(one) == {"bag", "severity", "place", "message", "remedy"} for one in findings)
    assert findings[-1]["message"] == "no such bag" and findings[0]["severity"] == "error"


def test_warnings_alone_are_no_failure(bag, call):
    (bag / "metadata.yaml").unlink()
    status, said, _ = call("check", bag)
    assert status == 0 and said.endswith(f"{bag}: 1 warning\n")


def test_a_type_that_the_bag_lacks_can_be_given(tmp_path, call):
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/x", "lab_msgs/msg/X", "")
        bag.write("/x", 1, 1, serialize(TYPES, TEXT, {"data": "a"}))
    status, said, _ = call("check", tmp_path / "bag")
    assert (
        status == 0
        and "warning: bag_0.mcap, topic /x: it has type lab_msgs/msg/X, which the bag does not define"
        in said
    )
    assert "(give the folder of its .msg files with --definitions" in said
    (tmp_path / "lab_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "lab_msgs" / "msg" / "X.msg").write_text("string data\n")
    status, said, _ = call("check", tmp_path / "bag", "--definitions", tmp_path / "lab_msgs")
    assert status == 0 and said.endswith("nothing is wrong with it\n"), said


# recover


def test_recover_says_what_was_kept_and_lost_and_leaves_a_whole_bag(cut, tmp_path, call):
    before = (cut / "bag_0.mcap").read_bytes()
    status, said, complaint = call("recover", cut, "--output", tmp_path / "new")
    assert (status, complaint) == (0, "")
    with BagReader(tmp_path / "new") as reader:
        count, end_ns = reader.message_count, reader.end_ns
    assert 300 < count < 600
    assert (
        f"{count} messages on 3 topics kept, from 2023-11-14 22:13:20.123 UTC"
        " (1700000000.123456789 s) to 2023" in said
    )
    assert f"({end_ns // 10**9}.{end_ns % 10**9:09d} s)\n" in said
    assert "bag_0.mcap, byte " in said and "the file ends within a record" in said
    assert (
        "lost: it is not known how many messages; 1 chunks and " in said
        and "leaves no trace" in said
    )
    assert said.splitlines()[-1] == f"next: dart-skill bag info {tmp_path / 'new'}"
    assert (cut / "bag_0.mcap").read_bytes() == before
    assert [one for one in check_bag(tmp_path / "new") if one.severity != "note"] == []


def test_recover_of_a_whole_bag_is_complete(bag, tmp_path, call):
    status, said, _ = call("recover", bag, "--output", tmp_path / "new")
    assert (
        status == 0
        and "900 messages on 3 topics kept" in said
        and "\ncomplete: nothing is lost\n" in said
    )


def test_recover_without_metadata_only_says_that_what_was_never_written_is_unknown(
    bag, tmp_path, call
):
    file = bag / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[:-8])
    status, said, _ = call("recover", file, "--output", tmp_path / "new")
    assert status == 0 and "complete: no message that was in it is lost; what the recorder" in said


def test_recover_names_what_a_changed_byte_costs(bag, tmp_path, call):
    file = bag / "bag_0.mcap"
    data = bytearray(file.read_bytes())
    data[middle_chunk(file)] ^= 0xFF
    file.write_bytes(data)
    status, said, _ = call("recover", bag, "--output", tmp_path / "new", "--json")
    told = json.loads(said)
    assert (
        status == 0
        and not told["is_complete"]
        and told["lost_chunks"] == 1
        and told["path"] == str(tmp_path / "new")
    )
    assert told["message_count"] + sum(told["lost"].values()) == 900 and told["places"][0][
        "messages"
    ] == sum(told["lost"].values())
    status, said, _ = call("recover", bag, "--output", tmp_path / "again")
    lost = ", ".join(f"{count} messages on {topic}" for topic, count in told["lost"].items())
    assert f"lost: {lost}; 1 chunks and {told['lost_bytes']} bytes left out" in said


def test_recover_names_its_output_after_the_bag_and_overwrites_nothing(
    cut, tmp_path, call, monkeypatch
):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert (
        call("recover", cut)[0] == 0
        and (tmp_path / "elsewhere" / "bag_recovered" / "metadata.yaml").is_file()
    )
    status, said, complaint = call("recover", cut)
    assert (status, said) == (
        1,
        "",
    ) and "bag_recovered exists already: bags are never overwritten" in complaint


# what is refused


@pytest.mark.parametrize("verb", ["info", "check", "recover", "convert"])
def test_bags_that_are_none_are_refused_by_each_verb(tmp_path, call, verb):
    """Missing, empty, not a bag, two bags' files in a folder: one line why, status 1, nothing
    written.
    """
    (tmp_path / "zero_0.mcap").write_bytes(b"")
    (tmp_path / "noise.mcap").write_bytes(np.random.default_rng(0).bytes(10_000))
    (tmp_path / "text.txt").write_text("no bag")
    (tmp_path / "folder").mkdir()
    cases = {
        "nothing": "no such",
        "zero_0.mcap": "empty .0 bytes.",
        "noise.mcap": "magic is invalid",
        "folder": "no .mcap file",
    }
    if verb != "check":
        cases["text.txt"] = "no .mcap file|a bag is a folder"
    there = sorted(tmp_path.iterdir())
    for name, reason in cases.items():
        output = ["--output", tmp_path / "new"] if verb in ("recover", "convert") else []
        status, said, complaint = call(verb, tmp_path / name, *output)
        assert status == 1, name
        if verb == "check":
            assert re.search(f"error: .*({reason})", said), (name, said)
        else:
            assert re.search(reason, complaint) and complaint.count("\n") == 1 and said == "", (
                name,
                complaint,
            )
    assert sorted(tmp_path.iterdir()) == there


def test_a_folder_with_files_of_two_bags_is_refused(tmp_path, bag, call):
    other = record(tmp_path / "other", topic="/{}")
    (other / "other_0.mcap").rename(bag / "other_0.mcap")
    status, said, _ = call("check", bag)
    assert status == 0 and "metadata.yaml does not name it: readers leave it out" in said
    (bag / "metadata.yaml").unlink()
    status, said, complaint = call("info", bag)
    assert (
        (status, said) == (1, "")
        and "2 files and no metadata.yaml" in complaint
        and "open one of them by its name" in complaint
    )
    status, said, _ = call("check", bag)
    assert "they may be of different bags" in said


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["info"],
        ["recover"],
        ["unknown", "x"],
        ["play", "x", "--rate", "-1"],
        ["play", "x", "--rate", "nan"],
        ["play", "x", "--start", "soon"],
        ["play", "x", "--duration", "0"],
        ["play", "x", "--clock", "1e9"],
        ["play", "x", "--remap", "/a=/b"],
        ["play"],
    ],
)
def test_wrong_usage_has_status_2(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main(["bag", *arguments])
    assert end.value.code == 2 and "usage: dart-skill bag" in capsys.readouterr().err


def test_a_reader_that_stops_reading_is_no_error(bag):
    """`dart-skill bag info BAG | head -1`, with a pipe that is closed before the first line."""
    program = (
        "import os, sys\n"
        "from dart_skill.cli import main\n"
        "read, write = os.pipe()\n"
        "os.close(read), os.dup2(write, 1)\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    command = [sys.executable, "-c", program, "bag", "info", str(bag)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "")


# convert


def test_convert_writes_our_topics_and_reports_faults(tmp_path, call):
    lab = record(tmp_path / "lab", topic="/lab/{}")
    mapping = {body: {"topic": f"/lab/{body}"} for body in BODIES}
    mapping["axes"] = {"length": "cm"}
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(mapping))
    output = tmp_path / "ours"
    status, said, _ = call(
        "convert", lab, "--mapping", tmp_path / "mapping.yaml", "--output", output
    )
    assert (
        status == 0
        and "300 poses of the hand, 300 poses of the ball, 300 poses of the basket, no joint states"
        in said
    )
    assert (
        "it was not recorded when it opened" in said
        and said.splitlines()[-1] == f"next: dart-skill learn {output}"
    )
    with BagReader(output) as reader:
        assert set(reader.topics) == {f"/vrpn_mocap/{body}/pose" for body in BODIES}
        first = next(iter(reader.messages(["/vrpn_mocap/basket/pose"]))).data
    assert first.pose.position.x == pytest.approx(0.02) and first.header.frame_id == "world"
    status, said, complaint = call(
        "convert", lab, "--mapping", tmp_path / "mapping.yaml", "--output", output
    )
    assert (status, said) == (1, "") and "name another folder with --output" in complaint
    status, _, complaint = call("convert", lab, "--output", tmp_path / "none")
    assert (
        status == 1
        and "no topic /vrpn_mocap/hand/pose for 'hand'" in complaint
        and not (tmp_path / "none").exists()
    )


def test_the_mapping_in_the_documentation_is_one():
    page = (DOCS / "bags.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"\n\n((?:    .*\n)*    hand: .*\n(?:    .*\n)*)", page)
    mapping = parse_mapping(yaml.safe_load(block))
    assert (
        mapping.bodies["hand"].capture.file == "take_001.csv"
        and mapping.joints.table.delimiter == ";"
    )


def test_convert_tells_what_is_wrong_with_the_poses(tmp_path, call):
    path = tmp_path / "stale"
    with BagWriter(path) as bag:
        for body in BODIES:
            bag.add_topic(f"/vrpn_mocap/{body}/pose", POSE, definition(TYPES, POSE))
        for step in range(300):
            stamp = START_NS + step * STEP_NS
            for body, x in BODIES.items():
                lost = body == "hand" and 100 <= step < 110
                way = 0.0 if body == "basket" else 0.002 * (99 if lost else step)
                bag.write(f"/vrpn_mocap/{body}/pose", stamp, stamp, pose(stamp, x + way))
    status, said, _ = call("convert", path, "--output", tmp_path / "text")
    assert (
        status == 0
        and "hand: the same pose again, 10 times with new stamps (a lost body): left out" in said
    )
    _, said, _ = call("convert", path, "--output", tmp_path / "data", "--json")
    told = json.loads(said)
    assert told["poses"] == {"hand": 290, "ball": 300, "basket": 300} and told["path"] == str(
        tmp_path / "data"
    )
    assert ("stale", "hand", 10, True) in {
        (one["kind"], one["body"], one["count"], one["repaired"]) for one in told["faults"]
    }


# play


def parameters(*arguments):
    play = pytest.importorskip("dart_skill_nodes.verbs.play")
    parser = argparse.ArgumentParser()
    play.add_arguments(parser)
    return play.player_parameters(parser.parse_args(list(arguments)))


def test_play_leaves_to_the_node_what_was_not_given():
    assert parameters("bag") == {"bag": "bag"}


def test_play_makes_parameters_of_every_option():
    line = (
        "bag --rate 2 --start 3 --duration 5 --loop --paused --topics /a.* /b --exclude /a/x"
        " --remap /b:=/c /d:=/e --clock 50 --wait-for /c"
    )
    assert parameters(*shlex.split(line)) == {
        "bag": "bag",
        "rate": 2.0,
        "start": 3.0,
        "duration": 5.0,
        "loop": True,
        "start_paused": True,
        "topics": ["/a.*", "/b"],
        "exclude": ["/a/x"],
        "remap": ["/b=/c", "/d=/e"],
        "clock_rate": 50.0,
        "awaited": ["/c"],
    }


def test_help_needs_no_ros_and_loads_nothing_that_bags_need():
    program = (
        "import sys\nsys.modules.update(dict.fromkeys(('rclpy', 'dart_skill_nodes')))\nfrom"
        " dart_skill.cli import main\ntry:\n    main(sys.argv[1:])\nexcept SystemExit as end:\n   "
        " assert end.code == 0\nprint([name for name in ('rosbags', 'mcap', 'yaml', 'zstandard')"
        " if name in sys.modules])\n"
    )
    for arguments in (["--help"], ["bag", "play", "--help"], ["learn", "--help"]):
        done = subprocess.run(
            [sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=True
        )
        assert "usage: dart-skill" in done.stdout and done.stdout.splitlines()[-1] == "[]"


def test_play_without_the_workspace_says_what_to_do(monkeypatch, capsys):
    for name in [name for name in sys.modules if name.startswith("dart_skill_nodes.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "dart_skill_nodes", None)
    assert main(["bag", "play", "anything"]) == 1
    assert (
        "dart-skill: bag play needs the ROS 2 workspace: 'make setup'" in capsys.readouterr().err
    )


# learn, which the last lines of the others lead to


def test_learn_is_a_command_and_its_errors_have_status_1(tmp_path, bag, capsys):
    assert main(["learn", str(bag), "--output", str(tmp_path / "model.npz")]) == 1
    complaint = capsys.readouterr().err
    assert (
        "0 demonstrations among 0 throws are too few" in complaint
        and "joint angles were not recorded" in complaint
    )
    assert not (tmp_path / "model.npz").exists()
    with pytest.raises(SystemExit) as end:
        main(["learn", str(bag), "--raw", "--demonstrations-topic"])
    assert end.value.code == 2


def test_what_a_bag_says_does_not_reach_the_terminal_as_it_is(tmp_path, capsys):
    """Names in a bag may hold what clears a screen, or types for the user."""
    wicked = "\x1b[2J\x07\r/topic\u202e"
    with BagWriter(tmp_path / "bag", custom_data={wicked: wicked}) as bag:
        bag.add_topic("/a" + wicked, "std_msgs/msg/String", "string data\n", "", wicked)
        bag.add_attachment(wicked, "x", wicked)
        bag.write("/a" + wicked, 1, 1, b"\0\1\0\0\2\0\0\0a\0")
    for verb in ("info", "check"):
        main(["bag", verb, str(tmp_path / "bag")])
    main(["bag", "recover", str(tmp_path / "bag"), "--output", str(tmp_path / "kept")])
    main(["bag", "info", str(tmp_path / wicked.replace("/", ""))])
    told = capsys.readouterr()
    assert all(one.isprintable() or one == "\n" for one in told.out + told.err)
    assert r"\x1b[2J" in told.out
