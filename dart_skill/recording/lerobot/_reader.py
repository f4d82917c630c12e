"""A dataset of LeRobot as arrays."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.extras import need, optional
from dart_skill.recording.lerobot import _format as format_

CONVERTER = "python -m lerobot.scripts.convert_dataset_v21_to_v30"
LATE = 1e-3
"""A frame may be so far from frame_index / fps, where float32 rounds [s]."""


@dataclass(frozen=True, eq=False)
class Episode:
    """An episode: its index, its task in words, the instants (n,) of its frames [s], and its vectors (n, k) by the key of the feature."""

    index: int
    task: str
    time: np.ndarray
    frames: Mapping[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class LeRobotDataset:
    """A dataset: its folder, frames per second, names of the elements by feature (vectors only), and episodes in order.

    * fps: frames per second.
    """

    path: Path
    fps: int
    names: Mapping[str, tuple[str, ...]]
    episodes: tuple[Episode, ...]

    def column(self, episode: Episode, name: str) -> np.ndarray | None:
        """An element (n,) of any feature by its name; None if there is none of that name. episode: which one."""
        for key, names in self.names.items():
            if name in names:
                return episode.frames[key][:, names.index(name)]
        return None


def is_dataset(path: str | os.PathLike) -> bool:
    """Whether a folder is a dataset of LeRobot, of any version."""
    return (Path(path) / format_.INFO).is_file()


def read_dataset(path: str | os.PathLike) -> LeRobotDataset:
    """A dataset of version 3; videos and pictures are not read. ValueError names what is wrong, and where."""
    need("pyarrow")
    path = Path(path)
    info = _info(path)
    names = {key: _names(path, key, one) for key, one in info["features"].items() if _is_vector(key, one)}
    columns = _data(path, names)
    tasks = _tasks(path)
    order = np.lexsort((columns["frame_index"], columns["episode_index"]))
    columns = {key: values[order] for key, values in columns.items()}
    starts = np.flatnonzero(np.diff(columns["episode_index"], prepend=-1))
    stops = np.append(starts[1:], len(order))
    episodes = tuple(_episode(path, info["fps"], names, tasks, {key: values[a:b] for key, values in columns.items()})
                     for a, b in zip(starts, stops, strict=True))  # fmt: skip
    if len(episodes) != info.get("total_episodes"):
        raise ValueError(f"{path}: {format_.INFO} tells of {info.get('total_episodes')} episodes, in data/ are {len(episodes)}")
    return LeRobotDataset(path, info["fps"], names, episodes)


def _info(path: Path) -> dict[str, Any]:
    file = path / format_.INFO
    try:
        info = json.loads(file.read_text(encoding="utf-8"))
        version, fps, features = info["codebase_version"], info["fps"], info["features"]
    except FileNotFoundError:
        raise ValueError(f"{path}: no dataset of LeRobot: it has no {format_.INFO}") from None
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{file}: codebase_version, fps and features are needed: {error}") from error
    if not str(version).startswith("v3."):
        raise ValueError(f"{file}: version {version}, not {format_.VERSION}: '{CONVERTER}' of lerobot makes one of it")
    if not isinstance(fps, (int, float)) or not 0 < fps < np.inf or not isinstance(features, dict):
        raise ValueError(f"{file}: fps is {fps!r}: give a number above 0")
    return info


def _is_vector(key: str, feature: Any) -> bool:
    is_number = isinstance(feature, dict) and str(feature.get("dtype")).startswith(("float", "int", "bool"))
    return is_number and key not in format_.COUNTED and len(feature.get("shape", ())) == 1


def _names(path: Path, key: str, feature: dict[str, Any]) -> tuple[str, ...]:
    """Of the elements; some datasets have them below a word like `motors`, and some have none."""
    names, size = feature.get("names"), feature["shape"][0]
    if isinstance(names, dict):
        names = next(iter(names.values()), None)
    if isinstance(names, list) and len(names) == size:
        return tuple(map(str, names))
    return tuple(f"{key}[{k}]" for k in range(size))


def _data(path: Path, names: Mapping[str, tuple[str, ...]]) -> dict[str, np.ndarray]:
    pa, pq = optional("pyarrow"), optional("pyarrow.parquet")
    files = sorted((path / "data").glob("*/*.parquet"))
    if not files:
        raise ValueError(f"{path}: no Parquet file in data/")
    wanted = [*names, *format_.COUNTED]
    parts: dict[str, list[np.ndarray]] = {}
    for file in files:
        try:
            with pq.ParquetFile(file) as stored:
                if missing := [key for key in wanted if key not in stored.schema_arrow.names]:
                    raise ValueError(f"no column {missing[0]}, of which {format_.INFO} tells")
                table = stored.read(columns=wanted)
            for key in wanted:
                parts.setdefault(key, []).append(_array(table.column(key)))
        except (pa.ArrowException, OSError, ValueError) as error:
            raise ValueError(f"{file}: {' '.join(str(error).split())}") from error
    try:
        return {key: np.concatenate(values) for key, values in parts.items()}
    except ValueError as error:
        raise ValueError(f"{path}: columns of its files have several sizes: {error}") from error


def _array(column: Any) -> np.ndarray:
    """(n, k) of lists, (n,) of numbers."""
    types = optional("pyarrow").types
    column = column.combine_chunks()
    if types.is_list(column.type) or types.is_large_list(column.type) or types.is_fixed_size_list(column.type):
        return np.array(column.flatten().to_numpy(zero_copy_only=False), dtype=float).reshape(len(column), -1)
    return column.to_numpy(zero_copy_only=False)


def _tasks(path: Path) -> dict[int, str]:
    """Texts of the tasks by number. lerobot keeps the text as the index of a data frame, which had no name in its first versions."""
    pa, pq = optional("pyarrow"), optional("pyarrow.parquet")
    file = path / format_.TASKS
    try:
        table = pq.read_table(file)
        texts = next(name for name in ("task", "__index_level_0__") if name in table.column_names)
        return dict(zip(table.column("task_index").to_pylist(), map(str, table.column(texts).to_pylist()), strict=True))
    except (pa.ArrowException, OSError, StopIteration, KeyError) as error:
        raise ValueError(f"{file}: no table of task and task_index: {error}") from error


def _episode(
    path: Path, fps: float, names: Mapping[str, tuple[str, ...]], tasks: Mapping[int, str], columns: Mapping[str, np.ndarray]
) -> Episode:
    index, time = int(columns["episode_index"][0]), columns["frame_index"] / fps
    if (late := np.abs(columns["timestamp"] - time)).max() > LATE:
        raise ValueError(f"{path}: episode {index}: frame {late.argmax()} is {late.max():.3g} s away from frame_index / fps")
    frames = {key: columns[key].reshape(len(time), -1) for key in names}
    for key, values in frames.items():
        if values.shape[1] != len(names[key]):
            raise ValueError(f"{path}: episode {index}: {key} has {values.shape[1]} elements, not {len(names[key])}")
    return Episode(index, tasks.get(int(columns["task_index"][0]), ""), time, frames)
