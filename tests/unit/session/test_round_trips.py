"""A recording in another form, and back: every form teaches the same model."""

import numpy as np
import pytest
import yaml

from dart_skill.recording import BagReader
from dart_skill.recording.imports import convert, load_mapping, parse_mapping, throws_to_csv
from dart_skill.robot import same_plan
from dart_skill.session import learn_from_bag, learn_throws_from_dataset, open_dataset, write_lerobot

POSES = {f"/vrpn_mocap/{role}/pose": role for role in ("hand", "ball", "basket")}


@pytest.fixture(scope="module")
def bag(recorded_session):
    return recorded_session[0]


@pytest.fixture(scope="module")
def model_id(bag):
    return learn_from_bag(bag)[0].skill.model_id


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_bags_of_both_storages(tmp_path, bag, model_id, storage):
    convert(bag, tmp_path / "once", storage=storage)
    convert(tmp_path / "once", tmp_path / "twice", storage="mcap")
    for path in (tmp_path / "once", tmp_path / "twice"):
        assert learn_from_bag(path)[0].skill.model_id == model_id


def test_tables_of_text(tmp_path, bag, model_id):
    throws_to_csv(bag, tmp_path / "tables")
    mapping = load_mapping(tmp_path / "tables" / "mapping.yaml")
    assert learn_from_bag(tmp_path / "tables", mapping)[0].skill.model_id == model_id
    convert(tmp_path / "tables", tmp_path / "back", mapping)
    assert learn_from_bag(tmp_path / "back")[0].skill.model_id == model_id


def test_data_frames_of_pandas(tmp_path, bag, model_id):
    """Topics as data frames, saved as Parquet, which a mapping reads."""
    pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    keys = {"teacher": {"topic": "/wam/teacher_wrench"}}
    with BagReader(bag) as reader:
        for topic, role in POSES.items():
            reader.to_pandas(topic).to_parquet(tmp_path / f"{role}.parquet")
            columns = {"time": "header.stamp", "position": [f"pose.position.{axis}" for axis in "xyz"]}
            columns["quaternion"] = [f"pose.orientation.{axis}" for axis in "xyzw"]
            keys[role] = {"table": f"{role}.parquet", "time": "ns", "columns": columns}
        states = reader.to_pandas("/joint_states")
        states.to_parquet(tmp_path / "joints.parquet")
        openings = convert(bag, tmp_path / "openings").openings
    columns = {"time": "header.stamp", "position": [f"position[{k}]" for k in range(7)], "velocity": [f"velocity[{k}]" for k in range(7)]}
    keys["joints"] = {"table": "joints.parquet", "time": "ns", "columns": columns}
    (tmp_path / "teacher.csv").write_text("t\n" + "".join(f"{one.stamp_ns}\n" for one in openings if one.taught))
    keys["teacher"] = {"csv": "teacher.csv", "time": "ns", "columns": {"time": "t"}}
    mapping = parse_mapping(yaml.safe_load(yaml.safe_dump(keys)))
    assert learn_from_bag(tmp_path, mapping)[0].skill.model_id == model_id


def test_a_dataset_of_lerobot_teaches_nearly_the_same(tmp_path, bag):
    """Its frames are not the instants of the recording: plans differ by less than a millimetre."""
    pytest.importorskip("pyarrow")
    write_lerobot(bag, tmp_path / "dataset")
    again, report = learn_throws_from_dataset(open_dataset(tmp_path / "dataset"))
    learned, first = learn_from_bag(bag)
    assert len(report.learned_from) == len(first.learned_from)
    target = first.learned_from[0].target + np.array([0.05, 0.02, 0.0])
    here, there = (one.plan(target) for one in (learned, again))
    assert not same_plan(here, there)
    place, other = here.path.position, there.path.position
    assert np.abs(place[: len(other)] - other[: len(place)]).max() < 1e-3
