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
from dart_skill.recording.bags._mcap_recovery import recover_mcap
from dart_skill.recording.bags._recovered_bag import LostPlace, RecoveredBag, Recovery
from dart_skill.recording.bags._sqlite_recovery import recover_sqlite
from dart_skill.recording.bags._text_mode import as_it_was, how_copied
from dart_skill.recording.bags.files import (
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
from dart_skill.recording.bags.metadata import read_metadata_file
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
                bag.lose(name, "by the numbers of the other files it is missing")
        return bag.finish()
    except BaseException:
        shutil.rmtree(output)  # made by this call
        raise


def _input(path: Path) -> tuple[list[Path], dict]:
    """Files of the bag in order, also those that are missing, and what metadata.yaml tells."""
    if not path.exists():
        raise BagError(f"{path}: no such bag")
    told: dict = {}
    if not path.is_dir():
        require_file(path)
        files = [path]
    else:
        # also where only the log of one is left
        there = {file.with_name(file.name.removesuffix("-wal")) for file in path.iterdir()}
        files = sorted((file for file in there if _is_for_messages(file)), key=part_number)
        try:
            told = read_metadata_file(path)
            named = [file for file in named_files(path, told) if _is_for_messages(file)]
        except (OSError, ValueError, TypeError):
            told, named = {}, []
        # the plain one of a compressed file stands for it, and the reverse
        by_name = {_plain_name(file): file for file in files}
        first = [file if file in files else by_name.get(_plain_name(file), file) for file in named]
        names = set(map(_plain_name, first))
        files = first + [file for file in files if _plain_name(file) not in names]
    if not files:
        raise BagError(f"{path}: no .mcap file and no .db3 file to recover")
    if all(
        file.is_file() and file.stat().st_size == 0 and not has_only_log(file) for file in files
    ):
        told_names = ", ".join(file.name for file in files)
        raise BagError(f"{path}: {told_names} is empty (0 bytes): there is nothing to recover")
    return files, told


def _is_for_messages(file: Path) -> bool:
    return Path(_plain_name(file)).suffix in SUFFIXES


def _plain_name(file: Path) -> str:
    return file.stem if file.suffix in COMPRESSED else file.name


def _take(bag: RecoveredBag, file: Path, scratch: Path) -> None:
    """Recover one file into the new bag. scratch: a folder for what is made on the way."""
    if has_only_log(file):
        state = "empty" if file.is_file() else "missing"
        bag.lose(file.name, f"the file is {state}, only its write-ahead log is there")
        recover_sqlite(bag, file.name, file, memoryview(b""), scratch)
        return
    if not file.is_file() or file.stat().st_size == 0:
        bag.lose(
            file.name, ("the file is empty (0 bytes)" if file.is_file() else "the file is missing")
        )
        bag.result.is_exact = False
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
        size = file.stat().st_size
        bag.lose(
            file.name, (f"it could be unpacked only in part ({reason})"), begin=size, end=size
        )
    with mapped(plain) as data:
        _take_plain(bag, plain, file, data, scratch)


def _take_plain(
    bag: RecoveredBag, file: Path, named: Path, data: memoryview, scratch: Path
) -> None:
    """Recover what is not compressed. named: the file that it stands for."""
    what = foreign(data) if len(data) else ""
    is_sqlite, is_mcap = bytes(data[:16]) == SQLITE_MAGIC, bytes(data[1:5]) == b"MCAP"
    copied = None if what else how_copied(data)
    if copied is not None:
        mended = as_it_was(copied, file, scratch)
        if mended is not None:
            path, done, is_all = mended
            with mapped(path) as again:
                bag.note(
                    f"{named.name}: {copied.text}; {done}; what follows is said of its"
                    f" {len(again)} bytes as they were"
                )
                if not is_all:
                    bag.note(
                        f"{named.name}: fetch it again in binary mode if it is still to be had:"
                        " then nothing is lost"
                    )
                _take_bytes(bag, path, named, again, scratch)
            return
        what = f"{copied.text}, which cannot be undone: fetch it again in binary mode"
    elif not (what or _is_for_messages(named) or is_sqlite or is_mcap):
        what = "no bag: a bag is a folder with metadata.yaml, or a file of MCAP or SQLite"
    if not what:
        _take_bytes(bag, file, named, data, scratch)
        return
    bag.lose(named.name, what if copied else f"it is {what}", end=len(data))
    bag.result.n_bytes += len(data)
    bag.result.is_exact = False


def _take_bytes(
    bag: RecoveredBag, file: Path, named: Path, data: memoryview, scratch: Path
) -> None:
    is_mcap = bytes(data[1:5]) == b"MCAP"
    if bytes(data[:16]) == SQLITE_MAGIC or (".db3" in named.suffixes and not is_mcap):
        recover_sqlite(bag, named.name, file, data, scratch)
    else:
        recover_mcap(bag, named.name, data)
