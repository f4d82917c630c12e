"""Recordings as tables: CSV files with units in their headers, which are read again bit for bit,
and data frames of pandas.
"""

import csv
import sys

import numpy as np
import pandas as pd
import pytest

from dart_skill.common.extras import explained
from dart_skill.recording import BagError, BagReader
from dart_skill.recording.imports import (
    MAPPING,
    bodies_to_csv,
    load_mapping,
    read_recording,
    throws_to_csv,
)
from dart_skill.session import learn_from_bag

ARRAYS = ("stamp_ns", "position", "quaternion")


@pytest.fixture(scope="module")
def bag(recorded_session):
    return recorded_session[0]


@pytest.fixture(scope="module")
def folder(bag, tmp_path_factory):
    path = tmp_path_factory.mktemp("tables") / "csv"
    throws_to_csv(bag, path)
    return path


def header(path):
    with open(path, newline="", encoding="utf-8") as file:
        return next(csv.reader(file))


def test_the_header_names_each_column_and_its_unit(folder):
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        ["hand.csv", "ball.csv", "basket.csv", "joints.csv", "teacher.csv", "command.csv", MAPPING]
    )
    assert header(folder / "ball.csv") == [
        "time [s]",
        "x [m]",
        "y [m]",
        "z [m]",
        "qx",
        "qy",
        "qz",
        "qw",
    ]
    joints = header(folder / "joints.csv")
    assert (
        joints[:2] == ["time [s]", "wam_j1 position [rad]"]
        and joints[-1] == "wam_j7 velocity [rad/s]"
        and len(joints) == 15
    )
    assert header(folder / "teacher.csv") == ["time [s]"]


def test_what_was_written_is_read_again_bit_for_bit(bag, folder):
    there, back = read_recording(bag), read_recording(folder, load_mapping(folder / MAPPING))
    for role, stream in there.bodies.items():
        assert all(
            np.array_equal(getattr(stream, name), getattr(back.bodies[role], name))
            for name in ARRAYS
        )
    assert all(
        np.array_equal(getattr(there.joints, name), getattr(back.joints, name))
        for name in ("stamp_ns", "position", "velocity")
    )
    assert (there.joints.names, there.openings, there.frame_id) == (
        back.joints.names,
        back.openings,
        back.frame_id,
    )


def test_who_forgets_the_mapping_is_told_of_it(folder, tmp_path):
    with pytest.raises(
        BagError,
        match=(
            "no .mcap file in this folder; its CSV files are read with --mapping"
            f" {folder / MAPPING}, which"
        ),
    ):
        learn_from_bag(folder)
    (tmp_path / "hand.csv").write_text("time [s]\n")
    with pytest.raises(BagError, match="with --mapping FILE, which names their columns"):
        learn_from_bag(tmp_path)


def test_bodies_of_any_skill_are_written_and_what_is_not_there_is_named(bag, tmp_path):
    rows = bodies_to_csv(bag, tmp_path / "two", ("hand", "basket", "unseen"))
    assert set(rows) == {"hand.csv", "basket.csv", "joints.csv"}
    for name, count in rows.items():
        assert len((tmp_path / "two" / name).read_text().splitlines()) == count + 1
    with pytest.raises(BagError, match="no poses of unseen"):
        bodies_to_csv(bag, tmp_path / "none", ("unseen",))
    assert not (tmp_path / "none").exists()


def test_a_topic_is_a_data_frame(bag):
    with BagReader(bag) as reader:
        messages = list(reader.messages(["/vrpn_mocap/ball/pose"]))
        poses, states = (
            reader.to_pandas("/vrpn_mocap/ball/pose"),
            reader.to_pandas("/joint_states", stop_ns=messages[0].stamp_ns),
        )
        with pytest.raises(BagError, match="no topic"):
            reader.to_pandas("/nothing")
    assert isinstance(poses, pd.DataFrame) and poses.index.name == "log_time_ns"
    assert poses.index.tolist() == [one.stamp_ns for one in messages]
    assert np.array_equal(poses["pose.position.z"], [one.data.pose.position.z for one in messages])
    first = messages[0].data.header.stamp
    assert (
        poses["header.stamp"].iloc[0] == first.sec * 10**9 + first.nanosec
        and (poses["header.frame_id"] == "world").all()
    )
    assert states["position[6]"].dtype == float and states["name[0]"].iloc[0] == "wam_j1"


def test_without_pandas_the_remedy_is_named(bag, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)  # as if it were not there
    with BagReader(bag) as reader, pytest.raises(ModuleNotFoundError) as complaint:
        reader.to_pandas("/joint_states")
    assert "pip install 'dart_skill[pandas]'" in explained(complaint.value)
