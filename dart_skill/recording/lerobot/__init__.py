"""LeRobotDataset v3.0 of Hugging Face: episodes at one frame rate, in and out; and streams of any
rate brought to its frames.

Written and read with pyarrow alone (extra `lerobot`), as `lerobot` itself needs torch. The format
is what `lerobot/datasets` of version 0.6 writes: data/ and meta/episodes/ in Parquet,
meta/info.json, meta/stats.json, meta/tasks.parquet, videos/ in MP4.
"""

from dart_skill.recording.lerobot._reader import Episode, LeRobotDataset, is_dataset, read_dataset
from dart_skill.recording.lerobot._resampling import (
    at_frames,
    changes_at,
    frame_times,
    held_mean,
    seen_at,
    turned_at_frames,
)
from dart_skill.recording.lerobot.writer import DatasetCamera, DatasetWriter, Feature

__all__ = [
    "DatasetCamera",
    "DatasetWriter",
    "Episode",
    "Feature",
    "LeRobotDataset",
    "at_frames",
    "changes_at",
    "frame_times",
    "held_mean",
    "is_dataset",
    "read_dataset",
    "seen_at",
    "turned_at_frames",
]
