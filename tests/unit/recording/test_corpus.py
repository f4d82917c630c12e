"""Bags that others test with, and what is said of each: no false alarm, and no missed fault.

Those that `make_corpus` makes are always read. The others are read below the folder that
DART_SKILL_CORPUS names, which has a checkout of each repository of the table (docs/bags.md says
which), or what there is of them. A bag that is not in the table must be read as rosbags and mcap
read it, and an error must be one of reading, too.
"""

import os
from collections import Counter
from contextlib import suppress
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from dart_skill.recording import BagError, BagReader
from dart_skill.recording.bags import check_bag, describe
from tests.unit.recording.make_corpus import CONTENTS, make, variants

KINDS = {
    "undefined": ("warning", "which the bag does not define: its messages were not decoded"),
    "definition": ("warning", "as the bag defines it, but as it is defined elsewhere"),
    "encoding": ("note", "not as cdr: they are not decoded"),
    "profile": ("note", "its profile is ''"),
    "empty": ("warning", "holds no messages"),
    "statistics": (
        "warning",
        (
            "the statistics say (1000000, 100000000) for first and last time, found are (0,"
            " 100000000)"
        ),
    ),
    "start": ("warning", "for the time of the first message, the files say"),
    "duration": ("warning", "for the duration, the files say"),
    "type": ("warning", "for the type of /"),
    "unnamed": ("warning", "metadata.yaml does not name it"),
    "no metadata": ("warning", "there is no metadata.yaml"),
    "no summary": ("warning", "there is no summary"),
    "no statistics": ("note", "the summary has no statistics"),
    "no index": ("warning", "have no message index"),
    "loose": ("note", "messages are outside chunks"),
    "missing": ("error", "the file is missing, which metadata.yaml names"),
    "counts": ("warning", "the files say 0"),
}
"""Severity and words of each finding."""
RESOURCES = "rosbag2_tests/resources"
SAMPLES = "rosbag2_py/test/resources"
EXPECTED = {
    "gps_nav_ws/bag": (5348, "undefined"),
    "gps_nav_ws/bag2": (6330, "undefined"),
    "plotjuggler/datasamples/example.bag": (8647,),
    "plotjuggler/datasamples/fake_joint_state.bag": (2725,),
    "plotjuggler/datasamples/out.bag": (194,),
    "plotjuggler/datasamples/tilt_laser.bag": (4093,),
    "plotjuggler/datasamples/rosbag2_test": (4695,),
    "robot-controller/rosbags/gravacao_esqueletos": (373, "undefined"),
    "robot-controller/rosbags/menos_movimentacao": (374, "undefined"),
    "rosbag2/ros2bag/test/resources/empty_bag": (0, "empty"),
    "rosbag2/rosbag2_cpp/test/rosbag2_cpp/bags/only_services.mcap": (12,),
    "rosbag2/rosbag2_cpp/test/rosbag2_cpp/bags/only_topics.mcap": (7,),
    "rosbag2/rosbag2_cpp/test/rosbag2_cpp/bags/topics_and_services.db3": (13,),
    "rosbag2/rosbag2_cpp/test/rosbag2_cpp/bags/topics_and_services.mcap": (13,),
    f"rosbag2/{SAMPLES}/mcap/convert_a": (150, "statistics"),
    f"rosbag2/{SAMPLES}/mcap/convert_b": (75,),
    f"rosbag2/{SAMPLES}/mcap/reindex_test_bags/multiple_files/multiple_files_0.mcap": (1324,),
    f"rosbag2/{SAMPLES}/mcap/reindex_test_bags/multiple_files/multiple_files_1.mcap": (1324,),
    f"rosbag2/{SAMPLES}/mcap/reindex_test_bags/multiple_files/multiple_files_2.mcap": (529,),
    f"rosbag2/{SAMPLES}/mcap/talker": (20,),
    f"rosbag2/{SAMPLES}/mcap/wbag": (6074, "start", "duration"),
    f"rosbag2/{SAMPLES}/sqlite3/convert_a": (150, "undefined"),
    f"rosbag2/{SAMPLES}/sqlite3/convert_b": (75, "undefined"),
    f"rosbag2/{SAMPLES}/sqlite3/reindex_test_bags/multiple_files/multiple_files_0.db3": (1324,),
    f"rosbag2/{SAMPLES}/sqlite3/reindex_test_bags/multiple_files/multiple_files_1.db3": (1324,),
    f"rosbag2/{SAMPLES}/sqlite3/reindex_test_bags/multiple_files/multiple_files_2.db3": (529,),
    f"rosbag2/{SAMPLES}/sqlite3/talker": (20, "definition"),
    f"rosbag2/{SAMPLES}/sqlite3/wbag": (6074, "start", "duration"),
    f"rosbag2/{RESOURCES}/mcap/bag_with_topics_and_service_events": (10,),
    f"rosbag2/{RESOURCES}/mcap/cdr_test": (7,),
    f"rosbag2/{RESOURCES}/mcap/wrong_rmw_test": (7, "encoding"),
    f"rosbag2/{RESOURCES}/sqlite3/bag_with_topics_and_service_events": (10,),
    f"rosbag2/{RESOURCES}/sqlite3/cdr_test": (7,),
    f"rosbag2/{RESOURCES}/sqlite3/wrong_rmw_test": (7, "undefined"),
    "rosbag2/rosbag2_transport/test/resources/mcap/rewriter_a": (150, "statistics"),
    "rosbag2/rosbag2_transport/test/resources/mcap/rewriter_b": (75,),
    "rosbag2/rosbag2_transport/test/resources/mcap/test_bag_for_seek": (5,),
    "rosbag2/rosbag2_transport/test/resources/sqlite3/test_bag_for_seek": (5, "undefined"),
    f"rosbag2@eloquent/{RESOURCES}/cdr_test": (7, "unnamed", "undefined", "type"),
    f"rosbag2@eloquent/{RESOURCES}/wrong_rmw_test": (7, "encoding", "type"),
    "rosbag2@foxy/ros2bag/test/resources/empty_bag": (0, "empty"),
    f"rosbag2@foxy/{RESOURCES}/cdr_test": (7, "undefined"),
    f"rosbag2@foxy/{RESOURCES}/wrong_rmw_test": (7, "undefined"),
    f"rosbag2@galactic/{RESOURCES}/reindex_test_bags/target_metadata/multiple_files": (
        None,
        "missing",
    ),
    f"rosbag2@humble/{SAMPLES}/talker": (20,),
    f"rosbag2@humble/{RESOURCES}/cdr_test": (7, "undefined"),
    f"rosbag2@humble/{RESOURCES}/wrong_rmw_test": (7, "undefined"),
    f"rosbag2@humble/{RESOURCES}/reindex_test_bags/file_compression": (775, "no metadata"),
    f"rosbag2@humble/{RESOURCES}/reindex_test_bags/message_compression/message_compression_0.db3": (
        380,
    ),
    f"rosbag2@humble/{RESOURCES}/reindex_test_bags/message_compression/message_compression_1.db3": (
        360,
    ),
    f"rosbag2@humble/{RESOURCES}/reindex_test_bags/message_compression/message_compression_2.db3": (
        360,
    ),
    f"rosbag2@humble/{RESOURCES}/reindex_test_bags/message_compression/message_compression_3.db3": (
        27,
    ),
    f"rosbag2@humble/{RESOURCES}/reindex_test_bags/multiple_files/multiple_files_0.db3": (20,),
    f"rosbag2@humble/{RESOURCES}/reindex_test_bags/multiple_files/multiple_files_1.db3": (20,),
    f"rosbag2@humble/{RESOURCES}/reindex_test_bags/multiple_files/multiple_files_2.db3": (12,),
    f"rosbag2@humble/{RESOURCES}/reindex_test_bags/reindexed_file_compression": (
        775,
        "start",
        "duration",
    ),
    f"rosbag2@humble/{RESOURCES}/reindex_test_bags/reindexed_message_compression": (
        1127,
        "start",
        "duration",
    ),
    f"rosbag2@humble/{RESOURCES}/reindex_test_bags/reindexed_multiple_files": (
        52,
        "start",
        "duration",
    ),
}
"""Messages (None: it cannot be opened), and the kinds of findings, but for those that say that
there is no CRC.
"""
CORPUS = os.environ.get("DART_SKILL_CORPUS")


def bags_in(folder):
    """Bag folders, and files that lie in none."""
    folders = {file.parent for file in folder.rglob("metadata.yaml")} | {
        file.parent for file in folder.rglob("*.zstd")
    }
    files = (
        file
        for file in folder.rglob("*")
        if file.suffix in (".mcap", ".db3", ".bag") and file.is_file()
    )
    return sorted(folders | {file for file in files if file.parent not in folders})


def kinds_of(findings):
    return {kind_of(one) for one in findings if "no CRC" not in one.message}


def kind_of(finding):
    found = [
        kind
        for kind, (severity, words) in KINDS.items()
        if finding.severity == severity and words in finding.message
    ]
    return found[0] if found else str(finding)


def count_of(path):
    """Messages that are read; None if the bag is refused."""
    try:
        with BagReader(path) as bag:
            count = sum(1 for _ in bag.messages(decode=False))
            assert (
                count
                == bag.message_count
                == describe(path, with_definitions=False)["message_count"]
            )
            return count
    except BagError:
        return None


def counts_of_others(path):
    """Messages as rosbags, and of a lone file of MCAP `mcap`, count them; those that can."""
    with suppress(Exception), Reader(path) as bag:
        yield bag.message_count
    if path.suffix == ".mcap":
        with suppress(Exception), open(path, "rb") as stream:
            yield sum(1 for _ in make_reader(stream).iter_messages())


def test_each_form_of_mcap_is_read_and_only_what_it_lacks_is_told(tmp_path):
    """None of it is ROS: no profile, no CDR. That is no fault."""
    seen = Counter()
    for name, data in variants():
        content, *features = name.split("-")
        file = tmp_path / "form.mcap"
        file.write_bytes(data)
        count = {"OneMessage": 1, "OneSchemalessMessage": 1, "TenMessages": 10}.get(content, 0)
        expected = {"profile", "encoding" if count else "empty"}
        if not {"chx", "rch", "rsh", "st", "ax", "mdx"} & {*features}:
            expected.add("no summary")
        elif "st" not in features:
            expected.add("no statistics")
        if count and "ch" in features:
            expected |= {"no index"} - ({"no index"} if "mx" in features else set())
        elif count:
            expected.add("loose")
        assert (count_of(file), kinds_of(check_bag(file))) == (count, expected), name
        seen[content] += 1
    assert seen.keys() == CONTENTS.keys() and seen["TenMessages"] > 50


def test_bags_of_each_version_of_rosbag2_have_no_fault(tmp_path):
    make(tmp_path / "made")
    bags = bags_in(tmp_path / "made" / "rosbag2")
    assert len(bags) == 15
    for bag in bags:
        assert (count_of(bag), kinds_of(check_bag(bag))) == (20, set()), bag


@pytest.mark.skipif(
    not CORPUS,
    reason="DART_SKILL_CORPUS names no folder with bags of others: docs/bags.md says which",
)
def test_bags_of_others_are_read_and_judged_as_the_table_says():
    root = Path(CORPUS)
    wrong, seen = [], 0
    for path in bags_in(root):
        name = str(path.relative_to(root))
        count, findings = count_of(path), check_bag(path)
        if name in EXPECTED:
            seen += 1
            expected, *kinds = EXPECTED[name]
            if (count, kinds_of(findings)) != (expected, set(kinds)):
                wrong.append(f"{name}: {count}, {kinds_of(findings)}, not {EXPECTED[name]}")
        elif (count is None) != any(one.severity == "error" for one in findings):
            wrong.append(
                f"{name}: read are {count}, and the check says {list(map(str, findings))}"
            )
        if any(other != count for other in counts_of_others(path)):
            wrong.append(
                f"{name}: {count} messages, but {list(counts_of_others(path))} as others count"
                " them"
            )
    assert seen and not wrong, "\n".join(wrong)
