"""Pictures of a camera as MP4 files of H.264, which every browser plays, written with PyAV."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.extras import optional
from dart_skill.recording.lerobot import _format as format_
from dart_skill.recording.lerobot._format import Camera

CODEC, PIXELS, KEY_FRAMES = "libx264", "yuv420p", 2
"""A key frame so often: whoever learns asks for frames in any order."""
MOST_SAMPLES = 100
"""Pictures of an episode that statistics are taken of, every so many pixels."""
EVERY = 4


class VideoFile:
    """videos/ of a camera: episodes one after the other in a file, and a new file where the last
    one is full.
    """

    def __init__(self, path: Path, camera: Camera, fps: int):
        self._path, self._camera, self._fps = path, camera, fps
        self._number, self._n_frames = -1, 0
        self._container: Any = None
        self._stream: Any = None
        self._sampled: list[tuple[np.ndarray, int]] = []

    def write(self, pictures: Iterable[np.ndarray], n: int) -> dict[str, Any]:
        """n pictures; where they are. ValueError for another number of them, or another size."""
        if self._container is None or self._full():
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
            **format_.chunk_and_file(self._number),
            "from_timestamp": begin / self._fps,
            "to_timestamp": self._n_frames / self._fps,
        }
        return {f"videos/{self._camera.key}/{name}": value for name, value in where.items()}

    def statistics(self, of_all: bool = False) -> dict[str, np.ndarray]:
        """Statistics of the colours of the last episode, or of all: (3, 1, 1) from 0 to 1; the
        count is of pictures.
        """
        chosen = self._sampled if of_all else self._sampled[-1:]
        found = format_.statistics(np.concatenate([colours for colours, _ in chosen]))
        shaped = {name: value.reshape(3, 1, 1) for name, value in found.items() if name != "count"}
        return {**shaped, "count": np.array([sum(count for _, count in chosen)])}

    def described(self) -> dict[str, Any]:
        """Entry in info.json."""
        return format_.described_video(self._camera, self._fps, "h264", PIXELS)

    def close(self) -> None:
        if self._container is not None:
            self._container.mux(self._stream.encode())
            self._container.close()
            self._container = None

    def _full(self) -> bool:
        return self._file().stat().st_size > format_.VIDEO_MB * 2**20

    def _file(self) -> Path:
        return self._path / format_.VIDEO.format(
            video_key=self._camera.key, **format_.chunk_and_file(self._number)
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
