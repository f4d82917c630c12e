"""Names, paths and columns of the format, as lerobot 0.6 has them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

VERSION = "v3.0"
CHUNK_SIZE, DATA_MB, VIDEO_MB = 1000, 100, 200
"""Files in a folder, and megabytes of a file of data and of video, at most."""
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODE_LINES, TASK_LINES = "meta/episodes.jsonl", "meta/tasks.jsonl"
"""Where version 2 has a line for each episode, and for each task."""
INFO, STATS, TASKS = "meta/info.json", "meta/stats.json", "meta/tasks.parquet"
COUNTED = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""What every dataset has beside its own features, and its type."""
QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)


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


def described(feature: Feature) -> dict[str, Any]:
    """Entry of a vector in info.json."""
    return {"dtype": "float32", "shape": [len(feature.names)], "names": list(feature.names)}


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
