"""The files of a bag, in order: those of its folder, and those that its metadata.yaml names."""

from __future__ import annotations

import re
from pathlib import Path, PurePath

ROS1_SUFFIX = ".bag"
SUFFIXES = (".mcap", ".db3", ROS1_SUFFIX)


def part_number(file: Path) -> tuple[str, int]:
    """Name and number of a file of a split bag; number -1 if it has none."""
    match = re.fullmatch(r"(.*)_(\d+)", file.stem)
    return (match[1], int(match[2])) if match else (file.stem, -1)


def files_in(folder: Path, suffixes: tuple[str, ...] = SUFFIXES) -> list[Path]:
    """The files of a folder that hold messages, in order."""
    return sorted((file for file in folder.iterdir() if file.suffix in suffixes), key=part_number)


def named_files(folder: Path, metadata: dict) -> list[Path]:
    """The files that the metadata name, whether they are there or not."""
    return [folder / PurePath(str(name)).name for name in metadata.get("relative_file_paths") or []]
