"""Making a new bag of one whose recorder was killed, whose disk was full or lost power, or whose
bytes have changed.

What a file is, its first bytes tell, not its name: MCAP, SQLite, or one of them compressed. Files
that were copied as if they were text are recognised, and mended where that can be verified. The
bag itself is never changed.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from dart_skill.common.files import require_file
from dart_skill.recording.bags._files import (
    SQLITE_MAGIC,
    SUFFIXES,
    foreign,
    has_only_log,
    missing_parts,
    named_files,
    packing,
    part_number,
    unpack,
)
from dart_skill.recording.bags._mcap_recovery import recover_mcap
from dart_skill.recording.bags._metadata import read_metadata_file
from dart_skill.recording.bags._recovered_bag import LostPlace, RecoveredBag, Recovery
from dart_skill.recording.bags._sqlite_recovery import recover_sqlite
from dart_skill.recording.bags._text_mode import as_it_was, how_copied
from dart_skill.recording.bags.reader import BagError
from dart_skill.recording.mcap import DamagedError, mapped

__all__ = ["LostPlace", "Recovery", "recover"]
COMPRESSED = (".zstd", ".zst", ".gz")
"""What compressed files are called behind their own name."""


def recover(path: str | os.PathLike, output: str | os.PathLike) -> Recovery:
    """Make a new bag of what can be read of a damaged one.

    Parameters
    ----------
    path
        Bag folder, with or without metadata.yaml, or a file of MCAP or SQLite, also compressed; it
        is only read.
    output
        Folder of the new bag, which must not exist.

    Raises
    ------
    BagError
        If nothing is left to recover, FileExistsError, and OSError if the new bag cannot be
        written.
    """
    path, output = Path(path), Path(output)
    files, told = _input(path)
    if output.exists():
        raise FileExistsError(
            f"{output} exists already: bags are never overwritten, choose another name"
        )
    if path.is_dir() and path.resolve() in output.resolve().parents:
        raise BagError(
            f"{output} is in the damaged bag {path}, which must not change: choose another folder"
        )
    output.mkdir(parents=True)
    scratch = output / ".recovery"
    try:
        bag = RecoveredBag(path, output, told)
        for file in files:
            scratch.mkdir()
            _take(bag, file, scratch)
            shutil.rmtree(scratch)
        if len(files) > 1 and not told and len({part_number(file)[0] for file in files}) == 1:
            for name in missing_parts(files):
                bag.lose(name, 0, 0, "by the numbers of the other files it is missing", None)
        return bag.finish()
    except BaseException:
        shutil.rmtree(output)  # made by this call
        raise


def _input(path: Path) -> tuple[list[Path], dict]:
    """Files of the bag in order, also those that are missing, and what metadata.yaml tells."""
    if not path.exists():
        raise BagError(f"{path}: no such bag")
    if not path.is_dir():
        require_file(path)
        files, told = [path], {}
    else:
        # also where only the log of one is left
        there = {file.with_name(file.name.removesuffix("-wal")) for file in path.iterdir()}
        files = sorted((file for file in there if _is_for_messages(file)), key=part_number)
        try:
            told = read_metadata_file(path)
            named = named_files(path, told)
            files = _first_named([file for file in named if _is_for_messages(file)], files)
        except (OSError, ValueError, TypeError):
            told = {}
    if not files:
        raise BagError(f"{path}: no .mcap file and no .db3 file to recover")
    if all(
        file.is_file() and file.stat().st_size == 0 and not has_only_log(file) for file in files
    ):
        names = ", ".join(file.name for file in files)
        raise BagError(f"{path}: {names} is empty (0 bytes): there is nothing to recover")
    return files, told


def _first_named(named: list[Path], there: list[Path]) -> list[Path]:
    """Files that metadata.yaml names, then those that it does not; the plain one of a compressed
    file stands for it, and the reverse.
    """
    found = [
        (
            file
            if file in there
            else next((one for one in there if _plain_name(one) == _plain_name(file)), file)
        )
        for file in named
    ]
    return found + [
        file
        for file in there
        if file not in found and _plain_name(file) not in map(_plain_name, found)
    ]


def _is_for_messages(file: Path) -> bool:
    return Path(_plain_name(file)).suffix in SUFFIXES


def _plain_name(file: Path) -> str:
    return file.stem if file.suffix in COMPRESSED else file.name


def _take(bag: RecoveredBag, file: Path, scratch: Path) -> None:
    """Recover one file into the new bag. scratch: a folder for what is made on the way."""
    if has_only_log(file):
        state = "empty" if file.is_file() else "missing"
        bag.lose(file.name, 0, 0, f"the file is {state}, only its write-ahead log is there", None)
        recover_sqlite(bag, file.name, file, memoryview(b""), scratch)
        return
    if not file.is_file() or file.stat().st_size == 0:
        reason = "the file is empty (0 bytes)" if file.is_file() else "the file is missing"
        bag.lose(file.name, 0, 0, reason, None)
        bag.is_exact = False
        return
    with mapped(file) as data:
        kind = packing(data)
        if not kind:
            _take_plain(bag, file, file, data, scratch)
            return
    plain = scratch / _plain_name(file)
    try:
        reason = unpack(file, kind, plain)
    except DamagedError as error:
        raise BagError(str(error)) from error
    bag.note(
        f"{file.name} is compressed with {kind}: what follows is said of its"
        f" {plain.stat().st_size} bytes, unpacked"
    )
    if reason:
        bag.lose(
            file.name,
            file.stat().st_size,
            file.stat().st_size,
            f"it could be unpacked only in part ({reason})",
            None,
        )
    with mapped(plain) as data:
        _take_plain(bag, plain, file, data, scratch)


def _take_plain(
    bag: RecoveredBag, file: Path, named: Path, data: memoryview, scratch: Path
) -> None:
    """Recover what is not compressed. named: the file that it stands for."""
    what = foreign(data) if len(data) else ""
    copied = how_copied(data)
    if not what and copied is None and not _is_for_messages(named) and not _is_one(data):
        what = "no bag: a bag is a folder with metadata.yaml, or a file of MCAP or SQLite"
    if what:
        _refuse(bag, named, len(data), f"it is {what}")
        return
    if copied is None:
        _take_bytes(bag, file, named.name, data, scratch)
        return
    mended = as_it_was(copied, data, scratch)
    if mended is None:
        _refuse(
            bag,
            named,
            len(data),
            f"{copied.text}, which cannot be undone: fetch it again in binary mode",
        )
        return
    path, done, is_all = mended
    with mapped(path) as again:
        bag.note(
            f"{named.name}: {copied.text}; {done}; what follows is said of its {len(again)} bytes"
            " as they were"
        )
        if not is_all:
            bag.note(
                f"{named.name}: fetch it again in binary mode if it is still to be had: then"
                " nothing is lost"
            )
        _take_bytes(bag, path, named.name, again, scratch)


def _is_one(data: memoryview) -> bool:
    """Whether a file begins as a bag does."""
    return bytes(data[: len(SQLITE_MAGIC)]) == SQLITE_MAGIC or bytes(data[1:5]) == b"MCAP"


def _refuse(bag: RecoveredBag, file: Path, size: int, reason: str) -> None:
    bag.lose(file.name, 0, size, reason, None)
    bag.n_bytes, bag.is_exact = bag.n_bytes + size, False


def _take_bytes(bag: RecoveredBag, file: Path, name: str, data: memoryview, scratch: Path) -> None:
    if bytes(data[: len(SQLITE_MAGIC)]) == SQLITE_MAGIC or (
        ".db3" in Path(name).suffixes and not _is_one(data)
    ):
        recover_sqlite(bag, name, file, data, scratch)
    else:
        recover_mcap(bag, name, data)
