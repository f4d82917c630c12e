"""The files of a bag, in order: those of its folder, and those that its metadata.yaml names."""

from __future__ import annotations

import re
from pathlib import Path, PureWindowsPath

SUFFIXES = (".mcap", ".db3")
SIDE_FILES = {"-wal": "write-ahead log", "-journal": "journal"}
"""Endings of what SQLite keeps beside a file: what is not in it yet, and what was in it before."""
PACKED = (".zstd", ".zst", ".lz4")
"""Endings of a file that was compressed as a whole, behind its own."""


def unpacked_name(name: str) -> str:
    """The name of a file without the ending of its compression."""
    return next((name.removesuffix(ending) for ending in PACKED if name.endswith(ending)), name)


def part_number(file: Path) -> tuple[str, int]:
    """Name and number of a file of a split bag; number -1 if it has none."""
    stem = Path(unpacked_name(file.name)).stem
    match = re.fullmatch(r"(.*)_(\d+)", stem)
    return (match[1], int(match[2])) if match else (stem, -1)


def side_files(file: Path) -> dict[str, Path]:
    """The write-ahead log and the journal beside an SQLite file, by their ending. file: which need
    not be there.
    """
    beside = {ending: file.with_name(file.name + ending) for ending in SIDE_FILES}
    return {ending: one for ending, one in beside.items() if one.is_file() and one.stat().st_size}


def has_only_log(file: Path) -> bool:
    """Whether an SQLite file is empty or missing and its write-ahead log is there: SQLite throws
    that away when it opens the file.
    """
    return (
        file.suffix == ".db3"
        and "-wal" in side_files(file)
        and not (file.is_file() and file.stat().st_size)
    )


def missing_parts(files: list[Path]) -> list[str]:
    """Which parts of a split bag are missing between others and before the first, by name. files:
    those that are there.
    """
    found, last = [], {part_number(file)[0]: -1 for file in files}
    for name, number in sorted(map(part_number, files)):
        first = last[name] + 1
        if number > first:
            found.append(
                f"{name}_{first}" + (f" to {name}_{number - 1}" if number > first + 1 else "")
            )
        last[name] = number
    return found


def files_in(folder: Path, suffixes: tuple[str, ...] = SUFFIXES) -> list[Path]:
    """The files of a folder that hold messages, in order. suffixes: of their names; those that
    were compressed as a whole have another.
    """
    return sorted((file for file in folder.iterdir() if file.suffix in suffixes), key=part_number)


def storage_files(folder: Path) -> list[Path]:
    """The files of a folder that hold messages, in order, and those that were compressed and are
    not there as they were before.
    """
    packed = [
        file
        for file in files_in(folder, PACKED)
        if Path(unpacked_name(file.name)).suffix in SUFFIXES
    ]
    return sorted(
        [
            *files_in(folder),
            *(file for file in packed if not (folder / unpacked_name(file.name)).exists()),
        ],
        key=part_number,
    )


def named_files(folder: Path, metadata: dict) -> list[Path]:
    """The files that the metadata name, whether they are there or not; in the folder, wherever
    they were when it was recorded.
    """
    names = [PureWindowsPath(str(name)).name for name in metadata.get("relative_file_paths") or []]
    return [folder / name for name in dict.fromkeys(names) if name]


def chosen_files(folder: Path, metadata: dict) -> tuple[list[Path], list[Path]]:
    """The files of a bag in a folder, in order, and those that are missing of it.

    Those that metadata.yaml names, if they are there. Where as many others stand in their place,
    the files were renamed or unpacked since.
    """
    there, named = storage_files(folder), named_files(folder, metadata)
    missing = [file for file in named if not file.exists()]
    others = [file for file in there if file not in named]
    if not named or (missing and len(others) == len(missing)):
        return there, []
    return [file for file in named if file not in missing], missing
