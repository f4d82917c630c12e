"""The file format of LeRobot: every field as it is published, streams at the frames of a dataset,
and what is refused.

Published by lerobot 0.6 (lerobot/datasets: dataset_writer.py, dataset_metadata.py,
compute_stats.py, utils.py). Where DART_SKILL_LEROBOT names a Python that has it, it loads what is
written here.
"""

import json
import os
import subprocess

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.recording.lerobot import (
    DatasetWriter,
    Feature,
    at_frames,
    changes_at,
    frame_times,
    held_mean,
    is_dataset,
    read_dataset,
    seen_at,
    turned_at_frames,
    writer,
)

STATE, ACTION = (
    Feature("observation.state", ("q [rad]", "v [rad/s]", "x [m]")),
    Feature("action", ("torque [N m]", "hand.open")),
)
FPS, LENGTHS = 20, (7, 4)
STATISTICS = ("min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99")
COUNTED = ("timestamp", "frame_index", "episode_index", "index", "task_index")


def frames_of(episode):
    rng = np.random.default_rng(episode)
    return {
        "observation.state": rng.normal(size=(LENGTHS[episode], 3)),
        "action": rng.normal(size=(LENGTHS[episode], 2)),
    }


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("lerobot") / "dataset"
    with DatasetWriter(path, FPS, "an_arm", [STATE, ACTION]) as dataset:
        for episode in range(2):
            dataset.add(f"task {episode}", frames_of(episode))
    return path


# streams at frames


def test_frames_are_all_instants_of_a_duration():
    assert np.array_equal(frame_times(0.3, 10), [0.0, 0.1, 0.2, 0.3]) and np.array_equal(
        frame_times(0.299, 10), [0.0, 0.1, 0.2]
    )
    assert np.array_equal(frame_times(0.0, 10), [0.0])


def test_a_straight_line_stays_one_and_ends_are_held():
    stamps = np.sort(np.random.default_rng(0).uniform(0.0, 1.0, 200))
    values, frames = np.column_stack([3.0 * stamps - 1.0, 5.0 - stamps]), frame_times(1.0, 30)
    inside = (frames >= stamps[0]) & (frames <= stamps[-1])
    found = at_frames(stamps, values, frames)
    assert np.allclose(
        found[inside], np.column_stack([3.0 * frames - 1.0, 5.0 - frames])[inside], atol=1e-12
    )
    assert np.array_equal(
        at_frames(np.array([0.2, 0.4]), np.array([[1.0], [2.0]]), np.array([0.0, 1.0])),
        [[1.0], [2.0]],
    )


def test_a_steady_turn_stays_one_whatever_the_signs_of_its_quaternions():
    stamps = np.linspace(0.0, 1.0, 41)
    axis, rng = np.array([2.0, -1.0, 2.0]) / 3.0, np.random.default_rng(1)
    quaternions = Rotation.from_rotvec(5.0 * stamps[:, None] * axis).as_quat() * rng.choice(
        [-1.0, 1.0], (41, 1)
    )
    frames = frame_times(1.0, 64)
    turned = turned_at_frames(stamps, quaternions, frames)
    assert (
        Rotation.from_quat(turned) * Rotation.from_rotvec(5.0 * frames[:, None] * axis).inv()
    ).magnitude().max() < 1e-7
    assert turned[0, 3] > 0.0 and (np.sum(turned[1:] * turned[:-1], axis=1) > 0.9).all()


@pytest.mark.parametrize("fps", [7, 30, 100, 333])
def test_commands_lose_nothing_at_any_frame_rate(fps):
    """The sum over all frames is that of what was held: the momentum that a force gives."""
    rng = np.random.default_rng(2)
    stamps, values = np.sort(rng.uniform(0.0, 1.0, 500)), rng.normal(size=(500, 2))
    frames = frame_times(1.5, fps)
    found = held_mean(stamps, values, frames, fps, hold=0.05)
    steps = np.minimum(np.diff(stamps, append=np.inf), 0.05)
    assert np.allclose(found.sum(axis=0) / fps, steps @ values, atol=1e-12)
    assert (
        not found[frames > stamps[-1] + 0.05].any()
        and not found[frames < stamps[0] - 1.0 / fps].any()
    )


def test_a_command_that_holds_over_whole_frames_is_what_it_was():
    stamps = np.arange(10) / 10
    assert np.allclose(held_mean(stamps, stamps[:, None], stamps, 10)[:, 0], stamps, atol=1e-12)


@pytest.mark.parametrize("fps", [10, 30, 100])
def test_the_instant_of_a_switch_is_kept_between_frames(fps):
    rng, frames = np.random.default_rng(3), frame_times(2.0, fps)
    for _ in range(20):
        on, off = rng.uniform(0.3, 0.8), rng.uniform(1.1, 1.7)
        share = held_mean(np.array([-1.0, on, off]), np.array([[0.0], [1.0], [0.0]]), frames, fps)[
            :, 0
        ].astype(np.float32)
        assert [was for _, was in changes_at(share, fps)] == [True, False]
        assert np.allclose(
            [instant for instant, _ in changes_at(share, fps)], [on, off], atol=2e-3 / fps
        )
    assert changes_at(np.array([0.0, 0.0, 1.0, 1.0]), fps) == [(2.0 / fps, True)], (
        "of somebody who knows only 0 and 1"
    )
    assert changes_at(np.ones(4), fps) == changes_at(np.zeros(4), fps) == []


def test_a_gap_is_told_from_a_slow_sensor():
    stamps = np.delete(np.arange(20) / 20, [8, 9, 10])
    assert seen_at(stamps, frame_times(0.95, 20), 20).tolist() == [1.0] * 8 + [0.0] * 3 + [1.0] * 9
    assert seen_at(np.arange(20) / 20, frame_times(0.95, 200), 200).all()
    slow = seen_at(stamps, frame_times(0.95, 200), 200)
    assert slow[:71].all() and not slow[71:110].any() and slow[110:].all(), (
        "on the line across a gap nothing was seen"
    )


# what is written


def test_info_has_every_field_of_the_published_format(written):
    info = json.loads((written / "meta" / "info.json").read_text())
    features = info.pop("features")
    assert info == {
        "codebase_version": "v3.0",
        "fps": FPS,
        "total_episodes": 2,
        "total_frames": 11,
        "total_tasks": 2,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "robot_type": "an_arm",
        "splits": {"train": "0:2"},
    }
    assert features["observation.state"] == {
        "dtype": "float32",
        "shape": [3],
        "names": ["q [rad]", "v [rad/s]", "x [m]"],
    }
    assert list(features) == ["observation.state", "action", *COUNTED]
    assert (
        features["timestamp"] == {"dtype": "float32", "shape": [1], "names": None}
        and features["index"]["dtype"] == "int64"
    )


def test_frames_are_columns_of_the_published_types(written):
    table = pq.read_table(written / "data" / "chunk-000" / "file-000.parquet")
    types = {name: table.schema.field(name).type for name in table.column_names}
    vectors = {"observation.state": pa.list_(pa.float32(), 3), "action": pa.list_(pa.float32(), 2)}
    assert types == {
        **vectors,
        "timestamp": pa.float32(),
        **dict.fromkeys(COUNTED[1:], pa.int64()),
    }
    assert (
        table["index"].to_pylist() == list(range(11))
        and table["episode_index"].to_pylist() == [0] * 7 + [1] * 4
    )
    assert (
        table["frame_index"].to_pylist() == [*range(7), *range(4)]
        and table["task_index"].to_pylist() == [0] * 7 + [1] * 4
    )
    assert np.array_equal(
        table["timestamp"].to_numpy(), (table["frame_index"].to_numpy() / FPS).astype(np.float32)
    )
    assert (
        pq.read_metadata(written / "data" / "chunk-000" / "file-000.parquet").num_row_groups == 2
    ), "one for each episode"


def test_episodes_tell_where_their_frames_are(written):
    table = pq.read_table(written / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    places = ["data/chunk_index", "data/file_index", "dataset_from_index", "dataset_to_index"]
    stats = [
        f"stats/{key}/{name}"
        for key in ("observation.state", "action", *COUNTED)
        for name in STATISTICS
    ]
    own = ["meta/episodes/chunk_index", "meta/episodes/file_index"]
    assert table.column_names == ["episode_index", "tasks", "length", *places, *stats, *own]
    rows = table.to_pylist()
    assert [
        (row["tasks"], row["length"], row["dataset_from_index"], row["dataset_to_index"])
        for row in rows
    ] == [
        (["task 0"], 7, 0, 7),
        (["task 1"], 4, 7, 11),
    ]
    assert table.schema.field("stats/action/mean").type == pa.list_(pa.float64())
    assert table.schema.field("stats/action/count").type == pa.list_(pa.int64())


def test_tasks_are_looked_up_by_their_text(written):
    tasks = pd.read_parquet(written / "meta" / "tasks.parquet")
    assert (
        tasks.index.name == "task"
        and tasks.index.tolist() == ["task 0", "task 1"]
        and tasks["task_index"].tolist() == [0, 1]
    )


def test_statistics_are_those_of_all_frames(written):
    told = json.loads((written / "meta" / "stats.json").read_text())
    rows = (
        np.concatenate([frames_of(episode)["action"] for episode in range(2)])
        .astype(np.float32)
        .astype(float)
    )
    assert set(told) == {"observation.state", "action", *COUNTED} and set(told["action"]) == set(
        STATISTICS
    )
    assert np.allclose(told["action"]["mean"], rows.mean(axis=0)) and np.allclose(
        told["action"]["std"], rows.std(axis=0)
    )
    assert np.allclose(told["action"]["q90"], np.quantile(rows, 0.9, axis=0)) and told["action"][
        "count"
    ] == [11]
    assert told["index"] == {**told["index"], "min": [0.0], "max": [10.0], "mean": [5.0]}


def test_a_full_file_is_followed_by_another_one(tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "DATA_MB", 2e-4)
    monkeypatch.setattr(writer, "CHUNK_SIZE", 2)
    with DatasetWriter(tmp_path / "many", FPS, "an_arm", [STATE, ACTION]) as dataset:
        for _ in range(3):
            dataset.add("task", frames_of(0))
    files = sorted(
        str(path.relative_to(tmp_path / "many" / "data"))
        for path in (tmp_path / "many" / "data").rglob("*.parquet")
    )
    assert files == [
        "chunk-000/file-000.parquet",
        "chunk-000/file-001.parquet",
        "chunk-001/file-000.parquet",
    ]
    read = read_dataset(tmp_path / "many")
    assert [
        np.allclose(one.frames["action"], frames_of(0)["action"], atol=1e-6)
        for one in read.episodes
    ] == [True] * 3


def test_nothing_is_left_of_a_dataset_that_cannot_be_written(tmp_path):
    for values in (
        np.full((7, 2), np.nan),
        np.ma.masked_array(np.ones((7, 2)), mask=np.eye(7, 2, dtype=bool)),
    ):
        with (
            pytest.raises(ValueError, match="action is not finite in all frames"),
            DatasetWriter(tmp_path / "new", FPS, "an_arm", [STATE, ACTION]) as data,
        ):
            data.add("task", {**frames_of(0), "action": values})
    assert not (tmp_path / "new").exists()
    with (
        pytest.raises(ValueError, match="at least one episode"),
        DatasetWriter(tmp_path / "new", FPS, "an_arm", [STATE]),
    ):
        pass
    assert not (tmp_path / "new").exists()


# what is read


def test_what_was_written_is_read_again(written):
    dataset = read_dataset(written)
    assert is_dataset(written) and not is_dataset(written / "meta")
    assert dataset.fps == FPS and dataset.names == {
        "observation.state": STATE.names,
        "action": ACTION.names,
    }
    assert [(one.index, one.task, len(one.time)) for one in dataset.episodes] == [
        (0, "task 0", 7),
        (1, "task 1", 4),
    ]
    for episode in dataset.episodes:
        assert np.array_equal(episode.time, np.arange(len(episode.time)) / FPS)
        for key, values in frames_of(episode.index).items():
            assert np.array_equal(episode.frames[key], values.astype(np.float32))
    assert np.array_equal(
        dataset.column(dataset.episodes[1], "hand.open"),
        frames_of(1)["action"][:, 1].astype(np.float32),
    )
    assert dataset.column(dataset.episodes[1], "unknown") is None


@pytest.fixture
def damage(written, tmp_path):
    """A copy of the dataset of which something is changed: a file of meta/ by its name, or a
    column of data/.
    """

    def change(info=None, column=None, values=None):
        import shutil

        path = tmp_path / "copy"
        shutil.copytree(written, path)
        told = json.loads((path / "meta" / "info.json").read_text())
        (path / "meta" / "info.json").write_text(json.dumps({**told, **(info or {})}))
        file = path / "data" / "chunk-000" / "file-000.parquet"
        if column:
            table = pq.read_table(file)
            place = table.column_names.index(column)
            table = (
                table.remove_column(place)
                if values is None
                else table.set_column(place, column, pa.array(values))
            )
            pq.write_table(table, file)
        return path

    return change


@pytest.mark.parametrize(
    ("changed", "complaint"),
    [
        (
            {"info": {"codebase_version": "v1.6"}},
            "version v1.6, neither 2 nor 3: .*convert_dataset_v1_to_v2",
        ),
        ({"info": {"fps": 0}}, "fps is 0: give a number above 0"),
        ({"info": {"total_episodes": 3}}, "tells of 3 episodes, in data/ are 2"),
        ({"column": "action"}, "no column action, of which meta/info.json tells"),
        (
            {"column": "timestamp", "values": np.arange(11.0)},
            "episode 0: frame 6 is 5.7 s away from frame_index / fps",
        ),
    ],
)
def test_what_is_wrong_with_a_dataset_is_named(damage, changed, complaint):
    with pytest.raises(ValueError, match=complaint):
        read_dataset(damage(**changed))


def test_a_file_that_is_none_is_named(damage):
    path = damage()
    (path / "data" / "chunk-000" / "file-000.parquet").write_bytes(b"PAR1 not")
    with pytest.raises(ValueError, match=r"file-000\.parquet"):
        read_dataset(path)
    with pytest.raises(ValueError, match="no dataset of LeRobot"):
        read_dataset(path / "data")


# datasets of others


STATE_NAMES, SIZE = ["a.x", "a.y", "a.z", "b.x", "b.y", "grip"], 6
SHAPES = {
    "a list": STATE_NAMES,
    "a list in a list": [STATE_NAMES],
    "one group": {"motors": STATE_NAMES},
    "axes and a gripper": {"axes": STATE_NAMES[:5], "gripper": ["grip"]},
    "a gripper alone": {"axes": STATE_NAMES[:5], "gripper": "grip"},
    "two groups in groups": {
        "arms": {"left": STATE_NAMES[:3], "right": STATE_NAMES[3:5]},
        "other": ["grip"],
    },
    "places": {name: place for place, name in reversed(list(enumerate(STATE_NAMES)))},
    "places in groups": {"motors": {name: place for place, name in enumerate(STATE_NAMES)}},
    "keys": dict.fromkeys(STATE_NAMES, None),
}
VALUES = np.arange(60.0).reshape(10, SIZE)


def write_others(
    path, info, columns, version="v3.0", lines=None, files=(slice(None),), tasks=True
):
    """A dataset as other programs write it: one file, or one for each slice of frames; for version
    2 with lines of JSON.
    """
    (path / "meta").mkdir(parents=True)
    (path / "data" / "chunk-000").mkdir(parents=True)
    (path / "meta" / "info.json").write_text(
        json.dumps({"codebase_version": version, "robot_type": None, "fps": 10, **info})
    )
    for k, part in enumerate(files):
        name = f"episode_{k:06d}" if version.startswith("v2") else f"file-{k:03d}"
        table = {key: pa.array(list(np.asarray(values)[part])) for key, values in columns.items()}
        pq.write_table(pa.table(table), path / "data" / "chunk-000" / f"{name}.parquet")
    if tasks and version.startswith("v2"):
        (path / "meta" / "tasks.jsonl").write_text(
            '{"task_index": 0, "task": "stir"}\n{"task_index": 1, "task": "pour"}\n'
        )
    elif tasks:
        pd.DataFrame(
            {"task_index": [0, 1]}, index=pd.Index(["stir", "pour"], name="task")
        ).to_parquet(path / "meta" / "tasks.parquet")
    if lines:
        (path / "meta" / "episodes.jsonl").write_text(
            "".join(json.dumps(line) + "\n" for line in lines)
        )
    return path


def others_columns(**changed):
    """Two episodes of six and four frames."""
    frame = np.concatenate([np.arange(6), np.arange(4)])
    columns = {
        "observation.state": VALUES,
        "timestamp": (frame / 10).astype(np.float32),
        "frame_index": frame,
    }
    columns |= {
        "episode_index": np.repeat([0, 1], [6, 4]),
        "index": np.arange(10),
        "task_index": np.repeat([1, 0], [6, 4]),
    }
    return {key: values for key, values in {**columns, **changed}.items() if values is not None}


def state(names, size=SIZE, **more):
    return {
        "features": {
            "observation.state": {"dtype": "float32", "shape": [size], "names": names},
            **more,
        }
    }


@pytest.mark.parametrize("names", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("version", ["v2.0", "v2.1", "v3.0"])
def test_names_have_any_shape_that_public_datasets_have(tmp_path, names, version):
    files = (slice(0, 6), slice(6, 10)) if version.startswith("v2") else (slice(None),)
    dataset = read_dataset(
        write_others(tmp_path / "other", state(names), others_columns(), version, files=files)
    )
    assert dataset.names == {"observation.state": tuple(STATE_NAMES)} and not dataset.notes
    assert [(one.index, one.task, len(one.time)) for one in dataset.episodes] == [
        (0, "pour", 6),
        (1, "stir", 4),
    ]
    assert np.array_equal(dataset.column(dataset.episodes[1], "b.x"), VALUES[6:, 3])


def test_elements_without_names_are_called_by_their_places_and_wrong_names_are_told(tmp_path):
    dataset = read_dataset(write_others(tmp_path / "none", state(None), others_columns()))
    assert (
        dataset.names["observation.state"] == tuple(f"observation.state[{k}]" for k in range(SIZE))
        and not dataset.notes
    )
    dataset = read_dataset(
        write_others(tmp_path / "more", state([*STATE_NAMES, "one", "two"]), others_columns())
    )
    assert dataset.notes == (
        "observation.state has 6 elements and 8 names, so none of them counts",
    )
    twice = {"left": ["x", "y", "z"], "right": ["x", "y", "z"]}
    dataset = read_dataset(write_others(tmp_path / "twice", state(twice), others_columns()))
    assert dataset.names["observation.state"] == (
        "left.x",
        "left.y",
        "left.z",
        "right.x",
        "right.y",
        "right.z",
    )
    dataset = read_dataset(
        write_others(
            tmp_path / "same", state(["a", "b", "c", "d", "grip", "grip"]), others_columns()
        )
    )
    with pytest.raises(
        ValueError,
        match="2 elements of observation.state are called 'grip': give them different names",
    ):
        dataset.column(dataset.episodes[0], "grip")


def test_what_was_seen_counts_before_what_was_commanded(tmp_path):
    features = {
        "action": {"dtype": "float32", "shape": [SIZE], "names": STATE_NAMES},
        **state(STATE_NAMES)["features"],
    }
    path = write_others(
        tmp_path / "other", {"features": features}, {"action": VALUES + 100.0, **others_columns()}
    )
    dataset = read_dataset(path)
    assert np.array_equal(dataset.column(dataset.episodes[0], "a.x"), VALUES[:6, 0])


FRAMES = {
    "stamps that go on over episodes": {"timestamp": (np.arange(10) / 10).astype(np.float32)},
    "stamps of the clock": {"timestamp": 1.7e9 + np.arange(10) / 10},
    "stamps in float32 after hours": {
        "timestamp": (50_000.0 + np.arange(10) / 10).astype(np.float32)
    },
    "no stamps": {"timestamp": None},
    "frames that go on over episodes": {"frame_index": np.arange(10)},
    "no frames": {"frame_index": None},
    "float64": {"observation.state": VALUES.astype(np.float64)},
    "extra columns": {"language": np.array(["stir"] * 10), "extra": np.arange(10)},
    "scalars in lists": {"timestamp": np.concatenate([np.arange(6), np.arange(4)])[:, None] / 10},
}


@pytest.mark.parametrize("changed", FRAMES.values(), ids=FRAMES)
def test_frames_are_read_whatever_their_stamps_begin_with(tmp_path, changed):
    dataset = read_dataset(
        write_others(tmp_path / "other", state(STATE_NAMES), others_columns(**changed))
    )
    for episode, rows in zip(dataset.episodes, (slice(0, 6), slice(6, 10)), strict=True):
        assert np.allclose(episode.time, np.arange(len(episode.time)) / 10)
        assert np.array_equal(episode.frames["observation.state"], VALUES[rows])


def test_episodes_may_come_in_any_order_and_without_tasks(tmp_path):
    columns = {key: values[::-1] for key, values in others_columns(task_index=None).items()}
    lines = [
        {"episode_index": 1, "tasks": ["pour"], "length": 4},
        {"episode_index": 0, "tasks": ["stir"], "length": 6},
    ]
    path = write_others(
        tmp_path / "two",
        state(STATE_NAMES),
        columns,
        "v2.1",
        lines,
        (slice(0, 4), slice(4, 10)),
        tasks=False,
    )
    assert [(one.index, one.task, len(one.time)) for one in read_dataset(path).episodes] == [
        (0, "stir", 6),
        (1, "pour", 4),
    ]
    path = write_others(
        tmp_path / "three",
        {**state(STATE_NAMES), "fps": 10.0, "total_episodes": 2},
        columns,
        tasks=False,
    )
    assert [one.task for one in read_dataset(path).episodes] == ["", ""]


def test_scalars_and_tables_of_elements(tmp_path):
    more = {
        "speed": {"dtype": "float64", "shape": [1], "names": None},
        "done": {"dtype": "bool", "shape": []},
    }
    more["picture"] = {"dtype": "float32", "shape": [2, 3], "names": ["height", "width"]}
    columns = others_columns(speed=np.arange(10.0), done=np.arange(10) > 5)
    dataset = read_dataset(write_others(tmp_path / "other", state(STATE_NAMES, **more), columns))
    assert set(dataset.names) == {"observation.state", "speed", "done"}
    assert np.array_equal(dataset.column(dataset.episodes[1], "speed[0]"), np.arange(6.0, 10.0))


BROKEN = [
    ({"total_episodes": 5}, {}, "tells of 5 episodes, in data/ are 2"),
    ({}, {"episode_index": None}, "no column episode_index"),
    (
        {},
        {"timestamp": np.arange(10.0)},
        "episode 0: frame 5 is 4.5 s away from frame_index / fps",
    ),
    ({"fps": True}, {}, "fps is True"),
]


@pytest.mark.parametrize(("info", "changed", "message"), BROKEN)
def test_what_is_wrong_with_a_dataset_of_others_is_named(tmp_path, info, changed, message):
    with pytest.raises(ValueError, match=message):
        read_dataset(
            write_others(
                tmp_path / "other", {**state(STATE_NAMES), **info}, others_columns(**changed)
            )
        )


def test_broken_lines_are_named(tmp_path):
    path = write_others(tmp_path / "other", state(STATE_NAMES), others_columns(), "v2.1")
    (path / "meta" / "tasks.jsonl").write_text('{"task_index": 0, "task": "stir"}\n{"task": \n')
    with pytest.raises(ValueError, match="tasks.jsonl, line 2: no JSON"):
        read_dataset(path)
    (path / "meta" / "tasks.jsonl").write_text('{"task": "stir"}\n')
    with pytest.raises(ValueError, match="tasks.jsonl, line 1: task_index is missing"):
        read_dataset(path)


LOAD = """
import sys
from lerobot.datasets.lerobot_dataset import LeRobotDataset
dataset = LeRobotDataset("local/dataset", root=sys.argv[1])
first, last = dataset[0], dataset[len(dataset) - 1]
print(dataset.num_episodes, dataset.num_frames, dataset.fps, first["task"], last["task"], last["action"].tolist())
"""


@pytest.mark.slow
@pytest.mark.skipif(
    "DART_SKILL_LEROBOT" not in os.environ,
    reason="DART_SKILL_LEROBOT names no Python that has lerobot",
)
def test_lerobot_itself_loads_it(written, tmp_path):
    environment = {**os.environ, "HF_HUB_OFFLINE": "1", "HF_HOME": str(tmp_path)}
    command = [os.environ["DART_SKILL_LEROBOT"], "-c", LOAD, str(written)]
    said = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=True, timeout=300
    ).stdout
    last = frames_of(1)["action"][-1].astype(np.float32).astype(float).tolist()
    assert said.splitlines()[-1] == f"2 11 {FPS} task 0 task 1 {last}"
