"""Episodes into a folder that `lerobot` loads, with videos as MP4 files of H.264, written with PyAV."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.checks import floats
from dart_skill.common.extras import need, optional
from dart_skill.recording.lerobot._reader import COUNTED, INFO, TASKS

VERSION = "v3.0"
CHUNK_SIZE = 1000
"""Most files in a folder."""
DATA_MB = 100
"""Largest size of a file of data [MB]."""
VIDEO_MB = 200
"""Largest size of a file of video [MB]."""
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
STATS = "meta/stats.json"
QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)
CODEC = "libx264"
"""How videos are encoded: every browser plays them."""
PIXELS = "yuv420p"
KEY_FRAMES = 2
"""Number of frames from one key frame to the next: training asks for frames in any order."""
MOST_SAMPLES = 100
"""Largest number of pictures of an episode that statistics are taken of."""
EVERY = 4
"""Step between the pixels that statistics are taken of."""


@dataclass(frozen=True)
class Feature:
    """A vector of each frame: its key in the dataset, and the names of its elements, with their
    units in brackets.
    """

    key: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class DatasetCamera:
    """A video: its key in the dataset, and its size [pixels].

    Parameters
    ----------
    height, width
        Of its pictures [pixels].
    """

    key: str
    width: int
    height: int


def described_video(
    camera: DatasetCamera, fps: int, codec: str, pixel_format: str
) -> dict[str, Any]:
    """Entry of a video in info.json."""
    about = {
        "video.height": camera.height,
        "video.width": camera.width,
        "video.codec": codec,
        "video.pix_fmt": pixel_format,
        "video.fps": fps,
        "video.channels": 3,
        "has_audio": False,
        "is_depth_map": False,
    }
    return {
        "dtype": "video",
        "shape": [camera.height, camera.width, 3],
        "names": ["height", "width", "channels"],
        "info": about,
    }


def statistics(values: np.ndarray) -> dict[str, np.ndarray]:
    """Statistics of values (n, k) over n: min, max, mean, std and quantiles (k,), and the count
    (1,).
    """
    values = np.asarray(values, dtype=float)
    found = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
    }
    quantiles = {f"q{round(100 * q):02d}": np.quantile(values, q, axis=0) for q in QUANTILES}
    return {**found, "count": np.array([len(values)]), **quantiles}


def chunk_and_file(number: int) -> dict[str, int]:
    """Where the file of a number is, for the patterns of paths."""
    return dict(zip(("chunk_index", "file_index"), divmod(number, CHUNK_SIZE), strict=True))


def task_metadata() -> Mapping[bytes, bytes]:
    """What pandas writes beside a table whose index is `task`: lerobot looks tasks up by it."""
    column = {"metadata": None, "numpy_type": "object", "pandas_type": "unicode"}
    number = {
        "name": "task_index",
        "field_name": "task_index",
        "metadata": None,
        "numpy_type": "int64",
        "pandas_type": "int64",
    }
    about = {
        "index_columns": ["task"],
        "column_indexes": [
            {"name": None, "field_name": None, **column, "metadata": {"encoding": "UTF-8"}}
        ],
        "columns": [number, {"name": "task", "field_name": "task", **column}],
        "pandas_version": "2.0.0",
    }
    return {b"pandas": json.dumps(about).encode()}


class DatasetWriter:
    """A new dataset; a context manager, which takes the folder away again where something goes
    wrong.

    Parameters
    ----------
    path
        Folder, which must not exist.
    fps
        Frames per second.
    robot_type
        As the dataset calls the robot.
    features
        Vectors of each frame.
    cameras
        Videos.

    Raises
    ------
    FileExistsError
        For a folder that is there, ModuleNotFoundError without the extra `lerobot`.
    """

    def __init__(
        self,
        path: str | os.PathLike,
        fps: int,
        robot_type: str,
        features: Sequence[Feature],
        cameras: Sequence[DatasetCamera] = (),
    ):
        need("pyarrow", *(["av"] if cameras else []))
        self.path, self.fps, self.features, self.cameras = (
            Path(path),
            fps,
            tuple(features),
            tuple(cameras),
        )
        self._robot_type = robot_type
        self.path.mkdir(parents=True)
        self.n_frames = 0
        self._tasks: dict[str, int] = {}
        self._rows: list[dict[str, Any]] = []
        self._all: dict[str, list[np.ndarray]] = {}
        self._data, self._videos = (
            _DataFiles(self.path, self.features),
            {one.key: VideoFile(self.path, one, fps) for one in self.cameras},
        )

    def add(
        self,
        task: str,
        frames: Mapping[str, np.ndarray],
        pictures: Mapping[str, Iterable[np.ndarray]] | None = None,
    ) -> None:
        """An episode.

        Parameters
        ----------
        frames
            Arrays (n, k) by the key of a feature.
        pictures
            n arrays (height, width, 3), uint8, by the key of a camera.

        Raises
        ------
        ValueError
            For what is not of these shapes, or not finite.
        """
        n, episode = _n_frames(frames, self.features), len(self._rows)
        number = self._tasks.setdefault(task, len(self._tasks))
        columns: dict[str, np.ndarray] = {
            key.key: floats(frames[key.key]).astype(np.float32) for key in self.features
        }
        columns["timestamp"] = (np.arange(n) / self.fps).astype(np.float32)
        columns["frame_index"] = np.arange(n)
        columns["episode_index"] = np.full(n, episode)
        columns["index"] = self.n_frames + np.arange(n)
        columns["task_index"] = np.full(n, number)
        row: dict[str, Any] = {"episode_index": episode, "tasks": [task], "length": n}
        row |= {f"data/{name}": value for name, value in self._data.write(columns, n).items()}
        row |= {"dataset_from_index": self.n_frames, "dataset_to_index": self.n_frames + n}
        for key, values in columns.items():
            self._all.setdefault(key, []).append(values.reshape(n, -1))
            row |= _statistics_keys(key, statistics(values.reshape(n, -1)))
        for camera in self.cameras:
            row |= self._videos[camera.key].write((pictures or {})[camera.key], n)
            row |= _statistics_keys(camera.key, self._videos[camera.key].statistics())
        where = chunk_and_file(0)
        row |= {f"meta/episodes/{name}": value for name, value in where.items()}
        self._rows.append(row)
        self.n_frames += n

    def close(self) -> None:
        """Write what is about all episodes.

        Raises
        ------
        ValueError
            Without any.
        """
        if not self._rows:
            raise ValueError(f"{self.path}: a dataset needs at least one episode")
        self._data.close()
        for video in self._videos.values():
            video.close()
        self._write_tables()
        totals = {key: statistics(np.concatenate(parts)) for key, parts in self._all.items()}
        totals |= {key: video.statistics(of_all=True) for key, video in self._videos.items()}
        plain = {
            key: {name: value.tolist() for name, value in one.items()}
            for key, one in totals.items()
        }
        _write_json(self.path / STATS, plain)
        # the last one: without it there is no dataset
        _write_json(self.path / INFO, self._info())

    def _write_tables(self) -> None:
        pa, pq = optional("pyarrow"), optional("pyarrow.parquet")
        path = self.path / EPISODES.format(**chunk_and_file(0))
        path.parent.mkdir(parents=True)
        pq.write_table(pa.Table.from_pylist(self._rows), path)
        tasks = pa.table({"task_index": list(self._tasks.values()), "task": list(self._tasks)})
        pq.write_table(tasks.replace_schema_metadata(task_metadata()), self.path / TASKS)

    def _info(self) -> dict[str, Any]:
        features: dict[str, dict[str, Any]] = {
            one.key: ({"dtype": "float32", "shape": [len(one.names)], "names": list(one.names)})
            for one in self.features
        }
        features |= {
            one.key: described_video(one, self.fps, "h264", PIXELS) for one in self.cameras
        }
        features |= {
            key: {"dtype": dtype, "shape": [1], "names": None} for key, dtype in COUNTED.items()
        }
        return {
            "codebase_version": VERSION,
            "fps": self.fps,
            "features": features,
            "total_episodes": len(self._rows),
            "total_frames": self.n_frames,
            "total_tasks": len(self._tasks),
            "chunks_size": CHUNK_SIZE,
            "data_files_size_in_mb": DATA_MB,
            "video_files_size_in_mb": VIDEO_MB,
            "data_path": DATA,
            "video_path": VIDEO if self.cameras else None,
            "robot_type": self._robot_type,
            "splits": {"train": f"0:{len(self._rows)}"},
        }

    def __enter__(self) -> DatasetWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self.close()
                return
        except BaseException:
            shutil.rmtree(self.path)
            raise
        shutil.rmtree(self.path)


class _DataFiles:
    """data/: a row group for each episode, and a new file where the last one is full."""

    def __init__(self, path: Path, features: Sequence[Feature]):
        self._path, self._features = path, features
        self._writer: Any = None
        self._number, self._bytes = -1, 0

    def write(self, columns: Mapping[str, np.ndarray], n: int) -> dict[str, int]:
        """An episode of n frames; where it is."""
        pa, pq = optional("pyarrow"), optional("pyarrow.parquet")
        arrays = {}
        for one in self._features:
            flat = pa.array(columns[one.key].ravel())
            arrays[one.key] = (
                flat
                if len(one.names) == 1
                else pa.FixedSizeListArray.from_arrays(flat, len(one.names))
            )
        arrays |= {key: pa.array(columns[key], type=dtype) for key, dtype in COUNTED.items()}
        table = pa.table(arrays)
        if self._writer is None or self._bytes + table.nbytes > DATA_MB * 2**20:
            self.close()
            self._number, self._bytes = self._number + 1, 0
            path = self._path / DATA.format(**chunk_and_file(self._number))
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(path, table.schema, compression="snappy")
        self._writer.write_table(table, row_group_size=n)
        self._bytes += table.nbytes
        return chunk_and_file(self._number)

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None


class VideoFile:
    """videos/ of a camera: episodes one after the other in a file, and a new file where the last
    one is full.
    """

    def __init__(self, path: Path, camera: DatasetCamera, fps: int):
        self._path, self._camera, self._fps = path, camera, fps
        self._number, self._n_frames = -1, 0
        self._container: Any = None
        self._stream: Any = None
        self._sampled: list[tuple[np.ndarray, int]] = []

    def write(self, pictures: Iterable[np.ndarray], n: int) -> dict[str, Any]:
        """n pictures; where they are.

        Raises
        ------
        ValueError
            For another number of them, or another size.
        """
        if self._container is None or self._file().stat().st_size > VIDEO_MB * 2**20:
            self._open()
        begin, samples = self._n_frames, []
        for k, picture in enumerate(pictures):
            if (
                picture.shape != (self._camera.height, self._camera.width, 3)
                or picture.dtype != np.uint8
            ):
                raise ValueError(
                    f"{self._camera.key}: picture {k} is {picture.shape} {picture.dtype}"
                )
            self._encode(picture)
            if k % max(1, n // MOST_SAMPLES) == 0:
                samples.append(picture[::EVERY, ::EVERY].reshape(-1, 3))
        if self._n_frames - begin != n:
            raise ValueError(
                f"{self._camera.key}: {self._n_frames - begin} pictures for {n} frames"
            )
        self._sampled.append((np.concatenate(samples) / 255.0, len(samples)))
        where = {
            **chunk_and_file(self._number),
            "from_timestamp": begin / self._fps,
            "to_timestamp": self._n_frames / self._fps,
        }
        return {f"videos/{self._camera.key}/{name}": value for name, value in where.items()}

    def statistics(self, of_all: bool = False) -> dict[str, np.ndarray]:
        """Statistics of the colours of the last episode, or of all: (3, 1, 1) from 0 to 1; the
        count is of pictures.
        """
        chosen = self._sampled if of_all else self._sampled[-1:]
        found = statistics(np.concatenate([colours for colours, _ in chosen]))
        shaped = {name: value.reshape(3, 1, 1) for name, value in found.items() if name != "count"}
        return {**shaped, "count": np.array([sum(count for _, count in chosen)])}

    def close(self) -> None:
        if self._container is not None:
            self._container.mux(self._stream.encode())
            self._container.close()
            self._container = None

    def _file(self) -> Path:
        return self._path / VIDEO.format(
            video_key=self._camera.key, **chunk_and_file(self._number)
        )

    def _open(self) -> None:
        self.close()
        self._number, self._n_frames = self._number + 1, 0
        self._file().parent.mkdir(parents=True, exist_ok=True)
        self._container = optional("av").open(str(self._file()), "w")
        self._stream = self._container.add_stream(
            CODEC, rate=self._fps, options={"g": str(KEY_FRAMES), "crf": "23", "bf": "0"}
        )
        self._stream.codec_context.time_base = Fraction(1, self._fps)
        self._stream.width, self._stream.height, self._stream.pix_fmt = (
            self._camera.width,
            self._camera.height,
            PIXELS,
        )

    def _encode(self, picture: np.ndarray) -> None:
        frame = optional("av").VideoFrame.from_ndarray(
            np.ascontiguousarray(picture), format="rgb24"
        )
        frame.pts, frame.time_base = self._n_frames, self._stream.codec_context.time_base
        self._container.mux(self._stream.encode(frame))
        self._n_frames += 1


def _n_frames(frames: Mapping[str, np.ndarray], features: Sequence[Feature]) -> int:
    if set(frames) != {one.key for one in features}:
        raise ValueError(
            f"an episode has {', '.join(sorted(frames))}: give"
            f" {', '.join(one.key for one in features)}"
        )
    n = len(frames[features[0].key])
    for one in features:
        shape = np.shape(frames[one.key])
        if shape != (n, len(one.names)) or n == 0:
            raise ValueError(
                f"{one.key} has shape {shape}: give {(n or 'n', len(one.names))}, with n at"
                " least 1"
            )
        if not np.isfinite(floats(frames[one.key])).all():
            raise ValueError(
                f"{one.key} is not finite in all frames: lerobot takes statistics of it"
            )
    return n


def _statistics_keys(key: str, found: Mapping[str, np.ndarray]) -> dict[str, list]:
    return {f"stats/{key}/{name}": value.tolist() for name, value in found.items()}


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=4, ensure_ascii=False) + "\n", encoding="utf-8")
