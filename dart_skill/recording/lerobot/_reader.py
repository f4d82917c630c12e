"""A dataset of LeRobot as arrays: versions 3, with many episodes in a file, and 2, with a file and
lines of JSON for each episode.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.extras import need, optional

INFO = "meta/info.json"
TASKS = "meta/tasks.parquet"
EPISODE_LINES = "meta/episodes.jsonl"
"""Where version 2 has a line for each episode."""
TASK_LINES = "meta/tasks.jsonl"
"""Where version 2 has a line for each task."""
COUNTED = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""What every dataset has beside its own features, and its type."""
READ = ("v2.", "v3.")
"""How versions begin that are read."""
CONVERTER = "python -m lerobot.scripts.convert_dataset_v1_to_v2"
LATE = 1e-3
"""Largest distance of a frame from frame_index / fps, where float32 rounds [s]."""
COMMANDED = "action"
"""How keys of commands begin: what was seen may have elements of the same names."""


@dataclass(frozen=True, eq=False)
class Episode:
    """An episode: its index, its task in words, the instants (n,) of its frames [s], and its
    vectors (n, k) by the key of the feature.
    """

    index: int
    task: str
    time: np.ndarray
    frames: Mapping[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class LeRobotDataset:
    """A dataset: its folder, frames per second, names of the elements by feature (vectors only),
    and episodes in order.

    Parameters
    ----------
    fps
        Frames per second.
    notes
        What is wrong with its names.
    """

    path: Path
    fps: float
    names: Mapping[str, tuple[str, ...]]
    episodes: tuple[Episode, ...]
    notes: tuple[str, ...] = ()

    def column(self, episode: Episode, name: str) -> np.ndarray | None:
        """An element (n,) of any feature by its name, of an observation rather than a command;
        None if there is none of that name.

        Parameters
        ----------
        episode
            Which one.

        Raises
        ------
        ValueError
            If a feature has several of that name.
        """
        for key in sorted(self.names, key=lambda key: key.startswith(COMMANDED)):
            found = self.names[key].count(name)
            if found > 1:
                raise ValueError(
                    f"{self.path}: {found} elements of {key} are called '{name}': give them"
                    f" different names in {INFO}"
                )
            if found:
                return episode.frames[key][:, self.names[key].index(name)]
        return None


def is_dataset(path: str | os.PathLike) -> bool:
    """Whether a folder is a dataset of LeRobot, of any version."""
    return (Path(path) / INFO).is_file()


def read_dataset(path: str | os.PathLike) -> LeRobotDataset:
    """A dataset of version 2 or 3; videos and pictures are not read.

    Raises
    ------
    ValueError
        Names what is wrong, and where.
    """
    need("pyarrow")
    path = Path(path)
    info = _info(path)
    notes: list[str] = []
    names = {
        key: _names(key, one, notes)
        for key, one in info["features"].items()
        if _is_vector(key, one)
    }
    columns = _data(path, names)
    tasks, told = _tasks(path), _tasks_of_episodes(path)
    order = np.lexsort((columns["frame_index"], columns["episode_index"]))
    columns = {key: values[order] for key, values in columns.items()}
    starts = np.flatnonzero(
        np.diff(columns["episode_index"], prepend=columns["episode_index"][:1] - 1)
    )
    parts = (
        {key: values[a:b] for key, values in columns.items()}
        for a, b in zip(starts, [*starts[1:], len(order)], strict=True)
    )
    episodes = tuple(
        _episode(path, float(info["fps"]), names, tasks, told, part) for part in parts
    )
    expected = info.get("total_episodes", len(episodes))
    if len(episodes) != expected:
        raise ValueError(
            f"{path}: {INFO} tells of {expected} episodes, in data/ are {len(episodes)}"
        )
    return LeRobotDataset(path, info["fps"], names, episodes, tuple(notes))


def _info(path: Path) -> dict[str, Any]:
    file = path / INFO
    try:
        info = json.loads(file.read_text(encoding="utf-8"))
        version, fps, features = str(info["codebase_version"]), info["fps"], info["features"]
    except FileNotFoundError:
        raise ValueError(f"{path}: no dataset of LeRobot: it has no {INFO}") from None
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(
            f"{file}: codebase_version, fps and features are needed: {error}"
        ) from error
    if not version.startswith(READ):
        raise ValueError(
            f"{file}: version {version}, neither 2 nor 3: '{CONVERTER}' of lerobot before 0.4"
            " makes version 2 of one of version 1"
        )
    if (
        isinstance(fps, bool)
        or not isinstance(fps, (int, float))
        or not 0 < fps < np.inf
        or not isinstance(features, dict)
    ):
        raise ValueError(f"{file}: fps is {fps!r}: give a number above 0")
    return info


def _is_vector(key: str, feature: Any) -> bool:
    is_number = isinstance(feature, dict) and str(feature.get("dtype")).startswith(
        ("float", "int", "uint", "bool")
    )
    return is_number and key not in COUNTED and _size(feature) is not None


def _size(feature: Mapping[str, Any]) -> int | None:
    """Elements of a feature, None for a table of them."""
    shape = feature.get("shape", ())
    shape = (shape,) if isinstance(shape, int) else shape
    return 1 if len(shape) == 0 else int(shape[0]) if len(shape) == 1 else None


def _names(key: str, feature: Mapping[str, Any], notes: list[str]) -> tuple[str, ...]:
    """Names of the elements; their places, and a note, where a dataset has none, or not as many as
    there are elements.
    """
    size = _size(feature) or 0
    told = list(_told(feature.get("names")))
    several = {name for name, count in Counter(name for _, name in told).items() if count > 1}
    found = [f"{group}.{name}" if group and name in several else name for group, name in told]
    if len(found) == size:
        return tuple(found)
    if found:
        notes.append(f"{key} has {size} elements and {len(found)} names, so none of them counts")
    return tuple(f"{key}[{k}]" for k in range(size))


def _told(names: Any, group: str = "") -> Iterator[tuple[str, str]]:
    """Names of elements in their order, each with the group in which it stands: lists, groups of
    them, or names with their places.
    """
    if isinstance(names, dict):
        if names and all(
            isinstance(place, int) and not isinstance(place, bool) for place in names.values()
        ):
            names = sorted(names, key=names.__getitem__)
        else:
            are_groups = any(isinstance(part, (dict, list, tuple)) for part in names.values())
            for key, part in names.items():
                yield from (
                    _told(part, str(key))
                    if are_groups and part is not None
                    else [(group, str(key))]
                )
            return
    for one in names if isinstance(names, (list, tuple)) else () if names is None else (names,):
        yield from (
            _told(one, group) if isinstance(one, (dict, list, tuple)) else [(group, str(one))]
        )


def _data(path: Path, names: Mapping[str, tuple[str, ...]]) -> dict[str, np.ndarray]:
    pa, pq = optional("pyarrow"), optional("pyarrow.parquet")
    files = sorted((path / "data").rglob("*.parquet"))
    if not files:
        raise ValueError(f"{path}: no Parquet file in data/")
    parts: dict[str, list[np.ndarray]] = {}
    for file in files:
        try:
            with pq.ParquetFile(file) as stored:
                there = stored.schema_arrow.names
                if missing := [key for key in names if key not in there]:
                    raise ValueError(f"no column {missing[0]}, of which {INFO} tells")
                table = stored.read(columns=[key for key in (*names, *COUNTED) if key in there])
            columns = {key: _array(table.column(key)) for key in table.column_names}
            for key, values in _counted(columns, file, len(table)).items():
                parts.setdefault(key, []).append(values)
        except (pa.ArrowException, OSError, ValueError) as error:
            raise ValueError(f"{file}: {' '.join(str(error).split())}") from error
    try:
        return {key: np.concatenate(values) for key, values in parts.items()}
    except ValueError as error:
        raise ValueError(f"{path}: columns of its files have several sizes: {error}") from error


def _counted(columns: dict[str, np.ndarray], file: Path, n: int) -> dict[str, np.ndarray]:
    """The columns of a file, with those that every dataset should have made from the others;
    task_index is -1 where it is not told.
    """
    if "episode_index" not in columns:
        number = file.stem.rpartition("_")[2]
        if not (file.stem.startswith("episode_") and number.isdigit()):
            raise ValueError("no column episode_index, which tells its episodes apart")
        columns["episode_index"] = np.full(n, int(number))
    episode = columns["episode_index"] = columns["episode_index"].reshape(-1).astype(int)
    if "frame_index" not in columns:
        begins = np.flatnonzero(np.diff(episode, prepend=episode[:1] - 1))
        columns["frame_index"] = np.arange(n) - np.repeat(begins, np.diff(np.append(begins, n)))
    columns["task_index"] = columns.get("task_index", np.full(n, -1))
    columns["timestamp"] = columns.get("timestamp", np.full(n, np.nan))
    columns["index"] = np.arange(n)
    return {
        key: values.reshape(-1) if key in COUNTED else values for key, values in columns.items()
    }


def _array(column: Any) -> np.ndarray:
    """(n, k) of lists, (n,) of numbers."""
    column = column.combine_chunks()
    if "list" in str(column.type):
        return np.array(column.flatten().to_numpy(zero_copy_only=False), dtype=float).reshape(
            len(column), -1
        )
    return column.to_numpy(zero_copy_only=False)


def _tasks(path: Path) -> dict[int, str]:
    """Texts of the tasks by number. lerobot keeps the text as the index of a data frame, which had
    no name in its first versions.
    """
    pa, pq = optional("pyarrow"), optional("pyarrow.parquet")
    file = path / TASKS
    if not file.is_file():
        return {
            int(line["task_index"]): str(line["task"])
            for line in _lines(path / TASK_LINES, "task_index", "task")
        }
    try:
        table = pq.read_table(file)
        texts = next(name for name in ("task", "__index_level_0__") if name in table.column_names)
        return dict(
            zip(
                table.column("task_index").to_pylist(),
                map(str, table.column(texts).to_pylist()),
                strict=True,
            )
        )
    except (pa.ArrowException, OSError, StopIteration, KeyError) as error:
        raise ValueError(f"{file}: no table of task and task_index: {error}") from error


def _tasks_of_episodes(path: Path) -> dict[int, str]:
    """The task of each episode by its number, as version 2 tells it beside the frames, where it is
    one.
    """
    lines = _lines(path / EPISODE_LINES, "episode_index", "tasks")
    return {
        int(line["episode_index"]): str(line["tasks"][0])
        for line in lines
        if isinstance(line["tasks"], list) and len(line["tasks"]) == 1
    }


def _lines(file: Path, *keys: str) -> Iterator[dict[str, Any]]:
    """Objects with some keys, one in each line of a file; none if there is no file."""
    if not file.is_file():
        return
    for number, text in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
        if not text.strip():
            continue
        try:
            line = json.loads(text)
            missing = [key for key in keys if key not in line]
        except (ValueError, TypeError) as error:
            raise ValueError(f"{file}, line {number}: no JSON: {error}") from error
        if missing:
            raise ValueError(f"{file}, line {number}: {missing[0]} is missing")
        yield line


def _episode(
    path: Path,
    fps: float,
    names: Mapping[str, tuple[str, ...]],
    tasks: Mapping[int, str],
    told: Mapping[int, str],
    columns: Mapping[str, np.ndarray],
) -> Episode:
    """An episode; its time begins with its first frame, whatever the stamps of that are."""
    index, number = int(columns["episode_index"][0]), int(columns["task_index"][0])
    time = (columns["frame_index"] - columns["frame_index"][0]) / fps
    stamps = columns["timestamp"]
    rounded = 2.0 * np.spacing(np.abs(stamps).max()) if stamps.dtype.kind == "f" else 0.0
    late = np.abs((stamps - stamps[0]).astype(float) - time)
    if np.isfinite(late).any() and np.nanmax(late) > max(LATE, rounded):
        raise ValueError(
            f"{path}: episode {index}: frame {np.nanargmax(late)} is {np.nanmax(late):.3g} s away"
            " from frame_index / fps"
        )
    frames = {key: columns[key].reshape(len(time), -1) for key in names}
    for key, values in frames.items():
        if values.shape[1] != len(names[key]):
            raise ValueError(
                f"{path}: episode {index}: {key} has {values.shape[1]} elements, not"
                f" {len(names[key])}"
            )
    return Episode(index, tasks.get(number, told.get(index, "")), time, frames)
